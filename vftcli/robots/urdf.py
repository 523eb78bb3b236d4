"""URDF and MJCF (by Pinocchio) as trees of links and joints, every number checked."""

import math
import os
import re
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, NoReturn
from xml.etree import ElementTree as ET

import numpy as np

from vftcli.robots.arm import BodyTree, TreeJoint
from vftcli.robots.chain import NO_BODY, Body, symmetric
from vftcli.robots.profile import UPRIGHT
from vftcli.robots.robot_file import BOUNDS
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError
from vftcli.signals.packages import needed
from vftcli.signals.parsing import shown
from vftcli.signals.pose import Pose, rpy_matrix

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?")
TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
#: Types of joints that have an axis.
MOVING = ("revolute", "continuous", "prismatic", "planar")
KINDS = (*MOVING, "fixed", "floating")  #: Types of joints.
#: Attribute of <limit> → field of `vftcli.robots.robot.Limits`.
LIMITS = {"lower": "q_min", "upper": "q_max", "velocity": "qd_max", "effort": "tau_max"}


def urdf_tree(path: Path, root: ET.Element) -> BodyTree:
    """The tree that a URDF describes."""
    links = [UrdfPart(path, element) for element in root.iterfind("link")]
    joints = [UrdfPart(path, element) for element in root.iterfind("joint")]
    if max(len(links), len(joints)) > MOST:
        raise RobotError(
            f"{path}: has {len(links)} links and {len(joints)} joints; a robot has at most {MOST}"
        )
    if not links:
        raise RobotError(f"{path}: the <robot> is empty: it has no link and no joint")
    bodies = {}
    for link in links:
        if link.name in bodies:
            link.refuse("another link has this name; each needs its own")
        bodies[link.name] = link.body()
    return BodyTree(
        name=root.get("name", "") or path.stem,
        path=path,
        bodies=bodies,
        joints=[joint.joint() for joint in joints],
        gravity=np.array(UPRIGHT),
    )


class UrdfPart(NamedTuple):
    """A link or a joint of a URDF, read number by number."""

    path: Path
    element: ET.Element  #: The link or the joint.

    @property
    def name(self) -> str:
        """Its name."""
        if not (name := self.element.get("name", "")):
            self.refuse("it needs a name")
        return name

    def refuse(self, message: str) -> NoReturn:
        """Raise a RobotError that names the file and the link or joint."""
        name = self.element.get("name", "without a name")
        raise RobotError(f"{self.path}: {self.element.tag} {name!r}: {message}")

    def body(self) -> Body:
        """The link's inertia in its axes, `NO_BODY` where it has none."""
        inertial = self.element.find("inertial")
        if inertial is None:
            return NO_BODY
        mass = self.bounded(inertial, "mass", "value", 1, "mass")[0]
        tensor = [self.bounded(inertial, "inertia", key, 1, "inertia")[0] for key in TENSOR]
        R, com = self.origin(inertial)
        return Body(mass, com, R @ symmetric(tensor) @ R.T)

    def joint(self) -> TreeJoint:
        """The joint."""
        kind = self.element.get("type", "")
        if kind not in KINDS:
            self.refuse(f"type is {shown(kind)}; it is one of {', '.join(KINDS)}")
        mimic, limit = self.part("mimic"), self.part("limit")
        follows = mimic.get("joint", "")
        if self.element.find("mimic") is not None and not follows:
            self.refuse("<mimic> names no joint")
        limits = self.given(limit, LIMITS)
        # None of an endless joint's positions; other zero limits say nothing.
        endless = kind == "continuous"
        known = {k: v for k, v in limits.items() if (not endless if k[:2] == "q_" else v > 0)}
        followed = self.given(mimic, {key: key for key in ("multiplier", "offset")})
        return TreeJoint(
            name=self.name,
            kind=kind,
            parent=self.link("parent"),
            child=self.link("child"),
            placement=self.origin(self.element),
            axis=self.axis(moving=kind in MOVING),
            limits=known,
            follows=follows,
            **followed,
        )

    def part(self, tag: str) -> ET.Element:
        """The element of this tag within it, an empty one if there is none."""
        found = self.element.find(tag)
        return ET.Element(tag) if found is None else found

    def given(self, element: ET.Element, fields: Mapping[str, str]) -> dict[str, float]:
        """Field → number of each attribute that the element has."""
        there = {key: name for key, name in fields.items() if key in element.attrib}
        return {name: self.numbers(element, key, 1)[0] for key, name in there.items()}

    def link(self, tag: str) -> str:
        """The link that <parent> or <child> names."""
        if not (name := self.part(tag).get("link", "")):
            self.refuse(f"<{tag}> is missing, or names no link")
        return name

    def axis(self, *, moving: bool) -> Array:
        """The unit axis; x where none is given. (3,)"""
        axis = self.element.find("axis")
        if axis is None or not moving:
            return np.array([1.0, 0.0, 0.0])
        vector = np.array(self.numbers(axis, "xyz", 3))
        # Shorter, an axis is rounding; longer, its square overflows.
        if not 1e-9 < abs(vector).max() < 1e9:
            self.refuse(f"axis is {axis.get('xyz')!r}; it must point somewhere")
        return np.asarray(vector / np.linalg.norm(vector))

    def origin(self, parent: ET.Element) -> Pose:
        """The pose of <origin>; both of its keys may be missing."""
        found = parent.find("origin")
        xyz, rpy = (
            self.bounded(parent, "origin", key, 3, key)
            if found is not None and key in found.attrib
            else [0.0, 0.0, 0.0]
            for key in ("xyz", "rpy")
        )
        return Pose(rpy_matrix(rpy), np.array(xyz))

    def bounded(
        self, parent: ET.Element, tag: str, key: str, length: int, bound: str
    ) -> list[float]:
        """The numbers of an element's attribute below `parent`, within bounds."""
        found = parent.find(tag)
        if found is None:
            self.refuse(f"<{parent.tag}> has no <{tag}>")
        if key not in found.attrib:
            self.refuse(f"<{tag}> has no {key}")
        values = self.numbers(found, key, length)
        if why := BOUNDS[bound].broken(f"{tag} {key}", values):
            self.refuse(why)
        return values

    def numbers(self, element: ET.Element, key: str, length: int) -> list[float]:
        """The numbers of an attribute. (length,)"""
        text = element.get(key, "")
        words = text.split()
        if len(words) != length or not all(NUMBER.fullmatch(word) for word in words):
            due = "a number" if length == 1 else f"{length} numbers"
            self.refuse(f"{element.tag} {key} is {shown(text)}; it must be {due}")
        return [float(word) for word in words]


