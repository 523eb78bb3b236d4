"""Arrays at the door of a type: read-only, float64, of the right shape, on a clock that runs."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vftcli.signals.arrays import (
    check_clock,
    check_shape,
    frozen,
    handed_over,
    is_uniform,
    median,
    number_array,
)
from vftcli.signals.errors import ClockError, ShapeError
from vftcli.signals.wrench import Wrench


def test_a_frozen_copy_does_not_follow_its_origin_and_what_nobody_can_write_to_is_not_copied():
    origin = np.arange(6.0)
    copy = frozen(origin)
    origin[0] = 1.0
    assert copy[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        copy[0] = 2.0
    assert frozen(copy) is copy
    assert frozen(copy[::2]).base is not None  # a view of sealed memory stays one
    view = origin[::2]
    view.setflags(write=False)
    assert not np.shares_memory(frozen(view), origin)  # its owner could still change it
    owner = np.zeros((2, 3))
    assert handed_over(owner.T).base is owner
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
        check_clock(np.array(t), "a log")


@given(st.lists(st.floats(-1e9, 1e9), min_size=1, max_size=50))
def test_the_median_is_numpy_s(values: list[float]) -> None:
    assert median(np.array(values)) == np.median(values)


def test_even_clocks_are_reported_from_jittering_ones() -> None:
    t = 0.008 * np.arange(100)
    assert is_uniform(np.round(t, 9))
    assert is_uniform(t[:1])
    t[50] += 1e-4
    assert not is_uniform(t)
    assert is_uniform(t, tolerance=0.05)


@pytest.mark.parametrize(
    ("value", "reported"),
    [("q", "the text 'q'"), ([[1, 2], [3]], "rows of unequal length"), (object(), "no number")],
)
def test_what_is_no_array_of_numbers_is_refused(value: object, reported: str) -> None:
    assert number_array([[1, 2]], "q", "x").tolist() == [[1.0, 2.0]]
    words = f"^q of x is {reported}.*; expected an array of numbers$"
    with pytest.raises(ShapeError, match=words):
        number_array(value, "q", "x")  # type: ignore[arg-type]


def test_another_shape_is_named() -> None:
    check_shape(np.zeros((3, 6)), ("T", "n"), "q", "x")
    check_shape([[0.0] * 6], ("T", 6), "q", "x")
    with pytest.raises(ShapeError, match=r"^q of x has shape \(3, 6\); expected \(T, 7\)$"):
        check_shape(np.zeros((3, 6)), ("T", 7), "q", "x")
    with pytest.raises(ShapeError, match=r"expected \(T, n\)$"):
        check_shape(np.zeros(3), ("T", "n"), "q", "x")
