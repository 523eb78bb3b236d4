"""The drawn arm: meshes of few triangles or capsules, and a force's place on it."""

from bisect import bisect
from typing import NamedTuple

import numpy as np

from vftcli.contacts.contact_list import Contact
from vftcli.outputs.charts import Index
from vftcli.robots.chain import Chain
from vftcli.robots.meshes import read_mesh
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError

#: Radius of the first and of the last link, as a share of the arm's length.
THICKNESS = (0.048, 0.030)
SHORTEST = 0.02  #: Links below this share of the arm's length are not drawn, their joints are.
MOST_TRIANGLES = 400  #: Triangles of a link on a page.
FINEST = 7.0  #: The finest grid has 2 to this power of cells along the longest side.
FLAT = 1e-3  #: Along directions that bend less, of the most, a corner stays in the middle.


class Capsule(NamedTuple):
    """A cylinder with round ends, in its frame's axes."""

    start: Array  #: Centre of one end. (3,) [m]
    direction: Array  #: From one end's centre to the other's. (3,) [m]
    radius: float  #: Radius. [m]
    kind: str = "link"  #: "link", or "joint" where it is one.


def capsules(chain: Chain) -> list[list[Capsule]]:
    """Parts on the base and on each link: n + 1 lists, base first."""
    n = chain.joints
    offsets = np.vstack([chain.translation, chain.flange_translation])
    length = np.linalg.norm(offsets, axis=1).sum()  # of the stretched arm
    radii = length * np.linspace(*THICKNESS, n + 1)
    shapes: list[list[Capsule]] = []
    for j in range(n + 1):
        shapes.append([])
        # A joint is a short thick cylinder about its link's z.
        if j > 0:
            axis = np.array([0.0, 0.0, 2.2 * radii[j]])
            shapes[j].append(Capsule(-0.5 * axis, axis, 1.18 * radii[j], "joint"))
        if np.linalg.norm(offsets[j]) > SHORTEST * length:
            shapes[j].append(Capsule(np.zeros(3), offsets[j], radii[j]))
    return shapes


class Surface(NamedTuple):
    """Triangles."""

    corners: Array  #: Places of their corners. (V, 3) [m]
    faces: Index  #: Three corners of each, counter-clockwise from outside. (F, 3)


def link_surfaces(robot: Robot) -> tuple[dict[int, Surface], list[str]]:
    """Link → its meshes as one surface of few triangles; names of unreadable ones.

    A link that lacks one of its meshes is drawn as capsules.
    """
    parts: dict[int, list[Array]] = {}
    lacking: dict[str, int] = {}
    for mesh in robot.meshes:
        try:
            parts.setdefault(mesh.link, []).append(read_mesh(mesh))
        except RobotError:
            lacking[mesh.name] = mesh.link
    whole = {link: np.vstack(p) for link, p in parts.items() if link not in lacking.values()}
    return {link: fewer(corners) for link, corners in whole.items()}, list(lacking)


def fewer(corners: Array) -> Surface:
    """A surface of at most `MOST_TRIANGLES`: one corner for each cell of a grid.

    It is where the planes of the cell's triangles meet best, within the cell, so that no
    point moves farther than a cell's diagonal. (Lindstrom 2000, Out-of-core simplification
    of large polygonal models, section 3)
    """
    long = np.ptp(corners, axis=(0, 1)).max()
    sizes = (long / 2.0 ** np.linspace(1.0, FINEST, 100)).tolist()
    count = bisect(sizes, MOST_TRIANGLES, key=lambda size: len(merged(corners, size)[1]))
    size = sizes[max(count - 1, 0)]
    cells, faces = merged(corners, size)
    count = int(cells.max()) + 1
    middle, planes, ends = np.zeros((count, 3)), np.zeros((count, 3, 3)), np.zeros((count, 3))
    np.add.at(middle, cells.ravel(), corners.reshape(-1, 3))
    middle /= np.bincount(cells.ravel())[:, None]
    # Planes n·(x − m) = n·(p − m) about the cell's middle m, by area.
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for cell in cells.T:
        away = np.sum(normal * (corners[:, 0] - middle[cell]), axis=1)
        np.add.at(planes, cell, normal[:, :, None] * normal[:, None, :])
        np.add.at(ends, cell, normal * away[:, None])
    best = middle + np.einsum("kij,kj->ki", np.linalg.pinv(planes, FLAT, hermitian=True), ends)
    floor = size * np.floor(middle / size)
    used, numbers = np.unique(faces, return_inverse=True)
    return Surface(np.clip(best, floor, floor + size)[used], numbers.reshape(-1, 3))


def merged(corners: Array, size: float) -> tuple[Index, Index]:
    """Cells of corners; triangles between three cells. (F, 3)"""
    places = np.floor(corners / size).astype(np.int64)
    x, y, z = np.moveaxis(places - places.min(axis=(0, 1)), -1, 0)
    _, cells = np.unique((x * (y.max() + 1) + y) * (z.max() + 1) + z, return_inverse=True)
    faces = cells = cells.reshape(-1, 3)
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    # Equal ones begin with the same corner.
    turned = (faces.argmin(axis=1)[:, None] + np.arange(3)) % 3
    faces = np.take_along_axis(faces, turned, axis=1)
    count = int(cells.max()) + 1
    _, first = np.unique(faces @ [count * count, count, 1], return_index=True)
    return cells, faces[first]


def spot_of(contact: Contact, joints: int) -> tuple[int, int]:
    """Frames beside a force's place: flange, or a link's ends."""
    if 0 in contact.places or not contact.places:
        return joints + 1, joints + 1
    return contact.places[-1], contact.places[-1] + 1


def touched_point(contact: Contact, origins: Array) -> Array:
    """Place of a force, by frames' origins (S, n+1, 3). (S, 3) [m]"""
    first, last = spot_of(contact, origins.shape[1] - 1)
    return 0.5 * (origins[:, first - 1] + origins[:, last - 1])
