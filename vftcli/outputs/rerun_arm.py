"""The arm and forces in a Rerun recording: shapes, poses and colours over time, arrows.

The arm is made of capsules, from the chain's own geometry.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import rerun as rr

from vftcli.outputs.palette import rgb
from vftcli.robots.chain import Chain, link_poses
from vftcli.signals.arrays import Array
from vftcli.signals.pose import matrix_quaternion, rotation_onto

Stream = rr.RecordingStream  #: A recording that is being made.

ROBOT = "/robot"  #: Root of the arm.
#: Radius of the first and of the last link, as a share of the arm's length.
THICKNESS = (0.048, 0.030)
RATE = 50.0  #: Poses a second that are drawn. [Hz]
MOST_POSES = 20_000  #: Poses that are drawn, however long the log is.
SHORTEST = 0.02  #: A link shorter than this share of the arm's length is not drawn: its joints are.
NEWTON_PER_METRE = 200.0  #: Length of a force arrow where nothing else is said: 200 N are 1 m.
#: Colours of links, joints and the force arrow.
LINK, JOINT, FORCE = "#b0b8c0", "#4e5c6a", "#dd6415"
#: Lengths that a force arrow may have. [N/m]
SCALES = (5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0)
SHAFT = 0.012  #: Radius of a force arrow. [m]
LONGEST = 0.5  #: The hardest force's arrow is as long at most. [m]


class Capsule(NamedTuple):
    """A cylinder with round ends, in the axes of the frame it moves with."""

    start: Array  #: Centre of one end. (3,) [m]
    direction: Array  #: From one end's centre to the other's. (3,) [m]
    radius: float  #: Radius. [m]
    joint: bool  #: Whether it is a joint, not a link.


class ArmPoses(NamedTuple):
    """Poses of the links over time."""

    t: Array  #: Time. (S,) [s]
    translation: Array  #: Origins in the base frame, the flange last. (S, n+1, 3) [m]
    quat_xyzw: Array  #: Orientations as unit quaternions. (S, n+1, 4)
    q: Array  #: Joint positions. (S, n) [rad]


def arm_length(chain: Chain) -> float:
    """Length of the stretched arm, base to flange. [m]"""
    offsets = np.vstack([chain.translation, chain.flange_translation])
    return float(np.linalg.norm(offsets, axis=1).sum())


def capsules(chain: Chain) -> list[list[Capsule]]:
    """Parts on the base and on each link: n + 1 lists, base first."""
    n, length = chain.joints, arm_length(chain)
    offsets = np.vstack([chain.translation, chain.flange_translation])
    radii = length * np.linspace(*THICKNESS, n + 1)
    shapes: list[list[Capsule]] = []
    for j in range(n + 1):
        shapes.append([])
        # A joint is a short thick cylinder about its axis, which is z of the link that it moves.
        if j > 0:
            half = 1.1 * radii[j]
            axis = np.array([0.0, 0.0, 2.0 * half])
            shapes[j].append(Capsule(-0.5 * axis, axis, 1.18 * radii[j], joint=True))
        if np.linalg.norm(offsets[j]) > SHORTEST * length:
            shapes[j].append(Capsule(np.zeros(3), offsets[j], radii[j], joint=False))
    return shapes


def motion(chain: Chain, t: Array, q: Array) -> ArmPoses:
    """Poses of all links at about `RATE` samples a second, `MOST_POSES` of them at most."""
    # At least each sample: a slow log is drawn as it is.
    every = max(1, int(len(t) / max(float(t[-1] - t[0]) * RATE, 1.0)), -(-len(t) // MOST_POSES))
    t, q = t[::every], np.ascontiguousarray(q[::every])
    poses = link_poses(chain, q)
    return ArmPoses(t, poses.translation, xyzw(poses.rotation), q)


def xyzw(rotation: Array) -> Array:
    """Unit quaternions of rotation matrices, the scalar last as Rerun has it. (…, 4)"""
    return np.roll(matrix_quaternion(rotation), -1, axis=-1)


class PaintedSpan(NamedTuple):
    """A span in which a link has another colour."""

    start: float  #: [s]
    stop: float  #: [s]
    colour: str  #: ``#rrggbb``.


def arrow_scale(hardest: float) -> float:
    """Newtons that are 1 m, so that the arrow of the hardest force can be seen. [N/m]"""
    return next((scale for scale in SCALES if hardest <= LONGEST * scale), SCALES[-1])


def send_arm(
    stream: Stream, chain: Chain, poses: ArmPoses, painted: Mapping[int, Sequence[PaintedSpan]]
) -> None:
    """Send the arm's shape once, its poses over time, and when links have another colour."""
    time = rr.TimeColumn("t", duration=poses.t)
    for j, shapes in enumerate(capsules(chain)):
        link = f"{ROBOT}/link_{j}" if j else f"{ROBOT}/base"
        if shapes:
            # Rerun's own capsules lie along z from one end.
            turns = np.array([rotation_onto(shape.direction) for shape in shapes])
            batch = rr.Capsules3D(
                lengths=[np.linalg.norm(shape.direction) for shape in shapes],
                radii=[shape.radius for shape in shapes],
                translations=np.array([shape.start for shape in shapes]),
                quaternions=xyzw(turns),
                fill_mode="solid",
            )
            stream.log(link, batch, static=True)
            own = [rgb(JOINT if shape.joint else LINK) for shape in shapes]
            send_colours(stream, link, own, float(poses.t[0]), painted.get(j, ()))
        if j:
            columns = rr.Transform3D.columns(
                translation=poses.translation[:, j - 1], quaternion=poses.quat_xyzw[:, j - 1]
            )
            stream.send_columns(link, [time], columns)


def send_colours(
    stream: Stream,
    link: str,
    own: Sequence[tuple[int, ...]],
    start: float,
    painted: Sequence[PaintedSpan],
) -> None:
    """Send the colours of a link's shapes: its own, and others in the painted spans.

    Args:
        stream: The recording.
        link: Entity of the link.
        own: Red, green and blue of each shape.
        start: The first pose's time. [s]
        painted: The spans in which all of them have another colour, in order.
    """
    if not painted:
        stream.log(link, rr.Capsules3D.from_fields(colors=own), static=True)
        return
    changes: dict[float, Sequence[tuple[int, ...]]] = {start: own}
    for span in painted:
        changes[max(span.start, start)] = [rgb(span.colour)] * len(own)
        changes[span.stop] = own
    colours = np.array([colour for t in sorted(changes) for colour in changes[t]], dtype=np.uint8)
    columns = rr.Capsules3D.columns(colors=colours).partition([len(own)] * len(changes))
    stream.send_columns(link, [rr.TimeColumn("t", duration=sorted(changes))], columns)


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
    """Send an arrow over time; where the force is not known there is none.

    Args:
        stream: The recording.
        path: Entity of the arrow.
        t: Time. (S,) [s]
        origin: Where it acts, in base axes. (S, 3) [m]
        force: In base axes, NaN where not known. (S, 3) [N]
        scale: Newtons that are 1 m.
        colour: ``#rrggbb``.
    """
    known = np.all(np.isfinite(force), axis=1)
    count = int(known.sum())
    columns = rr.Arrows3D.columns(
        origins=origin[known],
        vectors=force[known] / scale,
        radii=np.full(count, SHAFT),
        colors=np.tile(np.array([*rgb(colour), 255], dtype=np.uint8), (count, 1)),
    ).partition(known.astype(int))
    stream.send_columns(path, [rr.TimeColumn("t", duration=t)], columns)
