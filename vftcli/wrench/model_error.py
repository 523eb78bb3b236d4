"""The model error b: of each joint d = b + n where nobody touches the arm.

n is white of variance R, b an Ornstein–Uhlenbeck process of variance s² and correlation
time T. Over blocks of B seconds the spectrum of d is

    S(f) = B [R + s² (1 − a²)/(1 − 2a cos 2πfB + a²)],    a = exp(−B/T),

and the free part's periodogram P fixes the three by Whittle's likelihood, Σ ln S + P/S.

The smoother of a whole log uses b as it is (`torque_noise`). A list of contacts models it
closer (`learn_noise`, `error_process`): learned without reversals, inflated by the tails,
stiction drawn anew where a joint comes to rest. In both n has a share of the dry friction
where a moving joint turns round.

References:
    P. Whittle, "Estimation and information in stationary time series", Arkiv för Matematik 2, 1953.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.robots.friction import (
    CREEP_SHARE,
    PUSHED_SHARE,
    REST_SHARE,
    STOP_SHARE,
    dry_torques,
)
from vftcli.robots.robot import Robot
from vftcli.robots.run import RunSamples
from vftcli.robots.terms import TIE, Blocks, disturbance_blocks
from vftcli.signals.arrays import Array, Mask, grown, median, near, runs_of, summed
from vftcli.signals.estimation import SPIKE, LinearModel, filtered, robust_sd
from vftcli.signals.rest import NEAR_REST
from vftcli.wrench.solvers import TORQUE_SD

REST_TIME = 2.0  #: Stiction keeps its state at least this long. [s]
#: Time in which a push re-settles the stiction of a joint at rest. [s]
PUSHED_TIME = 0.3
#: Factor on the variance of rest that such a push adds to motion.
RESETTLED = (PUSHED_SHARE / REST_SHARE) ** 2
#: A joint that moves in less than the share `SEEN` of the free blocks: its model error in
#: motion as a share of F_c, and the least correlation time. [s]
UNSEEN_SHARE, UNSEEN_TIME, SEEN = 0.2, 1.0, 0.2
#: Prior of the correlation time T: its median [s] and the spread of ln T.
USUAL_TIME, TIME_SPREAD = 0.5, 1.5
LEAST_NOISE = 1e-6  #: Smallest R: a millinewton-metre, far below any drive's. [(N·m)²]
#: Shortest unbroken stretch of the free part that has a spectrum, in blocks.
LEAST_BLOCKS = 20
LONG = 8192  #: Least length of the stretches of a long piece, in blocks.
ASSUMED_SHARE = 0.2  #: Model error of motion as a share of F_c, without a free part.
#: Share of blocks in which a joint moves, to bridge reversals.
MOVES = 0.3
#: Shares of the squares ν²/S, and their χ² of one degree.
QUANTILES = (0.9, 2.706), (0.97, 4.709)
#: Smallest inferred model error without known free motion: this share of F_c, this much
#: [N·m]; and its least correlation time there. [s]
DRY_SHARE, LEAST_ERROR, LEAST_TIME = 0.2, 0.1, 0.3
#: Without learned noise the quietest 60 % of the blocks in motion count as free; 60 % of
#: a normal variable lie within so many SDs.
QUIET, QUIET_SD = 0.6, 0.8416
#: Share of b that is left when a joint comes to rest.
STOP_DECAY = np.exp(-5.0)
#: A joint stops if it moved for more than half of this time before; for this time after
#: a start b changes within `START_TIME`. [s]
RECENT = 0.1
START_TIME = 0.05  #: Correlation time of b while a joint breaks away. [s]
#: Rate of spikes within so long [s] of motion, and at rest.
SPIKES_MOVING, SPIKES_RESTING, SPIKE_REACH = 0.01, 1e-5, 0.3
UNKNOWN = 1e9  #: Variance of the white noise of a block that says nothing. [(N·m)²]


class TorqueNoise(NamedTuple):
    """White noise and model error of every joint, by blocks of one length."""

    white: Array  #: R, variance of the white noise. (n,) [(N·m)²]
    variance: Array  #: s² of motion that the free part shows. (n,) [(N·m)²]
    time: Array  #: T, its correlation time. (n,) [s]
    dry: Array  #: F_c. (n,) [N·m]
    #: Whether the free part moved the joint; else friction adds to its error. (n,)
    seen: Mask
    at_rest: Array  #: Variance that rest adds. (n,) [(N·m)²]
    pushed: Array  #: Variance that rest under a contact adds. (n,) [(N·m)²]
    near: float = 0.0  #: Reach of rest before and after itself. [s]
    #: Length of the free motion behind it; 0 where it is assumed. [s]
    free_seconds: float = 0.0

    @property
    def moving(self) -> Array:
        """Variance of the model error in motion. (n,) [(N·m)²]"""
        return self.variance + ~self.seen * (UNSEEN_SHARE * self.dry) ** 2

    @property
    def moving_time(self) -> Array:
        """Its correlation time. (n,) [s]"""
        return np.where(self.seen, self.time, np.maximum(self.time, UNSEEN_TIME))

    def stationary(self, blocks: Blocks, touched: Mask | None = None) -> tuple[Array, Array]:
        """Variance and time of b in blocks; `touched` ones may re-settle. (K, n) each"""
        rests = np.column_stack([grown(blocks.t, rest, self.near) for rest in blocks.rests.T])
        held = blocks.rests & (False if touched is None else touched[:, None])
        variance = np.where(rests, self.variance + self.at_rest, self.moving)
        time = np.where(rests, np.maximum(self.time, REST_TIME), self.moving_time)
        return (
            np.where(held, self.variance + self.pushed, variance),
            np.where(held, PUSHED_TIME, time),
        )


def steps(blocks: Blocks) -> Array:
    """Time from the middle of the block before; 0 for the first. (K,) [s]"""
    return np.diff(blocks.t, prepend=blocks.t[:1])


def torque_noise(
    log: Blocks, free: Sequence[RunSamples], robot: Robot, seconds: float
) -> TorqueNoise:
    """Noise of a whole log: from free motion of this log or of others, else assumed.

    At rest the model error is at least `REST_SHARE` of the dry friction: stiction keeps
    the last motion's, or the last touch's, state. The free part counts from its first
    motion to its last, since rest has its own model error; a piece without motion counts
    whole. Without any, the model error is a share of the dry friction, and the white noise
    the difference of neighbouring blocks.
    """
    dry, pieces = dry_torques(robot), []
    for run, inside in free:
        blocks = disturbance_blocks(run.terms, run.q, seconds, inside)
        motion = np.flatnonzero(blocks.known & ~blocks.rests.all(axis=1))
        ends = (motion[0], motion[-1] + 1) if len(motion) else (0, len(blocks.t))
        pieces += long_stretches(blocks.part(slice(*ends)))
    if pieces:
        noise = fitted_noise(pieces, dry)
        resting = np.maximum(noise.variance, (REST_SHARE * dry) ** 2)
        unseen = ~noise.seen * (UNSEEN_SHARE * dry) ** 2
        pushed = unseen + RESETTLED * resting
        return noise._replace(at_rest=resting - noise.variance, pushed=pushed)
    moving, rest = (np.maximum(share * dry, TORQUE_SD) for share in (ASSUMED_SHARE, REST_SHARE))
    bend = log.d[1:-1] - 0.5 * (log.d[2:] + log.d[:-2])
    # The median square of a normal variable is .455 of its mean square; the bend has 1.5 R.
    white = np.median(bend**2, axis=0) / (0.455 * 1.5) if len(bend) else TORQUE_SD**2 + 0.0 * dry
    return TorqueNoise(
        white=np.maximum(white, LEAST_NOISE),
        variance=moving**2,
        time=np.full(len(dry), USUAL_TIME),
        dry=dry,
        seen=np.ones(len(dry), bool),
        at_rest=rest**2 - moving**2,
        pushed=RESETTLED * rest**2,
        near=NEAR_REST,
    )


def learn_noise(free: Sequence[Blocks], dry: Array) -> TorqueNoise | None:
    """Noise of free pieces for a list of contacts, None without a long stretch."""
    pieces = [stretch for piece in free for stretch in long_stretches(piece)]
    if not pieces:
        return None
    share = (~np.concatenate([piece.rests for piece in pieces])).mean(axis=0)
    noise = fitted_noise([without_reversals(piece, share > MOVES) for piece in pieces], dry)
    # The innovations' tails, those where joints turn round too, may exceed the spectrum.
    each = []
    for piece in pieces:
        process = error_process(noise, piece)._replace(white=noise.white + 0.0 * piece.d)
        # Stretches of a long piece go side by side, each begun with what b is like anywhere.
        count = len(piece.d) // LONG or 1
        used = slice(len(piece.d) // count * count)
        d, decay, added, *rest = (
            np.stack(np.split(x[used], count), axis=1) for x in (piece.d, *process)
        )
        added[0] /= np.maximum(1.0 - decay[0] ** 2, 1e-9)
        stretches = innovations(d, ErrorProcess(decay, added, *rest))[0]
        each.append(np.concatenate(stretches))
    squares = np.concatenate(each)
    asked = [np.quantile(squares, share, axis=0) / value for share, value in QUANTILES]
    factor = np.maximum(np.max(asked, axis=0), 1.0)
    return noise._replace(white=noise.white * factor, variance=noise.variance * factor)


def infer_noise(log: Blocks, dry: Array, learned: TorqueNoise | None) -> TorqueNoise | None:
    """Noise of a log without known free motion, None in too few blocks."""
    bends = [np.diff(log.d[a:b], n=2, axis=0) for a, b in runs_of(log.known) if b - a > 2]
    if not bends:
        return None
    # A second difference of white noise has 6 R.
    white = np.maximum(robust_sd(np.concatenate(bends)) ** 2 / 6.0, LEAST_NOISE)
    least = np.maximum(DRY_SHARE * dry, LEAST_ERROR)
    moving = log.known[:, None] & ~log.rests
    asked = moving.mean(axis=0) >= SEEN
    if learned is not None:
        # The fit's friction is a floor, if it has any.
        asked &= DRY_SHARE * dry < LEAST_ERROR
    for j in np.flatnonzero(asked):
        quiet = np.quantile(abs(log.d[moving[:, j], j]), QUIET) / QUIET_SD
        least[j] = max(least[j], quiet)
    variance, time, seconds = least**2, np.full(len(dry), LEAST_TIME), 0.0
    if learned is not None:
        white, variance = np.maximum(white, learned.white), np.maximum(learned.variance, variance)
        floored = variance > learned.variance
        time = np.where(floored, np.maximum(learned.time, LEAST_TIME), learned.time)
        seconds = learned.free_seconds
    return TorqueNoise(
        white=white,
        variance=variance,
        time=time,
        dry=dry,
        seen=np.ones(len(dry), bool),
        at_rest=(CREEP_SHARE * dry) ** 2,
        pushed=(PUSHED_SHARE * dry) ** 2,
        free_seconds=seconds,
    )


def fitted_noise(stretches: Sequence[Blocks], dry: Array) -> TorqueNoise:
    """Noise by Whittle's likelihood over all stretches together, joint by joint."""
    whole = Blocks(*map(np.concatenate, zip(*stretches, strict=True)))
    # A block holds whole samples: its length differs a little.
    seconds = median(whole.length)
    f = np.concatenate([np.fft.rfftfreq(len(s.d), seconds)[1:] for s in stretches])
    P = np.concatenate([periodogram(s.d, seconds) for s in stretches])
    longest = max(s.length.sum() for s in stretches)
    white, variance, time = np.transpose([fit_spectrum(f, p, seconds, longest) for p in P.T])
    return TorqueNoise(
        white=white,
        variance=variance + whole.d.mean(axis=0) ** 2,  # an offset is an error too
        time=time,
        dry=dry,
        seen=(~whole.rests).mean(axis=0) >= SEEN,
        at_rest=(CREEP_SHARE * dry) ** 2,
        pushed=(PUSHED_SHARE * dry) ** 2,
        free_seconds=whole.length.sum(),
    )


