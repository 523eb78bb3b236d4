"""Motion that nobody touched, named or inferred: noise, level, smallest force."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np

from vftcli.bias.whole_log import WholeLogBias
from vftcli.contacts.windows import LEAST_IN_MOTION, MARGIN, contact_lanes, smooth_lanes
from vftcli.free_motion.free_motion import FreeLoad, FreeMotion, FreePart, free_load, without_load
from vftcli.observers.paper import MomentumObserver
from vftcli.observers.spectra import looks_free, spectra_of
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.friction import NEAR_REST_SHARE, dry_torques
from vftcli.robots.run import Run, RunSamples
from vftcli.robots.terms import Blocks, disturbance_blocks
from vftcli.signals.arrays import (
    Z_95,
    Array,
    Mask,
    covered,
    intervals,
    median_step,
    near,
    runs_of,
)
from vftcli.signals.errors import ParameterError, ReferenceTorqueError
from vftcli.signals.estimation import robust_sd
from vftcli.signals.remarks import Remark, Where, fact
from vftcli.signals.rest import NEAR_REST, REST, faster, slower
from vftcli.wrench.model_error import (
    DRY_SHARE,
    LEAST_ERROR,
    ErrorProcess,
    TorqueNoise,
    error_process,
    infer_noise,
    innovations,
    learn_noise,
)
from vftcli.wrench.smoother import (
    BLOCK,
    BlockLog,
    WrenchPrior,
    contact_block,
    deviations,
    in_blocks,
)

GAIN = 30.0  #: Gain of the momentum observer. [1/s]
#: Block of short contacts: longer ones cut the peak. [s]
FINE = 0.008
SETTLED = 0.3  #: Start of a log that the observer is left. [s]
LEVEL = 4.0  #: SDs of a joint's torque beyond which it is touched.
#: Least length of a touch, and the pause that joins two. [s]
LASTING, NEAR = 0.05, 0.2
LEAST_MOVING = 50  #: Fewest samples in motion for a level of a joint.
#: Basis that tells contact from model error.
Basis = Literal["free motion", "whole log", "friction", "none"]
#: Remarks of the whole log's fit on one that is too short.
SHORT_LOG = {"whole-log-too-short", "whole-log-friction-unclear"}
#: Fewest whole cycles of which free ones can be found.
LEAST_CYCLES = 2
#: Length of contacts made up in free motion [s], and most of them.
PSEUDO, MOST_PSEUDO = 0.6, 48


@dataclass(frozen=True, eq=False)
class FreeStatistics:
    """Noise and level of motion that nobody touched."""

    noise: TorqueNoise  #: Noise and model error.
    level: Array  #: SD of the momentum observer's torque in it. (n,) [N·m]
    own: Mask  #: Samples of the log itself that are free. (T,)
    #: The log, less its load and model error.
    log: Run
    free: tuple[RunSamples, ...]  #: Every free piece, less its load.
    #: A load that the model lacks, None where none shows.
    load: FreeLoad | None
    #: Its origin, and a load that it carries.
    remarks: tuple[Remark, ...]
    basis: Basis = "free motion"  #: Tells contact from model error.

    @property
    def seconds(self) -> float:
        """Length of a block. [s]"""
        return contact_block(self.log.t)

    @cached_property
    def fine(self) -> "tuple[FreeStatistics, Blocks] | None":
        """Its noise, and the log, in finer blocks; None if none are finer."""
        seconds, run = max(FINE, self.log.step), self.log
        # On a clock that jitters blocks are as short as they may be.
        if not seconds < 0.7 * self.seconds <= 0.7 * BLOCK:
            return None
        noise = noise_of(run, self.free, seconds, known=self.basis == "free motion")
        if noise is None:
            return None
        return replace(self, noise=noise), disturbance_blocks(run.terms, run.q, seconds)


def free_statistics(motion: FreeMotion, bias: WholeLogBias) -> FreeStatistics | None:
    """Statistics of a log's free motion; None if none is known."""
    part = free_part(motion)
    if part is None:
        return None
    load = free_load(part.pieces)
    # An unknown load is no noise: contacts are found beside it.
    log = without_load(bias.corrected(motion.log), load)
    pieces = tuple(
        p._replace(run=log if p.run is motion.log else without_load(bias.of(p.run), load))
        for p in part.pieces
    )
    noise = noise_of(log, pieces, contact_block(log.t), known=True)
    if noise is None:
        return None
    return FreeStatistics(
        noise=noise,
        level=torque_level(pieces),
        own=part.own,
        log=log,
        free=pieces,
        load=load if part.own.any() else None,
        remarks=part.remarks if load is None else (*part.remarks, load.remark),
    )


