"""Contact-free motion: a log's own spans and cycles, other runs; its load.

A payload that the model lacks pulls in the free part too. As noise it would make every
tuned gain slow and every band wide; it is an external torque, and stays in the estimates.
The disturbance there is fitted with a load's weight and friction,

    d = J_Fᵀ(q) [m g; m c × g] + a tanh(q̇/v₀) + o,

with friction and offset held to what a model usually misses of them.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vftcli.free_motion import FreeChoice
from vftcli.free_motion.alignment import Alignment, align
from vftcli.free_motion.cycles import Cycles, FreeCycles, find_free_cycles, find_period, segment
from vftcli.free_motion.difference import Pairing, pair_with_run
from vftcli.robots.chain import Chain, Payload
from vftcli.robots.kernels import load_regressor, load_wrench, momentum_terms
from vftcli.robots.run import Run, RunSamples
from vftcli.robots.terms import gain_sd
from vftcli.signals.arrays import (
    Array,
    Indices,
    Mask,
    handed_over,
    root_mean_square,
    root_mean_squares,
    seal,
)
from vftcli.signals.errors import ClockError, ParameterError, ReferenceTorqueError
from vftcli.signals.filters import derivative, zero_phase
from vftcli.signals.option import interval_text
from vftcli.signals.recording import Recording, refuse_repeated_logs
from vftcli.signals.remarks import Remark, Where, caution, fact
from vftcli.signals.shown import Shown

#: Joints that move less only yield to pushes. [rad]
SWAY = 0.1
#: A cycle inside a span may stick out by this share of itself.
SLACK = 0.03


def within(t: Array, spans: Iterable[tuple[float, float]]) -> Mask:
    """Samples that lie in any of some spans. (T,)"""
    inside = np.zeros(len(t), bool)
    for first, last in spans:
        inside |= (t >= first) & (t <= last)
    return inside


class FreePart(NamedTuple):
    """All that is free of contact, of the log and of free runs."""

    pieces: tuple[RunSamples, ...]  #: One a recording, the log's own first.
    own: Mask  #: RunSamples of the log itself that are free. (T,)
    remarks: tuple[Remark, ...]  #: What it is and how it was found.
    #: Whether it was found, not named, and may be touched.
    doubted: bool = False


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeRun:
    """A contact-free motion of another recording, beside its log."""

    run: Run  #: The free run.
    log: Run  #: The log.

    @cached_property
    def _alignment(self) -> Alignment | ReferenceTorqueError:
        try:
            return align(self.log.recording, self.recording)
        except ReferenceTorqueError as error:
            return error

    @property
    def recording(self) -> Recording:
        """The free run as it was read."""
        return self.run.recording

    @property
    def alignment(self) -> Alignment:
        """Its alignment with the log."""
        if isinstance(self._alignment, ReferenceTorqueError):
            raise self._alignment
        return self._alignment

    @cached_property
    def pairing(self) -> Pairing:
        """Instant in the free run of each sample of the log."""
        found = self.alignment
        pairing = pair_with_run(self.log.t, self.run, found.shift, found.rate)
        return pairing._replace(times=np.where(found.overlap, pairing.times, np.nan))


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class FreeMotion(Shown):
    """The free motion of one log; each part is found once, on demand."""

    log: Run  #: The log.
    choice: FreeChoice = field(default_factory=FreeChoice)  #: What the user says is free.
    runs: tuple[FreeRun, ...] = ()  #: Free runs in other recordings.

    def __post_init__(self) -> None:
        each = [self.log.recording, *(run.recording for run in self.runs)]
        again = "give another log; for free cycles within one log leave --free out"
        refuse_repeated_logs(each, "the log or as --free", again)
        if self.runs and (self.choice.cycles or self.choice.period is not None):
            raise ReferenceTorqueError(
                "two-cycle.period and two-cycle.free-cycles are for cycles of one log; leave them "
                "out with --free"
            )

    @property
    def steadied(self) -> "FreeMotion":
        """The motion without samples that stand alone, if any."""
        log = self.log.steadied
        if log is self.log and all(run.run is run.run.steadied for run in self.runs):
            return self
        runs = tuple(FreeRun(run=run.run.steadied, log=log) for run in self.runs)
        return replace(self, log=log, runs=runs)

    @cached_property
    def cycles(self) -> Cycles:
        """The cycles of the log."""
        recording = self.log.coarse.recording
        return segment(recording, find_period(recording, self.choice.period))

    @cached_property
    def free_cycles(self) -> FreeCycles:
        """Free cycles: those named or inside a free span, else those found."""
        cycles, whole = self.cycles, self.cycles.whole
        for number in self.choice.cycles:
            if not 1 <= number <= whole:
                raise ReferenceTorqueError(
                    f"{self.log.recording.name}: there is no cycle {number}; the log holds {whole} "
                    f"whole cycles of {cycles.period:.4g} s from {cycles.begin:.4g} s on"
                )
        slack, found = SLACK * cycles.period, {number - 1 for number in self.choice.cycles}
        for number in range(whole):
            begin, end = cycles.span(number)
            if any(begin >= a - slack and end <= b + slack for a, b in self.choice.spans):
                found.add(number)
        if found:
            return FreeCycles(tuple(sorted(found)), None)
        freest = find_free_cycles(self.log.coarse, cycles)
        self.log.spare()
        return freest

    @cached_property
    def known(self) -> FreePart:
        """The given spans and runs, else the free cycles of the log."""
        log, choice, t = self.log, self.choice, self.log.t
        own, spans = within(t, choice.spans), choice.spans
        if spans and (np.count_nonzero(own) < 2 or own.all()):
            raise ParameterError(
                f"{log.name}: the free part {', '.join(interval_text(*s) for s in spans)} "
                f"holds {np.count_nonzero(own)} of its {len(t)} samples; it must be "
                f"a part of the log, which runs from {t[0]:g} to {t[-1]:g} s"
            )
        ends = t[0], t[-1]
        remarks = [
            fact("free-span", begin_s=max(a, ends[0]), end_s=min(b, ends[1])) for a, b in spans
        ]
        given = choice.is_given or bool(self.runs)
        if not given and np.ptp(log.recording.q, axis=0).max() < SWAY:
            raise ReferenceTorqueError(
                f"{log.name}: no joint moves {SWAY:g} rad, so no cycle of it is free motion"
            )
        if choice.cycles or not given:
            found = self.free_cycles
            own = own | np.isin(self.cycles.number(t), found.numbers)
            remarks += found.remarks(self.cycles.whole)[:1]
        pieces = [RunSamples(log, own)] if own.any() else []
        whole = (RunSamples(r.run, np.ones(r.recording.samples, bool)) for r in self.runs)
        return FreePart((*pieces, *whole), own, tuple(remarks), doubted=not given)

    @cached_property
    def part(self) -> FreePart:
        """The free part, with remarks on each free run's place."""
        paired = []
        for run in self.runs:
            about = Where(about=run.recording.name)
            try:
                paired.append(fact("free-run", about, shift_s=run.alignment.shift))
            except ReferenceTorqueError:
                paired.append(fact("free-run-of-another-motion", about))
        return self.known._replace(remarks=(*self.known.remarks, *paired))

    def unloaded(self, spans: tuple[tuple[float, float], ...]) -> "FreeMotion":
        """The log with its unloaded spans free, where none is given."""
        if self.choice.is_given or not spans:
            return self
        return replace(self, choice=replace(self.choice, spans=spans))


