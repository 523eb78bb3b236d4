"""MCAP channels without ROS: JSON documents, and Foxglove's JointStates in protobuf."""

import json
import re
import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.readers.aliases import along_arm
from vftcli.readers.bags.container import Batch, Channel
from vftcli.readers.bags.decode import KINDS, Stream
from vftcli.readers.bags.ros_messages import VECTORS
from vftcli.readers.objects import flat
from vftcli.readers.reader import RawLog, ReadChoice
from vftcli.readers.table import Column, Names
from vftcli.readers.tables import ArrayTable, from_table
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import fact

JOINT_STATE, WRENCH = "sensor_msgs/JointState", "geometry_msgs/WrenchStamped"
FOXGLOVE = "foxglove.JointStates"
#: Names of a document's stamp, and of the seconds and nanoseconds in it.
STAMPS = ("header.stamp", "timestamp", "stamp")
SECONDS, NANOSECONDS = ("sec", "secs", "seconds"), ("nsec", "nsecs", "nanos", "nanosec")
MAX_BYTES, MAX_DEPTH, MAX_VALUES = 1 << 20, 8, 4096  #: What a message of joints may be.
Document = dict[str, Any]  #: A message, flattened: dotted path → value.


class Documents:
    """Documents of all channels, flattened as they come in."""

    def __init__(self, path: Path) -> None:
        self.path = path
        #: The documents of each channel, and when each was recorded. [ns]
        self.found: dict[Channel, tuple[list[Document], list[int]]] = {}

    def take(self, batch: Batch) -> bool:
        """Take up a batch of JSON or JointStates; False if it is neither."""
        channel = batch.channel
        if channel.encoding != "json" and (channel.encoding, channel.type) != (
            "protobuf", FOXGLOVE,
        ):  # fmt: skip
            return False
        rows, times = self.found.setdefault(channel, ([], []))
        for offset, length in zip(batch.offsets, batch.lengths, strict=True):
            message = batch.buffer[offset : offset + length].tobytes()
            try:
                rows.append(flattened(message, channel.encoding))
            except (ValueError, RecursionError) as error:
                raise LogError(
                    f"{self.path}: message {len(rows) + 1} of {channel.topic} is damaged "
                    f"({str(error)[:60]})"
                ) from None
        times.extend(batch.times.tolist())
        return True

    def streams(self, request: ReadChoice) -> list[Stream]:
        """The channels with documents that are JointState or WrenchStamped messages.

        None where --columns speaks of other fields; no channel where its stamps are no
        whole seconds and nanoseconds.
        """
        asked = {(item.pattern or "").rpartition(".")[2] for item in request.spec.items}
        if not asked <= {"", "position", "velocity", "effort"}:
            return []
        streams: list[Stream | None] = []
        for channel, (rows, times) in self.found.items():
            are_wrenches = all(f"wrench.{path}" in row for row in rows for path in VECTORS)
            by_names: dict[Names, list[int]] = {}
            if are_wrenches or all(map(is_joint_state, rows)):
                for k, row in enumerate(rows):
                    names = () if are_wrenches else tuple(row["name"])
                    by_names.setdefault(names, []).append(k)
            for names, at in by_names.items():
                own, stamps = [rows[k] for k in at], [times[k] for k in at]
                streams.append(stream_of(channel, own, stamps, names))
        return list(filter(None, streams))

    def read(self, request: ReadChoice) -> RawLog:
        """Read the channel with documents that hold joint positions."""
        failures: dict[int, LogError] = {}
        for channel, (rows, times) in self.found.items():
            try:
                raw = self._read(channel, rows, times, request)
            except LogError as error:
                failures.setdefault(len(rows), error)
                continue
            left = sorted({other.topic for other in self.found} - {channel.topic})
            said = [fact("topics-left-out", topics=tuple(left[:6]))] if left else []
            return replace(raw, remarks=(*raw.remarks, *said))
        # The fullest channel is the one that was meant; what it lacks is what the user
        # can mend.
        raise failures[max(failures)]

    def _read(
        self, channel: Channel, rows: Sequence[Document], times: list[int], request: ReadChoice
    ) -> RawLog:
        each = {key: column_of(rows, key) for key in rows[0]}
        columns = {
            key: column
            for key, column in each.items()
            if column is not None and not key.lower().startswith(("timestamp", "stamp", "header"))
        }
        stamps = [stamp_of(row) for row in rows]
        base = next((b for b in STAMPS if isinstance(rows[0].get(b), int | float)), "")
        clock = f"stamps in the messages of {channel.topic}"
        if None not in stamps:
            columns["timestamp_ns"] = np.array(stamps, dtype=np.int64)
        elif base and (number := column_of(rows, base)) is not None:
            columns["timestamp"] = number
        else:
            clock = "log time of the recorder"
            columns["timestamp_ns"] = np.array(times, dtype=np.int64)
        table = ArrayTable(path=f"{self.path}: topic {channel.topic}", columns=columns)
        names = rows[0].get("name", [])
        named = isinstance(names, list) and all(isinstance(name, str) for name in names)
        return from_table(table, request, names=tuple(names) if named else (), clock_name=clock)


