"""Arrays: one alias, read-only copies, checks; series along a clock: gaps, steps, runs."""

import mmap
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vftcli.signals.errors import ClockError, ParameterError, ShapeError

#: A float64 array; shapes and units stand in the docstrings, as ``(T, n) [N·m]``.
Array = NDArray[np.float64]
#: True or false, sample by sample or joint by joint, named for what is true.
Mask = NDArray[np.bool_]
Indices = NDArray[np.int64]  #: Numbers of rows or samples, counted from 0.
Z_95 = 1.96  #: Half width of a 95 % band, in SDs.


def frozen(value: ArrayLike, kind: type = float) -> Array:
    """A read-only float64 array or mask without other writers; itself if it is one."""
    if isinstance(value, np.ndarray) and value.dtype == kind and is_sealed(value):
        return value
    return handed_over(np.array(value, kind, order="K"))


def is_sealed(value: NDArray[Any]) -> bool:
    """Whether neither an array nor the array it is a view of can be written to."""
    owner = value.base
    if owner is None or value.flags.writeable:
        return not value.flags.writeable
    if isinstance(owner, np.ndarray):
        return is_sealed(owner)
    # The memory of a file that nobody can write to through it.
    return isinstance(owner, memoryview) and owner.readonly and isinstance(owner.obj, mmap.mmap)


def release(memory: object) -> None:
    """Let go of a mapped file's pages; they can be read again."""
    while isinstance(memory, np.ndarray):
        memory = memory.base
    mapped = memory.obj if isinstance(memory, memoryview) else None
    if isinstance(mapped, mmap.mmap) and hasattr(mmap, "MADV_DONTNEED"):
        mapped.madvise(mmap.MADV_DONTNEED)


def handed_over(value: NDArray[Any]) -> NDArray[Any]:
    """Make the caller's own new array read-only in place and return it."""
    value.setflags(write=False)
    if isinstance(value.base, np.ndarray):
        value.base.setflags(write=False)
    return value


def number_array(value: ArrayLike, name: str, owner: str, kind: type = float) -> Array:
    """Return `frozen` of what a user gives for an array."""
    try:
        return frozen(value, kind)
    except (TypeError, ValueError):
        what = "rows of unequal length, or no numbers" if np.iterable(value) else "no number"
        what = f"the text {value!r}" if isinstance(value, str) else what
        raise ShapeError(f"{name} of {owner} is {what}; expected an array of numbers") from None


def seal(
    owner: object, *names: str, shape: tuple[int, ...] = (), called: str = "", kind: type = float
) -> None:
    """Make a frozen dataclass's arrays read-only, check their shape; None stays None."""
    for name in names:
        if (value := getattr(owner, name)) is not None:
            # Past a frozen dataclass, for its own __post_init__ only.
            object.__setattr__(owner, name, number_array(value, name, type(owner).__name__, kind))
            if shape:
                check_shape(value, shape, name, called)


def one_each(value: ArrayLike, count: int, what: str, each: str = "joints") -> Array:
    """One number each from one number or a list with one for each. (count,)"""
    array = np.atleast_1d(np.asarray(value, float))
    if array.shape not in {(1,), (count,)}:
        raise ParameterError(
            f"{what} has {array.size} values; give one, or one for each of {count} {each}"
        )
    return np.full(count, array)


def empty_series(samples: int, columns: int) -> Array:
    """An uninitialised (T, n) array of contiguous columns."""
    return np.empty((columns, samples)).T


def check_clock(t: Array, what: str) -> None:
    """Raise unless a clock `t` [s] is one-dimensional, finite and strictly increasing."""
    if np.ndim(t) != 1:
        raise ShapeError(
            f"the clock of {what} has shape {np.shape(t)}; it must be one-dimensional"
        )
    if len(bad := np.flatnonzero(~np.isfinite(t))):
        raise ClockError(f"the clock of {what} is not finite at sample {bad[0]}")
    if len(back := np.flatnonzero(t[1:] <= t[:-1])):
        before, here = t[back[0] : back[0] + 2]
        raise ClockError(
            f"the clock of {what} stops increasing at sample {back[0] + 1} "
            f"({before:.6f} s, then {here:.6f} s)"
        )


def check_shape(value: ArrayLike, shape: tuple[int | str, ...], name: str, owner: str) -> None:
    """Raise a ShapeError unless `value` has `shape`, in which a letter is any length."""
    found = np.shape(value)
    alike = (own in {there, str(own)} for own, there in zip(shape, found, strict=False))
    if len(found) != len(shape) or not all(alike):
        wanted = str(shape).replace("'", "")
        raise ShapeError(f"{name} of {owner} has shape {found}; expected {wanted}")


def median(values: Array) -> float:
    """Median of a (T,) array; NumPy's own imports its masked arrays."""
    middle = len(values) // 2
    # Parting at one place takes sixty times as long where values are equal.
    parted = np.partition(values, (middle - 1, middle))
    upper = float(parted[middle])
    return upper if len(values) % 2 else 0.5 * (float(parted[middle - 1]) + upper)


