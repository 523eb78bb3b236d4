"""The text of a URDF, checked before its parser sees it: that takes what is no number for zero."""

import os
import re
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree as ET

from vftcli.robots.bounds import BOUNDS
from vftcli.robots.robot_file import robot_text
from vftcli.signals.errors import RobotError
from vftcli.signals.parsing import shown

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d{1,3})?")
TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
MOVING = ("revolute", "continuous", "prismatic", "planar")
"""Types of joints that have an axis."""


def checked_urdf(path: Path) -> str:
    """The text of a URDF in which every number of its links and joints is one.

    Raises:
        RobotError: If the file is no URDF, or a number is missing, no number, or none that a robot
            has; the message names the link or the joint.
    """
    text = robot_text(path)
    if "<!ENTITY" in text:
        raise RobotError(f"{path}: defines XML entities, which a URDF does not need; remove them")
    try:
        root = ET.fromstring(text)
    except (ET.ParseError, ValueError) as error:
        raise RobotError(f"{path}: not a URDF, which is XML: {error}") from None
    if root.tag != "robot":
        raise RobotError(f"{path}: not a URDF: its first element is <{root.tag}>, not <robot>")
    for link in root.iterfind("link"):
        UrdfPart(path, link).check_link()
    for joint in root.iterfind("joint"):
        UrdfPart(path, joint).check_joint()
    return text


class UrdfPart:
    """A link or a joint of a URDF, checked number by number.

    Attributes:
        path: The file.
        element: The link or the joint.
    """

    def __init__(self, path: Path, element: ET.Element) -> None:
        self.path = path
        self.element = element

    def refuse(self, message: str) -> NoReturn:
        """Raise a RobotError that names the file and the link or joint."""
        name = self.element.get("name", "without a name")
        raise RobotError(f"{self.path}: {self.element.tag} {name!r}: {message}")

    def check_link(self) -> None:
        """Check the link's mass, tensor and centre of mass; a link may have none of them."""
        for inertial in self.element.iterfind("inertial"):
            self.check(inertial, "mass", {"value": "mass"}, required=True)
            self.check(inertial, "inertia", dict.fromkeys(TENSOR, "inertia"), required=True)
            self.check_origin(inertial)

    def check_joint(self) -> None:
        """Check the joint's place, its axis and its limits."""
        self.check_origin(self.element)
        for limit in self.element.iterfind("limit"):
            for key in ("lower", "upper", "velocity", "effort"):
                if key in limit.attrib:
                    self.numbers(limit, key, 1)
        if self.element.get("type") not in MOVING:
            return
        for axis in self.element.iterfind("axis"):
            # An axis is normalised: shorter, it is rounding, longer, its square overflows.
            if not 1e-9 < max(map(abs, self.numbers(axis, "xyz", 3))) < 1e9:
                self.refuse(f"axis is {axis.get('xyz')!r}; it must point somewhere")

    def check_origin(self, parent: ET.Element) -> None:
        """Check a pose: both of its keys may be left out."""
        self.check(parent, "origin", {"xyz": "xyz", "rpy": "rpy"}, length=3)

    def check(
        self,
        parent: ET.Element,
        tag: str,
        keys: dict[str, str],
        *,
        length: int = 1,
        required: bool = False,
    ) -> None:
        """Check the attributes of an element below `parent`.

        Args:
            parent: What holds it.
            tag: What it is called.
            keys: Its attributes, and the key of a robot file whose bound each has.
            length: How many numbers each holds.
            required: Whether the element and each attribute must be there.
        """
        found = parent.find(tag)
        if found is None:
            if required:
                self.refuse(f"<{parent.tag}> has no <{tag}>")
            return
        for key, bound in keys.items():
            if key not in found.attrib:
                if required:
                    self.refuse(f"<{tag}> has no {key}")
                continue
            name = f"{tag} {key}"
            if why := BOUNDS[bound].broken(name, self.numbers(found, key, length)):
                self.refuse(why)

    def numbers(self, element: ET.Element, key: str, length: int) -> list[float]:
        """The numbers of an attribute. (length,)"""
        text = element.get(key, "")
        words = text.split()
        if len(words) != length or not all(NUMBER.fullmatch(word) for word in words):
            due = "a number" if length == 1 else f"{length} numbers"
            self.refuse(f"{element.tag} {key} is {shown(text)}; it must be {due}")
        return [float(word) for word in words]


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
