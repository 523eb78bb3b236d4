"""The elements of a robot description in XML, a xacro's expanded: no document types, not deep.

A xacro is a program that writes a URDF: the package xacro expands it, which needs no ROS. Packages
that it names with $(find NAME) are looked for beside the file and above it, by their `package.xml`.
A process of its own expands it, since a program need not end.
"""

import json
import re
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

from vftcli.robots.robot_file import robot_text
from vftcli.signals.errors import RobotError
from vftcli.signals.packages import needed
from vftcli.signals.parsing import did_you_mean

#: Elements within one another: a URDF has four, an MJCF one more than its arm has links.
DEEPEST = 500
#: How the tag of an element of xacro begins: a description with one still has to be expanded.
NAMESPACE = re.compile(r"\{[^}]*xacro[^}]*\}")
#: A declaration of an argument, which has a default.
DECLARED = re.compile(r"<xacro:arg\s[^>]*?name\s*=\s*[\"']([^\"']+)[\"']")
#: A use of an argument; one that is not declared has to be given.
USED = re.compile(r"\$\(arg\s+([^)\s]+)\s*\)")
NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")  #: The name of a package in its manifest.

ABOVE = 5  #: Folders above the file in which packages are looked for.
#: Time of a processor in which a xacro must be expanded; large ones take below one. [s]
SECONDS = 10
WAITED = 6  #: How many times as long it may take where others keep the processors busy.
MEMORY = 1 << 30  #: Memory in which it must be expanded; large ones take a tenth. [B]


class GuardedBuilder(ET.TreeBuilder):
    """A tree builder that takes no document type, which defines entities, and no deep nesting."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self._path = path
        self._depth = 0

    def doctype(self, name: str, public: str | None, system: str | None) -> None:
        """Refuse the document type, before what it defines is used."""
        del public, system
        raise RobotError(
            f"{self._path}: has a document type {name!r}, which defines XML entities; "
            "a robot description needs none: remove it"
        )

    def start(self, tag: str, attrs: dict[Any, Any], /) -> ET.Element:
        """Begin an element."""
        self._depth += 1
        if self._depth > DEEPEST:
            raise RobotError(f"{self._path}: more than {DEEPEST} elements within one another")
        return super().start(tag, attrs)

    def end(self, tag: str, /) -> ET.Element:
        """End an element."""
        self._depth -= 1
        return super().end(tag)


def xml_root(text: str, path: Path) -> ET.Element:
    """The first element of an XML text."""
    parser = ET.XMLParser(target=GuardedBuilder(path))
    try:
        parser.feed(text)
        root: ET.Element = parser.close()
    except (ET.ParseError, ValueError) as error:
        raise RobotError(f"{path}: not a URDF, xacro or MJCF, which is XML: {error}") from None
    return root


def urdf_of_xacro(path: Path, arguments: Sequence[str]) -> str:
    """The URDF that a xacro writes."""
    given = dict(word.split(":=", 1) for word in arguments)
    line = " ".join(["xacro", path.name, *(f"{k}:={v}" for k, v in given.items())])
    otherwise = f"; or give the URDF that it writes: {line} > {path.name.split('.')[0]}.urdf"
    for module in ("xacro", "xacrodoc"):
        needed(module, f"{path}: a xacro", otherwise, RobotError)
    made = expanded(path, given)
    why: str = made["why"]
    sources = [robot_text(Path(file)) for file in (path, *made["files"])]
    declared = {name: "" for source in sources for name in DECLARED.findall(source)}
    used = {name: "" for source in sources for name in USED.findall(source)}
    takes = f"it takes {', '.join({**used, **declared}) or 'none'}"
    if unknown := next((name for name in given if name not in {**used, **declared}), None):
        meant = did_you_mean(unknown, {**used, **declared})
        raise RobotError(
            f"{path}: the xacro takes no argument {unknown!r}.{meant} Behind its name {takes}"
        )
    if why and (missing := [name for name in used if name not in {**declared, **given}]):
        raise RobotError(
            f"{path}: the xacro needs {', '.join(missing)}: give --robot '{path} "
            f"{missing[0]}:=VALUE'; {takes}"
        )
    if why:
        raise RobotError(f"{path}: the xacro cannot be expanded: {why}; {takes}")
    text: str = made["text"]
    return text


def expanded(path: Path, arguments: Mapping[str, str]) -> dict[str, Any]:
    """What `vftcli.robots.xacro_child` makes of a xacro, within its limits."""
    asked = {
        "path": str(path),
        "arguments": arguments,
        "packages": dict(packages_near(path)),
        "seconds": SECONDS,
        "memory": MEMORY,
    }
    # By its path and without the current folder, in which anything may be called xacro.
    command = [sys.executable, "-P", str(Path(__file__).with_name("xacro_child.py"))]
    try:
        ended = subprocess.run(
            command,
            input=json.dumps(asked),
            capture_output=True,
            encoding="utf-8",
            timeout=WAITED * SECONDS,
            check=True,
        )
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired):
        raise RobotError(
            f"{path}: the xacro cannot be expanded within {SECONDS} s of a processor and "
            f"{MEMORY / 2**30:.0f} GiB of memory; give the URDF that it writes"
        ) from None
    made: dict[str, Any] = json.loads(ended.stdout)
    return made


def packages_near(path: Path) -> Iterator[tuple[str, str]]:
    """Name and folder of the packages above a file and beside these, the nearest last."""
    for folder in reversed(path.resolve().parents[:ABOVE]):
        for manifest in (*sorted(folder.glob("*/package.xml")), *folder.glob("package.xml")):
            with suppress(RobotError):  # a neighbour's that is no text
                if name := NAME.search(robot_text(manifest)):
                    yield name[1], str(manifest.parent)
