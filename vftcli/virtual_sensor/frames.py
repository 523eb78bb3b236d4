"""Frames of a wrench: which axes it is expressed in and which point its moment refers to.

A wrench moves between frames by the adjoint of a pose. With R the orientation of S in F and p the
origin of S in F, a wrench given in S reads in F

    [F_F; N_F] = [[R, 0], [[p]×R, R]] [F_S; N_S]

which is (56) in its right form (the paper prints R the wrong way round in the lower left block) and
Pinocchio's ``SE3(R, p).act(Force)``.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import numbers
from vftcli.signals.pose import IDENTITY, Pose, adjoint, inverse, rpy_matrix

#: How far RᵀR may lie from the identity: nine printed digits of a rotation leave 1e-9.
ROTATION_TOLERANCE = 1e-6
#: Name at the command line → axes and reference point.
FRAMES: dict[str, str] = {
    "flange": "flange axes, moment about the flange point",
    "base": "base axes, moment about the flange point",
    "tool": "tool axes, moment about the tool point (virtual-sensor.tool)",
    "sensor": "sensor axes, moment about the sensor's origin (virtual-sensor.sensor)",
}


class Mounting(NamedTuple):
    """What is fixed to the flange."""

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
    """Pose in the flange frame of what a frame is fixed to."""
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
    """Matrices that take a wrench in base axes about the flange point to a named frame. (T, 6, 6)

    The flange has the orientation (T, 3, 3) in the base.
    """
    if check_frame(frame) == "base":
        # A wrench in base axes needs no pose at all, not even the tool's.
        return np.broadcast_to(np.eye(6), (len(flange), 6, 6))
    turned = np.swapaxes(flange, 1, 2)
    X = np.zeros((len(flange), 6, 6))
    X[:, :3, :3] = X[:, 3:, 3:] = turned
    if frame == "flange":
        return X
    moved: Array = adjoint(inverse(frame_pose(frame, mounting))) @ X
    return moved


def checked_pose(rotation: Array, translation: Array, what: str) -> Pose:
    """A pose whose rotation is one."""
    R, p = np.asarray(rotation, dtype=np.float64), np.asarray(translation, dtype=np.float64)
    if R.shape != (3, 3) or p.shape != (3,) or not (np.isfinite(R).all() and np.isfinite(p).all()):
        raise ParameterError(f"{what}: a pose has a finite 3×3 rotation and three finite lengths")
    error = float(np.max(np.abs(R.T @ R - np.eye(3))))
    if error > ROTATION_TOLERANCE or np.linalg.det(R) < 0:
        why = f"RᵀR differs from the identity by {error:.3g}"
        if error <= ROTATION_TOLERANCE:
            why = "its determinant is −1 (left-handed axes)"
        raise ParameterError(f"{what}: the matrix is not a rotation: {why}")
    return Pose(R, p)


def pose_of_numbers(values: Sequence[float], what: str) -> Pose:
    """A pose from x, y, z [m] with roll, pitch, yaw [rad] or nine entries of R by rows."""
    if (count := len(values)) not in {3, 6, 12}:
        raise ParameterError(
            f"{what}: {count} numbers; a pose is x,y,z or x,y,z,roll,pitch,yaw or x,y,z and "
            "nine entries of a rotation matrix, row by row [m, rad]"
        )
    turn = values[3:] or np.eye(3)
    R = rpy_matrix(values[3:]) if count == 6 else np.reshape(turn, (3, 3))
    return checked_pose(R, np.asarray(values[:3]), what)


def read_pose(text: str, robot: Robot, section: str, option: str) -> Pose:
    """A pose from the command line: numbers, or NAME of ``[section.NAME]`` in the robot file."""
    if (values := numbers(text)) is not None:
        return pose_of_numbers(values, option)
    poses = {"tool": robot.tools, "sensor": robot.sensors}[section]
    if not text or text not in poses:
        there = ", ".join(filter(None, poses)) or "none"
        raise ParameterError(
            f"{option} {text!r}: {robot.name} has no [{section}.{text}]; it has {there}. Give "
            f"numbers x,y,z,roll,pitch,yaw [m, rad], or add the section with xyz and rpy"
        )
    return poses[text]
