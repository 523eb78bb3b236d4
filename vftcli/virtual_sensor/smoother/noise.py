"""What a smoother takes for noise: white noise of the drives, and model error that wanders slowly.

Of each joint d = b + n, with n white of variance R and b an Ornstein–Uhlenbeck process of variance
s² and correlation time T. Over blocks of B seconds its spectrum is

    S(f) = B [R + s² (1 − a²)/(1 − 2a cos 2πfB + a²)],    a = exp(−B/T),

and the free part's periodogram P fixes the three by Whittle's likelihood, Σ ln S + P/S.

References:
    P. Whittle, "Estimation and information in stationary time series", Arkiv för Matematik 2, 1953.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vftcli.robots.disturbance import Blocks, disturbance_blocks
from vftcli.robots.friction import PUSHED_SHARE, REST_SHARE, dry_torques
from vftcli.robots.robot import Robot
from vftcli.robots.run import RunSamples
from vftcli.signals.arrays import Array, Mask, median
from vftcli.signals.rest import NEAR_REST
from vftcli.signals.series import grown, runs_of
from vftcli.virtual_sensor.solvers import TORQUE_SD

REST_TIME = 2.0  #: Stiction keeps its state at least this long. [s]
#: A joint that rests under a contact: the push re-settles its stiction within so long. [s]
PUSHED_TIME = 0.3
#: Such a push adds to the variance of motion that of rest, by the drives' share under a push.
RESETTLED = (PUSHED_SHARE / REST_SHARE) ** 2
#: A joint that moves in less than the share `SEEN` of the free part's blocks: the model error of
#: its motion, as a share of F_c, and its least correlation time. [s]
UNSEEN_SHARE, UNSEEN_TIME, SEEN = 0.2, 1.0, 0.2
#: Prior of the correlation time T: its median [s] and the spread of ln T.
USUAL_TIME, TIME_SPREAD = 0.5, 1.5
LEAST_NOISE = 1e-6  #: Smallest R: a millinewton-metre, far below any drive's. [(N·m)²]
LEAST_BLOCKS = 20  #: Shortest unbroken stretch of the free part that has a spectrum, in blocks.
ASSUMED_SHARE = 0.2  #: Where no free part tells: the model error of motion, as a share of F_c.


@dataclass(frozen=True, kw_only=True)
class TorqueNoise:
    """White noise and model error of every joint, by blocks of one length."""

    white: Array  #: R, variance of the white noise. (n,) [(N·m)²]
    variance: Array  #: s² of motion that the free part shows. (n,) [(N·m)²]
    time: Array  #: T, its correlation time. (n,) [s]
    dry: Array  #: F_c. (n,) [N·m]
    seen: Mask  #: Whether the free part moved the joint; else motion errs by its friction. (n,)
    at_rest: Array  #: Variance that rest adds. (n,) [(N·m)²]
    pushed: Array  #: The same of rest under a contact. (n,) [(N·m)²]
    near: float = 0.0  #: How long before and after a rest that of rest holds. [s]
    #: How much free motion it was learned from; 0 where it is assumed. [s]
    free_seconds: float = 0.0

    @property
    def moving(self) -> Array:
        """Variance of the model error in motion. (n,) [(N·m)²]"""
        return self.variance + ~self.seen * (UNSEEN_SHARE * self.dry) ** 2

    @property
    def moving_time(self) -> Array:
        """Its correlation time. (n,) [s]"""
        return np.where(self.seen, self.time, np.maximum(self.time, UNSEEN_TIME))

    def course(self, blocks: Blocks, touched: Mask | None = None) -> tuple[Array, Array]:
        """Stationary variance of the model error in every block, its correlation time. (K, n) each

        Args:
            blocks: The log.
            touched: Blocks in which a contact may re-settle stiction; None for none. (K,)
        """
        rests = np.column_stack([grown(blocks.t, rest, self.near) for rest in blocks.rests.T])
        variance = np.where(rests, self.variance + self.at_rest, self.moving)
        time = np.where(rests, np.maximum(self.time, REST_TIME), self.moving_time)
        if touched is not None:
            held = blocks.rests & touched[:, None]
            variance = np.where(held, self.variance + self.pushed, variance)
            time = np.where(held, PUSHED_TIME, time)
        return variance, time


def steps(blocks: Blocks) -> Array:
    """Time from the middle of the block before; 0 for the first. (K,) [s]"""
    return np.diff(blocks.t, prepend=blocks.t[:1])


def torque_noise(
    log: Blocks, free: Sequence[RunSamples], robot: Robot, seconds: float
) -> TorqueNoise:
    """The noise that the free part shows, else what the drives' dry friction lets assume.

    At rest the model error is at least `REST_SHARE` of the dry friction, whatever the free part
    shows: stiction keeps what the last motion, or the last touch, left.

    Args:
        log: The blocks to be smoothed.
        free: Motion that nobody touched, of this log or of others.
        robot: The arm, for its dry friction.
        seconds: Length of a block. [s]
    """
    dry = dry_torques(robot)
    stretches = [s for piece in free for s in free_stretches(piece, seconds)]
    if not stretches:
        return assumed_noise(log, dry)
    white, variance, time = fit_joints(stretches)
    seen = (~np.concatenate([s.rests for s in stretches])).mean(axis=0) >= SEEN
    resting = np.maximum(variance, (REST_SHARE * dry) ** 2)
    return TorqueNoise(
        white=white,
        variance=variance,
        time=time,
        dry=dry,
        seen=seen,
        at_rest=resting - variance,
        pushed=~seen * (UNSEEN_SHARE * dry) ** 2 + RESETTLED * resting,
        free_seconds=float(sum(s.length.sum() for s in stretches)),
    )


def assumed_noise(log: Blocks, dry: Array) -> TorqueNoise:
    """Model error as shares of the dry friction; white noise as neighbouring blocks differ.

    Args:
        log: The blocks to be smoothed.
        dry: F_c; a joint without is taken for `TORQUE_SD`. (n,) [N·m]
    """
    moving, rest = (np.maximum(share * dry, TORQUE_SD) for share in (ASSUMED_SHARE, REST_SHARE))
    bend = log.d[1:-1] - 0.5 * (log.d[2:] + log.d[:-2])
    white = np.full(len(dry), TORQUE_SD**2)
    if len(bend):
        # The median square of a normal variable is .455 of its mean square; the bend has 1.5 R.
        white = np.median(bend**2, axis=0) / (0.455 * 1.5)
    return TorqueNoise(
        white=np.maximum(white, LEAST_NOISE),
        variance=moving**2,
        time=np.full(len(dry), USUAL_TIME),
        dry=dry,
        seen=np.ones(len(dry), dtype=bool),
        at_rest=rest**2 - moving**2,
        pushed=RESETTLED * rest**2,
        near=NEAR_REST,
    )


def free_stretches(piece: RunSamples, seconds: float) -> list[Blocks]:
    """The stretches of a free piece that are long enough for a spectrum, in blocks.

    They reach from its first motion to its last, since rest has a model error of its own; a piece
    without motion counts as it is.
    """
    blocks = disturbance_blocks(piece.run.terms, piece.run.q, seconds, piece.inside)
    motion = np.flatnonzero(blocks.known & ~blocks.rests.all(axis=1))
    if len(motion):
        blocks = blocks.part(slice(int(motion[0]), int(motion[-1]) + 1))
    return long_stretches(blocks)


def long_stretches(blocks: Blocks) -> list[Blocks]:
    """The stretches of known blocks that a spectrum can be learned from."""
    runs = [run for run in runs_of(blocks.known) if run[1] - run[0] >= LEAST_BLOCKS]
    return [blocks.part(slice(*run)) for run in runs]


def fit_joints(stretches: Sequence[Blocks]) -> tuple[Array, Array, Array]:
    """R, s² and T of every joint, by Whittle's likelihood over all stretches together. (n,) each"""
    # A block holds whole samples, so that it is not quite as long as was asked.
    seconds = median(np.concatenate([s.length for s in stretches]))
    f = np.concatenate([np.fft.rfftfreq(len(s.d), seconds)[1:] for s in stretches])
    P = np.concatenate([periodogram(s.d, seconds) for s in stretches])
    longest = max(float(s.length.sum()) for s in stretches)
    each = [fit_spectrum(f, p, seconds, longest) for p in P.T]
    white, variance, time = (np.array(v) for v in zip(*each, strict=True))
    # An offset is an error too.
    variance += np.concatenate([s.d for s in stretches]).mean(axis=0) ** 2
    return white, variance, time