#: Least load: drive constants that are 3 % off look like .3 kg. [kg]
LEAST = 0.4
SURE = 4.0  #: SDs that it has to be.
PARTLY = 0.8  #: Most of the free part's disturbance that it may leave.
CUTOFF = 6.0  #: Low-pass of the disturbance. [Hz]
RATE = 30.0  #: RunSamples a second that are weighed.
#: The model's errors are alike for so long: one sample. [s]
MEMORY = 0.3
SIGN_SPEED = 0.02  #: Velocity over which the sign of friction turns. [rad/s]
PASSES = 4  #: Fits, each with the joints' errors that the last one left.
#: SDs of a load's mass and first moment. [kg, kg·m]
WIDE = (20.0, 5.0, 5.0, 5.0)


@dataclass(frozen=True, kw_only=True)
class FreeLoad:
    """A load in the free part."""

    mass: float  #: Its mass. [kg]
    moment: Array  #: Mass times its centre, in flange axes. (3,) [kg·m]
    sd: float  #: SD of the mass. [kg]
    moment_sd: Array  #: That of the moment. (3,) [kg·m]
    share: float  #: What is left of the free part's disturbance with it.

    def __post_init__(self) -> None:
        seal(self, "moment", "moment_sd")

    @property
    def remark(self) -> Remark:
        """The free part's load, and its remedy."""
        left = 100.0 * self.share
        return caution("free-part-loaded", load_kg=self.mass, sd_kg=self.sd, left_percent=left)

    @property
    def weights(self) -> Array:
        """Mass and moment. (4,) [kg, kg·m]"""
        return np.concatenate([[self.mass], self.moment])

    def torque(self, run: Run) -> Array:
        """External joint torque of its weight. (T, n) [N·m]"""
        return handed_over(load_regressor(run.robot.chain, run.q) @ self.weights)

    def wrench(self, chain: Chain, q: Array) -> tuple[Array, Array]:
        """Base-axes wrench of its weight at q about the flange; covariance. (N, 6)"""
        each = load_wrench(chain, q)
        spread = each * np.concatenate([[self.sd], self.moment_sd])
        return each @ self.weights, spread @ spread.swapaxes(1, 2)