def long_stretches(blocks: Blocks) -> list[Blocks]:
    """The stretches of known blocks long enough for a spectrum."""
    runs = [run for run in runs_of(blocks.known) if run[1] - run[0] >= LEAST_BLOCKS]
    return [blocks.part(slice(*run)) for run in runs]


def without_reversals(piece: Blocks, joints: Mask) -> Blocks:
    """The blocks with the given joints' d bridged in a line where they rest."""
    d, moves = piece.d.copy(), ~piece.rests
    for j in np.flatnonzero(joints & moves.any(axis=0)):
        d[:, j] = np.interp(piece.t, piece.t[moves[:, j]], d[moves[:, j], j])
    return piece._replace(d=d)


def periodogram(d: Array, seconds: float) -> Array:
    """Two-sided periodogram at the positive frequencies. (N//2, n) [(N·m)²/Hz]"""
    spectrum = np.fft.rfft(d, axis=0)[1:]
    return (spectrum.real**2 + spectrum.imag**2) * (seconds / len(d))


def fit_spectrum(
    f: Array, P: Array, seconds: float, longest: float
) -> tuple[float, float, float]:
    """R, s² and T of one joint, by a grid over ln T and ln s²/R, narrowed five times.

    The level follows in closed form: two numbers are searched. No correlation time is
    longer than the longest stretch. Units are Hz, (N·m)²/Hz and s.
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
        cost = np.log(S).sum(axis=2) + len(f) * np.log(np.maximum(levels, LEAST_NOISE**2))
        cost += 0.5 * ((times[:, None] - np.log(USUAL_TIME)) / TIME_SPREAD) ** 2
        i, j = np.unravel_index(cost.argmin(), cost.shape)
        best, level = np.array([times[i], ratios[j]]), levels[i, j]
        reach = (high - low) / (count - 1)
        low, high = np.maximum(low, best - reach), np.minimum(high, best + reach)
        count = 5
    time, ratio = np.exp(best)
    return max(level, LEAST_NOISE), level * ratio, time


class ErrorProcess(NamedTuple):
    """State-space model of b: decay, added variance and white noise of every block."""

    decay: Array  #: Share of b that is kept from the block before. (K, n)
    added: Array  #: Variance that is added. (K, n) [(N·m)²]
    white: Array  #: R, `UNKNOWN` of a hidden block. (K, n) [(N·m)²]
    spikes: Array  #: Rate of spikes among innovations. (K, n)

    def hiding(self, hidden: Mask) -> "ErrorProcess":
        """The process with some blocks (K,) hidden."""
        return self._replace(white=np.where(hidden[:, None], UNKNOWN, self.white))


def steady_process(
    noise: TorqueNoise, blocks: Blocks, touched: Mask | None = None, starts: Mask | None = None
) -> ErrorProcess:
    """Process of b without stops and spikes; `starts` (K, n) shorten its time.

    In the `touched` blocks (K,) a contact may re-settle stiction at rest.
    """
    variance, time = noise.stationary(blocks, touched)
    if starts is not None:
        time = np.where(starts, np.minimum(time, START_TIME), time)
    decay = np.exp(-steps(blocks)[:, None] / time)
    decay[0] = 0.0
    # Where a moving joint turns round its dry friction may be any.
    v, turns = np.where(blocks.rests, 0.0, blocks.velocity), np.zeros(decay.shape)
    turns[1:-1] = v[:-2] * v[2:] < 0.0
    turned = turns * (CREEP_SHARE * noise.dry) ** 2
    white = np.where(blocks.known[:, None], noise.white + turned, UNKNOWN)
    return ErrorProcess(decay, variance * (1.0 - decay**2), white, np.zeros(decay.shape))


def error_process(
    noise: TorqueNoise, blocks: Blocks, touched: Mask | None = None
) -> ErrorProcess:
    """Process of b; `touched` blocks (K,) may re-settle stiction at rest."""
    rests, length = blocks.rests, np.median(blocks.length)
    # Share of the `RECENT` blocks before each in which a joint moved.
    count, k = max(round(RECENT / length), 1), np.arange(len(rests))
    total, first = summed(~rests), np.maximum(k - count, 0)
    moved = (total[:-1] - total[first]) / np.maximum(k - first, 1)[:, None]
    process = steady_process(noise, blocks, touched, ~rests & (moved < 1.0))
    stops, anew = rests & (moved > 0.5), (STOP_SHARE * noise.dry) ** 2
    stops[1:] &= ~rests[:-1]
    process.decay[stops] = STOP_DECAY
    np.copyto(process.added, anew, where=stops)
    process.added[0] += rests[0] * anew
    # 12.5 blocks of 24 ms: the clock's last digit decides nothing.
    reach = max(round(SPIKE_REACH / length - TIE), 1)
    spikes = np.where(near(~rests, reach), SPIKES_MOVING, SPIKES_RESTING)
    return process._replace(spikes=spikes)


def error_model(d: Array, process: ErrorProcess) -> LinearModel:
    """The model of b alone, each joint for itself, from mean disturbances d (K, …, n)."""
    own = (each[..., None] for each in (process.white, process.decay, process.added))
    return LinearModel(d[..., None], np.ones((*d.shape, 1, 1)), *own)


def spike_limit(spikes: Array) -> Array:
    """ν²/S above which an innovation is likelier a spike, by its rate. (K, …, n)"""
    with np.errstate(divide="ignore"):
        odds = np.log(spikes) - np.log1p(-spikes)
    return np.asarray((np.log(SPIKE) - 2.0 * odds) / (1.0 - 1.0 / SPIKE))


def innovations(d: Array, process: ErrorProcess) -> tuple[Array, Array]:
    """ν²/S of every joint's own model, and S, by the rate of spikes. (K, …, n) each"""
    blocks = filtered(error_model(d, process), spike_limit(process.spikes))
    each = [(block.square, block.spread[..., 0, 0]) for block in blocks]
    squares, spreads = (np.array(series) for series in zip(*each, strict=True))
    return squares, spreads


def spiked_white(d: Array, process: ErrorProcess) -> Array:
    """R of every block, spikes included, for d (K, n). (K, n) [(N·m)²]"""
    squares, spreads = innovations(d, process)
    spiked = squares > spike_limit(process.spikes)
    return process.white + np.where(spiked, (SPIKE - 1.0) * spreads, 0.0)
