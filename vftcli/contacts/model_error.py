"""The model error b that a contact is told from: of each joint d = b + n in motion nobody touched.

b is an Ornstein–Uhlenbeck process of variance s² and correlation time T, n white of variance R, as
for the wrench smoother. A list of contacts is measured against the quiet blocks on either side, so
here b is modelled closer: reversals are taken out before the spectrum is learned, what the spectrum
misses of the tails inflates it, and a joint that comes to rest draws its stiction anew.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.robots.disturbance import TIE, Blocks
from vftcli.robots.friction import CREEP_SHARE, PUSHED_SHARE, STOP_SHARE
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.least_squares import robust_sd
from vftcli.signals.linear_model import SPIKE, LinearModel, filtered
from vftcli.signals.series import near, runs_of
from vftcli.virtual_sensor.smoother.noise import (
    LEAST_NOISE,
    SEEN,
    TorqueNoise,
    fit_joints,
    long_stretches,
    steps,
)

#: Share of the free part's blocks in which a joint must move for its reversals to be bridged.
MOVES = 0.3
#: Shares of the normalised squares ν²/S, and where χ² of one degree has them.
QUANTILES = (0.9, 2.706), (0.97, 4.709)
#: Smallest model error that is inferred where no free motion is known: this share of F_c, and so
#: much [N·m]; its correlation time is no shorter where it is this error. [s]
DRY_SHARE, LEAST_ERROR, LEAST_TIME = 0.2, 0.1, 0.3
#: Where nothing was learned the quietest 60 % of the blocks in which a joint moves count as
#: free; 60 % of a normal variable lie within so many standard deviations.
QUIET, QUIET_SD = 0.6, 0.8416
#: The block in which a joint comes to rest draws b anew: this share is left of what it was.
STOP_DECAY = float(np.exp(-5.0))
#: What a joint has just done: it stops if it moved for more than half of this time before, and for
#: this time after a start b changes within `START_TIME`. [s]
RECENT = 0.1
START_TIME = 0.05  #: Correlation time of b while a joint breaks away. [s]
#: How often a joint's innovation is a spike within so long [s] of its motion, and at rest.
SPIKES_MOVING, SPIKES_RESTING, SPIKE_REACH = 0.01, 1e-5, 0.3
UNKNOWN = 1e9  #: Variance of the white noise of a block that says nothing. [(N·m)²]


class ErrorCourse(NamedTuple):
    """How b goes from block to block, and the white noise upon it."""

    decay: Array  #: Share of b that is kept from the block before. (K, n)
    added: Array  #: Variance that is added. (K, n) [(N·m)²]
    white: Array  #: R, `UNKNOWN` where the block's disturbance is. (K, n) [(N·m)²]
    spikes: Array  #: How often an innovation is a spike. (K, n)


def learn_noise(free: Sequence[Blocks], dry: Array) -> TorqueNoise | None:
    """The noise of a free part, None where no stretch of it is long enough.

    Args:
        free: Blocks of every free piece.
        dry: F_c of each joint. (n,) [N·m]
    """
    pieces = [stretch for piece in free for stretch in long_stretches(piece)]
    if not pieces:
        return None
    moving = ~np.concatenate([piece.rests for piece in pieces])
    share = moving.mean(axis=0)
    bridged = [without_reversals(piece, share > MOVES) for piece in pieces]
    white, variance, time = fit_joints(bridged)
    found = TorqueNoise(
        white=white,
        variance=variance,
        time=time,
        dry=dry,
        seen=share >= SEEN,
        at_rest=(CREEP_SHARE * dry) ** 2,
        pushed=(PUSHED_SHARE * dry) ** 2,
        free_seconds=float(sum(piece.length.sum() for piece in pieces)),
    )
    factor = inflation(found, pieces)
    return replace(found, white=white * factor, variance=variance * factor)


def infer_noise(log: Blocks, dry: Array, learned: TorqueNoise | None) -> TorqueNoise | None:
    """The noise of a log without known free motion, None where it has too few known blocks.

    Args:
        log: The whole log.
        dry: F_c of each joint. (n,) [N·m]
        learned: What the samples show that the fit of the whole log calls free; None without.
    """
    bends = [np.diff(log.d[a:b], n=2, axis=0) for a, b in runs_of(log.known) if b - a > 2]
    if not bends:
        return None
    # A second difference of white noise has 6 R.
    spread = robust_sd(np.concatenate(bends))
    white, least = (
        np.maximum(spread**2 / 6.0, LEAST_NOISE),
        np.maximum(DRY_SHARE * dry, LEAST_ERROR),
    )
    moving = log.known[:, None] & ~log.rests
    asked = moving.mean(axis=0) >= SEEN
    if learned is not None:
        # The fit calls the quietest samples free; what its friction says is a floor, if it is any.
        asked &= DRY_SHARE * dry < LEAST_ERROR
    for j in np.flatnonzero(asked):
        quiet = np.quantile(np.abs(log.d[moving[:, j], j]), QUIET) / QUIET_SD
        least[j] = max(least[j], quiet)
    if learned is None:
        variance, time = least**2, np.full(len(dry), LEAST_TIME)
    else:
        white, variance = np.maximum(white, learned.white), np.maximum(learned.variance, least**2)
        floored = variance > learned.variance
        time = np.where(floored, np.maximum(learned.time, LEAST_TIME), learned.time)
    return TorqueNoise(
        white=white,
        variance=variance,
        time=time,
        dry=dry,
        seen=np.ones(len(dry), dtype=bool),
        at_rest=(CREEP_SHARE * dry) ** 2,
        pushed=(PUSHED_SHARE * dry) ** 2,
        free_seconds=0.0 if learned is None else learned.free_seconds,
    )


def without_reversals(piece: Blocks, joints: Mask) -> Blocks:
    """The blocks with d of the given joints bridged in a straight line where they rest."""
    d, still = piece.d.copy(), piece.rests
    for j in np.flatnonzero(joints):
        moves = ~still[:, j]
        if moves.any():
            d[:, j] = np.interp(piece.t, piece.t[moves], d[moves, j])
    return piece._replace(d=d)


def inflation(noise: TorqueNoise, pieces: Sequence[Blocks]) -> Array:
    """What the tails of the innovations ask for beyond the spectrum, at least 1. (n,)"""
    squares = []
    for piece in pieces:
        course = error_course(noise, piece)
        squares.append(innovations(error_model(piece.d, course), course.spikes)[0])
    together = np.concatenate(squares)
    each = [np.quantile(together, share, axis=0) / value for share, value in QUANTILES]
    factor: Array = np.maximum(np.max(each, axis=0), 1.0)
    return factor


def error_model(d: Array, course: ErrorCourse) -> LinearModel:
    """The model of b alone, each joint for itself.

    Args:
        d: Mean disturbance. (K, …, n) [N·m]
        course: How b goes.
    """
    own = (each[..., None] for each in (course.white, course.decay, course.added))
    return LinearModel(d[..., None], np.ones((*d.shape, 1, 1)), *own)


def spike_limit(spikes: Array) -> Array:
    """ν²/S beyond which an innovation is more likely a spike, for how often it is one. (K, …, n)"""
    with np.errstate(divide="ignore"):
        odds = np.log(spikes) - np.log1p(-spikes)
    limit: Array = (np.log(SPIKE) - 2.0 * odds) / (1.0 - 1.0 / SPIKE)
    return limit


def innovations(model: LinearModel, spikes: Array) -> tuple[Array, Array]:
    """ν²/S of every joint's model, and S. (K, …, n) each

    Args:
        model: The model of b alone.
        spikes: How often an innovation is a spike. (K, …, n)
    """
    blocks = filtered(model, spike_limit(spikes))
    each = [(block.square, block.spread[..., 0, 0]) for block in blocks]
    squares, spreads = (np.array(series) for series in zip(*each, strict=True))
    return squares, spreads


def spiked_white(d: Array, course: ErrorCourse) -> Array:
    """R of every block with its spikes in it. (K, n) [(N·m)²]

    Args:
        d: Mean disturbance. (K, n) [N·m]
        course: How b goes.
    """
    squares, spreads = innovations(error_model(d, course), course.spikes)
    spiked = squares > spike_limit(course.spikes)
    return course.white + np.where(spiked, (SPIKE - 1.0) * spreads, 0.0)


def error_course(noise: TorqueNoise, blocks: Blocks, pushed: Mask | None = None) -> ErrorCourse:
    """How b goes along a log.

    Args:
        noise: What free motion shows.
        blocks: The log.
        pushed: Blocks in which a contact may re-settle the stiction of joints at rest; None for
            none. (K,)
    """
    rests, length = blocks.rests, float(np.median(blocks.length))
    moved = moved_before(~rests, max(round(RECENT / length), 1))
    variance, time = noise.course(blocks, pushed)
    time = np.where(~rests & (moved < 1.0), np.minimum(time, START_TIME), time)
    decay = np.exp(-steps(blocks)[:, None] / time)
    added = variance * (1.0 - decay**2)
    stops = rests & ~np.vstack([np.ones((1, rests.shape[1]), bool), rests[:-1]]) & (moved > 0.5)
    decay[stops] = STOP_DECAY
    anew = np.broadcast_to((STOP_SHARE * noise.dry) ** 2, variance.shape)
    added[stops] = anew[stops]
    decay[0] = 0.0
    added[0] = variance[0] + np.where(rests[0], anew[0], 0.0)
    white = np.where(blocks.known[:, None], noise.white, UNKNOWN)
    # 12.5 blocks of 24 ms: the clock's last digit decides nothing.
    reach = max(round(SPIKE_REACH / length - TIE), 1)
    spikes = np.where(near(~rests, reach), SPIKES_MOVING, SPIKES_RESTING)
    return ErrorCourse(decay, added, white, spikes)


def moved_before(moving: Mask, count: int) -> Array:
    """Share of the `count` blocks before each in which a joint moved. (K, n)"""
    total = np.vstack([np.zeros((1, moving.shape[1])), np.cumsum(moving, axis=0)])
    first = np.maximum(np.arange(len(moving)) - count, 0)
    many = np.maximum(np.arange(len(moving)) - first, 1)
    share: Array = (total[:-1] - total[first]) / many[:, None]
    return share
