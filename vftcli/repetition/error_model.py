"""Errors of a two-cycle difference, by sample and joint."""

from functools import cache
from typing import NamedTuple

import numpy as np

from vftcli.repetition.laid_over import LaidOver
from vftcli.robots.friction import REPEATED_STOP, TWO_STOPS
from vftcli.robots.run import band
from vftcli.signals.arrays import Array, Mask, at, empty_series
from vftcli.signals.filters import band_pass, low_pass, noise_passed

#: Least band of a noise estimate: contacts fill lower ones. [Hz]
LEAST_BAND = 12.0
#: Share of the correction that is wrong even with the best model.
LEAST_SHARE = 0.05
PIECE = 0.4  #: Length of pieces that separate noise from slow loads. [s]
#: Fewest pieces for a noise estimate: a short cycle may hold contact throughout.
LEAST_PIECES = 20
QUIET = 0.1  #: Share of the pieces without a fast contact.
SEED = 15  #: Of the white noise beside the quietest pieces.
TRUSTED_SHARE = 0.5  #: Least share of samples in motion of a joint to trust.


class ErrorModel(NamedTuple):
    """Expected error of a difference, from the logs themselves."""

    sd: Array  #: Deviation of each sample, NaN without a reference. (T, n) [N·m]
    standing: Mask  #: Where the joint rests in either log. (T, n)

    @property
    def standing_share(self) -> Array:
        """Share of paired samples at rest. (n,)"""
        return np.asarray(np.mean(self.standing[self.known], axis=0))

    @property
    def known(self) -> Mask:
        """Samples with a reference. (T,)"""
        return np.asarray(np.isfinite(self.sd).all(axis=1))

    @property
    def trusted_joints(self) -> Mask:
        """Joints with motion enough to cancel friction; all if none has. (n,)"""
        trusted = np.asarray(self.standing_share <= 1.0 - TRUSTED_SHARE)
        return trusted if np.any(trusted) else np.ones_like(trusted)

    @property
    def floor(self) -> Array:
        """Root mean square of `sd` over samples with a reference. (n,) [N·m]"""
        return rms(self.sd[self.known], np.ones_like(self.standing[self.known]))

    @property
    def floor_moving(self) -> Array:
        """Root mean square of `sd` in motion; of all samples if mostly at rest. (n,) [N·m]"""
        return self.rms_moving(self.sd)

    def rms_moving(self, x: Array) -> Array:
        """Root mean square of a signal over `floor_moving`'s samples. (n,)"""
        moving = ~self.standing[self.known]
        used = np.where(self.standing_share <= 1.0 - TRUSTED_SHARE, moving, True)
        return rms(x[self.known], used)

    @property
    def floor_standing(self) -> Array:
        """Root mean square of `sd` at rest, NaN if never at rest. (n,) [N·m]"""
        standing = self.standing[self.known]
        return np.where(np.any(standing, axis=0), rms(self.sd[self.known], standing), np.nan)


def error_model(
    laid: LaidOver, signal: Array, smooth: Array, *, corrected: bool, cutoff: float | None
) -> ErrorModel:
    """The error of a difference.

    Its square is the sum of
    - noise: √2·K·σ_i without repetition, measured on the difference itself: ripple that repeats
      does not count, the correction's noise does; the larger of the band about the cutoff, as if
      white, and the quietest seconds;
    - motion: the model's torque of the motion difference, with Coulomb friction that reverses at
      another instant; all of it without the correction, else the model's relative error on
      the free run's own torque;
    - stiction where a joint stops: two torques anywhere within ±F_c differ by √(2/3)·F_c, after
      a stop shorter than `STUCK` by its share, by `REPEATED_STOP` where the whole arm rests.

    Args:
        laid: The log over its free runs.
        signal: The difference where known. (S, n) [N·m]
        smooth: The low-passed difference. (S, n) [N·m]
        corrected: Whether the model's torque corrects it.
        cutoff: Cutoff of its low-pass, None without. [Hz]
    """
    motion, known = laid.motion, laid.known
    t, step = motion.t[known], motion.step
    moving = ~laid.standing[known]
    noise = noise_of(t, signal, moving, step, cutoff)
    noise = np.maximum(noise, noise_when_quiet(t, smooth, moving, step, cutoff))
    low = band(step, cutoff)[0]
    motion_error = laid.once(
        "motion", low, lambda: local_rms(low_pass(t, at(known, laid.change), low), step)
    )
    missed, own = np.maximum(LEAST_SHARE, laid.misfit), np.zeros(len(noise))
    if not corrected:
        # The model's torque differentiates momenta: their noise is no motion.
        missed = np.ones(len(noise))
        own = laid.once(
            "slope", low, lambda: slope_noise(t, at(known, laid.momentum), moving, step, low)
        )
    at_rest = laid.standing.all(axis=1)
    sd = np.full_like(laid.stopped, np.nan)
    for j, stopped in enumerate(laid.stopped.T):
        left = less_noise(motion_error[:, j] * missed[j], own[j])
        stuck = (
            motion.dry_friction[j] * np.where(at_rest, REPEATED_STOP, TWO_STOPS * stopped)[known]
        )
        sd[known, j] = np.sqrt(noise[j] ** 2 + left**2 + stuck**2)
    return ErrorModel(sd, laid.standing)


