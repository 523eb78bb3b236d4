"""What a difference of two motions is made from: the drive torques, and the model's of them."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from vftcli.robots.drive import drive_torque
from vftcli.robots.friction import dry_friction
from vftcli.robots.robot import Robot
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.filters import low_pass
from vftcli.signals.recording import Recording
from vftcli.signals.rest import duration, standing
from vftcli.signals.series import median_step


@dataclass(frozen=True, kw_only=True, eq=False)
class DriveRun:
    """One recording's motion and torque, on its own clock."""

    name: str  #: The recording's name.
    t: Array  #: Clock. (T,) [s]
    q: Array  #: Joint positions. (T, n) [rad]
    dq: Array  #: Joint velocities. (T, n) [rad/s]
    standing: Mask  #: Where a joint stands still. (T, n)
    #: Length of the stop a sample belongs to, 0 where the joint moves. (T, n) [s]
    standstill_s: Array
    torque: Array  #: Drive torque. (T, n) [N·m]
    #: Drive torque the model expects of the motion without contact, ṗ − Cᵀq̇ + g + F_f, with ṗ by
    #: central differences. (T, n) [N·m]
    model: Array
    momentum: Array  #: p = M q̇. (T, n) [kg·m²/s]
    coulomb: Array  #: Dry friction of each joint by the robot's model, 0 without one. (n,) [N·m]

    @property
    def step(self) -> float:
        """Median sample time. [s]"""
        return median_step(self.t)

    @cached_property
    def smooth_gap(self) -> Array:
        """What the model misses of the torque, below the band of the noise. (T, n) [N·m]"""
        return low_pass(self.t, self.torque - self.model, band(self.step, None)[0])

    @cached_property
    def smooth_model(self) -> Array:
        """The model's torque, below the band of the noise. (T, n) [N·m]"""
        return low_pass(self.t, self.model, band(self.step, None)[0])

    @cached_property
    def smooth_dq(self) -> Array:
        """Joint velocities without their noise: the direction of the path. (T, n) [rad/s]"""
        return low_pass(self.t, self.dq, min(12.0, 0.2 / self.step))

    def taken(self, samples: slice) -> "DriveRun":
        """Some of its samples as a run of its own."""
        series = {name: x[samples] for name, x in vars(self).items() if name in ALONG_TIME}
        return replace(self, **series)


#: Attributes of a run that have a value for each sample.
ALONG_TIME = ("t", "q", "dq", "standing", "standstill_s", "torque", "model", "momentum")


def drive_run_of(recording: Recording, robot: Robot, terms: DynamicsTerms) -> DriveRun:
    """Evaluate a recording's drive torque and the model's."""
    torque = drive_torque(recording, robot)
    dq = recording.require("dq")
    return DriveRun(
        name=recording.name,
        t=recording.t,
        q=recording.q,
        dq=dq,
        torque=torque,
        model=np.gradient(terms.p, recording.t, axis=0) - terms.mu + torque,
        momentum=terms.p,
        coulomb=dry_friction(robot.friction, robot.joints),
        standstill_s=duration(recording.t, dq),
        standing=standing(recording.t, dq),
    )


def band(step: float, cutoff: float | None) -> tuple[float, float]:
    """The band above the signal in which noise is measured. [Hz]"""
    low = min(12.0 if cutoff is None else cutoff, 0.22 / step)
    return low, min(2.0 * low, 0.45 / step)