def is_joint_state(row: Document) -> bool:
    """Whether a document has names, and as many positions."""
    names, positions = row.get("name"), row.get("position")
    if not isinstance(names, list) or not isinstance(positions, list):
        return False
    return len(names) == len(positions) > 0 and all(isinstance(name, str) for name in names)


def stream_of(
    channel: Channel, rows: Sequence[Document], times: list[int], names: Names = ()
) -> Stream | None:
    """One stream, None where its numbers or stamps are not what they should be."""
    stamps = [stamp_of(row) for row in rows]
    without = all(stamp is None for stamp in stamps)
    if any(key.startswith(STAMPS) for key in rows[0]) if without else None in stamps:
        return None
    kind, shape = JOINT_STATE if names else WRENCH, (len(rows), len(names) or len(VECTORS))
    signals = {}
    for signal, paths in KINDS[kind].signals.items():
        keys = [f"wrench.{path}" for path in VECTORS] if signal == "wrench" else paths
        each = [column for key in keys if (column := column_of(rows, key)) is not None]
        if len(each) == len(keys) and (values := np.column_stack(each)).shape == shape:
            signals[signal] = values
    if "q" not in signals and "wrench" not in signals:
        return None
    ordered, signals = along_arm(names, signals)
    return Stream(
        channel=channel._replace(type=kind),
        kind=KINDS[kind],
        names=ordered,
        mixed=ordered != names,
        frame=str(rows[0].get("header.frame_id", "")),
        receive=np.array(times, dtype=np.int64),
        header=None if without else np.array(stamps, dtype=np.int64),
        signals=signals,
    )


def column_of(rows: Sequence[Document], path: str) -> Column | None:
    """The numbers at a path of all documents, None where they are none of one shape."""
    first = rows[0].get(path, "")
    if isinstance(first, str | bool) or first == []:
        return None
    try:
        column = np.array([row.get(path) for row in rows], dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        return None
    return column if column.ndim in {1, 2} else None


def stamp_of(row: Document) -> int | None:
    """A document's own stamp, None without whole seconds and nanoseconds. [ns]"""
    for base, sec, nsec in product(STAMPS, SECONDS, NANOSECONDS):
        whole, rest = row.get(f"{base}.{sec}"), row.get(f"{base}.{nsec}")
        if not isinstance(whole, int) or not isinstance(rest, int):
            continue
        if abs(whole) < 9e9 and abs(rest) < 1e10:
            return whole * 10**9 + rest
    return None


def flattened(message: bytes, encoding: str) -> Document:
    """A document as dotted paths; joints given one object each become lists by field."""
    if len(message) > MAX_BYTES:
        raise ValueError("longer than any message of joints")
    document = json.loads(message) if encoding == "json" else joint_states(message)
    if not isinstance(document, dict):
        raise ValueError("not an object")  # noqa: TRY004 - damage, as what json finds
    found: Document = {}
    for path, value in flat(document, MAX_DEPTH - 1):
        listed = value if isinstance(value, list) else []
        if listed and all(isinstance(each, dict) for each in listed):
            for key in ("name", "position", "velocity", "effort"):
                if all(key in each for each in listed):
                    found[key] = [each[key] for each in listed]
        elif isinstance(value, list | int | float | str | bool):
            found[path] = value
        if (value and isinstance(value, dict)) or max(len(found), len(listed)) > MAX_VALUES:
            raise ValueError("nested or long beyond any message of joints")
    return found


VARINT = re.compile(rb"[\x80-\xff]{0,9}[\0-\x7f]")  #: A number of a protobuf message.
#: Number of a field of a joint in foxglove.JointStates → its name.
JOINT_FIELDS = {2: "position", 3: "velocity", 4: "acceleration", 5: "effort"}


def joint_states(message: bytes) -> Document:
    """A foxglove.JointStates message: timestamp = 1, joints = 2 {name 1, position 2, …}."""
    document: Document = {"joints": []}
    for number, value in fields(message):
        if number == 1 and isinstance(value, bytes):
            stamp = dict(fields(value))
            document["timestamp"] = {"sec": stamp.get(1, 0), "nsec": stamp.get(2, 0)}
        elif number == 2 and isinstance(value, bytes):
            joint: Document = {}
            for part, inner in fields(value):
                if part == 1 and isinstance(inner, bytes):
                    joint["name"] = inner.decode("utf-8", "replace")
                elif part in JOINT_FIELDS and isinstance(inner, float):
                    joint[JOINT_FIELDS[part]] = inner
            document["joints"].append(joint)
    return document


def fields(message: bytes) -> Iterator[tuple[int, int | float | bytes]]:
    """Field numbers and values of a protobuf message, one level deep."""
    position = 0

    def varint() -> int:
        nonlocal position
        if (found := VARINT.match(message, position)) is None:
            raise ValueError("a number ends outside its message")
        position = found.end()
        return sum((byte & 127) << 7 * k for k, byte in enumerate(found[0]))

    while position < len(message):
        number, kind = divmod(varint(), 8)
        if kind == 0:
            yield number, varint()
            continue
        size = varint() if kind == 2 else {1: 8, 5: 4}.get(kind, -1)
        if size < 0 or position + size > len(message):
            raise ValueError("a field ends outside its message")
        raw = message[position : position + size]
        position += size
        yield number, raw if kind == 2 else struct.unpack("<d" if kind == 1 else "<f", raw)[0]