#: Pinocchio's name of a joint → its kind; all others are of no use in an arm.
PINOCCHIO_KINDS = {
    r"JointModelR[XYZ]|JointModelRevoluteUnaligned": "revolute",
    r"JointModelRUB[XYZ]|JointModelRevoluteUnboundedUnaligned": "continuous",
    r"JointModelP[XYZ]|JointModelPrismaticUnaligned": "prismatic",
}


#: Links or joints of a URDF: a humanoid with two hands has a fifth of it.
MOST = 1000
#: Joints of an MJCF: Pinocchio needs .7 GB for so many, by their cube.
MOST_MJCF = 250


def mjcf_tree(path: Path, root: ET.Element) -> BodyTree:
    """The tree that an MJCF describes: its armature is the rotor inertia."""
    if (part := root.find(".//include")) is not None:
        raise RobotError(
            f"{path}: includes {part.get('file')!r}, which Pinocchio would leave out; have MuJoCo "
            "write it as one file (mj_saveLastXML)"
        )
    if (count := len([*root.iter("joint")])) > MOST_MJCF:
        raise RobotError(f"{path}: has {count} joints, more than {MOST_MJCF}")
    for part in root.iter():
        if re.fullmatch(r"[\s0.+-]*0[\s0.+-]*", part.get("quat", "")):
            raise RobotError(f"{path}: {part.tag} quat is of zeros only, which is no rotation")
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
        # Behind the place in the parser's source.
        reason = " ".join([*words, *str(error).split()]).rpartition("message: ")[2]
        raise RobotError(f"{path}: not an MJCF that Pinocchio can read: {reason}") from None
    # A joint's link is the body with the joint's own frame, else it has the joint's name.
    names = [str(name) for name in model.names]
    for frame in model.frames:
        k = frame.parentJoint
        same = frame.placement == pin.SE3.Identity()
        if frame.type == pin.FrameType.BODY and same and k and names[k] == model.names[k]:
            names[k] = str(frame.name)
    moved = range(1, model.njoints)
    bodies = {names[0]: NO_BODY, **{names[k]: mjcf_body(path, model, k) for k in moved}}
    joints = [mjcf_joint(path, model, k, names) for k in moved]
    for frame in model.frames:
        # Bodies without a joint, and sites, are frames of their joint.
        if frame.name not in bodies and frame.type != pin.FrameType.JOINT:
            bodies[frame.name] = NO_BODY
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


def mjcf_body(path: Path, model: Any, k: int) -> Body:  # noqa: ANN401
    """The body on joint k of Pinocchio's model, with all that is fixed to it."""
    found, place = model.inertias[k], model.jointPlacements[k]
    body = Body(float(found.mass), np.array(found.lever), np.array(found.inertia))
    each = {**body._asdict(), "xyz": place.translation}
    broken = (BOUNDS[key].broken(key, np.ravel(values).tolist()) for key, values in each.items())
    turns = np.allclose(place.rotation @ place.rotation.T, np.eye(3), atol=1e-6)
    if why := next(filter(None, broken), "") if turns else "its orientation is no rotation":
        raise RobotError(f"{path}: joint {model.names[k]!r}: {why}")
    return body


def mjcf_joint(path: Path, model: Any, k: int, names: list[str]) -> TreeJoint:  # noqa: ANN401
    """Joint k of Pinocchio's model in a tree of links with these names."""
    joint, form = model.joints[k], model.joints[k].shortname()
    kind = next((kind for name, kind in PINOCCHIO_KINDS.items() if re.fullmatch(name, form)), "")
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
    # Unit twist in its own frame, velocity first: the axis.
    twist, rotor = np.array(joint.createData().S).ravel(), float(model.armature[v])
    axis = twist[3:] if twist[3:].any() else twist[:3]
    why = BOUNDS["rotor_inertia"].broken("armature", [rotor])
    if not np.isclose(np.linalg.norm(axis), 1.0):
        why = "its axis points nowhere"
    if why:
        raise RobotError(f"{path}: joint {plain.name!r}: {why}")
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
    with suppress(OSError, ValueError, AttributeError):  # closed, or not a file
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
