"""A list of contacts against the true ones: found, split, false, onset, peak.

A true contact is found if a row overlaps it within `SLACK`; further rows on it are split.
A row without overlap is false if its middle lies in a vouched span.
"""

from collections.abc import Sequence
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

SLACK = 0.1  #: Largest distance of a row from its true contact. [s]
NORMAL = 1.959964  #: Quantile .975 of the normal distribution.

#: Start [s], end [s], peak [N] (NaN if unknown) of a true contact.
TrueContact = tuple[float, float, float]


class ListedRow(NamedTuple):
    """One row of a list of contacts."""

    start: float  #: [s]
    stop: float  #: [s]
    peak: float = 0.0  #: Its largest force, 0 where it has none. [N]
    band: float = 0.0  #: Half width of its 95 % band. [N]
    is_load: bool = False  #: Whether it is called a load.


def score_list(
    rows: Sequence[ListedRow],
    true: Sequence[TrueContact],
    vouched: Sequence[Sequence[float]],
    duration: float,
) -> dict[str, Any]:
    """Agreement of a list with the true contacts of a log of `duration` [s], by name.

    `free_h` is vouched time less true contacts [h]. `found_as_load` counts overlaps with loads
    alone; onset is the first row's, peaks the hardest row's.
    """
    on = [
        (each, start, peak)
        for start, stop, peak in true
        if (each := [r for r in rows if r.start <= stop + SLACK and r.stop >= start - SLACK])
    ]
    hits = {row for each, *_ in on for row in each}
    spans = [(max(a, 0.0), min(b, duration)) for a, b in vouched]
    false = [
        row.peak
        for row in rows
        if row not in hits and any(a <= 0.5 * (row.start + row.stop) <= b for a, b in spans)
    ]
    hardest = [(max((r.peak, r.band) for r in each), peak) for each, _, peak in on]
    known = [(size - peak, band, peak) for (size, band), peak in hardest if np.isfinite(peak)]
    free = sum(b - a for a, b in spans) - sum(b - a for a, b, _ in true)
    return {
        "true_contacts": len(true),
        "found": len(on),
        "found_as_load": sum(all(row.is_load for row in each) for each, *_ in on),
        "split": sum(len(each) - 1 for each, *_ in on),
        "false": len(false),
        "free_h": max(free, 0.0) / 3600.0,
        "onset_s": [each[0].start - start for each, start, _ in on],
        "peak_error_N": [error for error, *_ in known],
        "true_peak_N": [peak for *_, peak in known],
        "peaks_held": sum(abs(error) <= band for error, band, _ in known),
        "hardest_false_N": max(false, default=0.0),
    }


def rate_interval(count: int, hours: float) -> tuple[float, float]:
    """Exact 95 % interval of a Poisson rate, NaN of no time. [1/h] (Garwood 1936)"""
    from scipy.special import gammaincinv

    if not hours > 0.0:
        return np.nan, np.nan
    low = gammaincinv(count, 0.025) if count else 0.0
    return float(low / hours), float(gammaincinv(count + 1, 0.975) / hours)


def share_interval(part: int, whole: int) -> tuple[float, float]:
    """95 % interval of a share (Wilson 1927), NaN of nothing."""
    if not whole:
        return np.nan, np.nan
    share, extra = part / whole, NORMAL**2 / whole
    centre = share + 0.5 * extra
    half = NORMAL * sqrt(share * (1.0 - share) / whole + 0.25 * extra / whole)
    return max(centre - half, 0.0) / (1.0 + extra), (centre + half) / (1.0 + extra)