def less_noise(size: Array, noise: Array) -> Array:
    """Deviations less that of independent noise in them, 0 if it is larger."""
    return np.sqrt(np.maximum(size**2 - noise**2, 0.0))


def noise_of(t: Array, x: Array, moving: Mask, step: float, cutoff: float | None) -> Array:
    """Noise of a difference. (n,) [N·m]

    Without a low-pass from second differences: for white noise of deviation σ on a smooth signal
    x_{k−1} − 2x_k + x_{k+1} has √6·σ. With one, from the band about its cutoff, at least
    `LEAST_BAND`, as contacts fill lower ones; assumed as dense
    throughout.
    """
    if cutoff is None:
        return white(x, moving)
    middle = max(cutoff, min(LEAST_BAND, 0.2 / step))
    limits = (0.7 * middle, min(1.3 * middle, 0.45 / step))
    dense = rms(band_pass(t, x, *limits), moving) / np.sqrt(noise_passed(step, limits, "bandpass"))
    return np.asarray(dense * np.sqrt(noise_passed(step, cutoff, "lowpass")))


def noise_when_quiet(t: Array, x: Array, moving: Mask, step: float, cutoff: float | None) -> Array:
    """Coloured noise of a difference from its quietest pieces. (n,) [N·m]

    Real noise is denser at low frequencies than above contacts. In a piece of `PIECE` it is the
    deviation from a straight line, a slow load's course; `QUIET` of the pieces are assumed without
    a fast contact. Slower wander does not count: this errs low. Zero for fewer than
    `LEAST_PIECES`.

    Args:
        t: Clock of the paired samples. (S,) [s]
        x: The difference behind its low-pass. (S, n) [N·m]
        moving: Whether the joint moves. (S, n)
        step: Sample time. [s]
        cutoff: Cutoff of its low-pass, None without. [Hz]
    """
    size = round(PIECE / step)
    count = len(t) // size
    found = np.zeros(x.shape[1])
    if size < 8 or count < LEAST_PIECES:
        return found
    left = off_line(x, size)
    moves = moving[: count * size].reshape(count, size, -1).mean(axis=1) > 0.5
    whole = t[size - 1 : count * size : size] - t[: count * size : size] < 1.5 * PIECE
    for j in range(x.shape[1]):
        pieces = left[whole & moves[:, j], j]
        if len(pieces) >= LEAST_PIECES:
            found[j] = np.sqrt(np.quantile(pieces, QUIET) / white_when_quiet(size, step, cutoff))
    return found


def off_line(x: Array, size: int) -> Array:
    """Mean square deviation from a line in pieces of so many samples. (pieces, n)"""
    count = len(x) // size
    pieces = x[: count * size].reshape(count, size, -1)
    along = np.linspace(-1.0, 1.0, size)
    line = np.column_stack([np.ones(size) / np.sqrt(size), along / np.linalg.norm(along)])
    share = np.einsum("sk,psn->pkn", line, pieces)
    square = np.sum(pieces**2, axis=1) - np.sum(share**2, axis=1)
    return np.asarray(np.maximum(square, 0.0) / size)


@cache
def white_when_quiet(size: int, step: float, cutoff: float | None) -> float:
    """Square of `noise_when_quiet` for white noise over its variance, drawn once."""
    noise: Array = np.random.default_rng(SEED).standard_normal((400 * size, 1))
    clock = step * np.arange(len(noise), dtype=np.float64)
    smooth = noise if cutoff is None else low_pass(clock, noise, cutoff)
    return float(np.quantile(off_line(smooth, size), QUIET) / np.mean(smooth**2))


def slope_noise(t: Array, momentum: Array, moving: Mask, step: float, cutoff: float) -> Array:
    """Noise of differentiated momenta in the low-passed model torque. (n,) [N·m]"""
    limits = band(step, cutoff)
    dense = rms(band_pass(t, momentum, *limits), moving) / np.sqrt(
        noise_passed(step, limits, "bandpass")
    )
    return np.asarray(dense * np.sqrt(noise_passed(step, cutoff, "lowpass", slope=1)))


def white(x: Array, moving: Mask) -> Array:
    """Deviation of a signal's white part, from second differences. (n,)"""
    curvature = x[:-2] - 2.0 * x[1:-1] + x[2:]
    return np.asarray(rms(curvature, moving[1:-1]) / np.sqrt(6.0))


def rms(x: Array, where: Mask) -> Array:
    """Root mean square per column over chosen samples, over all if none. (n,)"""
    # Column by column: copies of a long log take longer.
    chosen = (c[w] if w.any() else c for c, w in zip(x.T, where.T, strict=True))
    return np.asarray(np.sqrt([np.dot(column, column) / len(column) for column in chosen]))


def local_rms(x: Array, step: float) -> Array:
    """Root mean square over a tenth of a second around each sample. (T, n)"""
    width = max(1, round(0.05 / step))
    here = np.arange(len(x))
    first, last = np.maximum(here - width, 0), np.minimum(here + width + 1, len(x))
    out, total = empty_series(*x.shape), np.zeros(len(x) + 1)
    for column, mean in zip(x.T, out.T, strict=True):
        np.cumsum(column**2, out=total[1:])
        np.sqrt((total[last] - total[first]) / (last - first), out=mean)
    return out
