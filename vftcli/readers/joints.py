"""Joint names: their order along the arm, and the robot they belong to."""

import re
from collections.abc import Sequence
from dataclasses import replace

from vftcli.readers.columns import SIGNALS
from vftcli.readers.reader import RawLog, ReadChoice
from vftcli.signals.arrays import Array
from vftcli.signals.errors import LogError
from vftcli.signals.recording import EFFORTS
from vftcli.signals.remarks import fact

#: The UR drivers' joint names, base to tip; the arrays of the ROS 1 driver are alphabetical.
UR_NAMES = (
    "shoulder_pan_joint",
    "shoulder_lift_joint",
    "elbow_joint",
    "wrist_1_joint",
    "wrist_2_joint",
    "wrist_3_joint",
)
#: The names on UR's teach pendant, base to tip.
UR_WORDS = ("base", "shoulder", "elbow", "wrist 1", "wrist 2", "wrist 3")

FRANKA = re.compile(r"(?:.*_)?(panda|fr3|fer|fp3)_joint([1-7])")
NUMBERED = re.compile(r".*?joint[_ ]?(\d{1,9})", re.IGNORECASE)

HINTS = {"panda": "panda", "fer": "panda", "fr3": "fr3"}  #: Stem of Franka's joint names → profile.


def kinematic_order(names: Sequence[str]) -> tuple[int, ...]:
    """Positions of the arm's joints among `names`, base to tip.

    Franka and UR joints are found by name wherever they stand, prefixes and further joints (a
    gripper's fingers) set aside; UR's words and joints called joint1, joint_2, … where there are no
    others. Unknown names keep the file's order.
    """
    words = [re.sub(r"[_ ]+", " ", name.lower()).strip() for name in names]
    numbers = (NUMBERED.fullmatch(name) for name in names)
    every: tuple[tuple[int, list[int | None]], ...] = (
        (7, [int(m[2]) if (m := FRANKA.fullmatch(name)) else None for name in names]),
        (6, [next((j for j, u in enumerate(UR_NAMES) if n.endswith(u)), None) for n in names]),
        (6, [UR_WORDS.index(w) if len(words) == 6 and w in UR_WORDS else None for w in words]),
        (len(names), [int(m[1]) if m else None for m in numbers]),
    )
    for count, places in every:
        found = {place: k for k, place in enumerate(places) if place is not None}
        if len(found) == count == len(places) - places.count(None):
            return tuple(found[place] for place in sorted(found))
    return tuple(range(len(names)))


def in_order(column: Array, order: Sequence[int], names: int) -> Array:
    """A joint signal's columns in an order, where it has one a name; others as they are.

    Args:
        column: (T, k), or (T,) of what is no joint signal.
        order: Places of the arm's joints among the names.
        names: How many names there are, a gripper's fingers among them.
    """
    if column.ndim != 2 or column.shape[1] != names:
        return column
    return column[:, list(order)]


def effort_of(names: Sequence[str]) -> str:
    """What a JointState's effort is by its joints' names: UR's drivers publish motor currents.

    Returns:
        "current" or "torque".
    """
    is_ur = len(names) == len(UR_NAMES) and all(name.endswith(UR_NAMES) for name in names)
    return "current" if is_ur else "torque"


def laid_along(raw: RawLog, names: Sequence[str], request: ReadChoice) -> RawLog:
    """A log of JointState messages with its joints base to tip, its effort by their names."""
    stated = request.spec.items
    if any("|" in (item.pattern or "") for item in stated):
        return raw
    width = raw.signals["q"].shape[1]
    if len(names) != width:
        raise LogError(f"{len(names)} names of joints for {width} positions: {', '.join(names)}")
    order = kinematic_order(names)
    ordered = tuple(names[k] for k in order)
    signals = {
        signal: value if signal == "wrench" else in_order(value, order, width)
        for signal, value in raw.signals.items()
    }
    remarks = raw.remarks
    told = {SIGNALS.get(item.signal) for item in stated}
    if effort_of(ordered) == "current" and "torque" in signals and not told & set(EFFORTS):
        signals["current"] = signals.pop("torque")
        remarks = (*remarks, fact("effort-is-current"))
    return replace(
        raw,
        signals=signals,
        joint_names=ordered,
        robot_hint=robot_of(ordered),
        remarks=remarks,
    )


def robot_of(names: Sequence[str]) -> str | None:
    """The profile that joint names settle; UR names do not tell the model."""
    stems = {m[1] for name in names if (m := FRANKA.fullmatch(name))}
    return HINTS.get(stems.pop()) if len(stems) == 1 else None
