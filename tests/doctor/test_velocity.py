"""Findings about the logged velocity: each with a known amount of its fault, inside and outside."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from vftcli.doctor.velocity import VelocityFit, clock_findings, velocity_findings, velocity_fit
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark

STEP = 0.01
T = STEP * np.arange(4001)
RATES = 2 * np.pi / 10 * np.array([1.0, 2, 3, 4, 5, 6])
"""Whole turns in the 40 s of the log. [rad/s]"""
Q = np.sin(np.outer(T, RATES))


def speed_at(t: Array) -> Array:
    """The velocities at any time. (T, 6) [rad/s]"""
    return np.asarray(RATES * np.cos(np.outer(t, RATES)))


DQ = speed_at(T)


def log_of(**changes: Array) -> Recording:
    """Six joints that swing by 1 rad, with some signals changed."""
    return Recording(**{"t": T, "q": Q, "dq": DQ, **changes})  # type: ignore[arg-type]


def fit_of(**changes: Array) -> VelocityFit:
    fit = velocity_fit(log_of(**changes))
    assert fit is not None
    return fit


def found(**changes: Array) -> dict[str, Remark]:
    """Findings about velocities and clock, each code once."""
    log = log_of(**changes)
    fit = velocity_fit(log)
    findings = [*clock_findings(log, fit), *velocity_findings(log, fit)]
    assert len({finding.code for finding in findings}) == len(findings)
    return {finding.code: finding for finding in findings}


def scaled(x: Array, factor: float, *joints: int) -> Array:
    """A signal with some of its columns, counted from 1, times a factor."""
    scale = np.ones(x.shape[1])
    scale[[j - 1 for j in joints]] = factor
    return x * scale


def test_a_sound_log_has_no_finding() -> None:
    fit = fit_of()
    assert found() == {}
    # Trapezoids over steps of 0.01 s at up to 3.8 rad/s: (3.8·0.01)²/12 ≈ 1e-4.
    np.testing.assert_allclose(fit.gain, 1.0, atol=2e-4)
    np.testing.assert_allclose(fit.lag, 0.0, atol=1e-5)


def test_gains_are_the_factor_of_the_velocity() -> None:
    factors = np.array([1.0, -1.0, 0.5, 2.0, 57.3, 1.2])
    np.testing.assert_allclose(fit_of(dq=DQ * factors).gain, factors, rtol=2e-4)


@pytest.mark.parametrize("lag", [-0.02, 0.003, 0.05])
def test_lags_are_the_delay_of_the_velocity(lag: float) -> None:
    """Windows of 20 steps weigh a slope (π/20)²/6 = 0.4 % too high; (ωτ)²/6 is up to 0.6 %."""
    fit = fit_of(dq=speed_at(T - lag))
    np.testing.assert_allclose(fit.lag, lag, rtol=0.01)


def test_uneven_steps_shift_nothing() -> None:
    """Steps of 4 to 16 ms, stamps as exact as the signals: the lag stays below 0.1 ms."""
    t = np.cumsum(np.random.default_rng(0).uniform(0.004, 0.016, 4001))
    t -= t[0]
    fit = fit_of(t=t, q=np.sin(np.outer(t, RATES)), dq=speed_at(t))
    np.testing.assert_allclose(fit.gain, 1.0, atol=1e-3)
    np.testing.assert_allclose(fit.lag, 0.0, atol=1e-4)


def test_joints_that_hardly_move_are_not_judged() -> None:
    """A twentieth of a radian of travel tells; the swing is 2 rad."""
    scale = np.array([0.024, 0.026, 1, 1, 1, 0.0])
    fit = fit_of(q=Q * scale, dq=DQ * scale)
    assert fit.known.tolist() == [False, True, True, True, True, False]


def test_a_fit_needs_eight_windows_and_velocities() -> None:
    assert velocity_fit(replace(log_of(), dq=None)) is None
    short = Recording(t=T[:65], q=Q[:65], dq=DQ[:65])  # eight windows of eight steps
    assert velocity_fit(short) is not None
    assert velocity_fit(short.between(0, T[63])) is None


def test_motion_in_a_gap_is_not_held_against_the_velocity() -> None:
    """The arm turns by 2 rad while nothing is recorded and its velocity is the same after."""
    late, turned = T.copy(), Q.copy()
    late[2000:] += 5.0
    turned[2000:] += 2.0
    fit = fit_of(t=late, q=turned)
    np.testing.assert_allclose(fit.gain, 1.0, atol=2e-4)


@pytest.mark.parametrize(("factor", "reported"), [(0.97, True), (0.99, False), (1.01, False)])
def test_velocities_of_another_size_are_reported(factor: float, reported: bool) -> None:
    findings = found(dq=scaled(DQ, factor, 3, 5))
    assert set(findings) == ({"velocity-mismatch"} if reported else set())
    if reported:
        assert findings["velocity-mismatch"].where.joints == (3, 5)
        slopes = findings["velocity-mismatch"].values["slopes"]
        assert slopes == pytest.approx([factor, factor], rel=2e-4)


def test_velocities_of_the_other_sign_are_reported() -> None:
    findings = found(dq=scaled(DQ, -1.0, 2))
    assert set(findings) == {"velocity-sign"}
    assert findings["velocity-sign"].where.joints == (2,)
    assert found(dq=-DQ)["velocity-sign"].where.joints == (1, 2, 3, 4, 5, 6)


@pytest.mark.parametrize("factor", [57.3, 60.0, 1 / 57.3, 1 / 60.0])
def test_velocities_off_by_degrees_on_every_joint_are_another_unit(factor: float) -> None:
    findings = found(dq=DQ * factor)
    assert set(findings) == {"velocity-unit"}
    assert findings["velocity-unit"].values["slope"] == pytest.approx(factor, rel=2e-4)


@pytest.mark.parametrize(
    ("factor", "quantity"),
    [
        (57.3, "deg/s"),
        (1 / 57.3, "rad/s, beside positions in degrees"),
        (50.0, "the motor's side of the gear"),
        (101.0, "the motor's side of the gear"),
        (1.55, "another motion or unit"),
        (0.6, "another motion or unit"),
    ],
)
def test_far_off_velocities_of_some_joints_are_another_quantity(
    factor: float, quantity: str
) -> None:
    findings = found(dq=scaled(DQ, factor, 1, 2))
    assert set(findings) == {"velocity-of-another-kind"}
    said = findings["velocity-of-another-kind"]
    assert (said.where.joints, said.values["quantity"]) == ((1, 2), quantity)


def test_velocities_of_the_motors_are_no_clock() -> None:
    findings = found(dq=101.0 * DQ)
    assert set(findings) == {"velocity-of-another-kind"}
    assert findings["velocity-of-another-kind"].where.joints == (1, 2, 3, 4, 5, 6)


def test_accelerations_in_the_place_of_velocities_are_named() -> None:
    """The motion holds whole swings, over which velocity and acceleration have nothing alike."""
    findings = found(dq=-(RATES**2) * Q)
    assert set(findings) == {"velocity-of-another-kind"}
    assert findings["velocity-of-another-kind"].values["quantity"] == "the joint's acceleration"


@pytest.mark.parametrize(
    ("factor", "pace"), [(0.9, "slow"), (0.975, "slow"), (0.985, ""), (1.015, ""), (1.05, "fast")]
)
def test_a_clock_of_another_rate_is_reported(factor: float, pace: str) -> None:
    findings = found(t=factor * T)
    assert set(findings) == ({"clock-rate"} if pace else set())
    if pace:
        values = findings["clock-rate"].values
        assert values["gain"] == pytest.approx(factor, rel=2e-4)
        assert values["pace"] == pace
        assert values["percent"] == pytest.approx(100 * abs(factor - 1), abs=0.02)


@pytest.mark.parametrize(
    ("factor", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns"), (1e-3, "s"), (950.0, "ms")]
)
def test_stamps_of_another_unit_are_reported_alone(factor: float, unit: str) -> None:
    """Milliseconds read as seconds also look like a tenth of a sample a second."""
    findings = found(t=factor * T)
    assert set(findings) == {"time-unit"}
    assert findings["time-unit"].values["unit"] == unit


@pytest.mark.parametrize("seed", [0, 1])
def test_noise_on_both_hides_no_unit(seed: int) -> None:
    """σ = 0.05 rad/s on steps of 1 ms read as seconds: eight of them as a window are too few."""
    chance = np.random.default_rng(seed)
    t = 1e-3 * np.arange(8000)
    q = np.sin(np.outer(t, RATES)) + chance.normal(0, 1e-5, (8000, 6))
    dq = speed_at(t) + chance.normal(0, 0.05, (8000, 6))
    assert set(found(t=1e3 * t, q=q, dq=dq)) == {"time-unit"}


@pytest.mark.parametrize(
    ("samples", "reported"), [(0.9, False), (1.2, True), (3, True), (-3, True)]
)
def test_a_velocity_that_is_late_by_more_than_a_sample_is_reported(
    samples: float, reported: bool
) -> None:
    dq = DQ.copy()
    dq[:, [0, 3]] = speed_at(T - samples * STEP)[:, [0, 3]]
    findings = found(dq=dq)
    assert set(findings) == ({"velocity-lag"} if reported else set())
    if reported:
        assert findings["velocity-lag"].where.joints == (1, 4)
        lags = findings["velocity-lag"].values["lags_ms"]
        assert lags == pytest.approx([10 * samples] * 2, rel=0.01)


@pytest.mark.parametrize(("late_ms", "reported"), [(7.0, False), (9.0, True)])
def test_at_a_kilohertz_eight_milliseconds_are_late(late_ms: float, reported: bool) -> None:
    """A real FR3's velocities are 2.9 ms late, those of a host's stamps up to 5.7."""
    t = 1e-3 * np.arange(8000)
    findings = found(t=t, q=np.sin(np.outer(t, RATES)), dq=speed_at(t - 1e-3 * late_ms))
    assert set(findings) == ({"velocity-lag"} if reported else set())


@pytest.mark.parametrize("cut_off", [0.5, 1.0, 2.0])
def test_a_filter_is_distinct_from_a_delay(cut_off: float) -> None:
    """A first-order low-pass takes 1/(2π f_c) and a part of the size, neither clock nor unit."""
    keep = np.exp(-2 * np.pi * cut_off * STEP)
    start = keep * DQ[:1]
    findings = found(dq=lfilter([1 - keep], [1, -keep], DQ, axis=0, zi=start)[0])
    assert set(findings) == {"velocity-filtered"}
    lags = findings["velocity-filtered"].values["lags_ms"]
    # Twice a sample of the recursion, and (ωτ)² of the linear fit on the slowest joint.
    assert lags[0] == pytest.approx(1e3 / (2 * np.pi * cut_off), rel=0.12)


def test_velocities_of_joints_that_are_exchanged() -> None:
    order = [0, 3, 2, 1, 4, 5]
    findings = found(dq=DQ[:, order])
    assert set(findings) == {"velocity-order"}
    assert findings["velocity-order"].where.joints == (2, 4)
    turned = found(dq=DQ[:, [1, 2, 0, 3, 4, 5]])
    assert turned["velocity-order"].where.joints == (1, 2, 3)


def test_joints_whose_motions_differ_by_a_factor_only_are_reported_apart() -> None:
    """In a plane the elbow often turns against the shoulder: own fits too, with another gain."""
    scale = np.array([1.0, 1.0, -1.4, 1.0, 1.0, 1.0])
    q, dq = Q.copy(), DQ.copy()
    q[:, 2], dq[:, 2] = q[:, 1], dq[:, 1]
    findings = found(q=q * scale, dq=(dq * scale)[:, [0, 2, 1, 3, 4, 5]])
    assert set(findings) == {"velocity-order"}
    assert findings["velocity-order"].where.joints == (2, 3)


def held(samples: int, dq: Array = DQ) -> Array:
    rows = np.arange(len(dq))
    return np.asarray(dq[rows - rows % samples])


@pytest.mark.parametrize(("samples", "reported"), [(2, False), (3, True), (8, True), (20, True)])
def test_velocities_that_are_held_are_reported(samples: int, reported: bool) -> None:
    """Held for two samples, half of the steps repeat: that is the limit."""
    findings = found(dq=held(samples))
    assert ("velocity-held" in findings) == reported
    if reported:
        share = findings["velocity-held"].values["shares_percent"][0]
        assert share == pytest.approx(100 * (1 - 1 / samples), abs=0.5)
        assert "velocity-lag" not in findings


def sound_repeats() -> Iterator[tuple[str, Array, Array]]:
    """Velocities that rightly repeat themselves: name, positions, velocities."""
    ramp = np.clip(np.abs((T % 10) - 5) - 2.5, -1, 1)[:, None] * np.ones(6)
    yield "constant speed", np.cumsum(ramp, axis=0) * STEP, ramp
    coarse = np.round(DQ / 0.05) * 0.05
    yield "coarse", Q, coarse
    rests = np.where((T % 10 < 5)[:, None], DQ, 0.0)
    yield "rests", np.cumsum(rests, axis=0) * STEP, rests


@pytest.mark.parametrize("kind", ["constant speed", "coarse", "rests"])
def test_a_velocity_that_rightly_repeats_itself_is_not_held(kind: str) -> None:
    ((q, dq),) = [(q, dq) for name, q, dq in sound_repeats() if name == kind]
    assert "velocity-held" not in found(q=q, dq=dq)


def test_rows_that_repeat_whole_hold_no_velocity() -> None:
    """A late packet repeats the positions too: 60 % of the rows here."""
    rows = np.maximum.accumulate(
        np.where(np.random.default_rng(0).random(4001) < 0.6, 0, np.arange(4001))
    )
    assert "velocity-held" not in found(q=Q[rows], dq=DQ[rows])


def test_noise_of_the_positions_hides_no_lag() -> None:
    """Noise of 1 mrad makes the derivative of the slope ten times as large as the motion's own."""
    q = Q + np.random.default_rng(0).normal(0, 1e-3, Q.shape)
    fit = fit_of(q=q, dq=speed_at(T - 0.03))
    np.testing.assert_allclose(fit.lag, 0.03, atol=4 * np.max(fit.lag_error))
    assert np.max(fit.lag_error) < 2e-3


