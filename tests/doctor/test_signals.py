"""Findings about the signals: each with a known amount of its fault, inside and outside."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.doctor.signals import (
    inverted_effort,
    signal_findings,
    stuck_findings,
    unusable_findings,
    work_shares,
)
from vftcli.doctor.velocity import velocity_findings, velocity_fit
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark

T = 0.01 * np.arange(4001)
RATES = 2 * np.pi / 10 * np.array([1.0, 2, 3, 4, 5, 6])
"""Whole turns in the 40 s of the log, so forward and backward weigh alike. [rad/s]"""
Q = np.sin(np.outer(T, RATES))
DQ = RATES * np.cos(np.outer(T, RATES))
FRICTION = np.sign(DQ) * (1 + 1e-3 * np.sin(np.arange(len(T)))[:, None])
"""Dry friction of 1 N·m, with a ripple of a thousandth lest it stays at its extreme. (T, 6)"""


def log_of(**changes: Array | None) -> Recording:
    """Six joints that swing by 1 rad against friction of 1 N·m, with some signals changed."""
    signals = {"q": Q, "dq": DQ, "torque": FRICTION, **changes}
    return Recording(t=T, **signals)  # type: ignore[arg-type]


def found(**changes: Array | None) -> dict[str, Remark]:
    log = log_of(**changes)
    found = (*signal_findings(log), *stuck_findings(log), *inverted_effort(log))
    both = (*found, *velocity_findings(log, velocity_fit(log)))
    return {finding.code: finding for finding in both}


def scaled(x: Array, factor: float, *joints: int) -> Array:
    """A signal with some of its columns, counted from 1, times a factor."""
    scale = np.ones(x.shape[1])
    scale[[j - 1 for j in joints]] = factor
    return x * scale


def effort_of_share(share: float, *joints: int) -> Array:
    """Effort whose net work over its gross work is as given on some joints, 1 on the others.

    It drives for (1 + share)/2 of all the way and brakes for the rest.
    """
    way = np.cumsum(np.abs(DQ), axis=0) / np.sum(np.abs(DQ), axis=0)
    drives = np.where(way <= (1 + share) / 2 + 1e-9, 1.0, -1.0)
    chosen = np.isin(np.arange(6), [j - 1 for j in joints])
    return FRICTION * np.where(chosen, drives, 1.0)


def test_a_sound_log_has_no_finding() -> None:
    assert found() == {}
    assert found(torque=None, current=FRICTION) == {}
    assert found(torque=None, torque_without_gravity=FRICTION) == {}


def test_a_log_without_velocity_or_effort() -> None:
    assert set(found(dq=None)) == {"no-velocity"}
    assert set(found(torque=None)) == {"no-effort"}
    assert {finding.level for finding in found(dq=None, torque=None).values()} == {"warning"}


@pytest.mark.parametrize(("peak", "reported"), [(12.9, False), (13.1, True), (-13.1, True)])
def test_positions_beyond_two_turns_may_be_degrees(peak: float, reported: bool) -> None:
    q = Q.copy()
    q[7, 2] = peak
    findings = found(q=q)
    assert ("degrees" in findings) == reported
    if reported:
        assert findings["degrees"].values["largest_rad"] == pytest.approx(13.1)


@pytest.mark.parametrize(("size", "reported"), [(59.0, False), (61.0, True)])
def test_currents_beyond_sixty_ampere_may_be_milliamperes(size: float, reported: bool) -> None:
    findings = found(current=size * FRICTION, torque=None)
    assert set(findings) == ({"milliamperes"} if reported else set())
    if reported:
        assert findings["milliamperes"].values["typical_A"] == pytest.approx(61.0, rel=2e-3)


def straight(x: Array, every: int, bend: float = 0.0) -> Array:
    """A signal of every such sample, joined by lines whose slope changes by a share within."""
    knots = np.arange(0, len(T), every)
    lines = np.column_stack([np.interp(T, T[knots], column[knots]) for column in x.T])
    rise = np.repeat(np.diff(x[knots], axis=0), every, axis=0)
    odd = np.arange(len(rise)) % every == every // 2
    lines[:-1] += 0.5 * bend * rise / every * odd[:, None]
    return lines


@pytest.mark.parametrize(
    ("q", "torque", "rate"),
    [
        (straight(Q, 4), straight(20 * Q, 4), 25.0),
        (straight(Q, 10), straight(20 * Q, 10), 10.0),
        (straight(Q, 2), straight(20 * Q, 2), None),  # half of it runs straight, less than .6
        (straight(Q, 4), 20 * Q, None),
        (Q, straight(20 * Q, 4), None),
        # a slope that changes by less than a thousandth of both sides' is the same
        (straight(Q, 4), straight(20 * Q, 4, bend=0.5e-3), 25.0),
        (straight(Q, 4), straight(20 * Q, 4, bend=8e-3), None),
        # what holds does not run straight, and is no motion: lines for 16 s, then steps
        (
            straight(Q, 4),
            np.where(T[:, None] < 16.0, straight(20 * Q, 4), 20 * Q[np.arange(len(T)) // 4 * 4]),
            25.0,
        ),
        # a tenth of the values has to change
        (straight(Q, 4), straight(20 * Q, 4) * (T[:, None] < 2.0), None),
        (straight(Q, 4), straight(20 * Q, 4) * (T[:, None] < 6.0), 25.0),
    ],
)
def test_signals_that_run_from_corner_to_corner_are_interpolated(
    q: Array, torque: Array, rate: float | None
) -> None:
    log = Recording(t=T, q=q, dq=DQ, torque=torque)
    rates = [f.values["rate_Hz"] for f in signal_findings(log) if f.code == "interpolated"]
    assert rates == ([] if rate is None else [pytest.approx(rate)])


@pytest.mark.parametrize(("joint", "reported"), [(6, False), (5, True)])
def test_the_last_joint_of_an_arm_may_turn_without_end(joint: int, reported: bool) -> None:
    """Wrist 3 of a UR3 has no limit: ten turns of it are 63 rad."""
    q = Q.copy()
    q[:, joint - 1] += 63.0
    assert ("degrees" in found(q=q)) == reported


def test_numbers_that_no_clock_and_no_robot_gives() -> None:
    """The limits are beyond every unit: 30 years in ns, steps from 0.1 ps to 300 years."""
    log = log_of()
    assert not list(unusable_findings(log))

    def codes(**changes: Array) -> list[str]:
        return [finding.code for finding in unusable_findings(replace(log, **changes))]

    assert codes(t=np.append(T[:-1], 0.9e18)) == []
    assert codes(t=np.append(T[:-1], 1.1e18)) == ["absurd-clock"]
    (clock,) = unusable_findings(replace(log, t=np.append(T[:-1], 1.1e18)))
    assert clock.values == {"least_s": T[0], "largest_s": 1.1e18}
    assert codes(t=1e-12 * T) == ["absurd-steps"]
    assert codes(t=1e-10 * T) == []
    assert codes(t=1.1e12 * T) == ["absurd-steps"]
    assert codes(torque=1.1e9 * DQ / DQ.max()) == ["absurd-values"]
    assert codes(torque=0.9e9 * DQ / DQ.max()) == []
    assert codes(tau_ext=1e300 * DQ, q=1e300 * Q) == ["absurd-values"] * 2


@pytest.mark.parametrize(("samples", "reported"), [(1, True), (2, True), (3, False)])
def test_two_samples_are_too_short(samples: int, reported: bool) -> None:
    log = Recording(t=T[:samples], q=Q[:samples], dq=DQ[:samples])
    findings = list(unusable_findings(log))
    assert [(f.code, f.level) for f in findings] == [("too-short", "warning")] * reported
    assert [f.values["samples"] for f in findings] == [samples] * reported


def test_a_few_currents_of_any_size_are_outliers() -> None:
    """Nine in a thousand are fewer than one in a hundred, eleven are more."""
    for per_thousand, reported in ((9, False), (11, True)):
        current = FRICTION.copy()
        current.flat[: current.size * per_thousand // 1000] = 500.0
        assert ("milliamperes" in found(current=current, torque=None)) == reported


@pytest.mark.parametrize("share", [1.0, 0.5, 0.0, -0.3, -1.0])
def test_shares_are_net_work_over_gross_work(share: float) -> None:
    shares = work_shares(log_of(), effort_of_share(share, 1, 2, 3, 4, 5, 6))
    np.testing.assert_allclose(shares, share, atol=2e-3)  # a sample of the fastest joint's way


def test_shares_of_joints_that_tell_nothing_are_not_known() -> None:
    """Too little way, one direction only, no effort: each alone."""
    log = log_of()
    ways = np.sum(np.abs(np.diff(Q, axis=0)), axis=0)
    for way, known in ((0.29, False), (0.31, True)):
        small = replace(log, q=Q * way / ways)
        assert np.isfinite(work_shares(small, FRICTION)).all() == known
    for slowest, known in ((-0.9e-3, False), (-1.1e-3, True)):
        one_way = replace(log, dq=np.maximum(DQ, slowest))
        assert np.isfinite(work_shares(one_way, np.ones_like(Q))).all() == known
        other_way = replace(log, dq=np.minimum(DQ, -slowest))
        assert np.isfinite(work_shares(other_way, np.ones_like(Q))).all() == known
    assert np.isnan(work_shares(log, np.zeros_like(Q))).all()
    assert np.isnan(work_shares(replace(log, dq=None), np.ones_like(Q))).all()


@pytest.mark.parametrize(("share", "reported"), [(-0.35, False), (-0.45, True)])
def test_most_joints_are_inverted_from_two_fifths_of_their_work(
    share: float, reported: bool
) -> None:
    findings = found(torque=effort_of_share(share, 1, 2, 3, 4))
    assert set(findings) == ({"effort-sign-by-work"} if reported else set())
    if reported:
        assert findings["effort-sign-by-work"].where.joints == (1, 2, 3, 4)


@pytest.mark.parametrize(("share", "reported"), [(-0.8, False), (-0.9, True)])
def test_a_joint_alone_is_inverted_only_by_nearly_all_its_work(
    share: float, reported: bool
) -> None:
    for joints in ((5,), (2, 3, 5)):
        findings = found(torque=effort_of_share(share, *joints))
        assert set(findings) == ({"effort-sign-of-some"} if reported else set())
        if reported:
            assert findings["effort-sign-of-some"].where.joints == joints


def test_the_numbers_of_an_inverted_effort() -> None:
    turned = scaled(-3.0 * FRICTION, -1.0, 1)
    for name, unit, column in (("torque", "N·m", "tau"), ("current", "A", "current")):
        effort = {"torque": None, name: turned}
        finding = found(**effort)["effort-sign-by-work"]
        assert finding.level == "warning"
        values = dict(finding.values)
        assert values.pop("shares_percent") == pytest.approx([-100.0] * 5)
        assert values == {
            "signal": name,
            "mean": pytest.approx(-3.0, rel=2e-3),
            "unit": unit,
            "first": 2,
            "column": column,
            "width": 6,
        }


def test_torque_is_judged_before_current() -> None:
    assert found(current=-FRICTION) == {}
    turned = found(torque=None, current=-FRICTION)["effort-sign-by-work"]
    assert turned.where.joints == (1, 2, 3, 4, 5, 6)


@pytest.mark.parametrize(
    ("judged", "least"), [(1, 2), (2, 2), (3, 2), (4, 2), (5, 3), (6, 4), (7, 4), (8, 5)]
)
def test_most_are_three_in_five_and_two_at_least(judged: int, least: int) -> None:
    """Of most joints less than half of the work tells the sign, of fewer it does not."""
    columns = np.arange(judged) % 6
    half = effort_of_share(-0.45, 1, 2, 3, 4, 5, 6)[:, columns]
    for turned in range(least - 1, min(least, judged) + 1):
        effort = np.where(np.arange(judged) < turned, half, FRICTION[:, columns])
        log = Recording(t=T, q=Q[:, columns], dq=DQ[:, columns], torque=effort)
        codes = [finding.code for finding in inverted_effort(log)]
        assert codes == ["effort-sign-by-work"] * (turned >= least)
