"""A free run has one owner: what was read, what the model says of it, where in it a log belongs."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from vftcli.robots.drive import check_joints
from vftcli.robots.robot import Robot
from vftcli.robots.terms import DynamicsTerms, dynamics_terms
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.recording import Recording
from vftcli.signals.rest import resting
from vftcli.signals.series import white_noise
from vftcli.signals.shown import Shown

# A plain estimate has no free run: what lays one under a log is loaded when it is asked for.
if TYPE_CHECKING:
    from vftcli.repetition.alignment import Alignment
    from vftcli.repetition.drive_run import DriveRun
    from vftcli.repetition.pairing import Pairing

#: Samples from which on a recording's terms do not stay in memory beside its results.
LONG = 1 << 17


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class ModelledRun(Shown):
    """A recording and what the robot's model says of it, evaluated once, when first asked for."""

    recording: Recording  #: The recording.
    robot: Robot  #: The arm, its payload mounted.
    #: Whether `terms` come from the paper's numeric method; equal to a millionth.
    literal: bool = False

    @cached_property
    def terms(self) -> DynamicsTerms:
        """P and μ, as the observers take them."""
        return dynamics_terms(self.recording, self.robot, literal=self.literal)

    @cached_property
    def drive(self) -> "DriveRun":
        """Drive torque and the model's."""
        from vftcli.repetition.drive_run import drive_run_of

        return drive_run_of(self.recording, self.robot, self.terms)

    @cached_property
    def noise(self) -> Array:
        """Standard deviation of the white part of μ. (n,) [N·m]"""
        return white_noise(self.terms.mu)

    @cached_property
    def steadied(self) -> "ModelledRun":
        """The run without samples that stand alone; itself where there are none."""
        from vftcli.repetition.isolated import without_isolated

        whole = without_isolated(self.recording)
        return self if whole is self.recording else replace(self, recording=whole)

    def spare(self) -> None:
        """Of a long recording give back the terms: they are evaluated anew if they are asked for.

        That takes less time than a pass of the observers, and all of a log's results have no room
        beside them.
        """
        if self.recording.samples > LONG and "terms" in self.__dict__:
            _ = self.noise
            del self.__dict__["terms"]
        if (steadied := self.__dict__.get("steadied", self)) is not self:
            steadied.spare()

    @cached_property
    def rests(self) -> Mask:
        """Where a joint rests. (T, n)"""
        return resting(self.recording.t, self.recording.require("dq"))

    def with_terms(self, terms: DynamicsTerms) -> "ModelledRun":
        """The same recording with other terms than the model's own."""
        made = replace(self)
        made.__dict__["terms"] = terms
        return made


class Models:
    """The recordings that a command models with its robots, each once."""

    def __init__(self) -> None:
        self._runs: list[ModelledRun] = []

    def of(self, recording: Recording, robot: Robot, *, literal: bool = False) -> ModelledRun:
        """The recording with this robot's model, the one that is there if there is one."""
        check_joints(recording, robot)
        for run in self._runs:
            if run.recording is recording and run.robot is robot and run.literal == literal:
                return run
        self._runs.append(ModelledRun(recording=recording, robot=robot, literal=literal))
        return self._runs[-1]


@dataclass(frozen=True, kw_only=True, eq=False)
class FreeRun:
    """A motion in another recording that nobody touched, beside the log it serves.

    Everything that is asked of it, by references, zero and bands, is made once.
    """

    run: ModelledRun  #: The free run.
    log: ModelledRun  #: The log.

    @cached_property
    def _alignment(self) -> "Alignment | ReferenceTorqueError":
        from vftcli.repetition.alignment import align

        try:
            return align(self.log.recording, self.recording)
        except ReferenceTorqueError as error:
            return error

    @property
    def recording(self) -> Recording:
        """The free run as it was read."""
        return self.run.recording

    @property
    def is_same_motion(self) -> bool:
        """Whether it follows the log's trajectory, or a part of it."""
        return not isinstance(self._alignment, ReferenceTorqueError)

    @property
    def alignment(self) -> "Alignment":
        """How it lies on the log."""
        if isinstance(self._alignment, ReferenceTorqueError):
            raise self._alignment
        return self._alignment

    @cached_property
    def pairing(self) -> "Pairing":
        """Where in the free run each sample of the log belongs."""
        from vftcli.repetition.pairing import pair_with_run

        found = self.alignment
        pairing = pair_with_run(self.log.recording.t, self.run.drive, found.shift, found.rate)
        return pairing._replace(times=np.where(found.overlap, pairing.times, np.nan))
