"""Mesh files of a URDF: found near it, placed on its arm's links, and read."""

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from vftcli.robots.arm import LumpedArm
from vftcli.robots.robot import Mesh
from vftcli.robots.robot_file import robot_text
from vftcli.robots.urdf import UrdfPart
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import IDENTITY, Pose, exp_matrix

#: Ending of a mesh file → its media type.
FORMATS = {
    ".dae": "model/vnd.collada+xml",
    ".glb": "model/gltf-binary",
    ".obj": "model/obj",
    ".stl": "model/stl",
}
COLOURED = (".dae", ".glb")  #: Those that hold colours.
LARGEST = 1 << 26  #: All files of an arm; most have a tenth. [B]
ABOVE = 5  #: Folders above the file in which packages are looked for.
FARTHEST = 1e6  #: Corners are nearer to their origin.
#: The unit of a DAE, and the axis that it calls up.
UNIT = re.compile(rb"(<unit\b[^>]*?\bmeter\s*=\s*[\"'])([^\"']*)")
UP = re.compile(rb"(<up_axis>\s*)[XY]_UP")
CORNER = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")  #: A corner in an STL of text.
#: A triangle in an STL of bytes.
FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
NAME = re.compile(r"<name>\s*([^<\s]+)\s*</name>")  #: A package's name in its manifest.


def meshes_of(arm: LumpedArm, root: ET.Element) -> tuple[Mesh, ...]:
    """Meshes of a URDF's links: for show if all are found, else for collisions."""
    asked = any("package://" in mesh.get("filename", "") for mesh in root.iter("mesh"))
    # A package's name is in its `package.xml`, else its folder's.
    above = reversed(arm.tree.path.resolve().parents[:ABOVE])
    packages = {folder.name: str(folder) for folder in above}
    packages |= packages_near(arm.tree.path) if asked else ()
    links = {
        link.get("name", ""): UrdfPart(arm.tree.path, link) for link in root.iterfind("link")
    }
    turns = [IDENTITY, *(Pose(turn.T) for turn, _ in arm.turned)]
    found = []
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
            except RobotError:  # looks are no reason to refuse it
                file = None
            yield Mesh(name, file, 0, pose, np.array(scale))


def file_of(name: str, path: Path, packages: Mapping[str, str]) -> Path | None:
    """The mesh file of a name in a URDF, None without one to show."""
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
    """Name and folder of packages above a file and beside, the nearest last."""
    for folder in reversed(path.resolve().parents[:ABOVE]):
        for manifest in (*sorted(folder.glob("*/package.xml")), *folder.glob("package.xml")):
            with suppress(RobotError):  # a neighbour's that is no text
                if name := NAME.search(robot_text(manifest)):
                    yield name[1], str(manifest.parent)


def read_mesh(mesh: Mesh) -> Array:
    """Triangles of a mesh on its link, counter-clockwise from outside. (F, 3, 3) [m]

    Raises RobotError if its file is missing, no STL, OBJ or DAE, or without a triangle.
    """
    try:
        found = CORNERS[Path(mesh.name).suffix.lower()]((mesh.file or Path()).read_bytes())
    except (OSError, LookupError, ValueError, SyntaxError) as error:
        raise RobotError(f"{mesh.name}: cannot be read as a mesh ({error})") from None
    if not len(found) or not (abs(found) < FARTHEST).all():
        raise RobotError(f"{mesh.name}: holds no triangle, or a corner that is nowhere")
    corners = found @ (mesh.pose.rotation * mesh.scale).T + mesh.pose.translation
    # Six times its volume: turned over where it or its scale is mirrored.
    volume = np.linalg.det(corners - corners.mean(axis=(0, 1))).sum()
    return corners if volume >= 0.0 else corners[:, ::-1]


def stl_corners(contents: bytes) -> Array:
    """Triangles of an STL, of bytes or of text. (F, 3, 3)"""
    if len(contents) == 84 + FACET.itemsize * int.from_bytes(contents[80:84], "little"):
        return np.frombuffer(contents, FACET, offset=84)["corners"].astype(float)
    return np.array(CORNER.findall(contents)).astype(float).reshape(-1, 3, 3)


