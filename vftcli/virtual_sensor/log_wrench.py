"""The wrench column of a log: what its reader said of axes, point and sign, in numbers."""

from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import Chain
from vftcli.robots.kinematics import link_poses
from vftcli.signals.arrays import Array
from vftcli.signals.errors import MissingSignalError, ParameterError
from vftcli.signals.pose import IDENTITY, adjoint
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.frames import FRAMES, Mounting, to_base


class Stated(NamedTuple):
    """How a log's wrench is given.

    Attributes:
        axes: Whose axes: a key of `FRAMES`.
        point: What its moment refers to: "flange", "tool" or "sensor".
        sign: +1 for force on the robot, −1 for force by the robot on the environment.
        notes: What was assumed, one sentence each.
    """

    axes: str
    point: str
    sign: float
    notes: tuple[str, ...]


TOOL_POINTS = ("TCP", "frame K", "tool")
"""Words of a reader that mean the tool's point."""


def stated(words: str | None, mounting: Mounting) -> Stated:
    """Understand what a reader, or ``--columns wrench[FRAME]=…``, says of a log's wrench.

    Args:
        words: `Recording.wrench_frame`.
        mounting: Where tool and sensor sit; without the tool's pose the flange stands for it.

    Raises:
        ParameterError: If the words name no frame.
    """
    if words is None:
        note = (
            "the log does not say the frame of its wrench: taken as force on the robot in sensor "
            "axes; say it with --columns wrench[base]=…, and the sensor's pose with --sensor-pose"
        )
        return Stated("sensor", "sensor", 1.0, (note, *unknown_pose(mounting)))
    axes = words.split()[0].strip(",").lower()
    if axes not in FRAMES:
        raise ParameterError(
            f"the log's wrench is said to be in {words!r}, which is no frame; there is "
            f"{', '.join(FRAMES)}, as in --columns wrench[base]=…"
        )
    sign = -1.0 if "BY the robot" in words else 1.0
    if axes == "sensor":
        return Stated("sensor", "sensor", sign, unknown_pose(mounting))
    at_tool = axes == "tool" or any(word in words for word in TOOL_POINTS)
    if at_tool and mounting.tool is None:
        note = (
            f"the log's wrench is {words}; the tool's pose is not known: the flange stands for it"
        )
        return Stated("flange" if axes == "tool" else axes, "flange", sign, (note,))
    return Stated(axes, "tool" if at_tool else "flange", sign, ())


def unknown_pose(mounting: Mounting) -> tuple[str, ...]:
    """A note where the sensor's pose has to be assumed."""
    if mounting.sensor is not None:
        return ()
    return ("the sensor's pose is not known: taken as the flange itself; give --sensor-pose",)


def logged_wrench(recording: Recording, chain: Chain, mounting: Mounting) -> Wrench:
    """The log's own wrench as force on the robot, in base axes about the flange point.

    Raises:
        MissingSignalError: If the log has none, or one that is zero throughout.
        ParameterError: If its frame is not one there is.
    """
    values = recording.require("wrench")
    if not np.any(values):
        raise MissingSignalError(
            f"{recording.name}: the log's wrench is zero in every sample, so it measures nothing"
        )
    how = stated(recording.wrench_frame, mounting)
    flange = link_poses(chain, recording.q).rotation[:, -1]
    turned = how.sign * values
    if how.axes == "base":
        lever = lever_of(how.point, mounting)
        there = np.einsum("tij,j->ti", flange, lever)
        moment = turned[:, 3:] + np.cross(there, turned[:, :3])
        moved: Array = np.concatenate([turned[:, :3], moment], axis=1)
    else:
        known = mounting if mounting.sensor is not None else mounting._replace(sensor=IDENTITY)
        moved = np.einsum("tij,tj->ti", to_base(how.axes, flange, known), turned)
    return Wrench(name="log", t=recording.t, values=moved, frame="base", remarks=how.notes)


def lever_of(point: str, mounting: Mounting) -> Array:
    """Position of a reference point in the flange frame. (3,) [m]"""
    pose = {"tool": mounting.tool, "sensor": mounting.sensor}.get(point)
    return np.zeros(3) if pose is None else np.asarray(pose.translation)


def in_sensor_axes(wrench: Wrench, chain: Chain, q: Array, mounting: Mounting) -> Array:
    """A wrench in base axes about the flange, as a sensor in its place reads it. (T, 6)"""
    sensor = mounting.sensor if mounting.sensor is not None else IDENTITY
    flange = link_poses(chain, q).rotation[:, -1]
    force = np.einsum("tji,tj->ti", flange, wrench.values[:, :3])
    moment = np.einsum("tji,tj->ti", flange, wrench.values[:, 3:])
    back = np.linalg.inv(adjoint(sensor))
    read: Array = np.concatenate([force, moment], axis=1) @ back.T
    return read
