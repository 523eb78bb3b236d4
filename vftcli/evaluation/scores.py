"""Scores of external torques and of lists of contacts against truth.

With e = τ̂ − τ, a missing τ̂ counting as 0, and weights w by the clock, all means are
Σ w x / Σ w. Sums of cells of 2 s are kept: a block bootstrap draws whole cells.

A true contact is found if a row overlaps it within `SLACK`; further rows on it are split.
A row without overlap is false if its middle lies in a vouched span.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple, Self

import numpy as np

from vftcli.free_motion.free_motion import within
from vftcli.signals.arrays import Z_95, Array, Mask, intervals, resample_columns, runs_of
from vftcli.signals.external_torque import ExternalTorque

CELL = 2.0  #: Length of a cell. [s]
DRAWS, FEWEST = 1000, 8  #: Draws of a bootstrap, and its fewest cells.
LONGEST_STEP = 5.0  #: Largest weight of a sample, in median steps: gaps do not count.
GUARD = 0.5  #: Motion nearer than this to a true contact is neither free nor contact. [s]
GAP, SHORTEST = 0.1, 0.03  #: Of true contacts. [s]
PENALTY = 40.0  #: 2/α of the interval score of a 95 % band (Gneiting and Raftery 2007).
#: Shifts of an estimate that are tried against the truth. [s]
LAGS = 0.01 * np.arange(-10, 51)


def weights(t: Array) -> Array:
    """Each sample's share of time, at most `LONGEST_STEP` medians. (T,) [s]"""
    step = np.gradient(t)
    return np.clip(step, 0.0, LONGEST_STEP * np.median(step))


def parts_of(t: Array, scored: Mask, contacts: Sequence[Sequence[float]]) -> dict[str, Mask]:
    """Samples by part; those near a true contact are in `all` alone. (T,) each"""
    touched = within(t, [(start, stop) for start, stop, *_ in contacts])
    near = within(t, [(start - GUARD, stop + GUARD) for start, stop, *_ in contacts])
    return {"contact": scored & touched, "free": scored & ~near, "all": scored}


def episodes(t: Array, size: Array, on: float, off: float) -> list[tuple[float, float, float]]:
    """True contacts of a size |f| or max |τ|: start, end [s], and peak.

    One starts above `on` and ends below `off`; gaps below `GAP` are closed, then contacts
    shorter than `SHORTEST` dropped.
    """
    inside = np.zeros(len(t), bool)
    for start, stop in runs_of(~(size < off)):
        # Its end is the sample in which it falls below `off`.
        inside[start : stop + 1] |= np.logical_or.accumulate(size[start : stop + 1] > on)
    runs = intervals(t, inside, SHORTEST, GAP)
    return [(float(t[a]), float(t[b - 1]), float(size[a:b].max())) for a, b in runs]


