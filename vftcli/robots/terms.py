"""Dynamics terms p and μ of a log, the input of observers; raw disturbance."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np

from vftcli.robots.friction import RunningFriction, measured_temperature
from vftcli.robots.kernels import MomentumTerms, momentum_chunks, momentum_terms
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import (
    Array,
    Clock,
    Mask,
    empty_series,
    gaps_of,
    handed_over,
    is_uniform,
    median_step,
    resample_columns,
    runs_of,
)
from vftcli.signals.errors import MissingSignalError, RobotError
from vftcli.signals.external_torque import DynamicsTerms, Instant
from vftcli.signals.packages import needed
from vftcli.signals.parsing import check_kind
from vftcli.signals.recording import EFFORTS, Recording
from vftcli.signals.rest import REST, slower

#: Deviation of drive constants and sensors: a UR10e's make 2.88 kg of a weighed 2.805 kg. [1]
CONSTANT_SD, SENSOR_SD = 0.03, 0.01
STEP = 1e-7  #: Δq of (10). [rad]


def check_joints(recording: Recording, robot: Robot) -> None:
    """Raise a RobotError unless the log and the robot have the same number of joints."""
    check_kind(recording, Recording, "the recording", "vftcli.read(LOG)")
    check_kind(robot, Robot, "the robot", "vftcli.load_robot('ur5')")
    if recording.joints != robot.joints:
        raise RobotError(
            f"{recording.name}: the log has {recording.joints} joints but robot {robot.name!r} has "
            f"{robot.joints}; choose another with --robot (vftcli help robots lists them)"
        )


def effort_name(recording: Recording, robot: Robot) -> str:
    """The signal of `EFFORTS` that the drive torque comes from.

    An arm described by currents uses a log's torques where it has no others, and conversely.
    """
    ranked = EFFORTS if robot.torque_source == "current" else (*EFFORTS[1:], EFFORTS[0])
    return next((name for name in ranked if getattr(recording, name) is not None), ranked[0])


def check_effort(recording: Recording) -> None:
    """Raise unless a log says what its drives do."""
    if all(getattr(recording, name) is None for name in EFFORTS):
        raise MissingSignalError(
            f"{recording.name}: the log has no joint torques and no motor currents, and "
            f"positions alone carry no force; it has {', '.join(recording.signals)}. Record "
            "them, or name their columns with --columns"
        )


def gain_sd(recording: Recording, robot: Robot) -> float:
    """Relative deviation of a log's torques. [1]"""
    return CONSTANT_SD if effort_name(recording, robot) == "current" else SENSOR_SD


def gravity_torque(robot: Robot, q: Array) -> Array:
    """Gravity torque of the loaded arm at positions (T, n) [rad]. (T, n) [N·m]"""
    return momentum_terms(robot.loaded_chain, q, np.zeros_like(q)).gravity


def drive_torque(recording: Recording, robot: Robot) -> Array:
    """Torque of the drives at the joints, friction included. (T, n) [N·m]

    τ = K i of a current, else the measured torque; without gravity's it is e + g(q).
    """
    check_joints(recording, robot)
    check_effort(recording)
    effort: Array = getattr(recording, name := effort_name(recording, robot))
    if name == "torque_without_gravity":
        return effort + gravity_torque(robot, recording.q)
    if name == "torque":
        return effort
    if robot.torque_constant is None:
        raise MissingSignalError(
            f"{recording.name}: the log has motor currents but robot {robot.name!r} has no "
            "torque_constant; give one per joint in its TOML file, or record torques"
        )
    return effort * robot.torque_constant


