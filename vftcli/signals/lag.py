"""Lag of one series behind another: the shift of their best fit.

The late series comes first; at a positive lag it runs behind.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import (
    Array,
    Indices,
    Mask,
    is_uniform,
    median_step,
    resample_columns,
    summed,
)

LONGEST = 1.0  #: Longest delay looked for. [s]
LEAD = 0.2  #: Longest lead looked for: a two-sided estimate may come early. [s]
FARTHEST = 0.5  #: Largest offset of two series that all columns tell. [s]
#: Below this correlation at the best delay there is nothing to tell a delay by.
LEAST_FIT = 0.3
#: Samples that one Fourier transform takes, unless the lags looked for need more.
BLOCK = 8192


def lags_of_each(late: Sequence[Array], early: Array, step: float) -> Array:
    """Delay of each column at which it fits best, NaN where nothing fits. (m, n)

    Best correlation with `early` from −`LEAD` to `LONGEST`, refined by a parabola. [s]
    """
    samples = len(early)
    first = -min(round(LEAD / step), samples // 4)
    last = max(1, min(round(LONGEST / step), samples // 4))
    at = np.arange(first - 1, last + 2)
    found = np.full((len(late), early.shape[1]), np.nan)
    for j, y in enumerate(early.T):
        alike: dict[bytes, list[int]] = {}
        for k, x in enumerate(late):
            known = np.isfinite(x[:, j]) & np.isfinite(y)
            alike.setdefault(np.packbits(known).tobytes(), []).append(k)
        for members in alike.values():
            columns = np.stack([late[k][:, j] for k in members])
            known = np.isfinite(columns[0]) & np.isfinite(y)
            fit = fits(centred(columns, known), centred(y[None], known), known, at)
            found[members, j] = [step * (first - 1 + peak(row)) for row in fit]
    return found


def fits(late: Array, early: Array, known: Mask, at: Indices) -> Array:
    """Correlation of m series with one that they lag, where they overlap. (m, L)

    All are without mean, and zero where unknown; `at` are successive lags [samples].
    """
    # Each is normalised by the known samples that overlap at that lag.
    if known.all():
        samples = len(known)
        behind = np.stack([overlap_energy(x[:, None], at, samples) for x in late])
        power = behind * overlap_energy(early.T, -at, samples)
    else:
        there = known.astype(float)[None]
        power = sliding(late**2, there, at) * sliding(there, early**2, at)
    return sliding(late, early, at) / np.sqrt(np.where(power > 0, power, np.inf))


def sliding(later: Array, earlier: Array, at: Indices) -> Array:
    """Sum over time of `later` (m, T), so many samples on, times `earlier`. (m, L)

    Blocks of `earlier` meet what their lags reach; spectra are added up (overlap-save).
    """
    samples, first, reach = earlier.shape[1], int(at[0]), len(at) - 1
    # A block no longer than the log, no shorter than its lags reach.
    size, whole = (1 << max(count - 1, 1).bit_length() for count in (2 * reach, samples + reach))
    size = min(max(BLOCK, size), whole)
    hop = size - reach
    total = np.zeros((len(later), size // 2 + 1), np.complex128)
    for start in range(0, samples, hop):
        begin, end = start + first, start + first + size
        block = later[:, max(begin, 0) : max(min(end, later.shape[1]), 0)]
        if begin < 0:
            block = np.pad(block, ((0, 0), (min(-begin, size), 0)))[:, :size]
        spectrum = np.conj(np.fft.rfft(earlier[:, start : start + hop], size))
        total += spectrum * np.fft.rfft(block, size)
    return np.fft.irfft(total, size)[:, : reach + 1]


def centred(signals: Array, known: Mask) -> Array:
    """Signals without their mean over the known samples, zero elsewhere. (m, T)"""
    centre = np.where(known, signals, 0.0)
    centre -= centre.sum(axis=1, keepdims=True) / max(np.count_nonzero(known), 1)
    centre[:, ~known] = 0.0
    return centre


def peak(fit: Array) -> float:
    """Position of the largest inner value, between samples; NaN without a peak."""
    k = 1 + int(fit[1:-1].argmax())
    before, here, after = fit[k - 1], fit[k], fit[k + 1]
    if not here >= LEAST_FIT or here < max(before, after):
        return float("nan")
    return k + parabola(before, here, after)


def parabola(before: float, here: float, after: float) -> float:
    """Peak of the parabola through three neighbours, from the middle one."""
    bend = before - 2.0 * here + after
    return 0.5 * (before - after) / bend if bend < 0 else 0.0


def bridge_unknown(t: Array, x: Array) -> Array:
    """Columns with a straight line across unknown samples, zero if all are. (T, n)"""
    columns = []
    for column in x.T:
        known = np.isfinite(column)
        columns.append(np.interp(t, t[known], column[known]) if known.any() else np.zeros(len(t)))
    return np.column_stack(columns)


def time_offset(t: Array, late: Array, early: Array) -> tuple[float, float]:
    """The lag of `late` behind `early` where they correlate best [s], and how well.

    All columns (T, k) count by size: give a wrench in one unit. Unknown samples are bridged.
    """
    step = median_step(t)
    even = t if is_uniform(t) else np.arange(t[0], t[-1], step)
    x, y = (resample_columns(even, t, bridge_unknown(t, series)) for series in (late, early))
    x, y, count = x - x.mean(axis=0), y - y.mean(axis=0), len(even)
    reach = min(int(FARTHEST / step), count - 2)
    at = np.arange(-reach, reach + 1)
    cross, behind, ahead = overlapping(x, y, at)
    value = cross / np.sqrt(np.maximum(behind * ahead, np.finfo(np.float64).tiny))
    best = int(value.argmax())
    inside = 0 < best < len(at) - 1
    shift = parabola(*value[best - 1 : best + 2]) if inside else 0.0
    return (at[best] + shift) * step, value[best]


class LagFit(NamedTuple):
    """Fit of two series at every lag of the first behind the second."""

    lag: Indices  #: (L,) [samples]
    #: Mean squared difference of all columns; infinite if short. (L,)
    difference: Array
    overlap: Indices  #: Samples that overlap. (L,)

    @property
    def closest(self) -> float:
        """The lag with the smallest difference. [samples]"""
        return float(self.lag[self.difference.argmin()])

    def rivals(self, most: float) -> list[float]:
        """Lags of valleys with a longer overlap than the closest, longest first."""
        inner, best = self.difference[1:-1], int(self.difference.argmin())
        valley = (
            (inner <= self.difference[:-2]) & (inner <= self.difference[2:]) & (inner <= most)
        )
        found = 1 + np.flatnonzero(valley & (self.overlap[1:-1] > self.overlap[best]))
        return [float(k) for k in self.lag[found[np.argsort(-self.overlap[found])]]]


def lag_fit(late: Array, early: Array, least: float) -> LagFit:
    """Fit of series (M, k), (N, k) where a share `least` of the shorter overlaps."""
    # Without a common offset sums of squares keep their digits.
    middle = late.mean(axis=0)
    x, y = late - middle, early - middle
    at = np.arange(-(len(y) - 1), len(x))
    overlap = np.minimum(len(y), len(x) - at) - np.maximum(0, -at)
    cross, behind, ahead = overlapping(x, y, at)
    enough = overlap >= max(2, int(least * min(len(x), len(y))))
    mean = np.where(enough, (behind + ahead - 2.0 * cross) / np.maximum(overlap, 1), np.inf)
    return LagFit(at, mean, overlap)


def overlapping(late: Array, early: Array, at: Indices) -> tuple[Array, Array, Array]:
    """Sums over the overlap, of all columns: products, squares of either. (L,)"""
    cross = sliding(late.T, early.T, at).sum(axis=0)
    return cross, overlap_energy(late, at, len(early)), overlap_energy(early, -at, len(late))


def overlap_energy(series: Array, lags: Indices, other: int) -> Array:
    """Sum of squares of what a series shares with one that it lags. (L,)"""
    total = summed(np.sum(series**2, axis=1))
    return total[np.minimum(len(series), other + lags)] - total[np.maximum(0, lags)]
