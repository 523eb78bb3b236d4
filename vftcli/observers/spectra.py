"""Spectra of the unexplained torque of the free and the loaded part of a log.

The raw disturbance d = (pᵗ − pᵗ⁻¹)/Ts − ½(μᵗ + μᵗ⁻¹) is the external torque, averaged
over a sample, plus noise, friction and model error. Its spectrum over the free part,
S_n, is the error's; the excess of the loaded part, S_τ = (S_d − S_n)₊, is the external
torque's. Above 5 Hz it is so only within the falling spectra of contacts: a drive that
chatters under load makes a plateau there, which counts as noise. From the two follows
the error of every linear estimator with frequency response H:

    rms² = ∫ |1 − H|² S_τ + |H|² S_n df

H is complex, so that delay counts. The spectra are one-sided and not detrended: a
constant error is an error too.

One model gives every estimate's error sample by sample, not its own covariance:

    sd² = e² + ∫|1 − H|² S_τ df + c²,

with e² the mean square of the estimator's reading while nothing touches the arm, of a
resting and a moving joint apart, and c the SD of a subtracted correction. Stiction at
rest is hidden: there e is at least the share of the dry friction measured on drives.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.robots.friction import HELD
from vftcli.robots.run import RunSamples
from vftcli.robots.terms import disturbance_stretches
from vftcli.signals.arrays import (
    Array,
    Mask,
    grown,
    handed_over,
    intervals,
    median_step,
    seal,
    summed,
)
from vftcli.signals.errors import ParameterError
from vftcli.signals.filters import welch

SEGMENT = 4.0  #: Length of a segment: slower changes are constant. [s]
#: Fewest samples of a segment; a shorter part has no spectrum.
LEAST_SEGMENT = 32
IMPACT = 1.0  #: Longest contact of a loaded part of impacts. [s]
#: Reach of the average over neighbours, by the frequency.
NEIGHBOURS = 0.2
SLOW = 5.0  #: Up to here the external torque's spectrum holds. [Hz]
#: Beyond, it falls at least as f to the minus this: between the 2 of a torque that jumps
#: and the 4 of one without jumps and corners.
FALL = 2.5

#: Least share of the loaded part's power below `SLOW` beyond that of a free one. Reference
#: runs show 0.96 and more, those touched in every cycle 0.86 and less.
QUIETER = 0.9


@dataclass(frozen=True, kw_only=True)
class Spectra:
    """One-sided power spectral densities of the raw disturbance."""

    frequency: Array  #: (F,) [Hz]
    free: Array  #: S_n, over the free part. (F, n) [(N·m)²/Hz]
    loaded: Array  #: S_d, over the rest. (F, n) [(N·m)²/Hz]
    step: float  #: Sample time. [s]
    segments: tuple[int, int]  #: Segments of the free and the loaded part.

    def __post_init__(self) -> None:
        seal(self, "frequency", "free", "loaded")

    @cached_property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.free.shape[1])

    @cached_property
    def width(self) -> float:
        """Distance of two frequencies. [Hz]"""
        return float(self.frequency[1] - self.frequency[0])

    @cached_property
    def excess(self) -> Array:
        """(S_d − S_n)₊, the excess of the loaded part. (F, n) [(N·m)²/Hz]"""
        # Averaged over neighbouring frequencies first: chance has both signs.
        return handed_over(np.maximum(neighbour_mean(self.loaded - self.free), 0.0))

    @cached_property
    def external(self) -> Array:
        """S_τ, the spectrum of the external torque. (F, n) [(N·m)²/Hz]

        The excess, above `SLOW` at most c/f^`FALL`, c the mean of f^`FALL` times it below.
        """
        f = self.frequency[:, None]
        slow = (self.frequency > 0.0) & (self.frequency <= SLOW)
        fast = self.frequency > SLOW
        if not (slow.any() and fast.any()):
            return self.excess
        level = np.mean(f[slow] ** FALL * self.excess[slow], axis=0)
        capped = self.excess.copy()
        capped[fast] = np.minimum(capped[fast], level / f[fast] ** FALL)
        return handed_over(capped)

    @cached_property
    def noise(self) -> Array:
        """S_n and the excess that is no external torque. (F, n) [(N·m)²/Hz]"""
        return handed_over(self.free + (self.excess - self.external))

    @property
    def floor(self) -> Array:
        """Noise S_n from its quietest octave up, level below. (F, n)"""
        # At low frequencies the rest of S_n is friction and model error.
        low, levels, tops = self.width, [], []
        while 2.0 * low <= self.frequency[-1]:
            inside = (self.frequency >= low) & (self.frequency <= 2.0 * low)
            levels.append(self.free[inside].mean(axis=0))
            tops.append(2.0 * low)
            low *= np.sqrt(2.0)
        quietest = np.argmin(levels, axis=0)
        above = self.frequency[:, None] > np.array(tops)[quietest]
        return np.where(above, neighbour_mean(self.free), np.min(levels, axis=0))

    def missed(self, response: NDArray[np.complex128]) -> Array:
        """∫|1 − H|² S_τ df of H (F, n), lost by lag and bandwidth. (n,) [(N·m)²]"""
        missed = abs(1.0 - response) ** 2 * self.external
        return np.asarray(missed.sum(axis=0) * self.width)

    def passed(self, response: NDArray[np.complex128]) -> Array:
        """∫|H|² S_n df, the noise that passes H (F, n). (n,) [(N·m)²]"""
        return np.asarray(np.sum(abs(response) ** 2 * self.noise, axis=0) * self.width)


def neighbour_mean(spectrum: Array) -> Array:
    """Mean of each bin and its `NEIGHBOURS`. (F, n)"""
    bins = np.arange(len(spectrum))
    reach = (NEIGHBOURS * bins).astype(int)
    reach = np.minimum(reach, len(spectrum) - 1 - bins)
    total = summed(spectrum)
    sums = total[bins + reach + 1] - total[bins - reach]
    return np.asarray(sums / (2 * reach + 1)[:, None])


def spectra_of(loaded: RunSamples, free: Sequence[RunSamples]) -> Spectra:
    """Spectra of a loaded part and a free one, by one estimator.

    Short impacts are widened to a second, and their excess, thinned by that, scaled back.
    """
    t = loaded.run.t
    nominal = median_step(t) if len(t) > 1 else 0.0
    short = not intervals(t, loaded.inside, least=IMPACT)
    inside = grown(t, loaded.inside, 0.5 * IMPACT) if short else loaded.inside
    heavy = disturbance_stretches(loaded.run.terms, inside, nominal)
    quiet = [d for run, at in free for d in disturbance_stretches(run.terms, at, nominal)]
    longest = [max((len(run) for run in found), default=0) for found in (heavy, quiet)]
    size = min(round(SEGMENT / nominal) if nominal else 0, *longest)
    if size < LEAST_SEGMENT:
        raise ParameterError(
            f"a spectrum needs {LEAST_SEGMENT} samples in a row; the loaded part has "
            f"{longest[0]}, the free part {longest[1]}"
        )
    thinned = inside.mean() / max(loaded.inside.mean(), 1.0 / len(t))
    size -= size % 2
    (noise, few), (both, many) = (welch(found, size, nominal) for found in (quiet, heavy))
    both = noise + thinned * (both - noise) if thinned > 1.0 else both
    return Spectra(
        frequency=np.asarray(np.fft.rfftfreq(size, nominal), float),
        free=handed_over(noise),
        loaded=handed_over(both),
        step=nominal,
        segments=(few, many),
    )


def looks_free(spectra: Spectra) -> bool:
    """Whether most joints have clearly less slow power free than loaded."""
    slow = spectra.frequency < SLOW
    power = np.maximum(spectra.loaded[slow].sum(axis=0), np.finfo(float).tiny)
    return bool(np.median(spectra.external[slow].sum(axis=0) / power) > QUIETER)


ENOUGH = 50  #: Fewest free samples, at rest or in motion, for a mean square.

#: Error of friction in motion over dry friction, without free motion to show
#: it: on a UR10e the maker's friction differs by .05 to .25 of itself from that day's.
UNSEEN = 0.2


class FreeError(NamedTuple):
    """Mean square of an estimator's reading while nothing touches the arm."""

    moving: Array  #: While the joint moves. (n,) [(N·m)²]
    resting: Array  #: While it rests. (n,) [(N·m)²]
    unseen: Mask  #: Joints that hardly move there. (n,)


