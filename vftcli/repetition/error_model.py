"""What a two-cycle difference cannot know: its own error, sample by sample and joint by joint."""

from functools import cache
from typing import NamedTuple

import numpy as np

from vftcli.repetition.laid_over import LaidOver
from vftcli.robots.friction import REPEATED_STOP, TWO_STOPS
from vftcli.robots.run import band
from vftcli.signals.arrays import Array, Mask, at, empty_series
from vftcli.signals.filters import band_pass, low_pass, noise_passed

#: Noise is not measured in a band about less than this: contacts live there. [Hz]
LEAST_BAND = 12.0
#: Share of the correction that is wrong even where the model is as good as it gets.
LEAST_SHARE = 0.05
PIECE = 0.4  #: Length of the pieces in which noise is told from slow loads. [s]
#: Fewest pieces of which the quietest speak for the noise: one short cycle may be pushed in all.
LEAST_PIECES = 20
QUIET = 0.1  #: Share of the pieces that are without a fast contact.
SEED = 15  #: Of the white noise that the quietest pieces are compared with.
TRUSTED_SHARE = 0.5  #: A joint is trusted if it moves in at least this share of the samples.


class ErrorModel(NamedTuple):
    """Expected error of a difference, from what the logs themselves show."""

    sd: Array  #: Standard deviation of each sample, NaN where there is no reference. (T, n) [N·m]
    standing: Mask  #: Where the joint stands in the log or in the free run. (T, n)

    @property
    def standing_share(self) -> Array:
        """Share of the paired samples in which the joint stands. (n,)"""
        return np.asarray(np.mean(self.standing[self.known], axis=0))

    @property
    def known(self) -> Mask:
        """Samples with a reference. (T,)"""
        return np.asarray(np.isfinite(self.sd).all(axis=1))

    @property
    def trusted_joints(self) -> Mask:
        """Joints that move enough for friction to cancel; all if none does. (n,)"""
        trusted = np.asarray(self.standing_share <= 1.0 - TRUSTED_SHARE)
        return trusted if np.any(trusted) else np.ones_like(trusted)

    @property
    def floor(self) -> Array:
        """Root mean square of `sd` over the samples with a reference. (n,) [N·m]"""
        return rms(self.sd[self.known], np.ones_like(self.standing[self.known]))

    @property
    def floor_moving(self) -> Array:
        """The same while the joint moves; over all samples if it mostly stands. (n,) [N·m]"""
        return self.rms_moving(self.sd)

    def rms_moving(self, x: Array) -> Array:
        """Root mean square of a signal over the samples of `floor_moving`. (n,)"""
        moving = ~self.standing[self.known]
        used = np.where(self.standing_share <= 1.0 - TRUSTED_SHARE, moving, True)
        return rms(x[self.known], used)

    @property
    def floor_standing(self) -> Array:
        """Root mean square of `sd` while the joint stands, NaN where it never does. (n,) [N·m]"""
        standing = self.standing[self.known]
        return np.where(np.any(standing, axis=0), rms(self.sd[self.known], standing), np.nan)


