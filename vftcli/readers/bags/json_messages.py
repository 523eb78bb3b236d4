"""ROS messages in JSON documents: JointState and WrenchStamped as the streams of other bags."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from vftcli.readers.bags.container import Channel, Integers
from vftcli.readers.bags.decode import Stream
from vftcli.readers.bags.kinds import KINDS, VECTORS
from vftcli.readers.joints import in_order, kinematic_order
from vftcli.signals.arrays import Array

JOINT_STATE, WRENCH = "sensor_msgs/JointState", "geometry_msgs/WrenchStamped"

Document = Mapping[str, Any]  #: A message, flattened: dotted path → value.


def message_streams(
    channel: Channel, rows: Sequence[Document], times: Sequence[int]
) -> Iterator[Stream]:
    """The streams of a channel whose documents are JointState or WrenchStamped messages.

    Nothing where a document is something else, or its stamp no whole seconds and nanoseconds.
    """
    if all(f"wrench.{path}" in row for row in rows for path in VECTORS):
        yield from _stream(channel, WRENCH, rows, times, ())
        return
    if not all(is_joint_state(row) for row in rows):
        return
    by_names: dict[tuple[str, ...], list[int]] = {}
    for k, row in enumerate(rows):
        by_names.setdefault(tuple(row["name"]), []).append(k)
    for names, at in by_names.items():
        own, stamps = [rows[k] for k in at], [times[k] for k in at]
        yield from _stream(channel, JOINT_STATE, own, stamps, names)


def is_joint_state(row: Document) -> bool:
    """Whether a document has joints' names and a position for each."""
    names, positions = row.get("name"), row.get("position")
    if not isinstance(names, list) or not isinstance(positions, list):
        return False
    return len(names) == len(positions) > 0 and all(isinstance(name, str) for name in names)


def _stream(
    channel: Channel,
    kind: str,
    rows: Sequence[Document],
    times: Sequence[int],
    names: tuple[str, ...],
) -> Iterator[Stream]:
    """One stream, none where its numbers or stamps are not what they should be."""
    stamps = [stamp_of(row) for row in rows]
    header = None
    if any(stamp is not None for stamp in stamps):
        if not all(stamp is not None for stamp in stamps):
            return
        header = np.array(stamps, dtype=np.int64)
    elif any(key.startswith(("timestamp", "stamp", "header.stamp")) for key in rows[0]):
        return
    signals = {}
    order = kinematic_order(names)
    for signal, paths in KINDS[kind].signals.items():
        keys = [f"wrench.{path}" for path in VECTORS] if signal == "wrench" else paths
        values = matrix(rows, keys, len(names) if names else len(VECTORS))
        if values is not None:
            signals[signal] = in_order(values, order, len(names)) if names else values
    if "q" in signals or "wrench" in signals:
        yield Stream(
            channel=replace(channel, type=kind),
            kind=KINDS[kind],
            names=tuple(names[k] for k in order),
            mixed=bool(names) and order != tuple(range(len(names))),
            frame=str(rows[0].get("header.frame_id", "")),
            receive=integers(times),
            header=header,
            robot=None,
            signals=signals,
            constants={},
        )


def integers(values: Sequence[int]) -> Integers:
    """Whole numbers as an array. (T,)"""
    return np.array(values, dtype=np.int64)


def matrix(rows: Sequence[Document], keys: Sequence[str], width: int) -> Array | None:
    """The numbers at some paths of all documents, None where one has not as many. (T, width)"""
    try:
        found = [np.hstack([row[key] for key in keys]) for row in rows]
        values = np.array(found, dtype=np.float64)
    except (KeyError, ValueError, TypeError, OverflowError):
        return None
    return values if values.shape == (len(rows), width) else None


def stamp_of(row: Document) -> int | None:
    """A document's own stamp, None without whole seconds and nanoseconds. [ns]"""
    for base in ("header.stamp", "timestamp", "stamp"):
        for sec, nsec in (("sec", "nanosec"), ("sec", "nsec"), ("secs", "nsecs")):
            whole, rest = row.get(f"{base}.{sec}"), row.get(f"{base}.{nsec}")
            if not isinstance(whole, int) or not isinstance(rest, int):
                continue
            if abs(whole) < 9e9 and abs(rest) < 1e10:
                return whole * 10**9 + rest
    return None
