"""URDF: links and joints as a tree, every number checked; the file may come out of a xacro."""

import re
from pathlib import Path
from typing import NamedTuple, NoReturn
from xml.etree import ElementTree as ET

import numpy as np

from vftcli.robots.chain import Body, symmetric
from vftcli.robots.profile import UPRIGHT
from vftcli.robots.robot_file import BOUNDS
from vftcli.robots.tree import MOST, BodyTree, TreeJoint
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError
from vftcli.signals.parsing import shown
from vftcli.signals.pose import Pose, rpy_matrix

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?")
TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
MOVING = ("revolute", "continuous", "prismatic", "planar")  #: Types of joints that have an axis.
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
    bodies: dict[str, Body | None] = {}
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

    path: Path  #: The file.
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

    def body(self) -> Body | None:
        """The link's inertia in its axes, None where it has none."""
        inertial = self.element.find("inertial")
        if inertial is None:
            return None
        mass = self.bounded(inertial, "mass", "value", 1, "mass")[0]
        tensor = [self.bounded(inertial, "inertia", key, 1, "inertia")[0] for key in TENSOR]
        R, com = self.origin(inertial)
        return Body(mass, com, R @ symmetric(tensor) @ R.T)

    def joint(self) -> TreeJoint:
        """The joint."""
        kind = self.element.get("type", "")
        if kind not in KINDS:
            self.refuse(f"type is {shown(kind)}; it is one of {', '.join(KINDS)}")
        mimic = self.element.find("mimic")
        known = {} if mimic is None else mimic.attrib
        follows = known.get("joint", "")
        if mimic is not None and not follows:
            self.refuse("<mimic> names no joint")
        return TreeJoint(
            name=self.name,
            kind=kind,
            parent=self.link("parent"),
            child=self.link("child"),
            placement=self.origin(self.element),
            axis=self.axis() if kind in MOVING else np.array([1.0, 0.0, 0.0]),
            limits=self.limits(endless=kind == "continuous"),
            follows=follows,
            **{
                key: self.numbers(mimic, key, 1)[0]
                for key in ("multiplier", "offset")
                if mimic is not None and key in known
            },
        )

    def link(self, tag: str) -> str:
        """The link that <parent> or <child> names."""
        found = self.element.find(tag)
        if found is None or not (name := found.get("link", "")):
            self.refuse(f"<{tag}> is missing, or names no link")
        return name

    def axis(self) -> Array:
        """The unit axis; x where none is given. (3,)"""
        axis = self.element.find("axis")
        if axis is None:
            return np.array([1.0, 0.0, 0.0])
        vector = np.array(self.numbers(axis, "xyz", 3))
        # An axis is normalised: shorter, it is rounding, longer, its square overflows.
        if not 1e-9 < np.max(np.abs(vector)) < 1e9:
            self.refuse(f"axis is {axis.get('xyz')!r}; it must point somewhere")
        unit: Array = vector / np.linalg.norm(vector)
        return unit

    def limits(self, *, endless: bool) -> dict[str, float]:
        """What <limit> gives; of an endless joint no positions."""
        found = self.element.find("limit")
        if found is None:
            return {}
        values = {
            field: self.numbers(found, key, 1)[0]
            for key, field in LIMITS.items()
            if key in found.attrib
        }
        ends = set() if endless else {"q_min", "q_max"}
        return {k: v for k, v in values.items() if k in ends or (k[:2] != "q_" and v > 0)}

    def origin(self, parent: ET.Element) -> Pose:
        """The pose that <origin> gives; both of its keys may be left out."""
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
        """The numbers of an attribute of an element below `parent`, within their bound."""
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
