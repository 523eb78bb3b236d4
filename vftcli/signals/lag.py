"""By how much one series runs behind another: the shift at which they fit best.

In every function the late series comes first, the early one second, and a positive lag says that
the first runs behind.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.signals.arrays import Array, Mask, is_uniform
from vftcli.signals.series import bridge_unknown, median_step, resample_columns

LONGEST = 1.0
"""Longest delay looked for. [s]"""

LEAD = 0.2
"""Longest lead looked for: a two-sided estimate may come early. [s]"""

LEAST_FIT = 0.3
"""Below this correlation at the best delay there is nothing to tell a delay by."""


def lags(late: Array, early: Array, step: float) -> Array:
    """Delay of each column at which it fits best, NaN where nothing fits. (n,) [s]

    Maximises the correlation over the samples that overlap, for delays from −`LEAD` to `LONGEST`,
    refined between samples by a parabola.

    Args:
        late: An estimate, NaN where unknown. (T, n)
        early: Its reference, likewise. (T, n)
        step: Sample time; an uneven clock's delay is in median steps. [s]
    """
    known = np.isfinite(late) & np.isfinite(early)
    x, y = (centred(signal, known) for signal in (late, early))
    first = -min(round(LEAD / step), len(x) // 4)
    last = max(1, min(round(LONGEST / step), len(x) // 4))
    size = 1 << int(np.ceil(np.log2(2 * len(x))))
    at = np.arange(first - 1, last + 2) % size
    there = known.astype(np.float64)
    # Each column is normalised by the samples that overlap at that lag, unknown ones left out.
    power = sliding(x**2, there, size, at) * sliding(there, y**2, size, at)
    fit = sliding(x, y, size, at) / np.sqrt(np.where(power > 0, power, np.inf))
    return np.array([step * (first - 1 + peak(column)) for column in fit.T])


def sliding(later: Array, earlier: Array, size: int, at: NDArray[np.int64]) -> Array:
    """Sum over time of `later`, `at` samples on, times `earlier`. (len(at), n)"""
    spectra = np.conj(np.fft.rfft(earlier, size, axis=0)) * np.fft.rfft(later, size, axis=0)
    return np.asarray(np.fft.irfft(spectra, size, axis=0)[at])


def centred(signal: Array, known: Mask) -> Array:
    """A signal without its mean over the known samples, zero elsewhere. (T, n)"""
    count = np.maximum(np.sum(known, axis=0), 1)
    filled = np.where(known, signal, 0.0)
    centre: Array = np.where(known, filled - filled.sum(axis=0) / count, 0.0)
    return centre


def peak(fit: Array) -> float:
    """Position of the largest value between the ends, between samples; NaN if none stands out."""
    k = 1 + int(np.argmax(fit[1:-1]))
    before, here, after = fit[k - 1], fit[k], fit[k + 1]
    if not here >= LEAST_FIT or here < max(before, after):
        return float("nan")
    return k + parabola(before, here, after)


def parabola(before: float, here: float, after: float) -> float:
    """Where the parabola through three neighbours peaks, counted in samples from the middle one."""
    bend = before - 2.0 * here + after
    return 0.5 * (before - after) / bend if bend < 0 else 0.0


class Offset(NamedTuple):
    """How far one series runs behind another.

    Attributes:
        lag: Time by which the first is late. [s]
        correlation: Correlation once that is taken out.
    """

    lag: float
    correlation: float


def time_offset(t: Array, late: Array, early: Array, limit: float = 0.5) -> Offset:
    """The lag of `late` behind `early` at which they correlate best, all columns together.

    The columns count by their size: those of a wrench are to be in one unit. The peak is refined by
    a parabola through its neighbours. Unknown samples are bridged.

    Args:
        t: Common clock. (T,) [s]
        late: A series. (T, k)
        early: Another. (T, k)
        limit: Largest lag considered, either way. [s]
    """
    step = median_step(t)
    even = t if is_uniform(t) else np.arange(t[0], t[-1], step)
    x, y = (resample_columns(even, t, bridge_unknown(t, series)) for series in (late, early))
    x, y = x - x.mean(axis=0), y - y.mean(axis=0)
    count = len(even)
    reach = min(int(limit / step), count - 2)
    at = np.arange(-reach, reach + 1)
    size = 1 << int(np.ceil(np.log2(2 * count)))
    cross = sliding(x, y, size, at % size).sum(axis=1)
    energy = overlap_energy(x, at, count) * overlap_energy(y, -at, count)
    value = cross / np.sqrt(np.maximum(energy, np.finfo(np.float64).tiny))
    best = int(np.argmax(value))
    inside = 0 < best < len(at) - 1
    shift = parabola(*value[best - 1 : best + 2]) if inside else 0.0
    return Offset(lag=float((at[best] + shift) * step), correlation=float(value[best]))


class LagFit(NamedTuple):
    """How well two series fit at every lag of the first behind the second.

    Attributes:
        lag: (L,) [samples]
        difference: Mean squared difference of what overlaps, all columns together; infinite where
            too little does. (L,)
        overlap: Samples that overlap. (L,)
    """

    lag: NDArray[np.int64]
    difference: Array
    overlap: NDArray[np.int64]

    @property
    def closest(self) -> float:
        """The lag with the smallest difference. [samples]"""
        return float(self.lag[int(np.argmin(self.difference))])

    def rivals(self, most: float) -> list[float]:
        """Lags of other valleys whose series overlap longer than at the closest lag, longest first.

        Args:
            most: Mean squared difference up to which a valley counts.
        """
        inner, best = self.difference[1:-1], int(np.argmin(self.difference))
        valley = (inner <= self.difference[:-2]) & (inner <= self.difference[2:]) & (inner <= most)
        found = 1 + np.flatnonzero(valley & (self.overlap[1:-1] > self.overlap[best]))
        return [float(k) for k in self.lag[found[np.argsort(-self.overlap[found])]]]


def lag_fit(late: Array, early: Array, least: float) -> LagFit:
    """How well two series fit at every lag of `late` behind `early`.

    Args:
        late: A series. (M, k)
        early: Another, on a clock of the same step. (N, k)
        least: Share of the shorter series that must overlap.
    """
    # A common offset changes no difference, and without it the sums of squares keep their digits.
    middle = late.mean(axis=0)
    x, y = late - middle, early - middle
    size = 1 << int(np.ceil(np.log2(len(x) + len(y))))
    at = np.arange(-(len(y) - 1), len(x))
    overlap = np.minimum(len(y), len(x) - at) - np.maximum(0, -at)
    cross = sliding(x, y, size, at % size).sum(axis=1)
    energy = overlap_energy(x, at, len(y)) + overlap_energy(y, -at, len(x))
    enough = overlap >= max(2, int(least * min(len(x), len(y))))
    mean = np.where(enough, (energy - 2.0 * cross) / np.maximum(overlap, 1), np.inf)
    return LagFit(at, mean, overlap)


def overlap_energy(series: Array, lags: NDArray[np.int64], other: int) -> Array:
    """Sum of squares of what a series shares with one of `other` samples that it lags. (L,)

    Without it a fit would favour small lags, which overlap longer.
    """
    total = np.concatenate([[0.0], np.cumsum(np.sum(series**2, axis=1))])
    energy: Array = total[np.minimum(len(series), other + lags)] - total[np.maximum(0, lags)]
    return energy
