"""DynamicsTerms: all an observer ever sees of a robot and its log."""

from dataclasses import dataclass

from vftcli.robots.drive import check_joints, drive_torque, uses_current
from vftcli.robots.kernels import momentum_chunks
from vftcli.robots.robot import Robot
from vftcli.robots.running_friction import RunningFriction
from vftcli.robots.temperature import measured_temperature
from vftcli.signals.arrays import (
    Array,
    check_clock,
    check_shape,
    empty_series,
    handed_over,
    seal,
)
from vftcli.signals.errors import ShapeError
from vftcli.signals.recording import Recording
from vftcli.signals.shown import Shown


@dataclass(frozen=True, kw_only=True, repr=False)
class DynamicsTerms(Shown):
    r"""Momentum form of the equations of motion: :math:`\dot p = \mu + \tau_{ext}` (33).

    Attributes:
        t: Time. (T,) [s]
        p: Generalised momentum M q̇. (T, n) [kg·m²/s]
        mu: μ = τ + Cᵀq̇ − g − F_f, the torque that changes p without contact. (T, n) [N·m]
    """

    t: Array
    p: Array
    mu: Array

    def __post_init__(self) -> None:
        seal(self, "t", "p", "mu")
        if self.p.ndim != 2:
            raise ShapeError(f"p has shape {self.p.shape}; expected (T, n)")
        check_clock(self.t, "the dynamics terms")
        check_shape(self.p, (len(self.t), self.p.shape[1]), "p", "the dynamics terms")
        check_shape(self.mu, self.p.shape, "mu", "the dynamics terms")

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.p.shape[1])

    @property
    def samples(self) -> int:
        """Number of samples T."""
        return len(self.t)


def dynamics_terms(recording: Recording, robot: Robot, *, literal: bool = False) -> DynamicsTerms:
    """Evaluate p and μ along a recording, chunk by chunk.

    Beside the recording and the two results it needs memory for one chunk only.

    Args:
        recording: The log.
        robot: The arm, its payload mounted.
        literal: Use the paper's numeric method (7)–(16) instead of the batched kernels.

    Raises:
        MissingSignalError: If velocities, or both currents and torques, are missing.
        RobotError: If the number of joints differs.
    """
    check_joints(recording, robot)
    q, dq = recording.q, recording.require("dq")
    effort, scale = effort_of(recording, robot)
    p, mu = empty_series(*q.shape), empty_series(*q.shape)
    friction = RunningFriction(robot.friction, robot.chain.transmission)
    temperature, coupling = measured_temperature(recording), robot.chain.rotor_coupling
    chunks = momentum_chunks(robot.loaded_chain, q, dq)
    if literal:
        from vftcli.robots.literal import literal_momentum_terms

        # The paper's method takes the whole log at once.
        found = literal_momentum_terms(robot.model, q, dq)
        if coupling is not None:
            found = found._replace(p=found.p + dq @ coupling)
        chunks = iter([(slice(0, len(q)), dq, found)])
    for span, velocity, chunk in chunks:
        p[span] = chunk.p
        mu[span] = effort[span]
        mu[span] *= scale
        mu[span] += chunk.coriolis_transpose_dq - chunk.gravity
        if robot.friction:
            warm = None if temperature is None else temperature[span]
            mu[span] -= friction.torque(q[span], velocity, chunk.gravity, warm)
    return DynamicsTerms(t=recording.t, p=handed_over(p), mu=handed_over(mu))


def effort_of(recording: Recording, robot: Robot) -> tuple[Array, Array | float]:
    """The measured effort (T, n) and what turns it into torque: K [N·m/A], or 1 for torques."""
    coupled = robot.chain.transmission is not None
    if uses_current(recording, robot) and robot.torque_constant is not None and not coupled:
        return recording.require("current"), robot.torque_constant
    return drive_torque(recording, robot), 1.0