def free_error(read: Array, resting: Mask, dry_friction: Array) -> FreeError:
    """The mean squares of an estimator's free samples, at least one.

    With fewer than `ENOUGH` of them at rest, or in motion, all count: a moving joint then
    adds `UNSEEN` of its dry friction.

    `read` (S, n) [N·m] is NaN, dry friction (n,) [N·m] is 0 where unknown.
    """
    known = np.isfinite(read)
    kinds = np.array([known, known & ~resting, known & resting])
    square, counts = np.where(known, read, 0.0) ** 2, np.count_nonzero(kinds, axis=1)
    sums = np.array([np.where(kind, square, 0.0).sum(axis=0) for kind in kinds])
    means = sums / np.maximum(counts, 1)
    moving, still = np.where(counts[1:] < ENOUGH, means[0], means[1:])
    unseen = counts[1] < ENOUGH
    return FreeError(
        moving=moving + unseen * (UNSEEN * dry_friction) ** 2,
        resting=np.maximum(still, (HELD * dry_friction) ** 2),
        unseen=unseen,
    )


def error_band(
    free: FreeError, missed: Array, resting: Mask, correction_sd: Array | None = None
) -> Array:
    """Deviation of an estimate's error, by the module's equation. (T, n) [N·m]

    `missed` is `Spectra.missed` (n,) [(N·m)²], `correction_sd` a correction's. (T, n)
    """
    variance = np.where(resting, free.resting + missed, free.moving + missed)
    if correction_sd is not None:
        variance += correction_sd**2
    return np.sqrt(variance, out=variance)
