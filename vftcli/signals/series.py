"""Any time series: its step, its gaps, another clock, runs of a mask."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, Indices, Mask, empty_series, is_uniform, median
from vftcli.signals.errors import ClockError


class Clock(NamedTuple):
    """Sampling of a log."""

    uniform: bool  #: Whether all steps are equal, so that constant coefficients are exact.
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


def near(mask: Mask, count: int) -> Mask:
    """Samples within `count` samples of a true one, column by column. (T, n)"""
    total, k = summed(mask), np.arange(len(mask))
    first, last = np.maximum(k - count, 0), np.minimum(k + count + 1, len(mask))
    return total[last] > total[first]
