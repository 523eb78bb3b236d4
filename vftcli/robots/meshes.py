"""The mesh files that a URDF names: found near it, and placed on the links of its arm.

Packages that it names are looked for above the file and beside the folders there, by their
`package.xml`, else by the name of a folder above it.
"""

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from vftcli.robots.arm import LumpedArm
from vftcli.robots.robot import Mesh
from vftcli.robots.robot_file import robot_text
from vftcli.robots.urdf import UrdfPart
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import IDENTITY, Pose

#: Ending of a mesh file → its media type.
FORMATS = {
    ".dae": "model/vnd.collada+xml",
    ".glb": "model/gltf-binary",
    ".obj": "model/obj",
    ".stl": "model/stl",
}
COLOURED = (".dae", ".glb")  #: Those that hold colours.
LARGEST = 1 << 26  #: The files of one arm together; most arms have a tenth of it. [B]
ABOVE = 5  #: Folders above the file in which packages are looked for.
NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")  #: The name of a package in its manifest.


def meshes_of(arm: LumpedArm, root: ET.Element) -> tuple[Mesh, ...]:
    """The meshes that the links of a URDF name.

    Of a link those for show, or where not all of them are found those for collisions.
    `root` is the first element of the URDF.
    """
    asked = any("package://" in mesh.get("filename", "") for mesh in root.iter("mesh"))
    above = reversed(arm.tree.path.resolve().parents[:ABOVE])
    packages = {folder.name: str(folder) for folder in above}
    packages |= packages_near(arm.tree.path) if asked else ()
    links = {link.get("name", ""): UrdfPart(arm.tree.path, link) for link in root.iterfind("link")}
    turns = [IDENTITY, *(Pose(turn.T, np.zeros(3)) for turn, _ in arm.turned)]
    found: list[Mesh] = []
    for name, (joint, pose) in arm.groups.items():
        each = [list(named(links[name], tag, packages)) for tag in ("visual", "collision")]
        whole = (some for some in each if some and all(mesh.file for mesh in some))
        place = turns[joint + 1] @ pose
        shown = next(whole, each[0] or each[1])
        found += [mesh._replace(link=joint + 1, pose=place @ mesh.pose) for mesh in shown]
    sizes = np.cumsum([mesh.file.stat().st_size if mesh.file else 0 for mesh in found])
    rows = zip(found, sizes, strict=True)
    return tuple(mesh if size <= LARGEST else mesh._replace(file=None) for mesh, size in rows)


def named(link: UrdfPart, tag: str, packages: Mapping[str, str]) -> Iterator[Mesh]:
    """The meshes of a link's shapes of one kind, in the link's frame."""
    for shape in link.element.iterfind(tag):
        geometry = UrdfPart(link.path, shape).part("geometry")
        for element in geometry.iterfind("mesh"):
            name, pose, scale = element.get("filename", ""), IDENTITY, [1.0, 1.0, 1.0]
            file = file_of(name, link.path, packages)
            try:
                pose = link.origin(shape)
                if "scale" in element.attrib:
                    scale = link.bounded(geometry, "mesh", "scale", 3, "xyz")
            except RobotError:  # what an arm looks like is no reason to refuse it
                file = None
            yield Mesh(name, file, 0, pose, np.array(scale))


def file_of(name: str, path: Path, packages: Mapping[str, str]) -> Path | None:
    """The mesh file of a name in a URDF, None where there is none that can be shown."""
    scheme, _, rest = name.rpartition("://")
    package, _, inner = rest.partition("/")
    file = path.parent / rest if scheme != "package" else Path(packages.get(package, "")) / inner
    known = scheme in {"", "file"} or (scheme == "package" and package in packages)
    with suppress(OSError):  # a name that is too long, a folder that is closed
        if known and file.suffix.lower() in FORMATS and file.is_file():
            # Of a DAE a viewer reads triangles, no other polygons.
            small = file.stat().st_size <= LARGEST
            if small and (file.suffix.lower() != ".dae" or b"<triangles" in file.read_bytes()):
                return file
    return None


def packages_near(path: Path) -> Iterator[tuple[str, str]]:
    """Name and folder of the packages above a file and beside these, the nearest last."""
    for folder in reversed(path.resolve().parents[:ABOVE]):
        for manifest in (*sorted(folder.glob("*/package.xml")), *folder.glob("package.xml")):
            with suppress(RobotError):  # a neighbour's that is no text
                if name := NAME.search(robot_text(manifest)):
                    yield name[1], str(manifest.parent)
