"""MJCF, the robot descriptions of MuJoCo, read by Pinocchio; what moves becomes a tree."""

import math
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from vftcli.robots.robot_file import BOUNDS
from vftcli.robots.tree import Body, BodyTree, TreeJoint
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError
from vftcli.signals.packages import needed
from vftcli.signals.pose import Pose

#: Pinocchio's name of a joint → its kind; all others are of no use in an arm.
KINDS = {
    r"JointModelR[XYZ]|JointModelRevoluteUnaligned": "revolute",
    r"JointModelRUB[XYZ]|JointModelRevoluteUnboundedUnaligned": "continuous",
    r"JointModelP[XYZ]|JointModelPrismaticUnaligned": "prismatic",
}


def mjcf_tree(path: Path, root: ET.Element) -> BodyTree:
    """The tree that an MJCF describes: its armature is the rotor inertia."""
    if (part := root.find(".//include")) is not None:
        raise RobotError(
            f"{path}: includes {part.get('file')!r}, which Pinocchio would leave out; have MuJoCo "
            "write it as one file (mj_saveLastXML)"
        )
    pin = needed(
        "pinocchio",
        f"{path}: an MJCF",
        "; or take the robot's URDF, which needs nothing",
        RobotError,
    )
    try:
        with parser_words() as words:
            model = pin.buildModelFromMJCF(str(path))
    except (ValueError, RuntimeError, IndexError, TypeError) as error:
        # Behind where in its source it stands.
        reason = " ".join([*words, *str(error).split()]).rpartition("message: ")[2]
        raise RobotError(f"{path}: not an MJCF that Pinocchio can read: {reason}") from None
    names = link_names(model)
    bodies: dict[str, Body | None] = {names[0]: None}
    bodies |= {names[k]: checked_body(model, k, path) for k in range(1, model.njoints)}
    joints = [moving_joint(model, k, names, path) for k in range(1, model.njoints)]
    for frame in model.frames:
        # Bodies without a joint, and sites, are frames of the joint that moves them.
        if frame.name not in bodies and frame.type != pin.FrameType.JOINT:
            bodies[frame.name] = None
            joints.append(
                TreeJoint(
                    name=f"{frame.name} (fixed)",
                    kind="fixed",
                    parent=names[frame.parentJoint],
                    child=frame.name,
                    placement=pose_of(frame.placement),
                )
            )
    return BodyTree(
        name=root.get("model", "") or path.stem,
        path=path,
        bodies=bodies,
        joints=joints,
        gravity=np.array(model.gravity.linear),
    )


def link_names(model: Any) -> list[str]:  # noqa: ANN401 - Pinocchio is untyped
    """For each joint the body whose frame is the joint's, the joint's own name where there is none.

    The first is the world's.
    """
    pin = needed("pinocchio", "an MJCF")

    names = [str(name) for name in model.names]
    for frame in model.frames:
        k = frame.parentJoint
        same = frame.placement == pin.SE3.Identity()
        if frame.type == pin.FrameType.BODY and same and k and names[k] == model.names[k]:
            names[k] = str(frame.name)
    return names


def pose_of(placement: Any) -> Pose:  # noqa: ANN401
    """Pinocchio's pose as ours."""
    return Pose(np.array(placement.rotation), np.array(placement.translation))


def checked_body(model: Any, index: int, path: Path) -> Body:  # noqa: ANN401
    """What a joint moves, what is fixed to it included."""
    found = model.inertias[index]
    R = model.jointPlacements[index].rotation
    if not np.allclose(R @ R.T, np.eye(3), atol=1e-6):
        raise RobotError(f"{path}: joint {model.names[index]!r}: its orientation is no rotation")
    body = Body(float(found.mass), np.array(found.lever), np.array(found.inertia))
    place = model.jointPlacements[index].translation
    for key, values in {"mass": [body.mass], "com": body.com, "inertia": body.inertia.ravel(),
                        "xyz": place}.items():  # fmt: skip
        if why := BOUNDS[key].broken(key, [float(value) for value in values]):
            raise RobotError(f"{path}: joint {model.names[index]!r}: {why}")
    return body


def moving_joint(
    model: Any,  # noqa: ANN401
    index: int,
    names: list[str],
    path: Path,
) -> TreeJoint:
    """A joint of Pinocchio's model as one of a tree whose links have these names."""
    joint, name = model.joints[index], str(model.names[index])
    kind = next((kind for form, kind in KINDS.items() if re.fullmatch(form, joint.shortname())), "")
    plain: dict[str, Any] = {
        "name": name,
        "kind": kind or joint.shortname(),
        "parent": names[model.parents[index]],
        "child": names[index],
        "placement": pose_of(model.jointPlacements[index]),
    }
    if not kind:
        return TreeJoint(**plain)
    v, q = joint.idx_v, joint.idx_q
    limits = {"qd_max": model.velocityLimit[v], "tau_max": model.effortLimit[v]}
    limits = {key: value for key, value in limits.items() if 0 < value < 1e300}
    if kind != "continuous":
        limits |= {"q_min": model.lowerPositionLimit[q], "q_max": model.upperPositionLimit[q]}
    axis, rotor = joint_axis(model, index), float(model.armature[v])
    if not np.isclose(np.linalg.norm(axis), 1.0):
        raise RobotError(f"{path}: joint {name!r}: its axis points nowhere")
    if why := BOUNDS["rotor_inertia"].broken("armature", [rotor]):
        raise RobotError(f"{path}: joint {name!r}: {why}")
    return TreeJoint(
        **plain,
        axis=axis,
        limits={key: float(value) for key, value in limits.items() if math.isfinite(value)},
        rotor_inertia=rotor,
        damping=float(model.damping[v]),
        dry_friction=float(model.upperDryFrictionLimit[v]),
    )


def joint_axis(model: Any, index: int) -> Array:  # noqa: ANN401
    """The unit axis of a joint that turns or slides, in its own frame. (3,)"""
    pin = needed("pinocchio", "an MJCF")

    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    local = pin.getJointJacobian(model, data, index, pin.ReferenceFrame.LOCAL)
    # The Jacobian of a single joint comes without its second axis.
    column = np.array(local).reshape(6, model.nv)[:, model.joints[index].idx_v]
    axis: Array = column[3:] if np.any(column[3:]) else column[:3]
    return axis


@contextmanager
def parser_words() -> Iterator[list[str]]:
    """Catch what C++ code writes to stderr by itself; the list holds its lines afterwards."""
    lines: list[str] = []
    with suppress(OSError, ValueError, AttributeError):  # a stderr that is closed, or not a file
        sys.stderr.flush()
    try:
        own = os.dup(2)
    except OSError:  # closed: nobody would read it
        yield lines
        return
    with tempfile.TemporaryFile() as kept:
        os.dup2(kept.fileno(), 2)
        try:
            yield lines
        finally:
            os.dup2(own, 2)
            os.close(own)
            kept.seek(0)
            lines += kept.read(1 << 16).decode(errors="replace").splitlines()
