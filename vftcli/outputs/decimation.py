"""Honest decimation: of every stretch of a series its lowest and its highest sample stay."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.signals.arrays import Array
from vftcli.signals.series import gaps_of

GAP_STEPS = 10.0  #: A step this many times the median is drawn as a break in the line.

Index = NDArray[np.intp]


class Line(NamedTuple):
    """One series ready to be drawn; NaN where the line breaks."""

    t: Array  #: Time. (P,) [s]
    y: Array  #: Value, in the series' own unit. (P,)


def decimated(t: Array, values: Array, stretches: int) -> list[Line]:
    """Draw each column with at most two samples a stretch, and the first and last of the log.

    The lowest and highest sample of every stretch keep their own time and value, so that no spike
    is lost and none is made. A log of at most twice as many samples is kept whole. Lines break
    where a stretch holds no known value and where the clock has a gap.

    Args:
        t: Time. (T,) [s]
        values: One column a series; NaN where not known. (T, n)
        stretches: Number of stretches the log is cut into.
    """
    gaps = gaps_of(t, GAP_STEPS)
    # Two samples a stretch would be all of them: nothing to leave out.
    if len(t) <= 2 * stretches:
        everything = np.arange(len(t))
        return [broken(t, column, everything, gaps) for column in values.T]
    low, high = extremes(values, stretches)
    ends = np.array([0, len(t) - 1], dtype=np.intp)
    lines = []
    for j, column in enumerate(values.T):
        # Samples beside a gap stay, or a line would be drawn up to the wrong place.
        index = np.unique(np.concatenate([ends, low[:, j], high[:, j], gaps, gaps + 1]))
        lines.append(broken(t, column, index, gaps))
    return lines


def level_rows(
    t: Array, values: Array, stretches: int, whole: Sequence[tuple[float, float]] = ()
) -> Index | None:
    """Sample numbers of a plot with one clock for all lines, None for all. (P,)

    Of every stretch the lowest and highest sample of every line stay, and the first unknown one,
    so that no spike is lost and no gap closed. A log of which that would leave out nothing is kept
    whole.

    Args:
        t: Time. (T,) [s]
        values: One column a line; NaN where not known. (T, k)
        stretches: Number of stretches the log is cut into.
        whole: Spans in which every sample stays. [s]
    """
    if len(t) <= 2 * values.shape[1] * stretches:
        return None
    kept = np.zeros(len(t), dtype=bool)
    kept[[0, -1]] = True
    low, high = extremes(values, stretches)
    kept[low.ravel()] = kept[high.ravel()] = True
    for column in values.T:
        unknown = np.flatnonzero(np.isnan(column))
        stretch = unknown // stretch_width(len(t), stretches)
        kept[unknown[np.unique(stretch, return_index=True)[1]]] = True
    gaps = gaps_of(t, GAP_STEPS)
    kept[gaps] = kept[gaps + 1] = True
    for begin, end in whole:
        kept[(t >= begin) & (t <= end)] = True
    return np.flatnonzero(kept)


def stretch_width(samples: int, stretches: int) -> int:
    """Samples a stretch, rounded up, so that no sample is left over."""
    return -(-samples // stretches)


def extremes(values: Array, stretches: int) -> tuple[Index, Index]:
    """Sample numbers of the lowest and highest known value of every stretch. (stretches, n)"""
    samples, n = values.shape
    width = stretch_width(samples, stretches)
    count = -(-samples // width)
    start = np.arange(count) * width
    low, high = np.zeros((2, count, n), dtype=np.intp)
    # The last stretch is filled with unknowns. One column at once: of a long log all have no room.
    padded = np.full(count * width, np.nan)
    for j, column in enumerate(values.T):
        padded[:samples] = column
        cut = padded.reshape(count, width)
        unknown = np.isnan(cut)
        # argmin of a stretch without a known value is its first sample, which is NaN: a break.
        low[:, j] = np.where(unknown, np.inf, cut).argmin(axis=1) + start
        high[:, j] = np.where(unknown, -np.inf, cut).argmax(axis=1) + start
    return low, high


def broken(t: Array, column: Array, index: Index, gaps: Index) -> Line:
    """The chosen samples of a column, with a NaN in every gap of the clock."""
    x, y = t[index], column[index]
    if gaps.size:
        after = np.searchsorted(index, gaps, side="right")
        # One NaN between the two samples is enough to break the line there.
        middle = 0.5 * (t[gaps] + t[gaps + 1])
        x, y = np.insert(x, after, middle), np.insert(y, after, np.nan)
    return Line(x, y)
