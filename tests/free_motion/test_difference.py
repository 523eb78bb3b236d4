"""The alignment ladder: what a difference is on each rung, and which rung is used."""

from collections.abc import Callable

import numpy as np
import pytest

from vftcli.free_motion.difference import (
    Difference,
    ErrorModel,
    PairedRuns,
    by_phase,
    difference,
    error_model,
    most_certain,
    noise_below,
    noise_of,
    noise_when_quiet,
    pair_with_run,
)
from vftcli.robots.run import Run
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.filters import low_pass

Make = Callable[..., Run]
T = 0.008 * np.arange(1500)
RNG = np.random.default_rng(4)
PUSH = 5.0 * np.exp(-((T - 6.0) ** 2))[:, None]
MODEL, FREE_MODEL = RNG.standard_normal((2, len(T), 1))


@pytest.fixture
def drive(drive_of: Make) -> Make:
    """One joint that swings, with torques of its own."""
    q, dq = np.sin(T)[:, None], np.cos(T)[:, None]
    return lambda torque, model: drive_of(T, q, dq, drive_torque=torque, model_torque=model)


def test_a_difference_is_free_less_loaded_with_the_model_s_own_taken_off(drive):
    """τ + τ_ext is what the model says of each motion: the push comes out exactly."""
    loaded, free = drive(MODEL - PUSH, MODEL), drive(FREE_MODEL, FREE_MODEL)
    laid = PairedRuns(motion=loaded, pairings=[pair_with_run(T, free, 0.0)])
    corrected = difference(laid, "model", None)
    np.testing.assert_allclose(corrected.tau, PUSH, atol=1e-9)
    plain = difference(laid, "period", None)
    np.testing.assert_allclose(plain.tau, FREE_MODEL - MODEL + PUSH, atol=1e-9)
    assert np.all(corrected.error.floor < plain.error.floor)


def test_too_few_partners_are_refused(drive):
    loaded = drive(MODEL, MODEL)
    laid = PairedRuns(motion=loaded, pairings=[pair_with_run(T, loaded, T[-1] - T[14])])
    with pytest.raises(ReferenceTorqueError, match="only 15 samples have a partner"):
        difference(laid, "period", None)


def test_the_simpler_of_two_alike_is_taken():
    def made(rung: str, *floor: float, stands: bool = False) -> Difference:
        """A difference of two joints' floors, of which the second may stand."""
        standing = np.zeros((4, 2), dtype=bool) | [False, stands]
        error = ErrorModel(np.tile(floor, (4, 1)), standing)
        return Difference(rung, None, np.zeros((4, 2)), error)

    low = made("period", 1.0, 1.0)
    assert most_certain([low, made("phase", 0.98, 0.98)])[0].rung == "period"
    assert most_certain([low, made("phase", 0.96, 0.96)])[0].rung == "phase"
    better = [low, made("phase", 0.9, 0.9), made("model", 0.9 * 0.97 + 0.01, 0.88)]
    assert most_certain(better)[0].rung == "phase"
    # A joint that stands decides nothing.
    stood = [made("period", 1.0, 1.0, stands=True), made("model", 0.5, 9.0, stands=True)]
    assert most_certain(stood)[0].rung == "model"


STEP = 0.008
TIMES = STEP * np.arange(6000)
MOVING = np.ones((6000, 1), dtype=bool)


def test_white_noise_is_measured_under_a_smooth_signal_and_where_it_is_quiet():
    x = 0.3 * np.random.default_rng(1).standard_normal((6000, 1))
    smooth = x + 10.0 * np.sin(2 * np.pi * 0.5 * TIMES)[:, None]
    # 6000 samples tell 1 %
    assert noise_of(TIMES, smooth, MOVING, STEP, None) == pytest.approx(0.3, rel=0.05)
    assert noise_when_quiet(TIMES, x, MOVING, STEP, None) == pytest.approx(0.3, rel=0.05)
    assert noise_when_quiet(TIMES[:300], x[:300], MOVING[:300], STEP, None) == 0.0  # six pieces


@pytest.mark.parametrize("cutoff", [6.0, 12.0])
def test_what_a_low_pass_leaves_of_white_noise(cutoff):
    """Measured beside the signal, predicted for the band that passes."""
    x = np.random.default_rng(2).standard_normal((6000, 1))
    left = float(np.sqrt(np.mean(low_pass(TIMES, x, cutoff) ** 2)))
    assert noise_of(TIMES, x, MOVING, STEP, cutoff) == pytest.approx(left, rel=0.1)


def coloured(memory: float, seed: int) -> np.ndarray:
    """Noise of one newton-metre whose correlation falls to 1/e within a time. (6000, 1)"""
    keep = np.exp(-STEP / memory)
    drive = np.random.default_rng(seed).standard_normal(8000) * np.sqrt(1.0 - keep**2)
    x = np.zeros(8000)
    for k in range(1, 8000):
        x[k] = keep * x[k - 1] + drive[k]
    return x[2000:, None]


