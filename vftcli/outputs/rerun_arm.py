"""The arm and forces in a Rerun recording: shapes, poses, colours, arrows.

The arm is drawn with the meshes of its description, else with capsules from the chain's
geometry. A contact's arrow is at its place while it lasts, below `/contacts`, and the
touched links have its colour.
"""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import rerun as rr
from numpy.typing import NDArray

from vftcli.contacts.contact_list import ContactList
from vftcli.outputs.charts import PLACES
from vftcli.outputs.shapes import capsules, touched_point
from vftcli.robots.chain import Chain, link_poses
from vftcli.robots.meshes import COLOURED, FORMATS, collada
from vftcli.robots.robot import Mesh, Robot
from vftcli.signals.arrays import Array
from vftcli.signals.pose import matrix_quaternion, rotation_onto

Stream = rr.RecordingStream  #: A recording in the making.
Packed = NDArray[np.uint32]  #: Colours in Rerun's form.
#: When a link's colour changes [s] → that colour ``#rrggbb``, "" for its own.
Changes = Mapping[float, str]

ROBOT, CONTACTS = "/robot", "/contacts"  #: Roots of the arm and of the contacts, by number.
RATE = 50.0  #: Drawn poses a second. [Hz]
MOST_POSES = 20_000  #: Most drawn poses.
NEWTON_PER_METRE = 200.0  #: Default scale of a force arrow: 200 N are 1 m.
#: Colours of links, joints and the force arrow.
LINK, JOINT, FORCE = "#b0b8c0", "#4e5c6a", "#dd6415"
#: Lengths that a force arrow may have. [N/m]
SCALES = (5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0)
SHAFT = 0.012  #: Radius of a force arrow. [m]
LONGEST = 0.5  #: Longest arrow, that of the hardest force. [m]


class ArmPoses(NamedTuple):
    """Poses of the links over time."""

    t: Array  #: Time. (S,) [s]
    translation: Array  #: Origins in the base frame, the flange last. (S, n+1, 3) [m]
    quat_xyzw: Array  #: Orientations as unit quaternions. (S, n+1, 4)
    q: Array  #: Joint positions. (S, n) [rad]


def rgba(*colours: str) -> Packed:
    """Colours ``#rrggbb`` as 0xRRGGBBAA: [r, g, b] is three colours to Rerun 0.30."""
    return np.array([int(f"{colour[1:]}ff", 16) for colour in colours], dtype=np.uint32)


