"""By how much an estimate lags its reference: the best-fitting delay."""

import numpy as np
from numpy.typing import NDArray

from vftcli.signals.arrays import Array, Mask

LONGEST = 1.0
"""Longest delay looked for. [s]"""

LEAD = 0.2
"""Longest lead looked for: a two-sided estimate may come early. [s]"""

LEAST_FIT = 0.3
"""Below this correlation at the best delay there is nothing to tell a delay by."""


def lags(estimate: Array, reference: Array, step: float) -> Array:
    """Delay at which the estimate fits the reference best, NaN where nothing fits. (n,) [s]

    Maximises the correlation over the samples that overlap, for delays from −`LEAD` to `LONGEST`,
    refined between samples by a parabola.

    Args:
        estimate: (T, n) [N·m]
        reference: (T, n) [N·m]
        step: Sample time; an uneven clock's delay is in median steps. [s]
    """
    known = np.isfinite(estimate) & np.isfinite(reference)
    x, y = (centred(signal, known) for signal in (estimate, reference))
    first = -min(round(LEAD / step), len(x) // 4)
    last = max(1, min(round(LONGEST / step), len(x) // 4))
    size = 1 << int(np.ceil(np.log2(2 * len(x))))
    at = np.arange(first - 1, last + 2) % size
    there = known.astype(np.float64)
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
    bend = before - 2.0 * here + after
    return k + (0.5 * (before - after) / bend if bend < 0 else 0.0)
