"""Where a joint stands still: stops long enough for stiction, with their moments around."""

from itertools import groupby

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vftcli.signals import rest

STEP = 0.01
T = STEP * np.arange(400)


def speeds(*stops: tuple[int, int]) -> np.ndarray:
    """A joint at 0.5 rad/s that stops over the samples first to last, both included."""
    dq = np.full((400, 1), 0.5)
    for first, last in stops:
        dq[first : last + 1] = 0.5 * rest.REST
    return dq


def test_a_joint_at_just_a_speed_is_neither_slower_nor_faster() -> None:
    dq = np.array([[0.02, -0.02, 0.021, -0.021, 0.019, -0.019, 0.0]])
    assert rest.faster(dq, 0.02).tolist() == [[False] * 2 + [True] * 2 + [False] * 3]
    assert rest.slower(dq, 0.02).tolist() == [[False] * 4 + [True] * 3]


def test_a_long_stop_stands_with_the_moments_around_it() -> None:
    found = rest.standing(T, np.hstack([speeds((100, 149)), speeds()]))
    around = round(rest.BREAKAWAY / STEP)
    expected = np.zeros(400, dtype=bool)
    expected[100 - around : 150 + around] = True
    # The samples at exactly the break-away time lie on either side of rounding.
    assert np.count_nonzero(found[:, 0] != expected) <= 2
    assert not found[:, 1].any()


def test_a_reversal_is_no_stop() -> None:
    short = round(rest.LEAST / STEP) - 2
    assert not rest.standing(T, speeds((100, 100 + short))).any()
    assert rest.standing(T, speeds((100, 100 + short + 2))).any()


@given(st.lists(st.booleans(), min_size=2, max_size=80))
def test_durations_add_up_to_the_still_samples(still: list[bool]) -> None:
    """A run of k still samples is said k times to last k steps, whatever the pattern."""
    t = STEP * np.arange(len(still))
    dq = np.where(still, 0.0, 1.0)[:, None]
    found = rest.duration(t, dq)[:, 0]
    assert np.array_equal(found > 0, still)
    runs = [len(list(run)) for value, run in groupby(still) if value]
    assert np.isclose(found.sum(), STEP * sum(k * k for k in runs))


def test_rest_is_what_lasts_longer_than_half_of_the_time_around() -> None:
    """A stop of 0.4 s at 100 Hz: at its edge half of ±.15 s is slow; counted by a loop."""
    t = np.arange(0.0, 2.0, 0.01)
    dq = np.where((t > 0.795) & (t < 1.195), 0.0, 0.5)[:, None]
    found = rest.resting(t, dq)
    near = [np.abs(dq[np.abs(t - x) <= rest.AROUND + 1e-9, 0]) < rest.REST for x in t]
    expected = np.array([np.mean(slow) > 0.5 for slow in near])
    # rounding of the clock may move one sample in or out of the window
    assert np.count_nonzero(found[:, 0] != expected) <= 2
    assert found[100, 0]
    assert not found[70, 0]


def test_a_pose_is_held_where_no_joint_travels_over_the_window() -> None:
    """Both rest for 2 s, then one moves at 0.02 rad/s: 4 mrad in 0.2 s, four times the limit."""
    q = np.column_stack([0.02 * np.maximum(T - 2.0, 0.0), np.full(400, 0.7)])
    found = rest.held(q, STEP)
    # The window reaches 0.1 s to either side, and one that holds 1 mrad of the way still counts.
    assert found[10:196].all()
    assert not found[:10].any()
    assert not found[200:].any()
    assert not rest.held(q[:20], STEP).any()
    assert np.flatnonzero(rest.held(q[:21], STEP)).tolist() == [10]