def motion(chain: Chain, t: Array, q: Array) -> ArmPoses:
    """Poses of all links at about `RATE` samples a second, at most `MOST_POSES`."""
    # A slow log is drawn as it is.
    every = max(1, int(len(t) / max(float(t[-1] - t[0]) * RATE, 1.0)), -(-len(t) // MOST_POSES))
    t, q = t[::every], np.ascontiguousarray(q[::every])
    poses = link_poses(chain, q)
    return ArmPoses(t, poses.translation, xyzw(poses.rotation), q)


def xyzw(rotation: Array) -> Array:
    """Unit quaternions of rotation matrices, the scalar last as Rerun has it. (…, 4)"""
    return np.roll(matrix_quaternion(rotation), -1, axis=-1)


def arrow_scale(found: ContactList | None) -> float:
    """Newtons of 1 m of arrow, for a visible hardest force. [N/m]"""
    if found is None or (hardest := found.hardest) is None:
        return NEWTON_PER_METRE
    force = hardest.peak_force or NEWTON_PER_METRE
    return next((scale for scale in SCALES if force <= LONGEST * scale), SCALES[-1])


def send_arm(
    stream: Stream, robot: Robot, poses: ArmPoses, painted: Mapping[int, Changes]
) -> None:
    """Send the arm's shape once, its poses over time, and changes of link colours."""
    time = rr.TimeColumn("t", duration=poses.t)
    for j, shapes in enumerate(capsules(robot.chain)):
        link = f"{ROBOT}/link_{j}" if j else f"{ROBOT}/base"
        meshes = [mesh for mesh in robot.meshes if mesh.link == j]
        changes = {float(poses.t[0]): "", **painted[j]} if j in painted else {}
        if not send_meshes(stream, link, meshes, changes) and shapes:
            # Rerun's own capsules are along z from one end.
            turns = np.array([rotation_onto(shape.direction) for shape in shapes])
            batch = rr.Capsules3D(
                lengths=[np.linalg.norm(shape.direction) for shape in shapes],
                radii=[shape.radius for shape in shapes],
                translations=np.array([shape.start for shape in shapes]),
                quaternions=xyzw(turns),
                fill_mode="solid",
            )
            stream.log(link, batch, static=True)
            own = rgba(*(JOINT if shape.kind == "joint" else LINK for shape in shapes))
            send_colours(stream, link, own, changes)
        if j:
            columns = rr.Transform3D.columns(
                translation=poses.translation[:, j - 1], quaternion=poses.quat_xyzw[:, j - 1]
            )
            stream.send_columns(link, [time], columns)


def send_meshes(stream: Stream, link: str, meshes: Sequence[Mesh], changes: Changes) -> bool:
    """Send the meshes of a link once; whether it has any and none is missing."""
    found = [(mesh, mesh.file) for mesh in meshes if mesh.file is not None]
    try:
        contents = [collada(file.read_bytes()) for _, file in found]
    except OSError:  # gone since the robot was loaded
        return False
    for k, (mesh, file) in enumerate(found):
        path, ending = f"{link}/mesh_{k}", file.suffix.lower()
        asset = rr.Asset3D(contents=contents[k][0], media_type=FORMATS[ending])
        shape = mesh.pose.rotation * mesh.scale * contents[k][1]
        place = rr.Transform3D(translation=mesh.pose.translation, mat3x3=shape)
        stream.log(path, asset, place, static=True)
        own = rgba(*() if ending in COLOURED else (LINK,))
        send_colours(stream, path, own, changes, mesh=True)
    return 0 < len(found) == len(meshes)


def send_colours(
    stream: Stream, path: str, own: Packed, changes: Changes, *, mesh: bool = False
) -> None:
    """Send the colours of shapes: their own, and changes."""
    kind, field = (rr.Asset3D, "albedo_factor") if mesh else (rr.Capsules3D, "colors")
    given: dict[str, Any] = {field: own}
    if not changes:
        if len(own):  # else those in a mesh's file show
            stream.log(path, kind.from_fields(**given), static=True)
        return
    count, times = max(len(own), 1), sorted(changes)
    colours = [rgba(*[changes[t]] * count) if changes[t] else own for t in times]
    given[field] = np.concatenate(colours)
    columns = kind.columns(**given).partition([*map(len, colours)])
    stream.send_columns(path, [rr.TimeColumn("t", duration=times)], columns)


def painted_links(found: ContactList, joints: int) -> dict[int, dict[float, str]]:
    """Number of a touched link → changes of its colour, to that of the part."""
    spans: dict[int, dict[float, str]] = {}
    for c in found.contacts:
        for link in {place or joints for place in c.places}:
            spans.setdefault(link, {}).update({c.start: PLACES[c.where], c.stop: ""})
    return spans


def send_force(
    stream: Stream,
    path: str,
    t: Array,
    origin: Array,
    force: Array,
    *,
    scale: float = NEWTON_PER_METRE,
    colour: str = FORCE,
) -> None:
    """Send an arrow over time, none where the force is unknown.

    `origin` [m] and `force` [N] are in base axes, (S, 3); `scale` newtons are 1 m.
    """
    known = np.all(np.isfinite(force), axis=1)
    count = int(known.sum())
    columns = rr.Arrows3D.columns(
        origins=origin[known],
        vectors=force[known] / scale,
        radii=np.full(count, SHAFT),
        colors=np.repeat(rgba(colour), count),
    ).partition(known.astype(int))
    stream.send_columns(path, [rr.TimeColumn("t", duration=t)], columns)


def send_contacts(
    stream: Stream, found: ContactList, poses: ArmPoses, force: Array | None, scale: float
) -> None:
    """Send the arrow of each contact, while it lasts; `scale` newtons are 1 m.

    On the wrist it is `force`, that of `best` at these poses in base axes [N], (S, 3);
    elsewhere, where the flange's would be wrong, that of the contact's peak.
    """
    for contact in found.contacts:
        if contact.wrench is None:
            continue
        first = int(np.searchsorted(poses.t, contact.start))
        # One more: the first pose after the contact ends the arrow.
        rows = slice(first, int(np.searchsorted(poses.t, contact.stop, side="right")) + 1)
        t, origin = poses.t[rows], touched_point(contact, poses.translation[rows])
        arrows = np.tile(contact.wrench[:3], (len(t), 1))
        if force is not None and contact.where == "wrist":
            arrows = np.where(np.isfinite(force[rows]), force[rows], arrows)
        arrows[t > contact.stop] = np.nan
        path, colour = f"{CONTACTS}/{contact.number}", PLACES[contact.where]
        send_force(stream, path, t, origin, arrows, scale=scale, colour=colour)
