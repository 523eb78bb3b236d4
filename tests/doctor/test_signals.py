"""Findings about the signals: each with a known amount of its fault, inside and outside."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.doctor.signals import (
    inverted_joints,
    is_clipped,
    is_most,
    signal_findings,
    velocity_slopes,
    work_shares,
)
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
    return {finding.code: finding for finding in signal_findings(log_of(**changes))}


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


def test_a_log_without_velocity_or_effort() -> None:
    assert set(found(dq=None)) == {"no-velocity"}
    assert set(found(torque=None)) == {"no-effort"}
    assert {finding.level for finding in found(dq=None, torque=None).values()} == {"warning"}


@pytest.mark.parametrize(("peak", "told"), [(12.9, False), (13.1, True), (-13.1, True)])
def test_positions_beyond_two_turns_may_be_degrees(peak: float, told: bool) -> None:
    q = Q.copy()
    q[7, 2] = peak
    findings = found(q=q)
    assert ("degrees" in findings) == told
    if told:
        assert findings["degrees"].values["largest_rad"] == pytest.approx(13.1)


@pytest.mark.parametrize(("size", "told"), [(59.0, False), (61.0, True)])
def test_currents_beyond_sixty_ampere_may_be_milliamperes(size: float, told: bool) -> None:
    findings = found(current=size * FRICTION, torque=None)
    assert set(findings) == ({"milliamperes"} if told else set())
    if told:
        assert findings["milliamperes"].values["typical_A"] == pytest.approx(61.0, rel=2e-3)


def test_a_few_currents_of_any_size_are_outliers() -> None:
    """Nine in a thousand are fewer than one in a hundred, eleven are more."""
    for per_thousand, told in ((9, False), (11, True)):
        current = FRICTION.copy()
        current.flat[: current.size * per_thousand // 1000] = 500.0
        assert ("milliamperes" in found(current=current, torque=None)) == told


def test_slopes_are_the_factor_of_the_velocity() -> None:
    factors = np.array([1.0, -1.0, 0.5, 2.0, 57.3, 1.2])
    # Trapezoids over 0.1 s and the step of 0.01 s: second order, (6·0.628·0.01)²/12 ≈ 1e-4.
    np.testing.assert_allclose(velocity_slopes(log_of(dq=DQ * factors)), factors, rtol=2e-4)


def test_slopes_of_joints_that_hardly_move_are_not_known() -> None:
    """A twentieth of a radian of travel tells; the swing is 2 rad."""
    scale = np.array([0.024, 0.026, 1, 1, 1, 0.0])
    slopes = velocity_slopes(log_of(q=Q * scale, dq=DQ * scale))
    assert np.isnan(slopes).tolist() == [True, False, False, False, False, True]


def test_slopes_need_twenty_samples_and_velocities() -> None:
    log = log_of()
    assert np.isnan(velocity_slopes(replace(log, dq=None))).all()
    fast = Recording(t=T[:20], q=20 * Q[:20], dq=20 * DQ[:20])
    assert np.isfinite(velocity_slopes(fast)).all()
    assert np.isnan(velocity_slopes(fast.between(0, T[18]))).all()


def test_motion_in_a_gap_is_not_held_against_the_velocity() -> None:
    """The arm turns by 2 rad while nothing is recorded and its velocity is the same after."""
    late, turned = T.copy(), Q.copy()
    late[2000:] += 5.0
    turned[2000:] += 2.0
    log = Recording(t=late, q=turned, dq=DQ)
    np.testing.assert_allclose(velocity_slopes(log), 1.0, rtol=2e-4)


@pytest.mark.parametrize(
    ("factor", "told"), [(0.65, True), (0.75, False), (1.25, False), (1.35, True), (-1.0, True)]
)
def test_velocities_three_tenths_off_are_told(factor: float, told: bool) -> None:
    findings = found(dq=scaled(DQ, factor, 3, 5))
    assert ("velocity-mismatch" in findings) == told
    if told:
        assert findings["velocity-mismatch"].where.joints == (3, 5)
        slopes = findings["velocity-mismatch"].values["slopes"]
        assert slopes == pytest.approx([factor, factor], rel=2e-4)


@pytest.mark.parametrize(
    ("factor", "code"),
    [
        (57.3, "velocity-unit"),
        (66.0, "velocity-unit"),
        (68.0, "velocity-mismatch"),
        (49.0, "velocity-unit"),
        (47.0, "velocity-mismatch"),
        (1 / 57.3, "velocity-unit"),
        (1 / 57.3 + 0.009, "velocity-unit"),
        (1 / 57.3 + 0.011, "velocity-mismatch"),
        (1 / 57.3 - 0.009, "velocity-unit"),
        (1 / 57.3 - 0.011, "velocity-mismatch"),
    ],
)
def test_velocities_off_by_degrees_on_every_joint_are_another_unit(
    factor: float, code: str
) -> None:
    findings = found(dq=DQ * factor)
    assert {"velocity-unit", "velocity-mismatch"} & set(findings) == {code}
    if code == "velocity-unit":
        assert findings[code].values["slope"] == pytest.approx(factor, rel=2e-4)
        assert findings[code].level == "warning"


def test_degrees_on_some_joints_only_are_a_mismatch() -> None:
    assert found(dq=scaled(DQ, 57.3, 1, 2))["velocity-mismatch"].where.joints == (1, 2)


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


@pytest.mark.parametrize(("share", "told"), [(-0.35, False), (-0.45, True)])
def test_most_joints_are_inverted_from_two_fifths_of_their_work(share: float, told: bool) -> None:
    findings = found(torque=effort_of_share(share, 1, 2, 3, 4))
    assert set(findings) == ({"effort-sign"} if told else set())
    if told:
        assert findings["effort-sign"].where.joints == (1, 2, 3, 4)


@pytest.mark.parametrize(("share", "told"), [(-0.8, False), (-0.9, True)])
def test_a_joint_alone_is_inverted_only_by_nearly_all_its_work(share: float, told: bool) -> None:
    for joints in ((5,), (2, 3, 5)):
        findings = found(torque=effort_of_share(share, *joints))
        assert set(findings) == ({"effort-sign-of-some"} if told else set())
        if told:
            assert findings["effort-sign-of-some"].where.joints == joints


def test_the_numbers_of_an_inverted_effort() -> None:
    turned = scaled(-3.0 * FRICTION, -1.0, 1)
    for name, unit, column in (("torque", "N·m", "tau"), ("current", "A", "current")):
        effort = {"torque": None, name: turned}
        finding = found(**effort)["effort-sign"]
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
    log = log_of(torque=FRICTION, current=-FRICTION)
    assert inverted_joints(log) == ([], 6)
    assert inverted_joints(replace(log, torque=None)) == ([0, 1, 2, 3, 4, 5], 6)
    assert inverted_joints(replace(log, torque=None, current=None)) == ([], 0)


@pytest.mark.parametrize(
    ("judged", "least"), [(1, 2), (2, 2), (3, 2), (4, 2), (5, 3), (6, 4), (7, 4), (8, 5)]
)
def test_most_are_three_in_five_and_two_at_least(judged: int, least: int) -> None:
    assert is_most(least, judged)
    assert not is_most(least - 1, judged)


def test_joints_that_never_move() -> None:
    """A milliradian of travel is motion; the swing is 2 rad."""
    assert "still-joint" not in found(q=scaled(Q, 0.55e-3, 2))
    still = found(q=scaled(Q, 0.45e-3, 2))
    assert still["still-joint"].where.joints == (2,)
    two = found(q=scaled(Q, 0.45e-3, 2, 6))
    assert two["still-joints"].where.joints == (2, 6)
    assert not {"still-joint", "at-rest"} & set(two)
    rest = found(q=0.45e-3 * Q)
    assert rest["at-rest"].values["travel_mrad"] == pytest.approx(0.9, rel=1e-3)
    assert {"still-joint", "still-joints"}.isdisjoint(rest)
    assert rest["at-rest"].level == "fact"


def wave(peak: float = 1.0, low: float = -1.0, run: int = 0) -> Array:
    """A signal between two extremes each of which it takes once, the upper for a run at will."""
    value = np.linspace(0.9 * low, 0.9 * peak, 200)
    value[50] = low
    value[100 : 100 + max(run, 1)] = peak
    return value


@pytest.mark.parametrize(("run", "clipped"), [(1, False), (9, False), (10, True), (30, True)])
def test_ten_samples_in_a_row_at_the_extreme_are_clipped(run: int, clipped: bool) -> None:
    assert is_clipped(wave(run=run)) == clipped
    assert is_clipped(-wave(run=run)) == clipped


def test_what_is_not_clipped() -> None:
    assert not is_clipped(np.ones(200))
    scattered = wave()
    scattered[::10] = 1.0
    assert not is_clipped(scattered)
    # an effort that often reads the same small value rests: below half of its range
    assert not is_clipped(wave(peak=0.9, low=-1.0, run=30))
    assert is_clipped(wave(peak=1.1, low=-1.0, run=30))
    # more than half of all samples at the extreme is a resting value too
    assert is_clipped(wave(run=100))
    assert not is_clipped(np.where(np.arange(200) < 101, 1.0, wave()))


def test_clipped_joints_are_named_with_their_signal() -> None:
    smooth = np.sin(np.outer(T, RATES))
    clipped = smooth.copy()
    clipped[:, 3] = np.clip(smooth[:, 3], -0.9, 0.9)
    findings = [
        finding
        for finding in signal_findings(log_of(current=clipped, torque=smooth))
        if finding.code == "saturation"
    ]
    assert [(f.where.joints, f.values["signal"], f.level) for f in findings] == [
        ((4,), "current", "warning")
    ]


@pytest.mark.parametrize(
    ("name", "level"),
    [
        ("current", "warning"),
        ("torque", "warning"),
        ("tau_ext", "warning"),
        ("target_torque", "fact"),
        ("dq", "fact"),
    ],
)
def test_signals_that_are_all_zero(name: str, level: str) -> None:
    code = f"zero-{name.replace('_', '-')}"
    zeros = np.zeros_like(Q)
    assert found(**{name: zeros})[code].level == level
    zeros[-1, 0] = 1e-9
    assert code not in found(**{name: zeros})


def test_a_zero_wrench_says_whether_the_torques_beside_it_are_zero() -> None:
    zeros = np.zeros((len(T), 6))
    assert found(wrench=zeros)["zero-wrench"].level == "warning"
    assert "zero-wrench" in found(wrench=zeros, tau_ext=zeros)
    beside = found(wrench=zeros, tau_ext=FRICTION)
    assert "zero-wrench-beside-tau-ext" in beside
    assert "zero-wrench" not in beside