class RunningTerms:
    """The terms of a log's blocks in turn, together those of the whole log."""

    def __init__(
        self, robot: Robot, clock: Clock | None = None, *, literal: bool = False
    ) -> None:
        self.robot, self.clock, self.literal = robot, clock, literal
        self.before: Instant | None = None
        self._friction = RunningFriction(robot.friction)

    def next(self, recording: Recording) -> DynamicsTerms:
        """Evaluate p and μ along the next block, chunk by chunk."""
        check_joints(recording, self.robot)
        q, dq = recording.q, recording.require("dq")
        effort, temperature = drive_torque(recording, self.robot), measured_temperature(recording)
        p, mu = empty_series(*q.shape), empty_series(*q.shape)
        chunks: Iterable[tuple[slice, Array, list[Array]]]
        if self.literal:
            momentum, coriolis, gravity = literal_momentum_terms(self.robot.model, q, dq)
            chunks = [(slice(0, len(q)), dq, [momentum, coriolis - gravity, gravity])]
        else:
            loaded = any(joint.parameters.get("load_coulomb") for joint in self.robot.friction)
            wanted = ("p", "bias", *["gravity"] * loaded)
            chunks = momentum_chunks(self.robot.loaded_chain, q, dq, wanted)
        for span, velocity, (momentum, bias, *loads) in chunks:
            p[span] = momentum
            mu[span] = effort[span] + bias
            if self.robot.friction:
                load = loads[0] if loads else None
                warm = None if temperature is None else temperature[span]
                mu[span] -= self._friction.torque(q[span], velocity, load, warm)
        clock, before = self.clock, self.before
        p, mu = handed_over(p), handed_over(mu)
        terms = DynamicsTerms(t=recording.t, p=p, mu=mu, log_clock=clock, before=before)
        self.before = terms.last
        return terms


def dynamics_terms(recording: Recording, robot: Robot, *, literal: bool = False) -> DynamicsTerms:
    """P and μ along a recording, `literal` by the paper's (7)–(16).

    Raises:
        MissingSignalError: If velocities, or both currents and torques, are missing.
        RobotError: If the number of joints differs.
    """
    return RunningTerms(robot, literal=literal).next(recording)


def literal_momentum_terms(model: Any, q: Array, dq: Array) -> MomentumTerms:  # noqa: ANN401
    r"""P, Cᵀq̇ and g as the paper prints them, (7)–(16), from inverse dynamics alone.

    It takes n + 3 calls of RNEA a sample and is good to about 5e-6 N·m, as (11)
    differentiates numerically.

    p = rnea(q, 0, q̇, 0) (8); Ṁq̇ ≈ Σᵢ [rnea(q+Δqᵢ, 0, q̇, 0) − p]/Δq · q̇ᵢ (11);
    Cq̇ = rnea(q, q̇, 0, 0) (12); Cᵀq̇ = Ṁq̇ − Cq̇ (14); G = rnea(q, 0, 0, g₀) (16).
    """
    pin = needed("pinocchio", "the paper's numeric method")

    weightless = model.copy()
    weightless.gravity.linear = np.zeros(3)
    data, free = model.createData(), weightless.createData()
    zero = np.zeros(q.shape[1])
    found = MomentumTerms(*np.empty((3, *q.shape)))
    for k, (here, velocity) in enumerate(zip(q, dq, strict=True)):
        found.p[k] = momentum = pin.rnea(weightless, free, here, zero, velocity)
        rate = -pin.rnea(weightless, free, here, velocity, zero)
        for move, speed in zip(STEP * np.eye(len(zero)), velocity, strict=True):
            moved = pin.rnea(weightless, free, here + move, zero, velocity)
            rate += (moved - momentum) / STEP * speed
        found.coriolis_transpose_dq[k] = rate
        found.gravity[k] = pin.rnea(model, data, here, zero, zero)
    return found


#: Rounding of a speed, or of a number of blocks up to 1e6 s.
TIE = 1e-6
GAP = 5.5  #: A longer step, in median steps, is a gap; no stretch reaches across.


def raw_disturbance(terms: DynamicsTerms) -> Array:
    """The unfiltered external torque d of every sample but the first. (T−1, n) [N·m]

    d = (pᵗ − pᵗ⁻¹)/Ts − ½(μᵗ + μᵗ⁻¹) by the log's own sample times.
    """
    d = np.diff(terms.p, axis=0) / np.diff(terms.t)[:, None]
    d -= 0.5 * (terms.mu[1:] + terms.mu[:-1])
    return d