def error_model(
    laid: LaidOver, signal: Array, smooth: Array, *, corrected: bool, cutoff: float | None
) -> ErrorModel:
    """Estimate the error of a difference.

    Its square is the sum of
    - noise: √2·K·σ_i where nothing repeats, measured on the difference itself, so that ripple
      which does repeat does not count and what the correction adds does; the larger of what the
      band about the cutoff says, as if it were white, and what the quietest seconds do;
    - motion: the model's torque of the motion difference, Coulomb friction that turns over at
      another instant included; all of it without the correction, with it the share by which the
      model misses the free run's own torque;
    - stiction where a joint stops: two torques anywhere within ±F_c differ by √(2/3)·F_c, after a
      stop shorter than `STUCK` by its share, and by `REPEATED_STOP` where the whole arm rests.

    Args:
        laid: The log over its free runs.
        signal: The difference where it is known. (S, n) [N·m]
        smooth: The same behind its low-pass. (S, n) [N·m]
        corrected: Whether the difference is corrected by the model's torque.
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
        # The model's torque differentiates momenta: their noise is no difference of the motions.
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
    """Standard deviations without that of an independent noise in them, 0 where it is larger."""
    return np.sqrt(np.maximum(size**2 - noise**2, 0.0))


def noise_of(t: Array, x: Array, moving: Mask, step: float, cutoff: float | None) -> Array:
    """Noise of a difference. (n,) [N·m]

    Without a low-pass from second differences: for white noise of deviation σ on a smooth signal
    x_{k−1} − 2x_k + x_{k+1} has √6·σ. With one, from the band about its cutoff, or about
    `LEAST_BAND` if that is higher, because contacts fill what is below; taken to be as dense
    throughout.
    """
    if cutoff is None:
        return white(x, moving)
    middle = max(cutoff, min(LEAST_BAND, 0.2 / step))
    limits = (0.7 * middle, min(1.3 * middle, 0.45 / step))
    dense = rms(band_pass(t, x, *limits), moving) / np.sqrt(noise_passed(step, limits, "bandpass"))
    return np.asarray(dense * np.sqrt(noise_passed(step, cutoff, "lowpass")))


def noise_when_quiet(t: Array, x: Array, moving: Mask, step: float, cutoff: float | None) -> Array:
    """Noise of a difference as its quietest pieces show it, coloured as it is. (n,) [N·m]

    Real noise is denser at low frequencies than where contacts leave it alone. In a piece of
    `PIECE` it is what departs from a straight line, which a slow load would make; `QUIET` of the
    pieces are taken to be without a fast contact. What wanders more slowly counts for nothing, so
    this errs to the low side. Zero where there are fewer than `LEAST_PIECES`.

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
    """Mean square departure from a straight line, piece by piece of so many samples. (pieces, n)"""
    count = len(x) // size
    pieces = x[: count * size].reshape(count, size, -1)
    along = np.linspace(-1.0, 1.0, size)
    line = np.column_stack([np.ones(size) / np.sqrt(size), along / np.linalg.norm(along)])
    share = np.einsum("sk,psn->pkn", line, pieces)
    square = np.sum(pieces**2, axis=1) - np.sum(share**2, axis=1)
    return np.asarray(np.maximum(square, 0.0) / size)


@cache
def white_when_quiet(size: int, step: float, cutoff: float | None) -> float:
    """What `noise_when_quiet` takes the root of for white noise, over its variance, drawn once."""
    noise: Array = np.random.default_rng(SEED).standard_normal((400 * size, 1))
    clock = step * np.arange(len(noise), dtype=np.float64)
    smooth = noise if cutoff is None else low_pass(clock, noise, cutoff)
    return float(np.quantile(off_line(smooth, size), QUIET) / np.mean(smooth**2))


def slope_noise(t: Array, momentum: Array, moving: Mask, step: float, cutoff: float) -> Array:
    """Noise that differentiated momenta put into the model's low-passed torque. (n,) [N·m]"""
    limits = band(step, cutoff)
    dense = rms(band_pass(t, momentum, *limits), moving) / np.sqrt(
        noise_passed(step, limits, "bandpass")
    )
    return np.asarray(dense * np.sqrt(noise_passed(step, cutoff, "lowpass", slope=1)))


def white(x: Array, moving: Mask) -> Array:
    """Standard deviation of the white part of a signal, from second differences. (n,)"""
    curvature = x[:-2] - 2.0 * x[1:-1] + x[2:]
    return np.asarray(rms(curvature, moving[1:-1]) / np.sqrt(6.0))


def rms(x: Array, where: Mask) -> Array:
    """Root mean square of each column over the chosen samples, over all if none is. (n,)"""
    # Column by column: whole copies of a long log take longer than the sums.
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
