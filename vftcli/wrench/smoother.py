"""The wrench smoother: a linear model of wrench and model error along a log.

    d = Jᵀw + b + n: block averages, noise, prior, filter and smoother in a row.

Wrench and model error are separated by how they move: the error as the free part shows it,
the wrench as its prior says. Where a force turns no joint the estimate rests on its past
and future, and its band grows.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from vftcli.free_motion.free_motion import FreeLoad
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.run import Run, RunSamples
from vftcli.robots.terms import TIE, Blocks, disturbance_blocks
from vftcli.signals.arrays import (
    Array,
    Mask,
    around,
    covered,
    median_step,
    resample_columns,
    runs_of,
)
from vftcli.signals.errors import RobotError
from vftcli.signals.estimation import LinearModel, log_likelihood, smoothed
from vftcli.signals.remarks import Remark, Where, caution, fact
from vftcli.wrench.model_error import (
    UNKNOWN,
    ErrorProcess,
    TorqueNoise,
    steady_process,
    steps,
    torque_noise,
)

COARSE = 0.1  #: Length of a block for steady loads, and for the choice of the prior. [s]
#: Length of a block where the wrench moves [s]; on a clock with one step in ten off by more
#: than this share it holds so many samples.
BLOCK, UNEVEN, SAMPLES = 0.024, 0.1, 5
#: Longer logs have longer blocks: each needs some 6 kB and .1 ms.
MOST_BLOCKS = 30_000
#: Factors on the model's own SDs of force and moment: friction's error is not
#: Gaussian. Chosen once on six simulated seeds, for all logs.
WIDENED = np.repeat([1.5, 2.0], 3)
DRIVES = 0.03  #: Error of the drives' constants, as a share of a reading.
#: Share of the bend, of a block less the mean of its neighbours, that the blocks may hide of
#: a peak, or between two of them.
BENT = 0.25
#: Outside the listed contacts the band is that of a contact of this length, that of the
#: made-up contacts in free motion that give the smallest force. [s]
UNLISTED = 0.6
#: Factor on the force's SD to measure a size: peaks exceed the mean behind
#: it, and would shrink.
LOOSER = 1.5
LEVER = 0.1  #: SD of a moment over that of the force. [m]
#: Correlation times of a wrench that are tried. [s]
TIMES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)
FORCES = (10.0, 30.0, 60.0)  #: SDs of a force that are tried. [N]
STEADY = 30.0  #: A wrench of at least this correlation time is a load, … [s]
#: … if its change in a second is no more than this (one SD). [N]
LOAD_CHANGE = 5.0


class WrenchPrior(NamedTuple):
    """An Ornstein–Uhlenbeck prior of the wrench in base axes."""

    time: float  #: Correlation time τ_w. [s]
    force: float  #: SD σ_f of each component of the force. [N]
    #: That of the moment; None for `LEVER` times the force. [N·m]
    moment: float | None = None

    @property
    def is_steady(self) -> bool:
        """Whether it is the prior of a load, not of contacts that come and go."""
        # Change of the force in a second, short against τ_w.
        change = self.force * np.sqrt(2.0 / self.time)
        return self.time >= STEADY and change <= LOAD_CHANGE

    @property
    def looser(self) -> "WrenchPrior":
        """The prior under which the size of a contact is measured."""
        return self._replace(force=LOOSER * self.force)

    @property
    def variance(self) -> Array:
        """Stationary variance of force and moment. (6,) [N², (N·m)²]"""
        moment = LEVER * self.force if self.moment is None else self.moment
        return np.repeat([self.force**2, moment**2], 3)

    def process(self, inside: Mask, step: Array) -> tuple[Array, Array]:
        """Share kept from the block before, and variance added. (K, 1), (K, 6)

        None is kept where the gate opens, and outside, where none is added either.
        """
        goes_on = inside & np.concatenate([[False], inside[:-1]])
        kept = np.where(goes_on, np.exp(-step / self.time), 0.0)[:, None]
        return kept, np.where(inside[:, None], self.variance * (1.0 - kept**2), 0.0)


#: The priors that are tried.
GRID = tuple(WrenchPrior(time, force) for time in TIMES for force in FORCES)


BlockSpan = tuple[int, int]  #: Number of the first block, and of the one behind the last.


class BlockLog(NamedTuple):
    """A log in blocks, with its model error."""

    blocks: Blocks  #: The blocks.
    process: ErrorProcess  #: b along them.


JacobianIn = Callable[[int, int], Array]  #: First, end of some blocks → J. (k, 6, n)


def in_blocks(jacobian: Array) -> JacobianIn:
    """J of the blocks asked for, from that of all. (K, 6, n)"""
    return lambda first, last: jacobian[first:last]


class Lane(NamedTuple):
    """One hypothesis on one window."""

    log: BlockLog  #: The blocks of its window. (k)
    window: BlockSpan  #: Which of the log they are.
    gate: Mask  #: Those in which a wrench may act. (k,)
    jacobian: JacobianIn  #: J along the log.
    prior: WrenchPrior | None  #: Prior of the wrench; None without contact.


def assembled(lanes: Sequence[Lane]) -> LinearModel:
    """Wrench w and model error b of lanes: d = Jᵀw + b + noise. (K, L, 6 + n)

    Shorter lanes end in hidden blocks, to which no b goes on. Outside its gate the wrench is
    zero; the first block inside starts it with the prior's variance, independent of before.
    """
    n, longest, count = (
        lanes[0].log.blocks.d.shape[1],
        max(len(x.gate) for x in lanes),
        len(lanes),
    )
    # Arrays alike in all lanes are held once: G priors of a long log would not fit.
    alike = all(a is b for lane in lanes for a, b in zip(lane[:4], lanes[0][:4], strict=True))
    each = 1 if alike else count
    # A wrench and an error a joint: H is [J; 1].
    d, observation = np.zeros((longest, each, n)), np.zeros((longest, each, 6 + n, n))
    observation[..., 6:, :] = np.eye(n)
    white = np.full((longest, each, n), UNKNOWN)
    decay, added = np.zeros((2, longest, count, 6 + n))
    for i, ((blocks, process), window, gate, jacobian_in, prior) in enumerate(lanes):
        own = slice(len(gate)), i
        decay[*own, 6:], added[*own, 6:] = process.decay, process.added
        if prior is not None:
            decay[*own, :6], added[*own, :6] = prior.process(gate, steps(blocks))
        if i < each:
            d[own], white[own] = blocks.d, process.white
            if prior is not None:
                observation[*own, :6] = jacobian_in(*window)
    # A window begins with the stationary b.
    added[0, :, 6:] /= np.maximum(1.0 - decay[0, :, 6:] ** 2, 1e-9)
    decay[0, :, 6:] = 0.0
    return LinearModel(d, observation, white, decay, added)


class BlockModel(NamedTuple):
    """A log in blocks of one length, with its noise and its gate."""

    blocks: Blocks  #: The blocks.
    jacobian: Array  #: J of the flange. (K, 6, n)
    noise: TorqueNoise  #: Noise and model error.
    inside: Mask  #: Blocks in which there may be a wrench. (K,)

    def under(self, priors: Sequence[WrenchPrior]) -> LinearModel:
        """The model of the whole log under each of G priors. (K, G, 6 + n)"""
        # With the whole log a contact, a push and its re-settling look alike.
        touched = None if self.inside.all() else self.inside
        process = steady_process(self.noise, self.blocks, touched)
        log, jacobian = BlockLog(self.blocks, process), in_blocks(self.jacobian)
        whole = log, (0, len(self.inside)), self.inside, jacobian
        return assembled([Lane(*whole, prior) for prior in priors])


def block_model(
    run: Run,
    free: Sequence[RunSamples],
    gate: Sequence[tuple[float, float]] | None,
    seconds: float,
) -> BlockModel:
    """A log in blocks of a length. [s]"""
    blocks = disturbance_blocks(run.terms, run.q, seconds)
    noise = torque_noise(blocks, free, run.robot, seconds)
    jacobian = flange_jacobian(run.robot.chain, blocks.q)
    return BlockModel(blocks, jacobian, noise, gated(blocks, gate))


def gated(blocks: Blocks, intervals: Sequence[tuple[float, float]] | None) -> Mask:
    """Blocks in listed intervals [s] and one beside each; all without a list. (K,)"""
    inside, half = np.full(len(blocks.t), intervals is None), 0.5 * blocks.length
    for start, stop in intervals or ():
        inside |= (blocks.t + half > start) & (blocks.t - half < stop)
    return covered(runs_of(inside), len(inside), 1)


def contact_block(t: Array) -> float:
    """Length of a block where the wrench moves. [s]"""
    usual = median_step(t)
    uneven = np.quantile(abs(np.diff(t) - usual), 0.9) > UNEVEN * usual
    return max(BLOCK, usual * (SAMPLES if uneven else 1))


def block_length(t: Array, *, fine: bool) -> float:
    """Length of a block, fine for a moving wrench, coarse for a load. [s]"""
    length = min(COARSE, contact_block(t)) if fine and len(t) > 1 else COARSE
    return max(length, float(t[-1] - t[0]) / MOST_BLOCKS)


def deviations(covariance: Array) -> Array:
    """SDs of covariances. (T, k)"""
    # A known model error has no variance, within rounding.
    return np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))


class SmoothedWrench(NamedTuple):
    """The wrench in base axes about the flange point, by block, with its model."""

    t: Array  #: Middle of each block. (K,) [s]
    values: Array  #: Force and moment on the robot. (K, 6) [N, N·m]
    #: Their covariance, widened by `WIDENED`, in contacts by the drives and the bend too;
    #: outside the listed ones that of `unlisted`. (K, 6, 6)
    covariance: Array
    #: Blocks that may have a wrench; the others read zero, as far as the pose shows. (K,)
    inside: Mask
    seconds: float  #: Length of a block. [s]
    prior: WrenchPrior  #: Prior of the wrench.
    noise: TorqueNoise  #: Its noise.
    gate: bool  #: Whether contacts were listed; else the whole log is one.
    #: Whether a correction of the model's error was left out; see `sensing.smooth_log`.
    uncorrected: bool = False
    #: A load that the free motion carries, in the wrench with its weight; None without one.
    load: FreeLoad | None = None

    @property
    def sd(self) -> Array:
        """SD in base axes. (K, 6) [N, N·m]"""
        return deviations(self.covariance)

    def unlisted(self, t: Array) -> Mask:
        """Times outside every listed contact; none without a list. (T,)"""
        block = np.searchsorted(self.t + 0.5 * self.seconds, t)
        return ~self.inside[np.minimum(block, len(self.t) - 1)]

    def at(self, t: Array) -> tuple[Array, Array]:
        """Values and SDs at other times, variances straight between blocks. (T, 6)"""
        variance = resample_columns(t, self.t, deviations(self.covariance) ** 2)
        return resample_columns(t, self.t, self.values), np.sqrt(variance)

    @property
    def record(self) -> dict[str, object]:
        """The model's numbers, as `run.json` holds them."""
        noise = self.noise
        return {
            "block_s": self.seconds,
            "force_time_s": self.prior.time,
            "force_sd_N": self.prior.force,
            "noise_sd_Nm": np.sqrt(noise.white).tolist(),
            "model_error_sd_Nm": np.sqrt(noise.moving).tolist(),
            "model_error_time_s": noise.moving_time.tolist(),
            "model_error_at_rest_sd_Nm": np.sqrt(noise.variance + noise.at_rest).tolist(),
            "free_s": noise.free_seconds,
            "gated": self.gate,
            "correction_left_out": self.uncorrected,
            "load_kg": None if self.load is None else self.load.mass,
        }

    def remarks(self, name: str) -> tuple[Remark, ...]:
        """Remarks on the wrench: its noise, correction and load."""
        where, free = Where(name), self.noise.free_seconds
        learned = fact("wrench-noise-learned", where, free_s=free)
        found = [
            fact(
                "wrench-smoothed",
                where,
                block_s=self.seconds,
                time_s=self.prior.time,
                force_N=self.prior.force,
                error_Nm=np.sqrt(self.noise.moving),
            ),
            learned if free else caution("wrench-noise-assumed", where),
        ]
        if self.uncorrected:
            found.append(fact("wrench-uncorrected", where))
        if (load := self.load) is not None:
            found.append(fact("wrench-holds-load", where, load_kg=load.mass, sd_kg=load.sd))
        return tuple(found)


