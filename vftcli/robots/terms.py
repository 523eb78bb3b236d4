"""From what the drives measure to the dynamics terms: all an observer sees of robot and log."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from vftcli.robots.kernels import MomentumTerms, momentum_chunks, momentum_terms
from vftcli.robots.robot import Robot
from vftcli.robots.running_friction import RunningFriction, measured_temperature
from vftcli.signals.arrays import (
    Array,
    handed_over,
)
from vftcli.signals.errors import MissingSignalError, RobotError
from vftcli.signals.external_torque import DynamicsTerms, Instant
from vftcli.signals.packages import needed
from vftcli.signals.parsing import check_kind
from vftcli.signals.recording import EFFORTS, Recording
from vftcli.signals.series import Clock

#: How well drive constants and torque sensors are known: a weighed 2.805 kg reads 2.88 kg through
#: the constants of a UR10e's maker. [1]
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

    A robot described by currents whose log has only torques uses the torques, and the other way
    round if its file has torque constants.
    """
    ranked = EFFORTS if robot.torque_source == "current" else (*EFFORTS[1:], EFFORTS[0])
    return next((name for name in ranked if getattr(recording, name) is not None), ranked[0])


def uses_current(recording: Recording, robot: Robot) -> bool:
    """Whether the drive torque comes from motor current."""
    return effort_name(recording, robot) == "current"


def gain_sd(recording: Recording, robot: Robot) -> float:
    """How well a log's torques are known, relative to them. [1]"""
    return CONSTANT_SD if uses_current(recording, robot) else SENSOR_SD


def drive_torque(recording: Recording, robot: Robot) -> Array:
    """Torque of the drives at the joints, friction not yet taken off. (T, n) [N·m]

    τ = K i where `effort_name` is current, else the measured torque. Torques without gravity get
    the gravity torque g(q) of the arm with its payload: τ = e + g(q).
    """
    check_joints(recording, robot)
    name = effort_name(recording, robot)
    if getattr(recording, name) is None:
        raise MissingSignalError(
            f"{recording.name}: the log has no joint torques and no motor currents, and "
            f"positions alone carry no force; it has {', '.join(recording.signals)}. Record "
            "them, or name their columns with --columns"
        )
    effort = recording.require(name)
    if name == "torque_without_gravity":
        still = np.zeros_like(recording.q)
        return effort + momentum_terms(robot.loaded_chain, recording.q, still).gravity
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

    def __init__(self, robot: Robot, clock: Clock | None = None, *, literal: bool = False) -> None:
        self.robot, self.clock, self.literal = robot, clock, literal
        self.before: Instant | None = None
        self._friction = RunningFriction(robot.friction)

    def next(self, recording: Recording) -> DynamicsTerms:
        """Evaluate p and μ along the next block, chunk by chunk.

        Beside the recording and the results it needs memory for one chunk only.
        """
        check_joints(recording, self.robot)
        q, dq = recording.q, recording.require("dq")
        effort, scale = effort_of(recording, self.robot)
        temperature = measured_temperature(recording)
        # One block of memory: the larger it is, the fewer pages the system has to find.
        p, mu, room = (rows.T for rows in np.empty((3, *q.T.shape)))
        for span, velocity, (momentum, bias, *gravity) in self._chunks(q, dq):
            p[span] = momentum
            mu[span] = effort[span]
            mu[span] *= scale
            mu[span] += bias
            if self.robot.friction:
                load = gravity[0] if gravity else None
                warm = None if temperature is None else temperature[span]
                mu[span] -= self._friction.torque(q[span], velocity, load, warm)
        terms = DynamicsTerms(
            t=recording.t,
            p=handed_over(p),
            mu=handed_over(mu),
            log_clock=self.clock,
            before=self.before,
            room=room,
        )
        self.before = terms.last
        return terms

    def _chunks(self, q: Array, dq: Array) -> Iterable[tuple[slice, Array, list[Array]]]:
        """P, Cᵀq̇ − g and, if friction asks for it, g, by chunks."""
        if self.literal:
            p, coriolis, gravity = literal_momentum_terms(self.robot.model, q, dq)
            return [(slice(0, len(q)), dq, [p, coriolis - gravity, gravity])]
        wanted = ("p", "bias", *["gravity"] * self._friction.takes_load)
        return momentum_chunks(self.robot.loaded_chain, q, dq, wanted)


def dynamics_terms(recording: Recording, robot: Robot, *, literal: bool = False) -> DynamicsTerms:
    """P and μ along a recording, `literal` by the paper's (7)–(16).

    Raises:
        MissingSignalError: If velocities, or both currents and torques, are missing.
        RobotError: If the number of joints differs.
    """
    return RunningTerms(robot, literal=literal).next(recording)


def effort_of(recording: Recording, robot: Robot) -> tuple[Array, Array | float]:
    """The measured effort (T, n) and its factor: K [N·m/A], or 1."""
    if uses_current(recording, robot) and robot.torque_constant is not None:
        return recording.require("current"), robot.torque_constant
    return drive_torque(recording, robot), 1.0


def literal_momentum_terms(model: Any, q: Array, dq: Array) -> MomentumTerms:  # noqa: ANN401
    r"""P, Cᵀq̇ and g as the paper prints them, (7)–(16), from inverse dynamics alone.

    It is slow (n + 3 calls of RNEA a sample) and good to about 5e-6 N·m, because (11)
    differentiates numerically. It stays for three purposes: an oracle that shares no code with
    the kernels, the ``--as-printed`` path, and the baseline of the benchmark.

    p = rnea(q, 0, q̇, 0) (8); Ṁq̇ ≈ Σᵢ [rnea(q+Δqᵢ, 0, q̇, 0) − p]/Δq · q̇ᵢ (11);
    Cq̇ = rnea(q, q̇, 0, 0) (12); Cᵀq̇ = Ṁq̇ − Cq̇ (14); G = rnea(q, 0, 0, g₀) (16).
    """
    pin = needed("pinocchio", "the paper's numeric method")

    weightless = model.copy()
    weightless.gravity.linear = np.zeros(3)
    data, free = model.createData(), weightless.createData()
    samples, n = q.shape
    zero = np.zeros(n)
    p, coriolis, gravity = (np.empty((samples, n)) for _ in range(3))
    for k in range(samples):
        p[k] = pin.rnea(weightless, free, q[k], zero, dq[k])
        rate = np.zeros(n)
        for i in range(n):
            moved = q[k].copy()
            moved[i] += STEP
            rate += (pin.rnea(weightless, free, moved, zero, dq[k]) - p[k]) / STEP * dq[k, i]
        coriolis[k] = rate - pin.rnea(weightless, free, q[k], dq[k], zero)
        gravity[k] = pin.rnea(model, data, q[k], zero, zero)
    return MomentumTerms(p, coriolis, gravity)
