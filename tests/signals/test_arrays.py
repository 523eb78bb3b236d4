"""Arrays at the door of a type: read-only, float64, of the right shape, on a clock that runs."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vftcli.signals import arrays
from vftcli.signals.errors import ClockError, ShapeError
from vftcli.signals.lag import bridge_unknown
from vftcli.signals.wrench import Wrench


def test_a_frozen_copy_does_not_follow_its_origin_and_what_nobody_can_write_to_is_not_copied():
    origin = np.arange(6.0)
    copy = arrays.frozen(origin)
    origin[0] = 1.0
    assert copy[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        copy[0] = 2.0
    assert arrays.frozen(copy) is copy
    assert arrays.frozen(copy[::2]).base is not None  # a view of sealed memory stays one
    view = origin[::2]
    view.setflags(write=False)
    assert not np.shares_memory(arrays.frozen(view), origin)  # its owner could still change it
    owner = np.zeros((2, 3))
    assert arrays.handed_over(owner.T).base is owner
    assert not owner.flags.writeable


def test_a_type_seals_its_arrays_and_leaves_what_is_none() -> None:
    made = Wrench(name="x", t=[0, 1], values=[range(6)] * 2, frame="base", masked=[0.0, -2.0])
    assert made.values.dtype == np.float64
    assert made.masked.tolist() == [False, True]
    assert not any(array.flags.writeable for array in (made.t, made.values, made.masked))
    assert made.sd is None


@pytest.mark.parametrize(
    ("t", "error", "words"),
    [
        ([[0.0, 1.0]], ShapeError, "one-dimensional"),
        ([0.0, np.nan, 1.0], ClockError, "not finite at sample 1"),
        ([0.0, 1.0, 1.0], ClockError, "stops increasing at sample 2 .1.000000 s, then 1.000000"),
        ([0.0, 2.0, 1.0], ClockError, "clock of a log stops increasing at sample 2"),
    ],
)
def test_a_clock_that_does_not_run_is_refused(t: list[float], error: type, words: str) -> None:
    with pytest.raises(error, match=words):
        arrays.check_clock(np.array(t), "a log")


@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=50))
def test_the_median_is_numpy_s(values: list[float]) -> None:
    assert arrays.median(np.array(values)) == np.median(values)


def test_even_clocks_are_reported_from_jittering_ones() -> None:
    t = 0.008 * np.arange(100)
    assert arrays.is_uniform(np.round(t, 9))
    assert arrays.is_uniform(t[:1])
    t[50] += 1e-4
    assert not arrays.is_uniform(t)
    assert arrays.is_uniform(t, tolerance=0.05)


@pytest.mark.parametrize(
    ("value", "reported"),
    [("q", "the text 'q'"), ([[1, 2], [3]], "rows of unequal length"), (object(), "no number")],
)
def test_what_is_no_array_of_numbers_is_refused(value: object, reported: str) -> None:
    assert arrays.number_array([[1, 2]], "q", "x").tolist() == [[1.0, 2.0]]
    words = f"^q of x is {reported}.*; expected an array of numbers$"
    with pytest.raises(ShapeError, match=words):
        arrays.number_array(value, "q", "x")  # type: ignore[arg-type]


def test_another_shape_is_named() -> None:
    arrays.check_shape(np.zeros((3, 6)), ("T", "n"), "q", "x")
    arrays.check_shape([[0.0] * 6], ("T", 6), "q", "x")
    with pytest.raises(ShapeError, match=r"^q of x has shape \(3, 6\); expected \(T, 7\)$"):
        arrays.check_shape(np.zeros((3, 6)), ("T", 7), "q", "x")
    with pytest.raises(ShapeError, match=r"expected \(T, n\)$"):
        arrays.check_shape(np.zeros(3), ("T", "n"), "q", "x")


# Time series: gaps, steps and other clocks, each against the plainest way to say it


def test_a_clock_is_even_or_not_and_has_a_step() -> None:
    """The median one, of an even clock the mean."""
    even = np.arange(100) * 0.004
    assert arrays.clock_of(even) == (True, pytest.approx(0.004, rel=1e-15))
    assert arrays.clock_of(np.delete(even, 50)) == (False, pytest.approx(0.004, rel=1e-12))
    assert arrays.clock_of(even[:1]) == (True, 1.0)
    with pytest.raises(ClockError, match="no sample time"):
        arrays.median_step(np.zeros(1))


def test_a_gap_is_longer_than_so_many_steps() -> None:
    t = np.array([0.0, 1.0, 2.0, 6.0, 7.0, 12.0, 13.0])
    assert arrays.gaps_of(t, 3.0).tolist() == [2, 4]
    assert arrays.gaps_of(t, 4.0).tolist() == [4]  # a step of just so many is none
    assert arrays.gaps_of(t[:1], 4.0).size == 0


@given(st.integers(0, 2**32 - 1))
def test_columns_on_another_clock_are_interpolated_one_by_one(seed: int) -> None:
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.1, 1.0, 20))
    x = rng.standard_normal((20, 3))
    at = rng.uniform(t[0] - 1.0, t[-1] + 1.0, 15)
    expected = np.column_stack([np.interp(at, t, column) for column in x.T])
    assert np.array_equal(arrays.resample_columns(at, t, x), expected)
    away = (at < t[0]) | (at > t[-1])
    open_ended = arrays.resample_columns(at, t, x, outside=np.nan)
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
        found = arrays.resample_columns(at, t, bridge_unknown(t, x))[:, k]
        np.testing.assert_allclose(found, direct, atol=1e-12)
    assert not bridge_unknown(t, np.full((30, 1), np.nan)).any()


@given(st.lists(st.booleans(), max_size=60))
def test_runs_are_the_true_samples_and_nothing_else(flags: list[bool]) -> None:
    mask = np.array(flags, dtype=bool)
    runs = arrays.runs_of(mask)
    assert all(start < stop for start, stop in runs)
    assert np.array_equal(arrays.covered(runs, len(mask)), mask)
    # Unbroken: between two runs lies at least one false sample.
    assert all(second[0] > first[1] for first, second in pairwise(runs))


T = 0.1 * np.arange(8)
MASK = np.array([1, 0, 1, 0, 0, 0, 1, 0], dtype=bool)


def test_runs_are_joined_across_short_gaps_and_may_last_long_enough_together() -> None:
    assert arrays.intervals(T, MASK) == [(0, 1), (2, 3), (6, 7)]
    assert arrays.intervals(T, MASK, gap=0.25) == [(0, 3), (6, 7)]
    assert arrays.intervals(T, MASK, least=0.15, gap=0.25) == [(0, 3)]
    assert arrays.intervals(T, MASK, least=0.15) == []


def test_runs_grow_by_samples_and_by_seconds_to_the_ends_of_the_clock() -> None:
    assert arrays.runs_of(arrays.covered([(0, 1), (6, 7)], 8, margin=2)) == [(0, 3), (4, 8)]
    uneven = np.array([0.0, 0.1, 0.2, 1.0, 1.05, 1.5])
    assert arrays.runs_of(arrays.grown(uneven, np.arange(6) == 3, 0.06)) == [(3, 5)]
    assert arrays.runs_of(arrays.grown(uneven, np.arange(6) == 1, 0.5)) == [(0, 3)]


def test_near_is_column_by_column() -> None:
    mask = np.column_stack([MASK, np.arange(8) == 7])
    assert arrays.runs_of(arrays.near(mask, 1)[:, 0]) == [(0, 4), (5, 8)]
    assert arrays.runs_of(arrays.near(mask, 9)[:, 1]) == [(0, 8)]
    assert not arrays.near(mask & False, 2).any()