@pytest.mark.parametrize(("memory", "share"), [(0.03, 0.8), (0.1, 0.55)])
def test_coloured_noise_is_measured_where_it_is_quiet(memory, share):
    """Beside a slow load and short contacts. What is slower than a piece counts for nothing: of an
    exponential correlation a line over .4 s leaves 86 % of the variance at .03 s, 45 % at .1 s."""
    load = 10.0 * np.sin(2 * np.pi * 0.1 * TIMES)[:, None]
    touched = np.sin(2 * np.pi * 0.25 * TIMES) > 0.0
    contact = np.where(touched, 30.0 * np.sin(2 * np.pi * TIMES) ** 2, 0.0)
    x = coloured(memory, 4) + load + contact[:, None]
    left = float(np.sqrt(np.mean(low_pass(TIMES, coloured(memory, 4), 12.0) ** 2)))
    quiet = noise_when_quiet(TIMES, low_pass(TIMES, x, 12.0), MOVING, STEP, 12.0)[0]
    assert share * left < quiet < 1.15 * left
    # taken to be white, the band about the cutoff says less than half of that at .1 s
    assert noise_of(TIMES, x, MOVING, STEP, 12.0)[0] < quiet


def test_what_a_differentiated_noise_leaves():
    p = np.random.default_rng(3).standard_normal((6000, 1))
    slope = np.gradient(low_pass(TIMES, p, 8.0), TIMES, axis=0)
    shown = float(np.sqrt(np.mean(slope[50:-50] ** 2)))
    found = noise_below(TIMES, p, MOVING, STEP, (8.0, 16.0), 8.0, slope=1)
    assert found == pytest.approx(shown, rel=0.1)


def test_the_noise_of_momenta_is_no_motion(drive_of):
    """The model's torque of a run that differs by 5 sin πt N·m, and by the slope of its noise.

    Local squares of the noise scatter about their mean, so that half of it is left at most.
    """
    p = 0.02 * np.random.default_rng(5).standard_normal((6000, 1))
    noise = np.gradient(p, TIMES, axis=0)
    square = np.mean(low_pass(TIMES, noise, 12.0) ** 2)
    free = drive_of(TIMES, 0.0 * p, 0.0 * p)
    for motion, least, most in ((0.0, 0.0, 0.5 * square), (5.0, 12.0, 12.5 + 0.5 * square)):
        model = noise + motion * np.sin(np.pi * TIMES)[:, None]
        log = drive_of(TIMES, 0.0 * p, 0.0 * p, momentum=p, model_torque=model)
        pair = PairedRuns(motion=log, pairings=[pair_with_run(TIMES, free, 0.0)])
        found = error_model(pair, 0.0 * p, 0.0 * p, corrected=False, cutoff=12.0)
        assert least <= np.mean(found.sd**2) < most


def test_the_floor_is_over_all_samples_and_the_floor_in_motion_over_those_that_move():
    sd = np.column_stack([np.full(10, 1.0), np.repeat([1.0, 3.0], 5)])
    standing = np.zeros((10, 2), dtype=bool)
    standing[5:, 1] = True
    model = ErrorModel(sd, standing)
    np.testing.assert_allclose(model.standing_share, [0.0, 0.5])
    np.testing.assert_allclose(model.floor, [1.0, np.sqrt(5.0)])  # (5·1 + 5·9)/10
    np.testing.assert_allclose(model.floor_moving, [1.0, 1.0])  # moving half alone
    np.testing.assert_allclose(model.rms_moving(2.0 * sd), [2.0, 2.0])
    standing[4:, 1] = True
    # it mostly stands, so that all samples speak for its motion too
    assert ErrorModel(sd, standing).floor_moving[1] == pytest.approx(np.sqrt(5.0))
    np.testing.assert_allclose(ErrorModel(sd, standing).standing_share, [0.0, 0.6])


CLOCK = 0.008 * np.arange(600)