def root_mean_square(x: Array) -> float:
    """Root mean square of all values, in their unit."""
    return float(np.sqrt(np.mean(x**2)))


def root_mean_squares(x: Array) -> Array:
    """RMS of each column of x (T, n), in its unit. (n,)"""
    return np.asarray(np.sqrt(np.mean(x**2, axis=0)))


def rms_of_known(x: Array) -> Array:
    """RMS of each column's finite samples (T, n), NaN without any. (n,)"""
    known = np.isfinite(x)
    count = np.count_nonzero(known, axis=0)
    total = np.sum(np.where(known, x, 0.0) ** 2, axis=0)
    return np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan))


EVEN = 1e-6  #: Share by which an even clock's steps differ: stamps of nine digits.


def is_uniform(t: Array, tolerance: float = EVEN) -> bool:
    """Whether all steps of a clock are equal to within `tolerance` of their median."""
    steps = np.diff(t)
    if steps.size == 0:
        return True
    least, most = steps.min(), steps.max()
    if least > 0.0 and most - least <= tolerance * least:
        return True  # wherever between them the median is
    usual = median(steps)
    return bool(max(most - usual, usual - least) <= tolerance * usual)


class Clock(NamedTuple):
    """Sampling of a log."""

    uniform: bool  #: Whether all steps are equal.
    step: float  #: Nominal sample time. [s]


def clock_of(t: Array) -> Clock:
    """The clock of a whole log. (T,) [s]

    An even clock's mean step has more digits than a difference of stamps.
    """
    if len(t) < 2:
        return Clock(True, 1.0)
    if is_uniform(t):
        return Clock(True, float((t[-1] - t[0]) / (len(t) - 1)))
    return Clock(False, median_step(t))


def median_step(t: Array) -> float:
    """Median time between samples of a clock; a gap belongs to none. [s]"""
    if len(t) < 2:
        raise ClockError("one sample has no sample time")
    return median(np.diff(t))


def gaps_of(t: Array, steps: float) -> Indices:
    """Samples after which a clock waits longer than `steps` steps. (G,)"""
    if len(t) < 2:
        return np.zeros(0, int)
    waits = np.diff(t)
    return np.flatnonzero(waits > steps * median(waits))


def resample_columns(at: Array, t: Array, x: Array, outside: float | None = None) -> Array:
    """Columns of `x`, known at `t`, interpolated linearly to the times `at`. (S, n)

    Beyond the known times they are `outside`; None holds the ends.
    """
    out = empty_series(len(at), x.shape[1])
    for column, known in zip(out.T, x.T, strict=True):
        column[:] = np.interp(at, t, known, left=outside, right=outside)
    return out


def runs_of(mask: Mask) -> list[tuple[int, int]]:
    """First sample of each run of true ones, and the one behind its last."""
    # With a false sample at either end every run has both its edges.
    walled = np.concatenate([[False], mask, [False]])
    edges = np.flatnonzero(walled[1:] != walled[:-1]).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def intervals(
    t: Array, mask: Mask, least: float = 0.0, gap: float = 0.0
) -> list[tuple[int, int]]:
    """Runs of a mask, joined across less than `gap`, of `least` or more. [s]"""
    found: list[tuple[int, int]] = []
    for start, stop in runs_of(mask):
        joined = bool(found) and t[start] - t[found[-1][1] - 1] < gap
        found.append((found.pop()[0] if joined else start, stop))
    return [(start, stop) for start, stop in found if t[stop - 1] - t[start] >= least]


def covered(runs: Sequence[tuple[int, int]], samples: int, margin: int = 0) -> Mask:
    """The mask of some runs and of `margin` samples on either side of each. (T,)"""
    mask = np.zeros(samples, bool)
    for start, stop in runs:
        mask[max(start - margin, 0) : stop + margin] = True
    return mask


def grown(t: Array, mask: Mask, margin: float) -> Mask:
    """A mask with `margin` before and after each of its runs [s]. (T,)"""
    found = mask.copy()
    for start, stop in runs_of(mask):
        first = t.searchsorted(t[start] - margin)
        found[first : t.searchsorted(t[stop - 1] + margin, side="right")] = True
    return found


def summed(x: Array | Mask) -> Array:
    """The sum of all rows before each, and of all. (T + 1, …) of (T, …)"""
    total = np.zeros((len(x) + 1, *x.shape[1:]))
    np.cumsum(x, axis=0, out=total[1:])
    return total


def integral(t: Array, x: Array) -> Array:
    """The integral of each column from the first sample on, by trapezoids. (T, …)"""
    return summed(((x[1:] + x[:-1]).T / 2 * np.diff(t)).T)


def around(x: Array | Mask, count: int) -> tuple[Array, Array]:
    """The sum of all rows within `count` rows of each, and their number. (T, …), (T,)"""
    total, k = summed(x), np.arange(len(x))
    first, last = np.maximum(k - count, 0), np.minimum(k + count + 1, len(x))
    return total[last] - total[first], (last - first).astype(float)


def near(mask: Mask, count: int) -> Mask:
    """Samples within `count` samples of a true one, column by column. (T, n)"""
    return np.asarray(around(mask, count)[0] > 0)
