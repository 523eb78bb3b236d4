"""The examination: order and level of what is said, and one cause said once."""

from dataclasses import replace

import numpy as np
import pytest
from moving_arms import moving

from vftcli.doctor import examine
from vftcli.robots import load_robot

UR10E = load_robot("ur10e")


def test_warnings_go_before_facts() -> None:
    log = moving()
    still = log.q.copy()
    still[:, 5] = 0.1  # a fact: the wrist never moves
    examination = examine(replace(log, q=still, current=-log.require("current")), UR10E)
    levels = [finding.level for finding in examination.findings]
    assert levels == sorted(levels, reverse=True)
    assert {"warning", "fact"} <= set(levels)
    warnings = examination.warnings
    assert [finding.level for finding in warnings] == ["warning"] * len(warnings)
    assert len(warnings) == levels.count("warning")


def test_one_cause_is_said_once() -> None:
    """Neither no robot that fits nor a load beside a turned sign."""
    log = moving()
    turned = examine(replace(log, current=-log.require("current")), UR10E)
    assert [finding.code for finding in turned.warnings] == ["effort-sign"]
    large = examine(replace(log, current=1e3 * log.require("current")), UR10E)
    assert {finding.code for finding in large.warnings} == {"milliamperes"}


def test_the_constants_of_another_joint_size_are_told() -> None:
    """A controller whose wrists have the constants of a smaller joint, 7.7 for 10.763 N·m/A."""
    log = moving()
    assert UR10E.torque_constant is not None
    q = np.repeat(log.q[:1], log.samples, axis=0)
    rest = np.zeros_like(q)
    constant = np.array([11.976, 11.976, 9.839, 7.7, 7.7, 7.7])
    current = np.full_like(q, 1.5)
    held = replace(
        log, q=q, dq=rest, current=current, target_current=current, target_torque=current * constant
    )
    found = [f for f in examine(held, UR10E).findings if f.code == "drive-constants"]
    assert [finding.where.joints for finding in found] == [(4, 5, 6)]
    # no joint of UR has 8.5 N·m/A: an old controller's or freedrive's law, not a constant
    odd = replace(held, target_torque=current * np.array([11.976, 11.976, 9.839, 8.5, 8.5, 10.763]))
    assert not [f for f in examine(odd, UR10E).findings if f.code == "drive-constants"]


def test_too_short_a_log_is_told_and_not_judged() -> None:
    log = moving().between(0.0, 0.01)
    assert [finding.code for finding in examine(log, UR10E).findings] == ["too-short"]


@pytest.mark.parametrize(
    ("factor", "refusals", "distrusts"), [(1.0, 0, False), (1.3, 0, True), (1.6, 1, True)]
)
def test_velocities_far_off_refuse_and_nearer_ones_are_not_relied_on(
    factor: float, refusals: int, distrusts: bool
) -> None:
    log = moving()
    dq = log.require("dq") * np.array([1.0, factor, 1.0, 1.0, 1.0, 1.0])
    made = examine(replace(log, dq=dq), UR10E)
    assert len(made.refusals()) == refusals
    assert made.distrusts == distrusts


def test_a_clock_of_another_rate_refuses() -> None:
    log = moving()
    made = examine(replace(log, t=1.05 * log.t), UR10E)
    assert [finding.code for finding in made.refusals()] == ["clock-rate"]