def obj_corners(contents: bytes) -> Array:
    """Triangles of an OBJ: a larger face is a fan of them. (F, 3, 3)"""
    points, fans = list[list[bytes]](), list[list[int]]()
    for kind, *words in filter(None, map(bytes.split, contents.splitlines())):
        if kind == b"v":
            points.append(words[:3])
        elif kind == b"f":
            at = [int(word.split(b"/")[0]) for word in words]
            at = [k - 1 if k > 0 else len(points) + k for k in at]
            fans += ([at[0], *pair] for pair in pairwise(at[1:]))
    every = np.array(points).astype(float).reshape(-1, 3)
    return np.asarray(every[np.array(fans)])


def dae_corners(contents: bytes) -> Array:
    """Triangles of a DAE, placed by its nodes, in its own axes. (F, 3, 3) [m]"""
    root, found = ET.fromstring(contents), list[Array]()
    for each in root.iter():
        each.tag = each.tag.rpartition("}")[2]
    named = {f"#{each.attrib['id']}": each for each in root.iter() if "id" in each.attrib}
    waiting = [(scene, np.eye(4)) for scene in root.iter("visual_scene")]
    while waiting:
        node, place = waiting.pop()
        for step in node:
            place = place @ node_step(step)
        waiting += [(child, place) for child in node.iterfind("node")]
        for part in node.iterfind("instance_geometry"):
            for triangles in named[part.attrib["url"]].iter("triangles"):
                corners = geometry_corners(triangles, named)
                found.append(corners @ place[:3, :3].T + place[:3, 3])
    return collada(contents)[1] * np.concatenate(found)


def node_step(step: ET.Element) -> Array:
    """Transform of an element of a DAE's node. (4, 4)"""
    made, texts = np.eye(4), (step.text or "").split()
    if step.tag == "matrix":
        made = np.array(texts, dtype=float).reshape(4, 4)
    elif step.tag == "translate":
        made[:3, 3] = np.array(texts, dtype=float)
    elif step.tag == "scale":
        made[:3, :3] = np.diag(np.array(texts, dtype=float))
    elif step.tag == "rotate":
        *axis, degrees = map(float, texts)
        made[:3, :3] = exp_matrix(np.radians(degrees) * np.array(axis))
    return made


def geometry_corners(triangles: ET.Element, named: Mapping[str, ET.Element]) -> Array:
    """The corners that an element of a DAE's geometry lists. (F, 3, 3)"""
    (vertex,) = triangles.iterfind("input[@semantic='VERTEX']")
    (position,) = named[vertex.attrib["source"]].iterfind("input[@semantic='POSITION']")
    (points,) = named[position.attrib["source"]].iterfind("float_array")
    (places,) = triangles.iterfind("p")
    width = 1 + max(int(each.attrib["offset"]) for each in triangles.iterfind("input"))
    at = np.array((places.text or "").split(), dtype=int).reshape(-1, 3, width)
    every = np.array((points.text or "").split(), dtype=float).reshape(-1, 3)
    return np.asarray(every[at[:, :, int(vertex.attrib["offset"])]])


#: Ending of a mesh file → its reader.
CORNERS = {".stl": stl_corners, ".obj": obj_corners, ".dae": dae_corners}


def collada(contents: bytes) -> tuple[bytes, float]:
    """A mesh with z up, a DAE's in metres, and the unit of its numbers. [m]

    Robot descriptions ignore a DAE's axis and Rerun its unit; other files state neither.
    """
    found, unit = UNIT.search(contents), 1.0
    with suppress(ValueError):
        unit = float(found[2]) if found else 1.0
    metric = UP.sub(rb"\1Z_UP", UNIT.sub(rb"\g<1>1", contents, count=1))
    return metric, unit if 1e-6 < unit < 1e3 else 1.0
