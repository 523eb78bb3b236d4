"""The wrench column of a log, turned into the form all wrenches here have: base axes, flange point.

A log may state its wrench's axes, the point of its moment and its sign (`WrenchFrame`); what it
leaves open is assumed, and the assumption is a remark.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vftcli.robots.chain import Chain, flange_jacobian, link_poses
from vftcli.signals.arrays import Array
from vftcli.signals.errors import MissingSignalError, ParameterError
from vftcli.signals.pose import IDENTITY
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, caution, fact
from vftcli.signals.wrench import Wrench, WrenchFrame
from vftcli.virtual_sensor.frames import FRAMES, Mounting

#: What is assumed of a log that states nothing: a sensor's own reading, force on the robot.
UNSTATED = WrenchFrame("sensor", "sensor")
#: As much of a log as counts for one independent sample: friction's errors last as long. [s]
PIECE = 1.0
#: Evidence from which on the currents' word is believed, that of three standard errors. [nats]
SURE = 4.5


class Placement(NamedTuple):
    """Where a log's wrench is measured."""

    frame: WrenchFrame  #: Its axes, point and sign.
    #: Orientation of its axes in the flange frame, None for the base's axes. (3, 3)
    axes: Array | None
    #: The point of its moment in the flange frame, None for the base's origin. (3,) [m]
    point: Array | None
    remarks: tuple[Remark, ...]  #: What had to be assumed.


def placement(frame: WrenchFrame | None, mounting: Mounting) -> Placement:
    """Where a log's wrench is measured; the flange stands for a tool or sensor of unknown pose."""
    remarks = [caution("wrench-frame-unstated")] if frame is None else []
    frame = frame or UNSTATED
    tool, sensor = mounting.tool or IDENTITY, mounting.sensor or IDENTITY
    poses = {"flange": IDENTITY, "tool": tool, "sensor": sensor}
    points = (*poses, "base")
    if frame.axes not in FRAMES or frame.point not in points:
        raise ParameterError(
            f"the log's wrench is in {frame}, which is no frame known here; say which with "
            f"--columns wrench[AXES@POINT], of the axes {', '.join(FRAMES)} and the points "
            f"{', '.join(points)}, as in wrench[base@tool]"
        )
    if mounting.sensor is None and "sensor" in (frame.axes, frame.point):
        remarks.append(caution("sensor-pose-unstated"))
    if mounting.tool is None and "tool" in (frame.axes, frame.point):
        remarks.append(caution("tool-pose-unstated", frame=str(frame)))
    axes = None if frame.axes == "base" else np.asarray(poses[frame.axes].rotation)
    point = None if frame.point == "base" else np.asarray(poses[frame.point].translation)
    return Placement(frame, axes, point, tuple(remarks))


def logged_wrench(recording: Recording, chain: Chain, mounting: Mounting) -> Wrench:
    """The log's own wrench as force on the robot, in base axes about the flange point."""
    if not np.any(recording.require("wrench")):
        raise MissingSignalError(
            f"{recording.name}: the log's wrench is zero in every sample, so it measures nothing"
        )
    return in_base_axes(recording, chain, mounting)


def in_base_axes(recording: Recording, chain: Chain, mounting: Mounting) -> Wrench:
    """A recording's wrench as force on the robot, in base axes about the flange point."""
    values = recording.require("wrench")
    frame, why = recording.wrench_frame, tuple[Remark, ...]()
    if frame is not None and frame.point == "controller":
        tool = None if mounting.tool is None else np.asarray(mounting.tool.translation)
        point, why = controller_point(recording, chain, tool)
        frame = replace(frame, point=point)
    where = placement(frame, mounting)
    poses = link_poses(chain, recording.q)
    flange = poses.rotation[:, -1]
    force, moment = where.frame.factor * values[:, :3], where.frame.factor * values[:, 3:]
    if where.axes is not None:
        turn = flange @ where.axes
        force, moment = (np.einsum("tij,tj->ti", turn, part) for part in (force, moment))
    # The force acts at the point, so about the flange it has the moment of its lever besides.
    lever = -poses.translation[:, -1] if where.point is None else flange @ where.point
    moment = moment + np.cross(lever, force)
    return Wrench(
        name="log",
        t=recording.t,
        values=np.concatenate([force, moment], axis=1),
        frame="base",
        remarks=(*why, *where.remarks),
    )


def controller_point(
    recording: Recording, chain: Chain, tool: Array | None
) -> tuple[str, tuple[Remark, ...]]:
    """The point of a controller's moment, "flange" or "tool", and why.

    The controller knows its payload and its arm: what the measured currents have beyond its target
    currents is what touches the arm, each joint with a factor and an offset of its own. It is
    explained by Jᵀ of the wrench, once about the flange and once about the tool's point. The one
    that leaves less is used if it is likelier by `SURE`; the flange is used where nothing tells,
    as an e-Series' own sensor has it.

    Args:
        recording: A log with a wrench in base axes.
        chain: The arm.
        tool: The tool's point in the flange frame, None where it is not known. (3,) [m]
    """
    if recording.current is None or recording.target_current is None:
        return "flange", (caution("controller-point-without-currents"),)
    if tool is None or not np.any(tool):
        return "flange", (caution("controller-point-without-tool"),)
    beyond = recording.current - recording.target_current
    force, moment = np.hsplit(recording.require("wrench"), 2)
    lever = link_poses(chain, recording.q).rotation[:, -1] @ tool
    J = flange_jacobian(chain, recording.q)
    about = {"flange": moment, "tool": moment + np.cross(lever, force)}
    left = {
        point: unexplained(beyond, np.einsum("tij,ti->tj", J, np.hstack([force, turned])))
        for point, turned in about.items()
    }
    values: dict[str, Any] = {
        point: float(np.sqrt(np.mean(share))) for point, share in left.items()
    }
    pieces = recording.duration / PIECE
    evidence = 0.5 * pieces * float(np.sum(np.log(left["flange"] / left["tool"])))
    if abs(evidence) <= SURE:
        return "flange", (caution("controller-point-open", **values),)
    point = "tool" if evidence > 0.0 else "flange"
    return point, (fact(f"controller-point-{point}", **values),)


def unexplained(beyond: Array, torque: Array) -> Array:
    """Share of each joint's variance (T, n) that a line in a torque (T, n) leaves. (n,)"""
    y, x = beyond - beyond.mean(axis=0), torque - torque.mean(axis=0)
    tiny = np.finfo(np.float64).tiny
    slope = np.sum(x * y, axis=0) / np.maximum(np.sum(x**2, axis=0), tiny)
    rest = np.sum((y - slope * x) ** 2, axis=0)
    share: Array = np.maximum(rest, tiny) / np.maximum(np.sum(y**2, axis=0), tiny)
    return share