def inferred_statistics(log: Run, bias: WholeLogBias) -> FreeStatistics | None:
    """Statistics of a log without known free motion, or None.

    None without dry friction where no whole joint is corrected.
    """
    if not (dry_torques(log.robot).any() or (bias.weight >= 1.0).any()):
        return None
    corrected = bias.corrected(log)
    short = any(remark.code in SHORT_LOG for remark in bias.remarks)
    # An arm that holds one pose does not tell a mass from a push.
    weighed = free_load([RunSamples(corrected, bias.free)]) if bias.fitted or short else None
    corrected = without_load(corrected, weighed)
    free = (RunSamples(corrected, bias.free),) if bias.fitted else ()
    noise = noise_of(corrected, free, contact_block(log.t), known=False)
    if noise is None:
        return None
    return FreeStatistics(
        basis="whole log" if bias.fitted else "friction",
        noise=noise,
        level=np.sqrt(noise.variance + observer_noise(corrected) ** 2),
        own=np.zeros(log.recording.samples, bool),
        log=corrected,
        free=free,
        load=weighed,
        remarks=() if weighed is None else (weighed.remark,),
    )


def noise_of(
    log: Run, pieces: Sequence[RunSamples], seconds: float, *, known: bool
) -> TorqueNoise | None:
    """Noise of free pieces, else of the log, in blocks of a length [s]."""
    dry = dry_torques(log.robot)
    learned = learn_noise(blocks_of(pieces, seconds), dry)
    if known:
        return learned
    return infer_noise(disturbance_blocks(log.terms, log.q, seconds), dry, learned)


def blocks_of(pieces: Sequence[RunSamples], seconds: float) -> list[Blocks]:
    """Free pieces in blocks of a length [s]."""
    return [disturbance_blocks(run.terms, run.q, seconds, inside) for run, inside in pieces]


def free_part(motion: FreeMotion) -> FreePart | None:
    """The free part of a log; None without one, or if it is doubtful."""
    try:
        part = motion.known
    except ReferenceTorqueError:  # nothing repeats for long enough
        if motion.choice.is_given:
            raise
        return None
    log, own = motion.log, part.own
    if part.doubted:
        if motion.cycles.whole < LEAST_CYCLES or not motion.free_cycles.numbers:
            return None
        # Touched: beyond friction, and no quieter than the rest.
        if (beyond_threshold(log, LEAST_ERROR) & own).any():
            with suppress(ParameterError):  # too short for a spectrum
                if not looks_free(spectra_of(RunSamples(log, ~own), [RunSamples(log, own)])):
                    return None
    runs = (fact("free-log", Where(about=run.recording.name)) for run in motion.runs)
    return part._replace(remarks=(*part.remarks, *runs))


def beyond_threshold(run: Run, level: Array | float) -> Mask:
    """Samples with a joint's torque beyond `LEVEL` SDs for a while.

    The SD is the level (n,) [N·m]; at rest and around it stiction adds to it. (T,)
    """
    t, dry = run.t, dry_torques(run.robot)
    sd = np.maximum(level, DRY_SHARE * dry)
    close = near(slower(run.dq), max(round(NEAR_REST / median_step(t)), 1))
    sd = np.where(close, np.maximum(sd, NEAR_REST_SHARE * dry), sd)
    above = np.any(abs(observed(run)) > LEVEL * sd, axis=1)
    settled: Mask = t >= t[0] + SETTLED
    return covered(intervals(t, above, least=LASTING, gap=NEAR), len(t)) & settled


def observed(run: Run) -> Array:
    """The momentum observer's torque along a log. (T, n) [N·m]"""
    return MomentumObserver(gain=GAIN).estimate(run.terms).tau


