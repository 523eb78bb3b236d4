"""Arrays: one alias, read-only copies, and the types' checks of their arrays."""

import mmap
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vftcli.signals.errors import ClockError, ParameterError, ShapeError

#: A float64 array; shapes and units stand in the docstrings, as ``(T, n) [N·m]``.
Array = NDArray[np.float64]
#: True or false, sample by sample or joint by joint, named for what is true.
Mask = NDArray[np.bool_]
Indices = NDArray[np.int64]  #: Numbers of rows or samples, counted from 0.
Z_95 = 1.96  #: Half width of a 95 % band, in standard deviations.


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
            # The one way past a frozen dataclass, for its own __post_init__ only.
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
    # Parting at one place takes NumPy sixty times as long where many values are equal.
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


EVEN = 1e-6  #: Largest share by which steps of an even clock, stamps of nine digits, differ.


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
