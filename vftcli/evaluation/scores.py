"""Scores of external torques against truth, as sums that add up over cells and logs.

With e = τ̂ − τ, a missing τ̂ counting as 0, and weights w by the clock, all means are
Σ w x / Σ w. Sums of cells of 2 s are kept: a block bootstrap draws whole cells.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Self

import numpy as np

from vftcli.free_motion.free_motion import within
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.external_torque import COVERS, ExternalTorque
from vftcli.signals.series import intervals, resample_columns, runs_of

CELL = 2.0  #: Length of a cell. [s]
DRAWS, FEWEST = 1000, 8  #: Draws of a bootstrap, and the fewest cells that it is made of.
LONGEST_STEP = 5.0  #: Largest weight of a sample, in median steps: a gap does not vote.
GUARD = 0.5  #: Motion nearer than this to a true contact is neither free nor contact. [s]
GAP, SHORTEST = 0.1, 0.03  #: Of true contacts. [s]
PENALTY = 40.0  #: 2/α of the interval score of a 95 % band (Gneiting and Raftery 2007).
#: Shifts of an estimate that are tried against the truth. [s]
LAGS = 0.01 * np.arange(-10, 51)


def weights(t: Array) -> Array:
    """Weight of each sample by its share of time, at most `LONGEST_STEP` medians. (T,) [s]"""
    step = np.gradient(t)
    return np.asarray(np.clip(step, 0.0, LONGEST_STEP * np.median(step)))


def parts_of(t: Array, scored: Mask, contacts: Sequence[Sequence[float]]) -> dict[str, Mask]:
    """Samples of the parts by name; what is near a true contact is in `all` alone. (T,) each"""
    touched = within(t, [(start, stop) for start, stop, *_ in contacts])
    near = within(t, [(start - GUARD, stop + GUARD) for start, stop, *_ in contacts])
    return {"contact": scored & touched, "free": scored & ~near, "all": scored}


def episodes(t: Array, size: Array, on: float, off: float) -> list[tuple[float, float, float]]:
    """True contacts of a size |f| or max |τ|: start, end [s], and peak.

    One starts above `on` and ends below `off`; gaps below `GAP` are closed, what is then
    shorter than `SHORTEST` is dropped.
    """
    inside = np.zeros(len(t), bool)
    for start, stop in runs_of(~(size < off)):
        # The sample in which it falls below `off` is its end.
        inside[start : stop + 1] |= np.logical_or.accumulate(size[start : stop + 1] > on)
    runs = intervals(t, inside, SHORTEST, GAP)
    return [(float(t[a]), float(t[b - 1]), float(size[a:b].max())) for a, b in runs]


@dataclass(frozen=True, kw_only=True, eq=False)
class Score:
    """Sums over the samples of each cell; those of several logs are joined by `+`."""

    seconds: Array  #: Σ w. (C,) [s]
    missing: Array  #: Σ w where there is no answer. (C, n) [s]
    squares: Array  #: Σ w e². (C, n) [(N·m)² s]
    sizes: Array  #: Σ w |e|. (C, n) [N·m s]
    truth: Array  #: Σ w τ². (C, n) [(N·m)² s]
    banded: Array  #: Σ w where there is a band. (C, n) [s]
    covered: Array  #: Σ w where the band holds the truth. (C, n) [s]
    penalties: Array  #: Σ w (2 b + 40 max(0, |e| − b)) over the band's half width b. (C, n)

    @classmethod
    def of(cls, estimate: ExternalTorque, truth: Array, inside: Mask) -> Self:
        """Sums of an estimate with bands of ±1.96 `error_sd` over some samples.

        Args:
            estimate: The estimate on the truth's clock.
            truth: External torque on the robot. (T, n) [N·m]
            inside: The samples that count. (T,)
        """
        t, tau = estimate.t, estimate.tau[inside]
        w, cell = weights(t)[inside], ((t - t[0]) // CELL).astype(int)[inside]
        answered, y = np.isfinite(tau), truth[inside]
        size = abs(np.where(answered, tau, 0.0) - y)
        band = np.full(tau.shape, np.nan)
        if estimate.error_sd is not None:
            band = COVERS * estimate.error_sd[inside]
        has = np.isfinite(band)
        penalty = 2.0 * band + PENALTY * np.maximum(0.0, size - band)
        numbers, start = np.unique(cell, return_index=True)

        def sums(values: Array) -> Array:
            added = w[:, None] * values
            return np.add.reduceat(added, start) if len(numbers) else added[:0]

        return cls(
            seconds=sums(np.ones((len(w), 1)))[:, 0],
            missing=sums(~answered),
            squares=sums(size**2),
            sizes=sums(size),
            truth=sums(y**2),
            banded=sums(has),
            covered=sums(has & (size <= np.where(has, band, 0.0))),
            penalties=sums(np.where(has, penalty, 0.0)),
        )

    def by_joint(self) -> Iterator[dict[str, list[float]]]:
        """Of each joint the sums of all cells, by name."""
        columns = {f.name: np.atleast_2d(getattr(self, f.name).T) for f in fields(self)}
        for j in range(self.squares.shape[1]):
            yield {name: rows[j % len(rows)].tolist() for name, rows in columns.items()}

    @classmethod
    def joined(cls, joints: Sequence[Mapping[str, Sequence[float]]]) -> Self:
        """The score of what `by_joint` gives."""
        names = [f.name for f in fields(cls)]
        sums = {name: np.array([joint[name] for joint in joints], float).T for name in names}
        return cls(**{**sums, "seconds": sums["seconds"][:, 0]})

    def __add__(self, other: Self) -> Self:
        """Both logs' cells, one after the other's."""
        pairs = {f.name: [getattr(self, f.name), getattr(other, f.name)] for f in fields(self)}
        return type(self)(**{name: np.concatenate(pair) for name, pair in pairs.items()})

    def _mean(self, sums: Array) -> Array:
        return np.asarray(sums.sum(axis=0) / self.seconds.sum())

    @cached_property
    def rmse(self) -> Array:
        """Root mean square error of each joint. (n,) [N·m]"""
        return np.sqrt(self._mean(self.squares))

    @cached_property
    def l1(self) -> Array:
        """Mean absolute error of each joint. (n,) [N·m]"""
        return self._mean(self.sizes)

    @property
    def skill(self) -> float:
        """1 less the mean RMSE over the truth's mean rms; NaN where the truth is 0."""
        return skill(self.rmse, np.sqrt(self._mean(self.truth)))

    @property
    def missed(self) -> float:
        """Share of time and joints without an answer."""
        return float(self._mean(self.missing).mean())

    @property
    def coverage(self) -> float:
        """Share of what has a band in which the band holds the truth, NaN without any."""
        return ratio(self.covered.sum(), self.banded.sum())

    @property
    def interval_score(self) -> float:
        """Mean interval score of the 95 % bands, NaN without any. [N·m]"""
        return ratio(self.penalties.sum(), self.banded.sum())

    @cached_property
    def drawn(self) -> Array | None:
        """Mean RMSE over the joints in every draw of cells, None of too few. (1000,) [N·m]"""
        count = len(self.seconds)
        if count < FEWEST:
            return None
        cells = np.random.default_rng(0).integers(0, count, (DRAWS, count))
        mean = self.squares[cells].sum(axis=1) / self.seconds[cells].sum(axis=1)[:, None]
        return np.asarray(np.sqrt(mean).mean(axis=1))


def percentiles(draws: Array | None) -> tuple[float, float]:
    """95 % interval of a number by its draws, NaN without any."""
    if draws is None:
        return float("nan"), float("nan")
    low, high = np.quantile(draws, [0.025, 0.975])
    return float(low), float(high)


def skill(rmse: Array | float, level: Array | float) -> float:
    """1 less the mean RMSE over the truth's mean rms, joint by joint; NaN where that is 0."""
    return 1.0 - ratio(float(np.mean(rmse)), float(np.mean(level)))


def ratio(part: float, whole: float) -> float:
    """A quotient, NaN over 0."""
    return float(part / whole) if whole > 0.0 else float("nan")


def lag_sums(estimate: ExternalTorque, truth: Array, inside: Mask) -> Array:
    """Σ w e² over joints and samples with the estimate read later by each of `LAGS`. (61,)"""
    t, w = estimate.t, weights(estimate.t)[inside, None]
    known = np.where(estimate.known, estimate.tau, 0.0)
    shifted = (resample_columns(t[inside] + lag, t, known) for lag in LAGS)
    return np.array([(w * (tau - truth[inside]) ** 2).sum() for tau in shifted])
