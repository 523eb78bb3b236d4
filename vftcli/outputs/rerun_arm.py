"""Arms and forces in a Rerun recording: shapes, poses and colours over time, arrows."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from vftcli.outputs.arm import ArmPoses, Capsule, capsules
from vftcli.outputs.palette import rgb
from vftcli.outputs.rerun_file import Stream
from vftcli.robots.chain import Chain
from vftcli.signals.arrays import Array

NEWTON_PER_METRE = 200.0  #: Length of a force arrow where nothing else is said: 200 N are 1 m.
#: Colours of links, joints and the force arrow.
LINK, JOINT, FORCE = "#b0b8c0", "#4e5c6a", "#dd6415"
#: Lengths that a force arrow may have. [N/m]
SCALES = (5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0)
LONGEST = 0.5  #: The hardest force's arrow is as long at most. [m]


class PaintedSpan(NamedTuple):
    """A span in which a link has another colour."""

    start: float  #: [s]
    stop: float  #: [s]
    colour: str  #: ``#rrggbb``.


def arrow_scale(hardest: float) -> float:
    """Newtons that are 1 m, so that the arrow of the hardest force can be seen. [N/m]"""
    return next((scale for scale in SCALES if hardest <= LONGEST * scale), SCALES[-1])


def send_arm(
    stream: Stream,
    path: str,
    chain: Chain,
    poses: ArmPoses,
    painted: Mapping[int, Sequence[PaintedSpan]] | None = None,
) -> None:
    """Send an arm's shape once and its poses over time."""
    import rerun as rr

    time = rr.TimeColumn("t", duration=poses.t)
    for j, shapes in enumerate(capsules(chain)):
        link = f"{path}/link_{j}" if j else f"{path}/base"
        if shapes:
            stream.log(link, capsule_batch(shapes), static=True)
            own = [rgb(JOINT if shape.joint else LINK) for shape in shapes]
            send_colours(stream, link, own, float(poses.t[0]), (painted or {}).get(j, ()))
        if j:
            columns = rr.Transform3D.columns(
                translation=poses.translation[:, j - 1], quaternion=poses.quat_xyzw[:, j - 1]
            )
            stream.send_columns(link, [time], columns)


def capsule_batch(shapes: Sequence[Capsule]) -> Any:  # noqa: ANN401
    """Capsules in the axes of the link they move with; Rerun's own lie along z from one end."""
    import rerun as rr

    directions = np.array([shape.direction for shape in shapes])
    lengths = np.linalg.norm(directions, axis=1)
    return rr.Capsules3D(
        lengths=lengths,
        radii=[shape.radius for shape in shapes],
        translations=np.array([shape.start for shape in shapes]),
        quaternions=[turn_from_z(d / s) for d, s in zip(directions, lengths, strict=True)],
        fill_mode="solid",
    )


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
    import rerun as rr

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


def turn_from_z(unit: Array) -> Array:
    """Quaternion (x, y, z, w) that turns z to a unit vector the short way. (4,)"""
    # Straight down every turn by half is as short; the formula below would divide by zero.
    if unit[2] < -1.0 + 1e-9:
        return np.array([1.0, 0.0, 0.0, 0.0])
    turn = np.array([-unit[1], unit[0], 0.0, 1.0 + unit[2]])
    turned: Array = turn / np.linalg.norm(turn)
    return turned


def send_force(
    stream: Stream,
    path: str,
    t: Array,
    origin: Array,
    force: Array,
    radius: float,
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
        radius: Of the arrow's shaft. [m]
        scale: Newtons that are 1 m.
        colour: ``#rrggbb``.
    """
    import rerun as rr

    known = np.all(np.isfinite(force), axis=1)
    count = int(known.sum())
    columns = rr.Arrows3D.columns(
        origins=origin[known],
        vectors=force[known] / scale,
        radii=np.full(count, radius),
        colors=np.tile(np.array([*rgb(colour), 255], dtype=np.uint8), (count, 1)),
    ).partition(known.astype(int))
    stream.send_columns(path, [rr.TimeColumn("t", duration=t)], columns)
