"""Stretches of a mask, each against the plainest way to say it."""

from itertools import pairwise

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from vftcli.signals.intervals import covered, grown, intervals, near, runs_of

T = 0.1 * np.arange(8)
MASK = np.array([1, 0, 1, 0, 0, 0, 1, 0], dtype=bool)


@given(st.lists(st.booleans(), max_size=60))
def test_runs_are_the_true_samples_and_nothing_else(flags: list[bool]) -> None:
    mask = np.array(flags, dtype=bool)
    runs = runs_of(mask)
    assert all(start < stop for start, stop in runs)
    assert np.array_equal(covered(runs, len(mask)), mask)
    # Unbroken: between two runs lies at least one false sample.
    assert all(second[0] > first[1] for first, second in pairwise(runs))


def test_runs_reach_the_first_and_the_last_sample() -> None:
    assert runs_of(np.array([True, True, False, True])) == [(0, 2), (3, 4)]
    assert runs_of(np.zeros(0, dtype=bool)) == []


def test_gaps_shorter_than_a_limit_are_closed() -> None:
    assert intervals(T, MASK) == [(0, 1), (2, 3), (6, 7)]
    assert intervals(T, MASK, gap=0.25) == [(0, 3), (6, 7)]


def test_what_is_joined_may_last_long_enough_together() -> None:
    assert intervals(T, MASK, least=0.15, gap=0.25) == [(0, 3)]
    assert intervals(T, MASK, least=0.15) == []


def test_runs_grow_by_samples_and_by_seconds_to_the_ends_of_the_clock() -> None:
    assert runs_of(covered([(0, 1), (6, 7)], 8, margin=2)) == [(0, 3), (4, 8)]
    uneven = np.array([0.0, 0.1, 0.2, 1.0, 1.05, 1.5])
    assert runs_of(grown(uneven, np.arange(6) == 3, 0.06)) == [(3, 5)]
    assert runs_of(grown(uneven, np.arange(6) == 1, 0.5)) == [(0, 3)]


def test_near_is_column_by_column() -> None:
    mask = np.column_stack([MASK, np.arange(8) == 7])
    assert runs_of(near(mask, 1)[:, 0]) == [(0, 4), (5, 8)]
    assert runs_of(near(mask, 9)[:, 1]) == [(0, 8)]
    assert not near(mask & False, 2).any()