def observer_noise(run: Run) -> Array:
    """SD of the observer torque's noise, touched or not. (n,) [N·m]

    From second differences, of six times white noise's variance: pushes last longer.
    """
    torque = observed(run)
    step = max(round(2.0 / (GAIN * median_step(run.t))), 1)
    bends = torque[2 * step :] - 2.0 * torque[step:-step] + torque[: -2 * step]
    return np.asarray(robust_sd(bends) / np.sqrt(6.0))


def torque_level(pieces: Sequence[RunSamples]) -> Array:
    """q95|τ|/1.96 of each joint over its free samples in motion. (n,) [N·m]"""
    uses = [(run, inside & (run.t >= run.t[0] + SETTLED)) for run, inside in pieces]
    torque = abs(np.concatenate([observed(run)[use] for run, use in uses]))
    moving = np.concatenate([faster(run.dq[use], REST) for run, use in uses])
    if not len(torque):
        return np.zeros(torque.shape[1])
    moving |= moving.sum(axis=0) < LEAST_MOVING
    within = np.where(moving, torque, np.nan)
    return np.nanquantile(within, 0.95, axis=0) / Z_95


def self_test(free: FreeStatistics, prior: WrenchPrior) -> Array:
    """Factor ≥ 1 on each axis' SD that holds 95 % of made-up contacts. (6,)"""
    shares = []
    each = max(MOST_PSEUDO // max(len(free.free), 1), 4)
    for blocks in blocks_of(free.free, free.seconds):
        # Runs of known blocks, half as much around each.
        long = max(round(PSEUDO / np.median(blocks.length)), 1)
        half = (long + 1) // 2
        made_up = [
            (k, k + long)
            for start, stop in runs_of(blocks.known)
            for k in range(start + half, stop - long - half + 1, long)
        ]
        made_up = made_up[:: max(len(made_up) // each, 1)][:each]
        process = error_process(free.noise, blocks, covered(made_up, len(blocks.t), 1))
        log = BlockLog(blocks, process)
        J = in_blocks(flange_jacobian(free.log.robot.loaded_chain, blocks.q))
        # Each alone: nobody touches the others.
        lanes = (lane for run in made_up for lane in contact_lanes(log, [run], J))
        wrenches = smooth_lanes(lanes, [prior] * len(made_up))
        for run, wrench in zip(made_up, wrenches, strict=True):
            inside = wrench.within(run)
            sd = np.maximum(deviations(inside.covariance), 1e-12)
            shares.append(abs(inside.values) / sd)
    if not shares:
        return np.ones(6)
    return np.maximum(np.quantile(np.concatenate(shares), 0.95, axis=0) / Z_95, 1.0)


def listed_force(free: FreeStatistics, log: BlockLog, least: float, untold: Mask) -> float:
    """The force that lists 95 % of trial pushes at the flange. [N]

    Of evidence ½F² Σν²/S, ν of 1 N, for `PSEUDO`; at rest F_c must give way first.
    """
    blocks, process = log
    count = len(blocks.t)
    edge, long = (round(seconds / free.seconds) for seconds in (MARGIN, PSEUDO))
    starts = np.linspace(0, max(count - long, 0), MOST_PSEUDO).astype(int)
    number = np.arange(-edge, long + edge)[:, None]
    at, inside = np.clip(starts + number, 0, count - 1), (number >= 0) & (number < long)
    middle = at[len(at) // 2]
    rests, chain = blocks.rests[middle], free.log.robot.loaded_chain
    axes = np.linalg.qr(np.random.default_rng(0).normal(size=(MOST_PSEUDO, 3, 3)))[0]
    torque = axes @ flange_jacobian(chain, blocks.q[middle])[:, :3]
    decay, added, *others = (x[at, None].repeat(3, axis=2) for x in process)
    added[0] /= np.maximum(1.0 - decay[0] ** 2, 1e-9)
    process = ErrorProcess(decay, added, *others)
    square, _ = innovations(inside[..., None, None] * torque, process)
    limit = np.where((rests | ~untold).all(axis=1), least, LEAST_IN_MOTION)
    force = np.sqrt(2.0 * limit[:, None] / square.sum(axis=(0, 3)))
    held = (rests * free.noise.dry)[:, None] / np.maximum(abs(torque), 1e-9)
    return float(np.quantile(np.maximum(force, held.min(axis=2)), 0.95))
