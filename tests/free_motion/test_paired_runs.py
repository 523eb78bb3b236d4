"""What differs between a log and its free runs, against the plain sums over them."""

import numpy as np
import pytest

from vftcli.free_motion.difference import PairedRuns, by_phase, pair_with_run

T = 0.008 * np.arange(600)


def test_the_differences_are_those_of_the_mean_over_the_free_runs(drive_of) -> None:
    rng = np.random.default_rng(7)

    def run():
        torque, model = rng.standard_normal((2, len(T), 2))
        stops = rng.uniform(0.1, 0.5, (len(T), 2))
        q = np.column_stack([np.sin(T), np.cos(T)])
        series = {"drive_torque": torque, "model_torque": model, "standstill": stops}
        return drive_of(T, q, np.gradient(q, T, axis=0), **series)

    log, frees = run(), [run(), run()]
    pairings = [
        pair_with_run(T, free, shift) for free, shift in zip(frees, (0.0, 0.5), strict=True)
    ]
    pair = PairedRuns(motion=log, pairings=pairings)
    differences = {"drive_torque": (pair.torque, -1), "model_torque": (pair.model_difference, 1)}
    for name, (made, sign) in differences.items():
        there = [p.there(getattr(p.free, name)) for p in pairings]
        # Where the second has ended the first stands alone.
        mean = np.where(np.isnan(there[1]), there[0], np.add(*there) / 2.0)
        np.testing.assert_array_equal(made, sign * (getattr(log, name) - mean))
    assert pair.torque is pair.torque  # made once, whatever rungs and cutoffs ask for it
    np.testing.assert_array_equal(pair.known, np.isfinite(pair.torque).all(axis=1))
    there = [p.there(p.free.standing.astype(float)) > 0 for p in pairings]
    np.testing.assert_array_equal(pair.standing, log.standing | there[0] | there[1])
    stops = [log.standstill, *(np.nan_to_num(p.there(p.free.standstill)) for p in pairings)]
    longest, shortest = np.max(stops, axis=0), np.min(stops, axis=0)
    share = np.minimum(longest / 0.3, 1) * (1 - 0.5 * shortest / np.maximum(longest, 1e-9))
    np.testing.assert_array_equal(pair.stopped, np.maximum(share, pair.standing))


def test_a_model_that_is_right_misses_nothing(drive_of) -> None:
    q = np.sin(T)[:, None]
    run = drive_of(T, q, np.cos(T)[:, None], drive_torque=5.0 * q, model_torque=5.0 * q)
    assert PairedRuns(motion=run, pairings=[pair_with_run(T, run, 0.0)]).misfit == 0.0
    wrong = drive_of(T, q, np.cos(T)[:, None], drive_torque=5.0 * q, model_torque=4.0 * q)
    found = PairedRuns(motion=wrong, pairings=[pair_with_run(T, wrong, 0.0)]).misfit
    np.testing.assert_allclose(found, 0.25, rtol=1e-9)  # one of four newton-metres


@pytest.mark.parametrize(("late", "moved"), [(0.05, 0.05), (-0.05, -0.05), (0.3, 0.1)])
def test_phase_finds_the_place_up_to_a_tenth_of_a_second_away(
    drive_of, late: float, moved: float
) -> None:
    """On a circle at constant speed the log is `late` behind the free run of the same clock."""

    def run(t):
        q, dq = np.column_stack([np.sin(t), np.cos(t)]), np.column_stack([np.cos(t), -np.sin(t)])
        return drive_of(T, q, dq)

    times = by_phase(run(T - late), pair_with_run(T, run(T), 0.0)).times
    middle = (T > 0.5) & (T[-1] - 0.5 > T)  # a partner lies within the free run
    # A Gauss–Newton step is damped by a hundredth, four of them by 1e-8.
    np.testing.assert_allclose(times[middle], T[middle] - moved, atol=1e-4)


def test_a_run_is_laid_by_shift_and_rate_as_far_as_it_goes(drive_of) -> None:
    pairing = pair_with_run(T, drive_of(T, np.column_stack([T]), np.ones((600, 1))), 1.0, 1.1)
    known = T[-1] >= 1.1 * T + 1.0
    np.testing.assert_array_equal(pairing.known, known)
    np.testing.assert_allclose(pairing.times[known], 1.1 * T[known] + 1.0)


def test_no_partner_is_made_up_in_a_gap(drive_of) -> None:
    """Six steps without a sample are a gap, five are interpolated across."""
    keep = np.ones(len(T), bool)
    keep[101:106] = keep[301:305] = False
    q = np.column_stack([T, -T])[keep]
    pairing = pair_with_run(T, drive_of(T[keep], q, np.ones_like(q)), 0.004)
    # Half a step later the last has none either.
    assert np.flatnonzero(~pairing.known).tolist() == [*range(100, 106), 599]


def test_phase_follows_slow_motion_by_steps_whichever_way_the_joint_turns(drive_of) -> None:
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