def periodogram(d: Array, seconds: float) -> Array:
    """Two-sided periodogram at the positive frequencies. (N//2, n) [(N·m)²/Hz]"""
    spectrum = np.fft.rfft(d, axis=0)[1:]
    power: Array = (spectrum.real**2 + spectrum.imag**2) * (seconds / len(d))
    return power


def fit_spectrum(f: Array, P: Array, seconds: float, longest: float) -> tuple[float, float, float]:
    """R, s² and T of one joint: the best of a grid over ln T and ln s²/R that narrows five times.

    The level follows in closed form, so that two numbers are left to search.

    Args:
        f: Frequencies. (F,) [Hz]
        P: Periodogram. (F,) [(N·m)²/Hz]
        seconds: Length of a block B. [s]
        longest: Longest stretch: no correlation time is longer. [s]
    """
    cosine = np.cos(2.0 * np.pi * f * seconds)
    low, high = np.log([2.0 * seconds, 1e-2]), np.log([max(longest, 4.0 * seconds), 1e6])
    best, level, count = np.zeros(2), 0.0, 13
    for _ in range(6):
        times, ratios = (np.linspace(low[i], high[i], count) for i in range(2))
        a = np.exp(-seconds / np.exp(times))[:, None]
        shape = (1.0 - a * a) / (1.0 - 2.0 * a * cosine + a * a)
        S = 1.0 + np.exp(ratios)[None, :, None] * shape[:, None, :]
        levels = np.mean(P / S, axis=2) / seconds
        cost = np.sum(np.log(S), axis=2) + len(f) * np.log(np.maximum(levels, LEAST_NOISE**2))
        cost += 0.5 * ((times[:, None] - np.log(USUAL_TIME)) / TIME_SPREAD) ** 2
        i, j = np.unravel_index(np.argmin(cost), cost.shape)
        best, level = np.array([times[i], ratios[j]]), float(levels[i, j])
        reach = (high - low) / (count - 1)
        low, high = np.maximum(low, best - reach), np.minimum(high, best + reach)
        count = 5
    time, ratio = np.exp(best)
    return max(level, LEAST_NOISE), float(level * ratio), float(time)
