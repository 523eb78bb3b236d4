"""Training data: filtered logs, the profile's torques, and the joints that move."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.identification.friction_shapes import FrictionColumns, friction_columns
from vftcli.identification.processing import (
    CUTOFF,
    PreparedLog,
    predicted_torque,
    prepare,
    rigid_torque,
)
from vftcli.robots.robot import Robot
from vftcli.robots.terms import uses_current
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import IdentificationError
from vftcli.signals.recording import Recording
from vftcli.signals.rest import MOVES
from vftcli.signals.series import median_step

ENOUGH = 1.0  #: Time a joint must move, and for both ways to count a tenth of it each way. [s]


class TrainingLog(NamedTuple):
    """One log to be fitted: M samples in motion."""

    motion: PreparedLog  #: The prepared log.
    columns: FrictionColumns  #: Its friction columns.
    weights: Array  #: Weight of every sample and joint, 0 where it tells nothing. (M, n)
    rigid: Array  #: Torque of the profile's rigid body. (M, n) [N·m]
    losses: Array  #: Torque of the profile's rotors and friction. (M, n) [N·m]


@dataclass(frozen=True, kw_only=True)
class Training:
    """The training logs, prepared."""

    robot: Robot  #: The profile.
    recordings: tuple[Recording, ...]  #: The logs.
    logs: tuple[TrainingLog, ...]  #: Those that move, filtered and decimated.
    moves: Mask  #: Joints that move at all. (n,)
    reverses: Mask  #: Joints that move both ways. (n,)
    fit_constants: bool = False  #: Whether drive constants are unknowns of the friction method.
    rubs: bool = True  #: Whether the joints have friction to be fitted.

    @property
    def rotor(self) -> bool:
        """Whether torque is measured before the gear and accelerates the rotor too."""
        return self.robot.torque_source != "link_torque"

    def top_speed(self, j: int) -> float:
        """Speed limit of joint j (from 0), else its fastest motion. [rad/s]"""
        fastest = max(float(np.max(np.abs(log.motion.dq[:, j]))) for log in self.logs)
        return float(np.fmax(self.robot.limits.qd_max[j], fastest))


def prepare_training(
    recordings: Sequence[Recording],
    robot: Robot,
    cutoff: float = CUTOFF,
    fit_constants: bool = False,
    rubs: bool = True,
) -> Training:
    """Training data of a profile's logs, of joints that rub or not."""
    motions = [prepare(recording, robot, cutoff) for recording in recordings]
    if fit_constants and not all(uses_current(r, robot) for r in recordings):
        raise IdentificationError(
            "--set identify.constants=yes needs motor currents; the logs have torques. Leave it out"
        )
    moves, reverses = moving_joints(motions)
    logs = []
    for motion in motions:
        if motion.samples > 1:
            rigid, columns = rigid_torque(robot, motion), friction_columns(motion, robot)
            losses = predicted_torque(robot, motion) - rigid
            logs.append(TrainingLog(motion, columns, motion.usable.astype(float), rigid, losses))
    return Training(
        robot=robot,
        recordings=tuple(recordings),
        logs=tuple(logs),
        moves=moves,
        reverses=reverses,
        fit_constants=fit_constants,
        rubs=rubs,
    )


def moving_joints(motions: Sequence[PreparedLog]) -> tuple[Mask, Mask]:
    """Joints that the logs move at all, and those that they move both ways. (n,), (n,)"""
    times = np.zeros((2, motions[0].dq.shape[1]))
    for motion in motions:
        if motion.samples > 1:
            ways = np.count_nonzero([motion.dq > MOVES, motion.dq < -MOVES], axis=1)
            times += median_step(motion.t) * ways
    moves = times.sum(axis=0) >= ENOUGH
    if not np.any(moves):
        names = ", ".join(m.recording.name for m in motions)
        raise IdentificationError(
            f"{names}: no joint moves faster than {MOVES:g} rad/s for {ENOUGH:g} s; a log at rest "
            "identifies no friction and no inertia. Record free motion, or use --method "
            "payload on static poses"
        )
    # A tenth of a second back is enough to tell the sign of friction from an offset.
    return moves, np.min(times, axis=0) >= 0.1 * ENOUGH
