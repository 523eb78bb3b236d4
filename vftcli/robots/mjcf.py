"""MJCF, the robot descriptions of MuJoCo, read by Pinocchio; what moves becomes a tree."""

import math
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, NoReturn
from xml.etree import ElementTree as ET

import numpy as np

from vftcli.robots.chain import Body
from vftcli.robots.robot_file import BOUNDS
from vftcli.robots.tree import BodyTree, TreeJoint
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
    # A joint's link is the body with the joint's own frame, else it has the joint's name.
    names = [str(name) for name in model.names]
    for frame in model.frames:
        k = frame.parentJoint
        same = frame.placement == pin.SE3.Identity()
        if frame.type == pin.FrameType.BODY and same and k and names[k] == model.names[k]:
            names[k] = str(frame.name)
    each = [MjcfJoint(path, pin, model, k) for k in range(1, model.njoints)]
    bodies: dict[str, Body | None] = {names[0]: None}
    bodies |= {names[one.number]: one.body() for one in each}
    joints = [one.joint(names) for one in each]
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


def pose_of(placement: Any) -> Pose:  # noqa: ANN401
    """Pinocchio's pose as ours."""
    return Pose(np.array(placement.rotation), np.array(placement.translation))


class MjcfJoint(NamedTuple):
    """A joint of a model that Pinocchio read, and what it moves."""

    path: Path  #: The MJCF.
    pin: Any  #: Pinocchio.
    model: Any  #: Its model.
    number: int  #: Number of the joint, the world's is 0.

    def refuse(self, message: str) -> NoReturn:
        """Raise a RobotError that names the file and the joint."""
        raise RobotError(f"{self.path}: joint {self.model.names[self.number]!r}: {message}")

    def body(self) -> Body:
        """What it moves, what is fixed to that included."""
        found, place = self.model.inertias[self.number], self.model.jointPlacements[self.number]
        if not np.allclose(place.rotation @ place.rotation.T, np.eye(3), atol=1e-6):
            self.refuse("its orientation is no rotation")
        body = Body(float(found.mass), np.array(found.lever), np.array(found.inertia))
        each = {**body._asdict(), "xyz": place.translation}
        for key, values in each.items():
            if why := BOUNDS[key].broken(key, np.ravel(values).tolist()):
                self.refuse(why)
        return body

    def joint(self, names: list[str]) -> TreeJoint:
        """The joint in a tree of links with these names."""
        model, k = self.model, self.number
        joint, form = model.joints[k], model.joints[k].shortname()
        kind = next((kind for name, kind in KINDS.items() if re.fullmatch(name, form)), "")
        plain = TreeJoint(
            name=str(model.names[k]),
            kind=kind or form,
            parent=names[model.parents[k]],
            child=names[k],
            placement=pose_of(model.jointPlacements[k]),
        )
        if not kind:
            return plain
        v, q = joint.idx_v, joint.idx_q
        limits = {"qd_max": model.velocityLimit[v], "tau_max": model.effortLimit[v]}
        limits = {key: value for key, value in limits.items() if 0 < value < 1e300}
        if kind != "continuous":
            limits |= {"q_min": model.lowerPositionLimit[q], "q_max": model.upperPositionLimit[q]}
        # The unit axis in its own frame; the Jacobian of a single joint comes without second axis.
        data = model.createData()
        self.pin.computeJointJacobians(model, data, self.pin.neutral(model))
        local = self.pin.getJointJacobian(model, data, k, self.pin.ReferenceFrame.LOCAL)
        column, rotor = np.array(local).reshape(6, model.nv)[:, v], float(model.armature[v])
        axis = column[3:] if np.any(column[3:]) else column[:3]
        if not np.isclose(np.linalg.norm(axis), 1.0):
            self.refuse("its axis points nowhere")
        if why := BOUNDS["rotor_inertia"].broken("armature", [rotor]):
            self.refuse(why)
        return replace(
            plain,
            axis=axis,
            limits={key: float(value) for key, value in limits.items() if math.isfinite(value)},
            rotor_inertia=rotor,
            damping=float(model.damping[v]),
            dry_friction=float(model.upperDryFrictionLimit[v]),
        )


@contextmanager
def parser_words() -> Iterator[list[str]]:
    """Catch what C++ code writes to stderr; the list holds its lines then."""
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