class Score(NamedTuple):
    """Sums over each cell's samples by joint; pooled logs join their cells."""

    seconds: Array  #: Σ w, equal on every joint. (C, n) [s]
    missing: Array  #: Σ w where there is no answer. (C, n) [s]
    squares: Array  #: Σ w e². (C, n) [(N·m)² s]
    sizes: Array  #: Σ w |e|. (C, n) [N·m s]
    truth: Array  #: Σ w τ². (C, n) [(N·m)² s]
    banded: Array  #: Σ w where there is a band. (C, n) [s]
    covered: Array  #: Σ w where the band holds the truth. (C, n) [s]
    penalties: Array  #: Σ w (2 b + 40 max(0, |e| − b)) over the band's half width b. (C, n)

    @classmethod
    def of(
        cls, t: Array, values: Array, truth: Array, inside: Mask, sd: Array | None = None
    ) -> Self:
        """Sums of an estimate (T, n) with bands of ±1.96 `sd` over at least one sample.

        The truth is on its clock (T, n), `inside` the samples that count (T,).
        """
        tau = values[inside]
        known, y = np.isfinite(tau), truth[inside]
        size = abs(np.where(known, tau, 0.0) - y)
        band = np.full(tau.shape, np.nan) if sd is None else Z_95 * sd[inside]
        has = np.isfinite(band)
        penalty = np.where(has, 2.0 * band + PENALTY * np.maximum(0.0, size - band), 0.0)
        each = (np.ones(tau.shape), ~known, size**2, size, y**2, has, size <= band, penalty)
        start = np.unique((t[inside] - t[0]) // CELL, return_index=True)[1]
        w = weights(t)[inside, None]
        return cls(*(np.add.reduceat(w * x, start) for x in each))

    def by_joint(self) -> list[dict[str, list[float]]]:
        """The sums of all cells by name, joint by joint."""
        joints = zip(*(sums.T.tolist() for sums in self), strict=True)
        return [dict(zip(self._fields, joint, strict=True)) for joint in joints]

    @classmethod
    def pooled(cls, joints: Sequence[Mapping[str, Any]]) -> Self:
        """The score of `by_joint` rows, a joint's with the cells of all logs in one list."""
        each = ([joint[name] for joint in joints] for name in cls._fields)
        return cls(*(np.array(cells, float).T for cells in each))

    def mean(self, sums: Array) -> Array:
        """Σ w x / Σ w of each joint. (n,)"""
        return np.asarray(sums.sum(axis=0) / self.seconds[:, 0].sum())

    @property
    def rmse(self) -> Array:
        """Root mean square error of each joint. (n,) [N·m]"""
        return np.sqrt(self.mean(self.squares))

    @property
    def drawn(self) -> Array:
        """Mean RMSE over the joints by draw of cells, NaN of too few. (1000,) [N·m]"""
        count = len(self.seconds)
        if count < FEWEST:
            return np.full(DRAWS, np.nan)
        cells = np.random.default_rng(0).integers(0, count, (DRAWS, count))
        mean = self.squares[cells].sum(axis=1) / self.seconds[cells].sum(axis=1)
        return np.asarray(np.sqrt(mean).mean(axis=1))

    def numbers(self, over: Array | float = np.nan) -> dict[str, float]:
        """Means over the joints, with 95 % intervals of the RMSE, and less `over`'s draws.

        Skill is NaN where the truth is 0, and so are numbers of bands without any.
        """
        drawn, rmse, banded = self.drawn, self.rmse, self.banded.sum()
        level = np.sqrt(self.mean(self.truth))
        low, high = np.quantile([drawn, drawn - over], [0.025, 0.975], axis=1).tolist()
        return {
            "seconds": float(self.seconds[:, 0].sum()),
            "rmse_Nm": float(rmse.mean()),
            "rmse_low_Nm": low[0],
            "over_best_low_Nm": low[1],
            "rmse_high_Nm": high[0],
            "over_best_high_Nm": high[1],
            "l1_Nm": float(self.mean(self.sizes).mean()),
            "skill": skill(rmse, level),
            "skill_low": skill(high[0], level),
            "skill_high": skill(low[0], level),
            "coverage_95": ratio(self.covered.sum(), banded),
            "interval_score_Nm": ratio(self.penalties.sum(), banded),
            "missing": float(self.mean(self.missing).mean()),
        }


def skill(rmse: Array | float, level: Array | float) -> float:
    """1 less the mean RMSE over the truth's mean rms, joint by joint; NaN at 0."""
    return 1.0 - ratio(float(np.mean(rmse)), float(np.mean(level)))


def ratio(part: float, whole: float) -> float:
    """A quotient, NaN over 0."""
    return part / whole if whole > 0.0 else float("nan")


def lag_sums(estimate: ExternalTorque, truth: Array, inside: Mask) -> list[float]:
    """Σ w e² over joints and samples for each of `LAGS` of the estimate. (61,)"""
    t, w = estimate.t, weights(estimate.t)[inside, None]
    known = np.where(estimate.known, estimate.tau, 0.0)
    shifted = (resample_columns(t[inside] + lag, t, known) for lag in LAGS)
    return [float((w * (tau - truth[inside]) ** 2).sum()) for tau in shifted]


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
    half = NORMAL * ((share * (1.0 - share) + 0.25 * extra) / whole) ** 0.5
    return max(centre - half, 0.0) / (1.0 + extra), (centre + half) / (1.0 + extra)