def test_the_differences_are_those_of_the_mean_over_the_free_runs(drive_of):
    rng = np.random.default_rng(7)

    def run():
        torque, model = rng.standard_normal((2, len(CLOCK), 2))
        stops = rng.uniform(0.1, 0.5, (len(CLOCK), 2))
        q = np.column_stack([np.sin(CLOCK), np.cos(CLOCK)])
        series = {"drive_torque": torque, "model_torque": model, "standstill": stops}
        return drive_of(CLOCK, q, np.gradient(q, CLOCK, axis=0), **series)

    log, frees = run(), [run(), run()]
    pairings = [pair_with_run(CLOCK, free, 0.5 * k) for k, free in enumerate(frees)]
    pair = PairedRuns(motion=log, pairings=pairings)
    differences = {"drive_torque": (pair.torque, -1), "model_torque": (pair.model_difference, 1)}
    for name, (made, sign) in differences.items():
        there = [p.there(getattr(p.free, name)) for p in pairings]
        # Where the second has ended the first stands alone.
        mean = np.where(np.isnan(there[1]), there[0], np.add(*there) / 2.0)
        np.testing.assert_array_equal(made, sign * (getattr(log, name) - mean))
    np.testing.assert_array_equal(pair.known, np.isfinite(pair.torque).all(axis=1))
    there = [p.there(p.free.standing.astype(float)) > 0 for p in pairings]
    np.testing.assert_array_equal(pair.standing, log.standing | there[0] | there[1])
    stops = [log.standstill, *(np.nan_to_num(p.there(p.free.standstill)) for p in pairings)]
    longest, shortest = np.max(stops, axis=0), np.min(stops, axis=0)
    share = np.minimum(longest / 0.3, 1) * (1 - 0.5 * shortest / np.maximum(longest, 1e-9))
    np.testing.assert_array_equal(pair.stopped, np.maximum(share, pair.standing))


def test_a_model_that_is_right_misses_nothing(drive_of):
    q = np.sin(CLOCK)[:, None]
    run = drive_of(CLOCK, q, np.cos(CLOCK)[:, None], drive_torque=5.0 * q, model_torque=5.0 * q)
    assert PairedRuns(motion=run, pairings=[pair_with_run(CLOCK, run, 0.0)]).misfit == 0.0
    wrong = drive_of(CLOCK, q, np.cos(CLOCK)[:, None], drive_torque=5.0 * q, model_torque=4.0 * q)
    found = PairedRuns(motion=wrong, pairings=[pair_with_run(CLOCK, wrong, 0.0)]).misfit
    np.testing.assert_allclose(found, 0.25, rtol=1e-9)  # one of four newton-metres


@pytest.mark.parametrize(("late", "moved"), [(0.05, 0.05), (-0.05, -0.05), (0.3, 0.1)])
def test_phase_finds_the_place_up_to_a_tenth_of_a_second_away(drive_of, late, moved):
    """On a circle at constant speed the log is `late` behind the free run of the same clock."""

    def run(t):
        q, dq = np.column_stack([np.sin(t), np.cos(t)]), np.column_stack([np.cos(t), -np.sin(t)])
        return drive_of(CLOCK, q, dq)

    times = by_phase(run(CLOCK - late), pair_with_run(CLOCK, run(CLOCK), 0.0)).times
    middle = (CLOCK > 0.5) & (CLOCK[-1] - 0.5 > CLOCK)  # a partner lies within the free run
    # A Gauss–Newton step is damped by a hundredth, four of them by 1e-8.
    np.testing.assert_allclose(times[middle], CLOCK[middle] - moved, atol=1e-4)


def test_a_run_is_laid_by_shift_and_rate_as_far_as_it_goes(drive_of):
    pairing = pair_with_run(
        CLOCK, drive_of(CLOCK, np.column_stack([CLOCK]), np.ones((600, 1))), 1.0, 1.1
    )
    known = CLOCK[-1] >= 1.1 * CLOCK + 1.0
    np.testing.assert_array_equal(pairing.known, known)
    np.testing.assert_allclose(pairing.times[known], 1.1 * CLOCK[known] + 1.0)


def test_no_partner_is_made_up_in_a_gap(drive_of):
    """Six steps without a sample are a gap, five are interpolated across."""
    keep = np.ones(len(CLOCK), bool)
    keep[101:106] = keep[301:305] = False
    q = np.column_stack([CLOCK, -CLOCK])[keep]
    pairing = pair_with_run(CLOCK, drive_of(CLOCK[keep], q, np.ones_like(q)), 0.004)
    # Half a step later the last has none either.
    assert np.flatnonzero(~pairing.known).tolist() == [*range(100, 106), 599]


def test_phase_follows_slow_motion_by_steps_whichever_way_the_joint_turns(drive_of):
    """A joint turns back at 1 rad/s, then at 0.05 rad/s, 30 ms behind the clock's word.

    Each of the four steps leaves d/(v² + d) of the shift, d being a hundredth of the mean v².
    """
    t = 0.01 * np.arange(1200)
    speed = np.where(t < 6.0, 1.0, 0.05)[:, None]

    def turn(late):
        s = (t - late)[:, None]
        return drive_of(t, -np.where(s < 6.0, s, 6.0 + 0.05 * (s - 6.0)), -speed)

    damping = 0.01 * float(np.mean(speed**2)) + 1e-6
    moved = by_phase(turn(0.03), pair_with_run(t, turn(0.0), 0.0)).times - t
    for middle, v in ((slice(100, 500), 1.0), (slice(700, 1100), 0.05)):
        left = (damping / (v**2 + damping)) ** 4
        # 1 %: the low-passed speed rings a little about its step at 6 s.
        np.testing.assert_allclose(moved[middle], -0.03 * (1.0 - left), rtol=0.01)