def disturbance_impulse(terms: DynamicsTerms) -> Array:
    """The raw disturbance's integral, pᵗ − p⁰ − ∫μ. (T, n) [N·m·s]"""
    total = empty_series(*terms.p.shape)
    total[:1] = 0.0
    gained = raw_disturbance(terms) * np.diff(terms.t)[:, None]
    gained.cumsum(axis=0, out=total[1:])
    return total


class Blocks(NamedTuple):
    """The raw disturbance averaged over successive blocks of time."""

    t: Array  #: Middle of each block. (K,) [s]
    length: Array  #: How long it lasts. (K,) [s]
    d: Array  #: Mean disturbance over it. (K, n) [N·m]
    q: Array  #: Joint positions at its middle. (K, n) [rad]
    velocity: Array  #: Mean velocity, from the positions. (K, n) [rad/s]
    known: Mask  #: Whether d is known: not across a gap. (K,)

    @property
    def rests(self) -> Mask:
        """Blocks in which each joint rests. (K, n)"""
        # An encoder's steps at just `REST` count as motion.
        return slower(self.velocity, (1.0 - TIE) * REST)

    def part(self, chosen: slice) -> "Blocks":
        """Some of the blocks."""
        return self._replace(**{name: x[chosen] for name, x in self._asdict().items()})


def disturbance_blocks(
    terms: DynamicsTerms, q: Array, seconds: float, inside: Mask | None = None
) -> Blocks:
    """Block averages d = (s(e′) − s(e))/(e′ − e) with s = p − ∫μ.

    A block of some seconds holds whole samples; a rest of less than half a block joins
    the last one of its stretch. A gap of the clock is a block of its own, its disturbance
    unknown, and so is what lies between samples `inside` (T,).
    """
    t, joints = terms.t, terms.joints
    if len(t) < 2:
        nothing, never = np.zeros((1, joints)), np.zeros(1, bool)
        return Blocks(t, np.zeros(1), nothing, q, nothing, never)
    size = max(round(seconds / median_step(t)), 1)
    whole = np.ones(len(t) - 1, bool) if inside is None else inside[1:] & inside[:-1]
    whole[gaps_of(t, GAP)] = False
    # Runs of intervals give the edges; one block spans a gap.
    places = {0, len(t) - 1}
    for start, stop in runs_of(whole):
        count = max(round((stop - start) / size), 1)
        places |= {*range(start, start + size * count, size), stop}
    edges = sorted(places)
    at = t[edges]
    middle, length = 0.5 * (at[1:] + at[:-1]), np.diff(at)
    return Blocks(
        t=middle,
        length=length,
        d=np.diff(disturbance_impulse(terms)[edges], axis=0) / length[:, None],
        q=resample_columns(middle, t, q),
        velocity=np.diff(q[edges], axis=0) / length[:, None],
        known=whole[edges[:-1]],
    )


def disturbance_stretches(terms: DynamicsTerms, inside: Mask, step: float) -> list[Array]:
    """The raw disturbance in unbroken stretches of an even clock. (N, n) each

    On an uneven clock the integral of d is interpolated: d averaged over each step [s].
    """
    t, whole = terms.t, inside[1:] & inside[:-1]
    if len(t) > 1 and is_uniform(t):
        d = raw_disturbance(terms)
        return [d[start:stop] for start, stop in runs_of(whole)]
    # Across a gap the mean of two μ says nothing.
    whole[gaps_of(t, GAP)] = False
    total, stretches = disturbance_impulse(terms), []
    for start, stop in runs_of(whole):
        own, even = slice(start, stop + 1), np.arange(t[start], t[stop], step)
        stretches.append(np.diff(resample_columns(even, t[own], total[own]), axis=0) / step)
    return stretches
