"""Frames of a wrench: axes and point of its moment; a log's wrench in base axes.

The adjoint of a pose moves a wrench between frames. With R the orientation of S in F and
p its origin, a wrench given in S reads in F

    [F_F; N_F] = [[R, 0], [[p]×R, R]] [F_S; N_S]

which is (56), corrected (the paper prints R inverted in the lower left block), and
Pinocchio's ``SE3(R, p).act(Force)``.

A log may state its wrench's axes, the point of its moment and its sign (`WrenchFrame`);
a remark names what is assumed instead.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import Chain, flange_jacobian, link_poses
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import MissingSignalError, ParameterError
from vftcli.signals.option import numbers
from vftcli.signals.pose import IDENTITY, Pose, adjoint, inverse, rpy_matrix
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, caution, fact, warning
from vftcli.signals.wrench import Wrench, WrenchFrame

#: Name at the command line → axes and reference point.
FRAMES: dict[str, str] = {
    "flange": "flange axes, moment about the flange point",
    "base": "base axes, moment about the flange point",
    "tool": "tool axes, moment about the tool point (virtual-sensor.tool)",
    "sensor": "sensor axes, moment about the sensor's origin (virtual-sensor.sensor)",
}


class Mounting(NamedTuple):
    """Poses of tool and sensor on the flange."""

    tool: Pose | None = None  #: Pose of the tool in the flange frame, None if there is none.
    #: Pose of the force/torque sensor in the flange frame, None if there is none.
    sensor: Pose | None = None


NOTHING = Mounting()  #: A bare flange.


def check_frame(name: str) -> str:
    """Return the frame's name."""
    if name not in FRAMES:
        raise ParameterError(
            f"no frame {name!r} for a wrench; there is "
            + ", ".join(f"{key} ({words})" for key, words in FRAMES.items())
        )
    return name


def frame_pose(frame: str, mounting: Mounting) -> Pose:
    """Pose of a frame's origin and axes in the flange frame."""
    if frame == "tool":
        if mounting.tool is None:
            raise ParameterError(
                "the robot has no tool, so there is no Jacobian for it: give its pose on the "
                "flange with --set virtual-sensor.tool=x,y,z,roll,pitch,yaw, or a [tool.NAME] "
                "section in the robot file and --set virtual-sensor.tool=NAME"
            )
        return mounting.tool
    if frame == "sensor":
        if mounting.sensor is None:
            raise ParameterError(
                "the sensor's pose on the flange is not known: give it with --set "
                "virtual-sensor.sensor=x,y,z,roll,pitch,yaw, or virtual-sensor.sensor=fit to "
                "estimate it from the log"
            )
        return mounting.sensor
    return IDENTITY


def from_base(frame: str, flange: Array, mounting: Mounting) -> Array:
    """Matrices to a frame from base axes about a flange turned so. (T, 6, 6)"""
    if check_frame(frame) == "base":
        # Base axes need no pose, not even the tool's.
        return np.broadcast_to(np.eye(6), (len(flange), 6, 6))
    turned = flange.swapaxes(1, 2)
    X = np.zeros((len(flange), 6, 6))
    X[:, :3, :3] = X[:, 3:, 3:] = turned
    if frame == "flange":
        return X
    return adjoint(inverse(frame_pose(frame, mounting))) @ X


def read_pose(text: str, robot: Robot, section: str, option: str) -> Pose:
    """A pose from numbers, or from NAME of ``[section.NAME]`` in the robot file."""
    if (values := numbers(text)) is not None:
        if len(values) not in {3, 6} or not np.isfinite(values).all():
            raise ParameterError(
                f"{option}: {len(values)} numbers; a pose is three or six finite ones, "
                "x,y,z or x,y,z,roll,pitch,yaw [m, rad]"
            )
        return Pose(rpy_matrix(values[3:] or (0.0, 0.0, 0.0)), np.array(values[:3]))
    poses = {"tool": robot.tools, "sensor": robot.sensors}[section]
    if not text or text not in poses:
        there = ", ".join(filter(None, poses)) or "none"
        raise ParameterError(
            f"{option} {text!r}: {robot.name} has no [{section}.{text}]; it has {there}. Give "
            f"numbers x,y,z,roll,pitch,yaw [m, rad], or add the section with xyz and rpy"
        )
    return poses[text]


