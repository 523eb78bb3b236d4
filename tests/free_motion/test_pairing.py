"""Which instant of a free run belongs to each sample of a log."""

from collections.abc import Callable

import numpy as np
import pytest

from vftcli.free_motion.cycles import Cycles, pair_with_cycle
from vftcli.free_motion.paired_runs import (
    Pairing,
    by_phase,
    in_gap,
    mean_of,
    pair_with_run,
)
from vftcli.robots.run import Run

T = 0.01 * np.arange(1200)


Make = Callable[..., Run]


@pytest.fixture
def drive(drive_of: Make) -> Make:
    """Two joints going round every 4 s, `late` seconds behind."""

    def make(t: np.ndarray = T, late: float = 0.0) -> Run:
        phase = 2.0 * np.pi * (t[:, None] - late) / 4.0
        q = np.hstack([np.sin(phase), 0.5 * np.cos(phase)])
        return drive_of(t, q, np.gradient(q, t, axis=0))

    return make


@pytest.mark.parametrize("free", [0, 1, 2])
def test_a_cycle_is_laid_under_all_others_and_not_under_itself(drive: Make, free: int) -> None:
    cycles = Cycles(period=4.0, begin=0.0, end=12.0)
    pairing = pair_with_cycle(drive(), cycles, free, 4.0)
    own = cycles.number(T) == free
    assert not pairing.known[own].any()
    assert pairing.known[~own].mean() > 0.98  # but where the cycles touch
    away = (T[pairing.known] - pairing.times[pairing.known]) / 4.0
    np.testing.assert_allclose(away, np.rint(away), atol=1e-9)
    first, last = cycles.span(free)
    partners = pairing.times[pairing.known]
    assert np.all((partners >= first) & (partners <= last))


def test_a_run_is_laid_by_shift_and_rate_as_far_as_it_goes(drive: Make) -> None:
    pairing = pair_with_run(T, drive(), 1.0, 1.1)
    known = T[-1] >= 1.1 * T + 1.0
    np.testing.assert_array_equal(pairing.known, known)
    np.testing.assert_allclose(pairing.times[known], 1.1 * T[known] + 1.0)


def test_nothing_is_interpolated_across_a_gap(drive: Make) -> None:
    clock = np.delete(T, slice(300, 320))
    assert in_gap(clock, np.array([3.05]))[0]
    assert not in_gap(clock, np.array([2.95, 3.25])).any()
    assert not in_gap(np.delete(T, slice(300, 304)), np.array([3.02])).any()  # 5 steps are none
    pairing = pair_with_run(T, drive(clock), 0.0)
    assert not pairing.known[(T > 2.995) & (T < 3.195)].any()


def test_a_signal_is_taken_from_the_paired_instants(drive: Make) -> None:
    free = drive()
    there = pair_with_run(T, free, -2.0).there(free.q)
    assert np.isnan(there[T < 2.0]).all()
    np.testing.assert_allclose(there[300], free.q[100], atol=1e-9)


def test_the_mean_is_over_the_runs_that_are_known(drive: Make) -> None:
    free = drive()
    nowhere = Pairing(free, np.full(len(T), np.nan))
    half = pair_with_run(T, free, 6.0)
    whole = pair_with_run(T, free, 0.0)
    x, y = np.full((len(T), 2), 1.0), np.full((len(T), 2), 3.0)
    mean = mean_of([whole, half, nowhere], [x, y, x])
    assert np.all(mean[half.known] == 2.0)
    assert np.all(mean[~half.known] == 1.0)
    assert np.isnan(mean_of([nowhere], [x])).all()


def test_phase_follows_slow_motion_by_steps_whichever_way_the_joint_turns(drive_of: Make) -> None:
    """A joint turns back at 1 rad/s, then at 0.05 rad/s, 30 ms behind the clock's word.

    Each of the four steps leaves d/(v² + d) of the shift, d being a hundredth of the mean v².
    """

    def turn(late: float) -> Run:
        s = (T - late)[:, None]
        return drive_of(T, -np.where(s < 6.0, s, 6.0 + 0.05 * (s - 6.0)), -speed)

    speed = np.where(T < 6.0, 1.0, 0.05)[:, None]
    damping = 0.01 * float(np.mean(speed**2)) + 1e-6
    moved = by_phase(turn(0.03), pair_with_run(T, turn(0.0), 0.0)).times - T
    for middle, v in ((slice(100, 500), 1.0), (slice(700, 1100), 0.05)):
        left = (damping / (v**2 + damping)) ** 4
        # 1 %: the low-passed speed rings a little about its step at 6 s.
        np.testing.assert_allclose(moved[middle], -0.03 * (1.0 - left), rtol=0.01)