def without_load(run: Run, load: FreeLoad | None) -> Run:
    """A run with a load in its model; itself without one."""
    return run if load is None else with_point_mass(run, load.weights)


def with_point_mass(run: Run, weights: Array) -> Run:
    """A run with a mass and its moment in its model. (4,) [kg, kg·m]"""
    body = Payload(mass=float(weights[0]), com=weights[1:] / weights[0])
    chain, terms = run.robot.loaded_chain, run.terms
    arms = (momentum_terms(each, run.q, run.dq) for each in (chain.with_payload(body), chain))
    # By its weight alone every start and stop would look like a push.
    p, coriolis, gravity = map(np.subtract, *arms)
    p, mu = map(handed_over, (terms.p + p, terms.mu + coriolis - gravity))
    return run.holding(terms=replace(terms, p=p, mu=mu))


def free_load(pieces: Sequence[RunSamples]) -> FreeLoad | None:
    """The load behind much of the free part's disturbance, or None."""
    parts = [part for piece in pieces if (part := columns(piece.coarse)) is not None]
    if not parts:
        return None
    robot = pieces[0].run.robot
    _, d, A = (np.concatenate(each) for each in zip(*parts, strict=True))
    if len(d) < 2 * A.shape[2] or not d.any():
        return None
    friction = pieces[0].run.dry_friction
    prior = np.concatenate([WIDE, 0.2 * friction + 0.05, 0.15 * friction + 0.02])
    weights, sd, loaded = weigh(d, A, prior)
    _, _, bare = weigh(d, A[:, :, 4:], prior[4:])
    moved = bare > 0.0  # a simulation may leave nothing on a joint at rest
    share = root_mean_square(loaded[moved] / bare[moved])
    mass = float(weights[0])
    if mass < max(LEAST, SURE * sd[0]) or share > PARTLY:
        return None
    whole = np.hypot(sd[:4], gain_sd(pieces[0].run.recording, robot) * weights[:4])
    return FreeLoad(
        mass=mass,
        moment=weights[1:4].copy(),
        sd=float(whole[0]),
        moment_sd=whole[1:],
        share=share,
    )


def columns(piece: RunSamples) -> tuple[Indices, Array, Array] | None:
    """Samples (S,), their disturbance (S, n) [N·m], columns (S, n, 4 + 2n); or None."""
    run, inside = piece.run, np.flatnonzero(piece.inside)
    if inside.size == 0:
        return None
    n, j, t, terms = run.robot.joints, np.arange(run.robot.joints), run.t, run.terms
    at = inside[:: max(1, int(1.0 / (RATE * run.step)))]
    try:
        raw = derivative(t, terms.p) - terms.mu
        d, speed = (zero_phase(t, x, CUTOFF)[at] for x in (raw, run.dq))
    except (ClockError, ValueError):
        return None
    A = np.zeros((len(at), n, 4 + 2 * n))
    A[:, :, :4] = load_regressor(run.robot.chain, run.q[at])
    A[:, j, 4 + j] = np.tanh(speed / SIGN_SPEED)
    A[:, j, 4 + n + j] = 1.0
    return at, d, A


def weigh(d: Array, A: Array, prior: Array) -> tuple[Array, Array, Array]:
    """Weights of columns (m,), their SDs, and the rms left (n,) [N·m].

    Regularised least squares of the disturbance d (S, n) [N·m] on A (S, n, m), each joint
    weighed by its residual; the prior (m,) is the weights' deviation about zero.
    """
    together = max(1.0, MEMORY * RATE)
    spread = root_mean_squares(d) + 1e-6
    for _ in range(PASSES):
        scaled = A / spread[:, None]
        gram = np.einsum("sjm,sjk->mk", scaled, scaled) / together + np.diag(prior**-2)
        right = np.einsum("sjm,sj->m", scaled, d / spread) / together
        covariance = np.linalg.inv(gram)
        weights = covariance @ right
        left = root_mean_squares(d - A @ weights)
        spread = np.maximum(left, 1e-3 * left.max() + 1e-6)
    return weights, np.sqrt(np.diag(covariance)), left