#: Of a log that states nothing: a sensor's reading, on the robot.
UNSTATED = WrenchFrame("sensor", "sensor")
#: One independent sample: errors of friction last as long. [s]
PIECE = 1.0
#: Evidence of three standard errors, enough to decide by currents. [nats]
SURE = 4.5


def logged_wrench(recording: Recording, chain: Chain, mounting: Mounting) -> Wrench:
    """The log's own wrench as force on the robot, in base axes about the flange point."""
    if not recording.require("wrench").any():
        raise MissingSignalError(
            f"{recording.name}: the log's wrench is zero in every sample, so it measures nothing"
        )
    return in_base_axes(recording, chain, mounting)


def in_base_axes(recording: Recording, chain: Chain, mounting: Mounting) -> Wrench:
    """A recording's wrench as force on the robot, in base axes about the flange point."""
    values, stated = recording.require("wrench"), recording.wrench_frame
    frame = stated or UNSTATED
    remarks = [warning("wrench-frame-unstated")] if stated is None else []
    if frame.point == "controller":
        tool = None if mounting.tool is None else mounting.tool.translation
        point, why = controller_point(recording, chain, tool)
        frame, remarks = replace(frame, point=point), [*why]
    # The flange replaces a tool or sensor of unknown pose; base axes need none.
    fixed = {name: pose or IDENTITY for name, pose in mounting._asdict().items()}
    poses = {"flange": IDENTITY, **fixed}
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
    axes, point_pose = poses.get(frame.axes), poses.get(frame.point)
    placed = link_poses(chain, recording.q)
    flange = placed.rotation[:, -1]
    force, moment = frame.factor * values[:, :3], frame.factor * values[:, 3:]
    if axes is not None:
        turn = flange @ axes.rotation
        force, moment = (np.einsum("tij,tj->ti", turn, part) for part in (force, moment))
    # About the flange the force has the moment of its lever too.
    lever = -placed.translation[:, -1]
    if point_pose is not None:
        lever = flange @ point_pose.translation
    moment = moment + np.cross(lever, force)
    return Wrench(
        name="log",
        t=recording.t,
        values=np.concatenate([force, moment], axis=1),
        frame="base",
        remarks=tuple(remarks),
    )


def controller_point(
    recording: Recording, chain: Chain, tool: Array | None
) -> tuple[str, tuple[Remark, ...]]:
    """The point of a controller's moment, "flange" or "tool", and why.

    The controller knows its payload and its arm: the measured current less its target is the
    touch, each joint with its own factor and offset. Jᵀ of the wrench explains it, once about
    the flange and once about the tool's point. The one that leaves less is used if it is
    likelier by `SURE`, else the flange, as of an e-Series' own sensor. The log's wrench is in
    base axes, and the tool's point in the flange frame. (3,) [m]
    """
    if recording.current is None or recording.target_current is None:
        return "flange", (caution("controller-point-without-currents"),)
    if tool is None or not tool.any():
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
    values = {point: np.sqrt(share.mean()) for point, share in left.items()}
    pieces = recording.duration / PIECE
    evidence = 0.5 * pieces * np.log(left["flange"] / left["tool"]).sum()
    if abs(evidence) <= SURE:
        return "flange", (caution("controller-point-open", **values),)
    point = "tool" if evidence > 0.0 else "flange"
    return point, (fact(f"controller-point-{point}", **values),)


def unexplained(beyond: Array, torque: Array) -> Array:
    """Share of each joint's variance (T, n) left by a line in torque (T, n). (n,)"""
    y, x = beyond - beyond.mean(axis=0), torque - torque.mean(axis=0)
    tiny = np.finfo(np.float64).tiny
    slope = np.sum(x * y, axis=0) / np.maximum(np.sum(x**2, axis=0), tiny)
    rest = np.sum((y - slope * x) ** 2, axis=0)
    return np.asarray(np.maximum(rest, tiny) / np.maximum(np.sum(y**2, axis=0), tiny))
