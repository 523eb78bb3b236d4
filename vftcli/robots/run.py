"""A run: a recording with its robot, and what the model says of it, each evaluated once."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vftcli.robots.friction import dry_friction
from vftcli.robots.robot import Robot
from vftcli.robots.terms import check_joints, drive_torque, dynamics_terms
from vftcli.signals.arrays import Array, Mask, handed_over
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.filters import low_pass
from vftcli.signals.recording import Recording
from vftcli.signals.repairs import without_isolated
from vftcli.signals.rest import duration, resting, standing
from vftcli.signals.series import median_step, white_noise
from vftcli.signals.shown import Shown

#: RunSamples from which on a recording's series do not stay in memory beside its results.
LONG = 1 << 17
#: What has a value for each sample, and stays in a part of a run.
SERIES = ("standing", "standstill", "drive_torque", "model_torque", "momentum")


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Run(Shown):
    """A recording, or a part of one, and what the robot's model says of it.

    Less an error of its model it is a run again: an observer does not know the difference.
    """

    recording: Recording  #: The recording.
    robot: Robot  #: The arm, its payload mounted.
    #: Whether `terms` come from the paper's numeric method; equal to a millionth.
    literal: bool = False

    @property
    def name(self) -> str:
        """What the recording is called in tables and messages."""
        return self.recording.name

    @property
    def t(self) -> Array:
        """Clock. (T,) [s]"""
        return self.recording.t

    @property
    def q(self) -> Array:
        """Joint positions. (T, n) [rad]"""
        return self.recording.q

    @property
    def dq(self) -> Array:
        """Joint velocities. (T, n) [rad/s]"""
        return self.recording.require("dq")

    @property
    def step(self) -> float:
        """Median sample time. [s]"""
        return median_step(self.t)

    @cached_property
    def terms(self) -> DynamicsTerms:
        """P and μ, as the observers take them."""
        return dynamics_terms(self.recording, self.robot, literal=self.literal)

    @cached_property
    def momentum(self) -> Array:
        """P = M q̇. (T, n) [kg·m²/s]"""
        return self.terms.p

    @cached_property
    def drive_torque(self) -> Array:
        """Torque of the drives. (T, n) [N·m]"""
        return drive_torque(self.recording, self.robot)

    @cached_property
    def model_torque(self) -> Array:
        """Drive torque that the model expects of the motion without contact. (T, n) [N·m]

        It is ṗ − Cᵀq̇ + g + F_f, with ṗ by central differences.
        """
        change: Array = np.gradient(self.terms.p, self.t, axis=0)
        return change - self.terms.mu + self.drive_torque

    @cached_property
    def smooth_gap(self) -> Array:
        """What the model misses of the torque, below the band of the noise. (T, n) [N·m]"""
        return low_pass(self.t, self.drive_torque - self.model_torque, band(self.step, None)[0])

    @cached_property
    def smooth_model(self) -> Array:
        """The model's torque, below the band of the noise. (T, n) [N·m]"""
        return low_pass(self.t, self.model_torque, band(self.step, None)[0])

    @cached_property
    def smooth_dq(self) -> Array:
        """Joint velocities without their noise: the direction of the path. (T, n) [rad/s]"""
        return low_pass(self.t, self.dq, min(12.0, 0.2 / self.step))

    @cached_property
    def noise(self) -> Array:
        """Standard deviation of the white part of μ. (n,) [N·m]"""
        return white_noise(self.terms.mu)

    @cached_property
    def dry_friction(self) -> Array:
        """Dry friction of each joint by the robot's model, 0 without one. (n,) [N·m]"""
        return dry_friction(self.robot.friction, self.robot.joints)

    @cached_property
    def rests(self) -> Mask:
        """Where a joint rests. (T, n)"""
        return resting(self.t, self.dq)

    @cached_property
    def standing(self) -> Mask:
        """Where a joint stands still. (T, n)"""
        return standing(self.t, self.dq)

    @cached_property
    def standstill(self) -> Array:
        """Length of the stop that a sample belongs to, 0 where the joint moves. (T, n) [s]"""
        return duration(self.t, self.dq)

    @cached_property
    def steadied(self) -> "Run":
        """The run without samples that stand alone; itself where there are none."""
        whole = without_isolated(self.recording)
        return self if whole is self.recording else replace(self, recording=whole)

    def less(self, torque: Array) -> "Run":
        """The run without an external torque (T, n) [N·m], μ ← μ + τ."""
        mu = handed_over(self.terms.mu + torque)
        return self.holding(terms=replace(self.terms, mu=mu))

    def holding(self, **values: object) -> "Run":
        """The same recording with other values of what the model says."""
        made = replace(self)
        vars(made).update(values)
        return made

    def part(self, span: slice) -> "Run":
        """Some of its samples as a run, with what the model says of them in the whole."""
        motion = Recording(
            t=self.t[span], q=self.q[span], dq=self.dq[span], source=self.recording.source
        )
        values = {name: getattr(self, name)[span] for name in SERIES}
        return replace(self, recording=motion).holding(**values)

    def spare(self) -> None:
        """Of a long recording give back what can be made anew in less than an observer's pass."""
        self.recording.release()
        if self.recording.samples > LONG and "terms" in vars(self):
            _ = self.noise
            del vars(self)["terms"]
        if (steadied := vars(self).get("steadied", self)) is not self:
            steadied.spare()


class RunSamples(NamedTuple):
    """Some samples of a run."""

    run: Run  #: The run.
    inside: Mask  #: Which of its samples they are. (T,)


class Runs:
    """The runs of a command, each made once."""

    def __init__(self) -> None:
        self._runs: list[Run] = []

    def of(self, recording: Recording, robot: Robot, *, literal: bool = False) -> Run:
        """The recording with this robot's model, the one that is there if there is one."""
        check_joints(recording, robot)
        for run in self._runs:
            if run.recording is recording and run.robot is robot and run.literal == literal:
                return run
        self._runs.append(Run(recording=recording, robot=robot, literal=literal))
        return self._runs[-1]


def band(step: float, cutoff: float | None) -> tuple[float, float]:
    """The band above the signal in which noise is measured. [Hz]"""
    low = min(12.0 if cutoff is None else cutoff, 0.22 / step)
    return low, min(2.0 * low, 0.45 / step)
