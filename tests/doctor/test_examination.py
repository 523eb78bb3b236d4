"""The examination: order and level of what is said, and one cause said once."""

from dataclasses import replace

import numpy as np
import pytest
from moving_arms import FRICTION, gravity, moving

from vftcli.doctor import examine, in_words
from vftcli.doctor.signals import signal_findings
from vftcli.robots import load_robot
from vftcli.signals.recording import Recording

UR10E = load_robot("ur10e")
ALL = (1, 2, 3, 4, 5, 6)


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


def test_a_turned_joint_is_turned_back_by_the_word_of_its_signal() -> None:
    """Currents named tau would be read as torques, too small by the drive constants."""
    current = moving().require("current").copy()
    current[:, 1] *= -1.0
    (found,) = examine(replace(moving(), current=current), UR10E).warnings
    assert (found.code, found.where.joints) == ("joint-sign", (2,))
    assert "--columns current=a|-b|c" in in_words(found).remedy


def test_the_constants_of_another_joint_size_are_reported() -> None:
    """A controller whose wrists have the constants of a smaller joint, 7.7 for 10.763 N·m/A."""
    log = moving()
    assert UR10E.torque_constant is not None
    q = np.repeat(log.q[:1], log.samples, axis=0)
    rest = np.zeros_like(q)
    constant = np.array([11.976, 11.976, 9.839, 7.7, 7.7, 7.7])
    current = np.full_like(q, 1.5)
    held = replace(
        log,
        q=q,
        dq=rest,
        current=current,
        target_current=current,
        target_torque=current * constant,
    )
    found = [f for f in examine(held, UR10E).findings if f.code == "drive-constants"]
    assert [finding.where.joints for finding in found] == [(4, 5, 6)]
    # no joint of UR has 8.5 N·m/A: an old controller's or freedrive's law, not a constant
    odd = replace(
        held, target_torque=current * np.array([11.976, 11.976, 9.839, 8.5, 8.5, 10.763])
    )
    assert not [f for f in examine(odd, UR10E).findings if f.code == "drive-constants"]


def test_too_short_a_log_is_reported_and_not_judged() -> None:
    log = moving().between(0.0, 0.01)
    assert [finding.code for finding in examine(log, UR10E).findings] == ["too-short"]


@pytest.mark.parametrize(
    ("factor", "refusals", "doubted"), [(1.0, 0, False), (1.3, 0, True), (1.6, 1, True)]
)
def test_velocities_far_off_refuse_and_nearer_ones_are_not_relied_on(
    factor: float, refusals: int, doubted: bool
) -> None:
    log = moving()
    dq = log.require("dq") * np.array([1.0, factor, 1.0, 1.0, 1.0, 1.0])
    made = examine(replace(log, dq=dq), UR10E)
    assert len(made.refusals()) == refusals
    assert bool(made.doubts) == doubted


def test_beside_a_joint_without_effort_no_size_is_relied_on() -> None:
    log = moving()
    made = examine(replace(log, current=log.require("current") * [1, 1, 0, 1, 1, 1]), UR10E)
    assert made.doubts == {"zero-effort"}
    assert not made.refusals()


def test_a_clock_of_another_rate_refuses() -> None:
    log = moving()
    made = examine(replace(log, t=1.05 * log.t), UR10E)
    assert [finding.code for finding in made.refusals()] == ["clock-rate"]


@pytest.mark.parametrize(
    ("factor", "joints"), [(0.8, ALL), (1.3, ALL), (0.8, (2,)), (1.25, (3,))]
)
def test_drives_of_another_size_are_named_with_their_factor(
    factor: float, joints: tuple[int, ...]
) -> None:
    """The model is the log's own: windows of 0.3 s leave .01 of a factor open."""
    log = moving()
    scale = np.ones(6)
    scale[[j - 1 for j in joints]] = factor
    made = examine(replace(log, current=log.require("current") * scale), UR10E)
    (found,) = made.warnings
    assert (found.code, found.where.joints) == ("drive-scale", joints)
    assert found.values["factor"] == pytest.approx(factor, abs=0.01)
    assert made.refusals() == ()


def test_a_load_is_no_factor() -> None:
    assert [f.code for f in examine(moving(load=3.0), UR10E).warnings] == ["unmodelled-load"]


def test_another_generation_is_no_factor() -> None:
    """A UR10e beside a UR10's model: the ratio of their masses explains most of it too."""
    codes = [finding.code for finding in examine(moving(), load_robot("ur10")).warnings]
    assert codes == ["other-robot"]


@pytest.mark.parametrize(("before", "after"), [(0.0, 1.5), (2.0, 0.0)])
def test_a_load_that_is_picked_up_or_set_down_is_named(before: float, after: float) -> None:
    """To a tenth of the 2 kg: the fit weighs a load and leaves its inertia out."""
    first, last = moving(load=before), moving(load=after)
    half = (first.t < 6.0)[:, None]
    current = np.where(half, first.require("current"), last.require("current"))
    made = examine(replace(first, current=current), UR10E)
    (found,) = made.warnings
    assert found.code == "load-changes"
    assert found.values["first_kg"] == pytest.approx(before, abs=0.2)
    assert found.values["last_kg"] == pytest.approx(after, abs=0.2)
    assert found.values["at_s"] == pytest.approx(6.0, abs=0.3)


def test_an_effort_without_friction_is_no_measurement() -> None:
    """The arm's own rigid-body torque, or its gravity alone; of `FRICTION` 4 N·m it has none."""
    log = moving()
    assert UR10E.torque_constant is not None
    friction = FRICTION * np.tanh(log.require("dq") / 0.01) / UR10E.torque_constant
    for current in (
        log.require("current") - friction,
        gravity(UR10E, log) / UR10E.torque_constant,
    ):
        made = examine(replace(log, current=current), UR10E)
        assert [finding.code for finding in made.refusals()] == ["no-friction-in-effort"]
    frictionless = replace(UR10E, friction=())
    made = examine(replace(log, current=log.require("current") - friction), frictionless)
    assert made.warnings == ()


def sampled_every(log: Recording, step: int) -> Recording:
    """A log of which every so many samples are kept, straight lines between them."""
    kept = log.t[::step]
    between = {
        name: np.stack([np.interp(log.t, kept, x[::step]) for x in getattr(log, name).T], axis=1)
        for name in log.signals
    }
    return replace(log, **between)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_straight_lines_are_seen_in_what_only_rises_or_only_falls(sign: float) -> None:
    t = 0.008 * np.arange(1500)
    course = sign * (0.2 * t + 0.05 * np.sin(3.0 * t))[:, None] * np.ones(6)
    log = Recording(t=t, q=course, dq=np.gradient(course, t, axis=0), current=course)
    found = {finding.code: finding for finding in signal_findings(sampled_every(log, 10))}
    assert found["interpolated"].values == pytest.approx({"rate_Hz": 12.5, "logged_Hz": 125.0})
    assert "interpolated" not in {finding.code for finding in signal_findings(log)}


@pytest.mark.parametrize("step", [10, 25])
def test_a_log_that_was_filled_up_by_straight_lines_is_named(step: int) -> None:
    log = moving()
    (found,) = [f for f in examine(sampled_every(log, step), UR10E).warnings
                if f.code == "interpolated"]  # fmt: skip
    assert found.values["rate_Hz"] == pytest.approx(125 / step)
    assert "interpolated" not in {f.code for f in examine(log, UR10E).findings}
