"""A list of contacts against the true ones: found, split, false, onset, peak.

A true contact is found if a row overlaps it within `SLACK`; further rows on it are split;
a row that overlaps none, its middle where the truth vouches, is false.
"""

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array

SLACK = 0.1  #: How far a row may be from a true contact that it finds. [s]
NORMAL = 1.959964  #: Quantile .975 of the normal distribution.

#: Start [s], end [s], peak [N] (NaN where it is not known) of a true contact.
TrueContact = tuple[float, float, float]


class ListedRow(NamedTuple):
    """One row of a list."""

    start: float  #: [s]
    stop: float  #: [s]
    peak: float = 0.0  #: Its largest force, 0 where it has none. [N]
    band: float = 0.0  #: Half width of its 95 % band. [N]
    is_load: bool = False  #: Whether it is called a load.


class ListScore(NamedTuple):
    """Counts of one log; those of several logs add up, but for the hardest."""

    true_contacts: int
    found: int
    found_as_load: int  #: Of the found those that only loads overlap.
    split: int  #: Rows on a true contact beyond its first.
    false: int
    free_h: float  #: Vouched time less true contacts. [h]
    onset_s: list[float]  #: Start of the first row less the true start.
    peak_error_N: list[float]  # noqa: N815  #: Largest overlapping row's peak less the true one.
    true_peak_N: list[float]  # noqa: N815
    peaks_held: int  #: True peaks within the row's band.
    hardest_false_N: float  # noqa: N815


def score_list(
    rows: Sequence[ListedRow],
    true: Sequence[TrueContact],
    vouched: Sequence[Sequence[float]],
    duration: float,
) -> ListScore:
    """How a list agrees with the true contacts of a log that lasts `duration` [s]."""
    on = [[r for r in rows if r.start <= b + SLACK and r.stop >= a - SLACK] for a, b, _ in true]
    hits = {row for each in on for row in each}
    spans = [(max(a, 0.0), min(b, duration)) for a, b in vouched]
    false = [
        row
        for row in rows
        if row not in hits and any(a <= 0.5 * (row.start + row.stop) <= b for a, b in spans)
    ]
    known = [
        (max((row.peak, row.band) for row in each), peak)
        for each, (_, _, peak) in zip(on, true, strict=True)
        if each and np.isfinite(peak)
    ]
    free = sum(b - a for a, b in spans) - sum(b - a for a, b, _ in true)
    return ListScore(
        true_contacts=len(true),
        found=sum(map(bool, on)),
        found_as_load=sum(bool(each) and all(row.is_load for row in each) for each in on),
        split=sum(max(len(each) - 1, 0) for each in on),
        false=len(false),
        free_h=max(free, 0.0) / 3600.0,
        onset_s=[each[0].start - a for each, (a, _, _) in zip(on, true, strict=True) if each],
        peak_error_N=[size - peak for (size, _), peak in known],
        true_peak_N=[peak for _, peak in known],
        peaks_held=sum(abs(size - peak) <= band for (size, band), peak in known),
        hardest_false_N=max((row.peak for row in false), default=0.0),
    )


def rate_interval(count: int, hours: float) -> tuple[float, float]:
    """Exact 95 % interval of a Poisson rate. [1/h] (Garwood 1936)"""
    from scipy.special import gammaincinv

    if not hours > 0.0:
        return float("nan"), float("nan")
    low = gammaincinv(count, 0.025) if count else 0.0
    return float(low / hours), float(gammaincinv(count + 1, 0.975) / hours)


def share_interval(part: int, whole: int) -> tuple[float, float]:
    """95 % interval of a share (Wilson 1927), NaN of nothing."""
    if not whole:
        return float("nan"), float("nan")
    share, extra = part / whole, NORMAL**2 / whole
    centre = share + 0.5 * extra
    half = NORMAL * sqrt(share * (1.0 - share) / whole + 0.25 * extra / whole)
    return max(centre - half, 0.0) / (1.0 + extra), (centre + half) / (1.0 + extra)


def wrench_sums(values: Array, truth: Array, w: Array) -> dict[str, float]:
    """Σ w |f̂ − f|² and its like over some samples; a missing wrench counts as 0."""
    error = np.where(np.isfinite(values), values, 0.0) - truth

    def total(x: Array) -> float:
        return float((w * (x**2).sum(axis=1)).sum())

    return {
        "force_squares": total(error[:, :3]),
        "moment_squares": total(error[:, 3:]),
        "true_force_squares": total(truth[:, :3]),
        "true_moment_squares": total(truth[:, 3:]),
        "wrench_missing_s": float((w * ~np.isfinite(values[:, 0])).sum()),
        "wrench_s": float(w.sum()),
    }
