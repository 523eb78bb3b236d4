"""Time series: gaps, steps and other clocks, each against the plainest way to say it."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vftcli.signals.arrays import (
    clock_of,
    covered,
    gaps_of,
    grown,
    intervals,
    median_step,
    near,
    resample_columns,
    runs_of,
)
from vftcli.signals.errors import ClockError
from vftcli.signals.lag import bridge_unknown


def test_a_clock_is_even_or_not_and_has_a_step() -> None:
    """The median one, of an even clock the mean."""
    even = np.arange(100) * 0.004
    assert clock_of(even) == (True, pytest.approx(0.004, rel=1e-15))
    assert clock_of(np.delete(even, 50)) == (False, pytest.approx(0.004, rel=1e-12))
    assert clock_of(even[:1]) == (True, 1.0)
    with pytest.raises(ClockError, match="no sample time"):
        median_step(np.zeros(1))


def test_a_gap_is_longer_than_so_many_steps() -> None:
    t = np.array([0.0, 1.0, 2.0, 6.0, 7.0, 12.0, 13.0])
    assert gaps_of(t, 3.0).tolist() == [2, 4]
    assert gaps_of(t, 4.0).tolist() == [4]  # a step of just so many is none
    assert gaps_of(t[:1], 4.0).size == 0


@given(st.integers(0, 2**32 - 1))
def test_columns_on_another_clock_are_interpolated_one_by_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.1, 1.0, 20))
    x = rng.standard_normal((20, 3))
    at = rng.uniform(t[0] - 1.0, t[-1] + 1.0, 15)
    expected = np.array([[np.interp(time, t, x[:, k]) for k in range(3)] for time in at])
    assert np.array_equal(resample_columns(at, t, x), expected)
    away = (at < t[0]) | (at > t[-1])
    open_ended = resample_columns(at, t, x, outside=np.nan)
    assert np.array_equal(np.isnan(open_ended[:, 0]), away)
    assert np.array_equal(open_ended[~away], expected[~away])


@given(st.integers(0, 2**32 - 1))
def test_bridging_then_resampling_reads_the_line_between_known_samples(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.1, 1.0, 30))
    x = np.where(rng.random((30, 2)) < 0.4, np.nan, rng.standard_normal((30, 2)))
    x[0] = 0.0  # each column knows a sample
    at = rng.uniform(t[0], t[-1], 25)
    for k in range(2):
        known = np.isfinite(x[:, k])
        direct = np.interp(at, t[known], x[known, k])
        # Both are the same line; their arithmetic differs by rounding.
        found = resample_columns(at, t, bridge_unknown(t, x))[:, k]
        np.testing.assert_allclose(found, direct, atol=1e-12)
    assert not bridge_unknown(t, np.full((30, 1), np.nan)).any()


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


def test_runs_are_joined_across_short_gaps_and_may_last_long_enough_together() -> None:
    assert intervals(T, MASK) == [(0, 1), (2, 3), (6, 7)]
    assert intervals(T, MASK, gap=0.25) == [(0, 3), (6, 7)]
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