def smooth_wrench(
    run: Run,
    free: Sequence[RunSamples] = (),
    gate: Sequence[tuple[float, float]] | None = None,
    prior: WrenchPrior | None = None,
) -> SmoothedWrench:
    """The wrench at the flange from the whole log, corrected or not, by `BlockModel`.

    Its noise is learned from free motion, else from the drives' dry friction. Outside the gate,
    from and to of every contact [s], the wrench is zero as far as the pose can show; without
    one the whole log is a contact. None chooses the prior by the log's likelihood.
    """
    if run.recording.joints < 6:
        raise RobotError(
            f"{run.recording.joints} joint torques cannot determine the six components of a "
            "wrench; leave --wrench and its options out: use the joint torques"
        )
    if prior is None:
        prior = prior_of(run, free, gate)
    seconds = block_length(run.t, fine=not prior.is_steady)
    model = block_model(run, free, gate, seconds)
    mean, covariance = smoothed(LinearModel(*(series[:, 0] for series in model.under([prior]))))
    values, own, inside = mean[:, :6], covariance[:, :6, :6], model.inside
    widened, listed = np.outer(WIDENED, WIDENED), inside[:, None, None]
    if gate is None:
        own = own * widened
    else:
        own = np.where(listed, own, unlisted(model, prior)) * widened
        own += listed * hidden_by_blocks(values)
    return SmoothedWrench(
        t=model.blocks.t,
        values=values,
        covariance=own,
        inside=inside,
        seconds=seconds,
        prior=prior,
        noise=model.noise,
        gate=gate is not None,
    )