def test_the_standard_errors_are_the_scatter() -> None:
    """Of 200 noises on a quarter turn to one and a half: 1/√400 = 5 % (one sigma)."""
    chance, short = np.random.default_rng(0), {"t": T[:250], "q": Q[:250]}
    fits = [
        fit_of(**short, dq=2 * DQ[:250] + chance.normal(0, 0.02, (250, 6))) for _ in range(200)
    ]
    for values, errors in (("gain", "gain_error"), ("lag", "lag_error")):
        scatter = np.std([getattr(fit, values) for fit in fits], axis=0)
        stated = np.mean([getattr(fit, errors) for fit in fits], axis=0)
        np.testing.assert_allclose(stated, scatter, rtol=0.2)


def test_a_velocity_that_was_written_for_a_joint_at_rest() -> None:
    """J6 rests; J5's velocity is its own, J6's that of J5: both are reported, neither as a size."""
    still = np.array([1.0, 1, 1, 1, 1, 0])
    findings = found(q=Q * still, dq=(DQ * still)[:, [0, 1, 2, 3, 5, 4]])
    assert set(findings) == {"velocity-order"}
    assert findings["velocity-order"].where.joints == (5, 6)


def test_filtered_velocities_are_no_other_joint_s() -> None:
    """Two joints of one rate, a quarter turn apart: a filter brings one closer to the other."""
    q, dq = Q.copy(), DQ.copy()
    q[:, 5], dq[:, 5] = np.sin(RATES[0] * T - 0.3), RATES[0] * np.cos(RATES[0] * T - 0.3)
    keep = np.exp(-2 * np.pi * 0.5 * STEP)
    start = keep * dq[:1]
    assert set(found(q=q, dq=lfilter([1 - keep], [1, -keep], dq, axis=0, zi=start)[0])) == {
        "velocity-filtered"
    }


def test_one_hard_stop_tells_no_lag() -> None:
    """3 s at one speed, then at rest: stamps that are 30 ms off at the stop would be a lag."""
    t = STEP * np.arange(400)
    speed = np.where(t < 3, 0.5, 0.0)
    way = np.cumsum(speed) * STEP
    logged = np.where(t < 3.03, 0.5, 0.0)
    assert "velocity-lag" not in found(t=t, q=way[:, None], dq=logged[:, None])


def test_a_motion_in_two_windows_only_is_not_judged() -> None:
    q = 0.2 * np.clip(T[:1000] - 5.0, 0, 0.3)[:, None]
    assert velocity_fit(Recording(t=T[:1000], q=q, dq=2 * np.gradient(q, STEP, axis=0))) is None
