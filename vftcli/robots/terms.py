"""The dynamics terms of a log, by a robot's model and its measured effort."""

from collections.abc import Iterator

import numpy as np

from vftcli.robots.drive import check_joints, drive_torque, uses_current
from vftcli.robots.kernels import momentum_chunks
from vftcli.robots.robot import Robot
from vftcli.robots.running_friction import RunningFriction, measured_temperature
from vftcli.signals.arrays import Array, handed_over
from vftcli.signals.recording import Recording
from vftcli.signals.series import Clock
from vftcli.signals.terms import DynamicsTerms, Instant


class RunningTerms:
    """The terms of a log's blocks, one after another: together they are those of the whole log.

    Attributes:
        robot: The arm, its payload mounted.
        clock: The clock of the whole log; None where it comes as one block.
        literal: Whether to use the paper's numeric method (7)–(16) instead of the batched kernels.
        before: The last sample so far, None before the first.
    """

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

    def _chunks(self, q: Array, dq: Array) -> Iterator[tuple[slice, Array, list[Array]]]:
        """P, Cᵀq̇ − g and, if friction asks for it, g: by chunks, the paper's method all at once."""
        if not self.literal:
            wanted = ("p", "bias", *(("gravity",) if self._friction.takes_load else ()))
            yield from momentum_chunks(self.robot.loaded_chain, q, dq, wanted)
            return
        from vftcli.robots.literal import literal_momentum_terms

        p, coriolis, gravity = literal_momentum_terms(self.robot.model, q, dq)
        yield slice(0, len(q)), dq, [p, coriolis - gravity, gravity]


def dynamics_terms(recording: Recording, robot: Robot, *, literal: bool = False) -> DynamicsTerms:
    """Evaluate p and μ along a whole recording.

    Args:
        recording: The log.
        robot: The arm, its payload mounted.
        literal: Use the paper's numeric method (7)–(16) instead of the batched kernels.

    Raises:
        MissingSignalError: If velocities, or both currents and torques, are missing.
        RobotError: If the number of joints differs.
    """
    check_joints(recording, robot)
    return RunningTerms(robot, literal=literal).next(recording)


def effort_of(recording: Recording, robot: Robot) -> tuple[Array, Array | float]:
    """The measured effort (T, n) and what turns it into torque: K [N·m/A], or 1 for torques."""
    if uses_current(recording, robot) and robot.torque_constant is not None:
        return recording.require("current"), robot.torque_constant
    return drive_torque(recording, robot), 1.0
