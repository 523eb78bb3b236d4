"""Xacro, a program that writes a URDF: expanded by the package xacro, which needs no ROS.

Packages that a xacro names with $(find NAME) are looked for beside the file and above it, by their
`package.xml`.
"""

import io
import re
from collections.abc import Iterator, Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from pathlib import Path
from xml.etree import ElementTree as ET

from vftcli.robots.robot_file import robot_text
from vftcli.signals.errors import RobotError
from vftcli.signals.packages import needed
from vftcli.signals.parsing import assignment, did_you_mean

NAMESPACE = re.compile(r"\{[^}]*xacro[^}]*\}")
"""How the tag of an element of xacro begins."""

DECLARED = re.compile(r"<xacro:arg\s[^>]*?name\s*=\s*[\"']([^\"']+)[\"']")
"""A declaration of an argument, which has a default."""

USED = re.compile(r"\$\(arg\s+([^)\s]+)\s*\)")
"""A use of an argument; one that is not declared has to be given."""

NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")
"""The name of a package in its manifest."""

FORM = "NAME=VALUE"
ABOVE = 5
"""Folders above the file in which packages are looked for."""


def has_macros(root: ET.Element) -> bool:
    """Whether a description still has to be expanded."""
    return any(NAMESPACE.match(str(element.tag)) for element in root.iter())


def urdf_of_xacro(path: Path, arguments: Sequence[str]) -> str:
    """The URDF that a xacro writes.

    Args:
        path: The file.
        arguments: What its arguments shall be, each ``NAME=VALUE``.

    Raises:
        RobotError: If xacro is not installed, an argument is unknown or missing, or the xacro
            cannot be expanded.
    """
    given = dict(assignment(word, "--robot-arg", FORM) for word in arguments)
    line = " ".join(["xacro", path.name, *(f"{k}:={v}" for k, v in given.items())])
    otherwise = f"; or give the URDF that it writes: {line} > {path.name.split('.')[0]}.urdf"
    xacro = needed("xacro", f"{path}: a xacro", otherwise, RobotError)
    packages = needed("xacrodoc.packages", f"{path}: a xacro", otherwise, RobotError)
    packages.update_package_cache(dict(packages_near(path)))
    text, why = "", ""
    try:
        with redirect_stderr(io.StringIO()), redirect_stdout(io.StringIO()):
            text = str(xacro.process_file(str(path), mappings=dict(given)).toxml())
    except Exception as error:  # noqa: BLE001 - a xacro is a program: it may raise anything
        why = " ".join(f"{type(error).__name__}: {error}".split())[:400]
    sources = [robot_text(Path(file)) for file in (path, *dict.fromkeys(xacro.all_includes))]
    declared = {name: "" for source in sources for name in DECLARED.findall(source)}
    used = {name: "" for source in sources for name in USED.findall(source)}
    takes = f"it takes {', '.join({**used, **declared}) or 'none'}"
    if unknown := next((name for name in given if name not in {**used, **declared}), None):
        meant = did_you_mean(unknown, {**used, **declared})
        raise RobotError(
            f"{path}: the xacro takes no argument {unknown!r}.{meant} As --robot-arg {takes}"
        )
    if why and (missing := [name for name in used if name not in {**declared, **given}]):
        raise RobotError(
            f"{path}: the xacro needs {', '.join(missing)}: give --robot-arg {missing[0]}=VALUE; "
            f"{takes}"
        )
    if why:
        raise RobotError(f"{path}: the xacro cannot be expanded: {why}; as --robot-arg {takes}")
    return text


def packages_near(path: Path) -> Iterator[tuple[str, str]]:
    """Name and folder of the packages above a file and beside these, the nearest last."""
    for folder in reversed(path.resolve().parents[:ABOVE]):
        for manifest in (*sorted(folder.glob("*/package.xml")), *folder.glob("package.xml")):
            with suppress(RobotError):  # a neighbour's that is no text
                if name := NAME.search(robot_text(manifest)):
                    yield name[1], str(manifest.parent)