def prior_of(
    run: Run,
    free: Sequence[RunSamples] = (),
    gate: Sequence[tuple[float, float]] | None = None,
) -> WrenchPrior:
    """The prior that makes a log likeliest; arguments as of `smooth_wrench`."""
    model = block_model(run, free, gate, block_length(run.t, fine=False))
    return GRID[log_likelihood(model.under(GRID)).argmax()]


def unlisted(model: BlockModel, prior: WrenchPrior) -> Array:
    """Covariance of a contact of `UNLISTED` seconds about each block. (K, 6, 6)

    The quiet blocks before it leave the model error b with a filter's steady variance,

        p⁺ = p⁻R/(p⁻ + R),    p⁻ = f²p⁺ + v(1 − f²).

    From there to the middle of the contact it grows to a by f and v of a contact's blocks, that
    of the blocks behind to a′, and to u of hidden ones. Together they leave
    c = 1/(1/a + 1/a′ − 1/u), and the wrench has

        (Σ⁻¹ + J (c̄ + R/m)⁻¹ Jᵀ)⁻¹,

    Σ of the prior, c̄ the harmonic mean over the contact's m blocks, valid for all of them.
    """
    blocks, J, noise, _ = model
    # A log of one sample is a block without length.
    R, length = noise.white, np.median(blocks.length) or BLOCK
    count = len(blocks.t)
    half = round(0.5 * UNLISTED / length - TIE)  # 12.5 blocks of 24 ms: rounding decides nothing
    variance, time = noise.stationary(blocks)
    kept = np.exp(-2.0 * length / time)
    added = variance * (1.0 - kept)
    beta = R * (1.0 - kept) - added
    ahead = 0.5 * (np.sqrt(beta**2 + 4.0 * added * R) - beta)
    v, time = noise.stationary(blocks, np.ones(count, bool))
    kept = np.exp(-2.0 * length / time)
    quiet = ahead * R / (ahead + R)
    backward = v[::-1], kept[::-1], half
    behind, nothing = (coasted(each[::-1], *backward)[::-1] for each in (quiet, v))
    known = 1.0 / coasted(quiet, v, kept, half) + 1.0 / behind - 1.0 / nothing
    total, number = around(known, half)
    known = total / number[:, None]
    # Nothing is known in a gap of the clock.
    weight = blocks.known[:, None] / (1.0 / known + R * min(length / UNLISTED, 1.0))
    information = (J * weight[:, None, :]) @ J.swapaxes(1, 2) + np.diag(1.0 / prior.variance)
    return np.asarray(np.linalg.inv(information))


def coasted(quiet: Array, v: Array, kept: Array, count: int) -> Array:
    """Variance of b so many blocks after it was `quiet`; it tends to v. (K, n)"""
    blocks = np.arange(len(v))
    found = np.where((blocks >= count)[:, None], quiet[np.maximum(blocks - count, 0)], v)
    for back in range(count - 1, -1, -1):
        at = np.maximum(blocks - back, 0)
        found = kept[at] * found + (1.0 - kept[at]) * v[at]
    return found


def hidden_by_blocks(values: Array, bent: float = BENT) -> Array:
    """Covariance that drive constants and a share of the bend hide. (K, 6, 6)"""
    walled = np.vstack([values[:1], values, values[-1:]])
    bend = bent * (values - 0.5 * (walled[2:] + walled[:-2]))
    drives = DRIVES * values
    return bend[:, :, None] * bend[:, None, :] + drives[:, :, None] * drives[:, None, :]
