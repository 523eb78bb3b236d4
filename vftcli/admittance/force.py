"""The wrench that drives a replay: from an observer's torque, a sensor's columns, or the truth."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vftcli.robots.kinematics import link_poses
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array, check_clock, check_shape, frozen
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.series import resampled
from vftcli.virtual_sensor.frames import FRAMES, Mounting, to_base
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor

BY_THE_ROBOT = "BY the robot"
"""How a recording says that its wrench is the robot's on the environment."""


@dataclass(frozen=True, kw_only=True)
class ForceRecord:
    """Force and moment on the flange along a log, and where the arm was.

    Attributes:
        t: Time since the log's first sample. (T,) [s]
        wrench: Force on the robot and moment about the flange point, in base axes; NaN where it is
            not known. (T, 6) [N, N·m]
        q: Joint positions. (T, n) [rad]
        source: Where the wrench comes from, in words.
        notes: What a reader should know, one sentence each.
    """

    t: Array
    wrench: Array
    q: Array
    source: str
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("t", "wrench", "q"):
            object.__setattr__(self, name, frozen(getattr(self, name)))
        check_clock(self.t, self.source)
        check_shape(self.wrench, (len(self.t), 6), "wrench", self.source)

    def zeroed(self, start: float, stop: float) -> "ForceRecord":
        """The same less its mean between two times, the drift of the zero. [s]

        Raises:
            ParameterError: If no known sample lies between them.
        """
        inside = (self.t >= start) & (self.t <= stop) & np.all(np.isfinite(self.wrench), axis=1)
        if not np.any(inside):
            raise ParameterError(
                f"--zero {start:g}:{stop:g} holds no known sample; the log runs from "
                f"{self.t[0]:g} to {self.t[-1]:g} s"
            )
        mean = self.wrench[inside].mean(axis=0)
        told = ", ".join(f"{value:.4g}" for value in mean)
        note = f"zero of the wrench removed, base axes [N, N·m]: {told} ({start:g}–{stop:g} s)"
        return ForceRecord(
            t=self.t,
            wrench=self.wrench - mean,
            q=self.q,
            source=self.source,
            notes=(*self.notes, note),
        )


def from_torque(estimate: ExternalTorque, q: Array, robot: Robot) -> ForceRecord:
    """F = pinv(J_Fᵀ) τ_ext (46) at the flange in base axes, unknown where the pose cannot tell it.

    Args:
        estimate: External torque on the robot.
        q: Joint positions. (T, n) [rad]
        robot: The arm.
    """
    sensed = VirtualSensor(frame="base").wrench(estimate, q, robot.chain)
    hidden = int(np.count_nonzero(~np.all(np.isfinite(sensed.known), axis=1)))
    notes = (
        (f"in {hidden} samples the pose cannot tell the wrench; they count as no force",)
        if hidden
        else ()
    )
    source = f"{estimate.name} through pinv(Jᵀ), force on the robot, base axes"
    return ForceRecord(t=estimate.t, wrench=sensed.known, q=q, source=source, notes=notes)


def from_sensor(
    recording: Recording, robot: Robot, frame: str | None = None, mounting: Mounting | None = None
) -> ForceRecord:
    """The log's own wrench column, turned into base axes and onto the robot.

    Args:
        recording: The log.
        robot: The arm, whose pose turns the wrench.
        frame: Its frame, one of `FRAMES` in virtual_sensor.frames; None takes what the log states.
        mounting: Where tool and sensor sit, for the frames that need it.

    Raises:
        MissingSignalError: If the log has no wrench.
        ParameterError: If neither the log nor `frame` names the wrench's frame.
    """
    wrench = recording.require("wrench")
    stated = recording.wrench_frame or ""
    name = frame or stated_frame(stated)
    if name is None:
        said = f"it says only {stated!r}" if stated else "the log does not name it"
        raise ParameterError(
            f"{recording.name}: the frame of the wrench is not named ({said}); name it with "
            f"--frame {'|'.join(FRAMES)}, or in --columns as wrench[base]=…"
        )
    X = to_base(name, link_poses(robot.chain, recording.q).rotation[:, -1], mounting or Mounting())
    notes = []
    sign = 1.0
    if BY_THE_ROBOT in stated:
        sign = -1.0
        notes.append("the log's wrench is the robot's on the environment; its sign was turned")
    if "stiffness frame" in stated or "TCP" in stated:
        notes.append("the log's moment is about its tool point, and is taken as about the flange")
    turned = sign * np.squeeze(X @ wrench[:, :, None], axis=2)
    return ForceRecord(
        t=recording.t,
        wrench=turned,
        q=recording.q,
        source=f"the log's own wrench ({stated or name})",
        notes=tuple(notes),
    )


def stated_frame(words: str) -> str | None:
    """The frame that a recording's words on its wrench begin with, or None."""
    first = words.split(maxsplit=1)[0].strip(",;:") if words else ""
    return first if first in FRAMES else None


def from_truth(recording: Recording, t: Array, wrench: Array, source: str) -> ForceRecord:
    """A wrench in base axes on its own clock, brought to the log's by interpolation.

    Args:
        recording: The log, for the poses.
        t: Times on the log's own clock, counted from its first sample. (S,) [s]
        wrench: Force and moment on the robot at the flange, base axes. (S, 6) [N, N·m]
        source: Where it comes from, in words.
    """
    inside = (recording.t >= t[0] - 1e-9) & (recording.t <= t[-1] + 1e-9)
    values = resampled(recording.t, t, wrench)
    values[~inside] = np.nan
    return ForceRecord(t=recording.t, wrench=values, q=recording.q, source=source)


def on_control_clock(t: Array, values: Sequence[Array], period: float) -> tuple[Array, list[Array]]:
    """Sample columns as a controller does: the newest sample at each control period.

    Args:
        t: Times of the log. (T,) [s]
        values: Columns. (T, …)
        period: Control period. [s]

    Returns:
        Times from the log's first sample on (S,) [s], and the columns then. (S, …)
    """
    count = int(np.floor((t[-1] - t[0]) / period + 1e-6)) + 1
    clock = t[0] + np.arange(count) * period
    # Half a microsecond of slack: a log's stamps are printed, and equal clocks must stay in step.
    newest = np.clip(np.searchsorted(t, clock + 5e-7 + 1e-3 * period, side="right") - 1, 0, None)
    return clock, [column[newest] for column in values]
