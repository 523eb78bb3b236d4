"""Findings about the logged velocity: each with a known amount of its fault, inside and outside."""

import numpy as np
import pytest
from scipy.signal import lfilter
from swinging import DQ, RATES, STEP, Q, T, found, log_of, scaled, speed_at

from vftcli.doctor.velocity import velocity_fit
from vftcli.signals.arrays import Array


def test_uneven_steps_shift_nothing() -> None:
    """Steps of 4 to 16 ms, stamps as exact as the signals: the lag stays below 0.1 ms."""
    t = np.cumsum(np.random.default_rng(0).uniform(0.004, 0.016, 4001))
    t -= t[0]
    fit = velocity_fit(log_of(t=t, q=np.sin(np.outer(t, RATES)), dq=speed_at(t)))
    np.testing.assert_allclose(fit.gain, 1.0, atol=1e-3)
    np.testing.assert_allclose(fit.lag, 0.0, atol=1e-4)


@pytest.mark.parametrize(("travel", "judged"), [(0.048, False), (0.052, True)])
def test_joints_that_hardly_move_are_not_judged(travel: float, judged: bool) -> None:
    """A twentieth of a radian of travel tells; the swing is 2 rad."""
    findings = found(q=scaled(Q, travel / 2, 2), dq=scaled(DQ, -travel / 2, 2))
    assert ("velocity-sign" in findings) == judged


@pytest.mark.parametrize(("samples", "judged"), [(64, False), (65, True)])
def test_velocities_are_judged_from_eight_windows_on(samples: int, judged: bool) -> None:
    rows = slice(samples)
    findings = found(t=T[rows], q=Q[rows], dq=np.rad2deg(DQ[rows]))
    assert ("velocity-unit" in findings) == judged


def test_motion_in_gaps_is_not_held_against_the_velocity() -> None:
    """The arm turns by .3 rad in every other second, of which nothing is recorded."""
    gaps = np.arange(4001) // 100
    assert set(found(t=T + gaps, q=Q + 0.3 * gaps[:, None])) == {"gaps"}


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


@pytest.mark.parametrize(
    ("dq", "quantity"),
    [
        (101.0 * DQ, "the motor's side of the gear"),
        # The motion holds whole swings, over which velocity and acceleration have nothing alike.
        (-(RATES**2) * Q, "the joint's acceleration"),
    ],
)
def test_velocities_of_another_kind_on_every_joint_are_no_clock(dq: Array, quantity: str) -> None:
    findings = found(dq=dq)
    assert set(findings) == {"velocity-of-another-kind"}
    said = findings["velocity-of-another-kind"]
    assert (said.where.joints, said.values["quantity"]) == ((1, 2, 3, 4, 5, 6), quantity)


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


def filtered(dq: Array, cut_off: float) -> Array:
    """Velocities behind a first-order low-pass. [Hz]"""
    keep = np.exp(-2 * np.pi * cut_off * STEP)
    return np.asarray(lfilter([1 - keep], [1, -keep], dq, axis=0, zi=keep * dq[:1])[0])


@pytest.mark.parametrize("cut_off", [0.5, 1.0, 2.0])
def test_a_filter_is_distinct_from_a_delay(cut_off: float) -> None:
    """A first-order low-pass takes 1/(2π f_c) and a part of the size, neither clock nor unit."""
    findings = found(dq=filtered(DQ, cut_off))
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


@pytest.mark.parametrize(("samples", "reported"), [(2, False), (3, True), (8, True), (20, True)])
def test_velocities_that_are_held_are_reported(samples: int, reported: bool) -> None:
    """Held for two samples, half of the steps repeat: that is the limit."""
    rows = np.arange(len(DQ))
    findings = found(dq=DQ[rows - rows % samples])
    assert ("velocity-held" in findings) == reported
    if reported:
        share = findings["velocity-held"].values["shares_percent"][0]
        assert share == pytest.approx(100 * (1 - 1 / samples), abs=0.5)
        assert "velocity-lag" not in findings


RAMP = np.clip(np.abs((T % 10) - 5) - 2.5, -1, 1)[:, None] * np.ones(6)
RESTS = np.where((T % 10 < 5)[:, None], DQ, 0.0)


@pytest.mark.parametrize(
    ("q", "dq"),
    [
        pytest.param(np.cumsum(RAMP, axis=0) * STEP, RAMP, id="constant speed"),
        pytest.param(Q, np.round(DQ / 0.05) * 0.05, id="coarse"),
        pytest.param(np.cumsum(RESTS, axis=0) * STEP, RESTS, id="rests"),
    ],
)
def test_a_velocity_that_rightly_repeats_itself_is_not_held(q: Array, dq: Array) -> None:
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
    fit = velocity_fit(log_of(q=q, dq=speed_at(T - 0.03)))
    np.testing.assert_allclose(fit.lag, 0.03, atol=4 * np.max(fit.lag_error))
    assert np.max(fit.lag_error) < 2e-3


def test_the_standard_errors_are_the_scatter() -> None:
    """Of 200 noises on a quarter turn to one and a half: 1/√400 = 5 % (one sigma)."""
    chance, short = np.random.default_rng(0), {"t": T[:250], "q": Q[:250]}
    fits = [
        velocity_fit(log_of(**short, dq=2 * DQ[:250] + chance.normal(0, 0.02, (250, 6))))
        for _ in range(200)
    ]
    for values, errors in (("gain", "gain_error"), ("lag", "lag_error")):
        scatter = np.std([getattr(fit, values) for fit in fits], axis=0)
        stated = np.mean([getattr(fit, errors) for fit in fits], axis=0)
        np.testing.assert_allclose(stated, scatter, rtol=0.2)


def test_a_velocity_that_was_written_for_a_joint_at_rest() -> None:
    """J6 rests; J5's velocity is its own, J6's that of J5: both are reported, neither as a size."""
    still = np.array([1.0, 1, 1, 1, 1, 0])
    findings = found(q=Q * still, dq=(DQ * still)[:, [0, 1, 2, 3, 5, 4]])
    assert [code for code in findings if code.startswith("velocity")] == ["velocity-order"]
    assert findings["velocity-order"].where.joints == (5, 6)


def test_filtered_velocities_are_no_other_joint_s() -> None:
    """Two joints of one rate, a quarter turn apart: a filter brings one closer to the other."""
    q, dq = Q.copy(), DQ.copy()
    q[:, 5], dq[:, 5] = np.sin(RATES[0] * T - 0.3), RATES[0] * np.cos(RATES[0] * T - 0.3)
    assert set(found(q=q, dq=filtered(dq, 0.5))) == {"velocity-filtered"}


def test_one_hard_stop_tells_no_lag() -> None:
    """3 s at one speed, then at rest: stamps that are 30 ms off at the stop would be a lag."""
    t = STEP * np.arange(400)
    speed = np.where(t < 3, 0.5, 0.0)
    way = np.cumsum(speed) * STEP
    logged = np.where(t < 3.03, 0.5, 0.0)
    assert "velocity-lag" not in found(t=t, q=way[:, None], dq=logged[:, None])


def test_a_motion_in_two_windows_only_is_not_judged() -> None:
    q = 0.2 * np.clip(T[:1000] - 5.0, 0, 0.3)[:, None]
    findings = found(t=T[:1000], q=q, dq=2 * np.gradient(q, STEP, axis=0))
    assert not [code for code in findings if code.startswith("velocity")]
