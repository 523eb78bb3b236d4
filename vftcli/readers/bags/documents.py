"""MCAP channels without ROS: JSON, and Foxglove's JointStates in protobuf."""

import json
import re
import struct
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.readers.aliases import TABLE
from vftcli.readers.bags.container import Batch, Channel, Integers
from vftcli.readers.bags.decode import VECTORS, Decoder, parts_at
from vftcli.readers.objects import flat
from vftcli.readers.reader import RawLog, ReadChoice
from vftcli.readers.table import Names
from vftcli.readers.tables import ArrayTable, from_table
from vftcli.signals.arrays import Array
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import fact

FRAME = "header.frame_id"
FOXGLOVE = "foxglove.JointStates"
#: Names of a document's stamp, and of the seconds and nanoseconds in it.
STAMPS = ("header.stamp", "timestamp", "stamp")
SECONDS, NANOSECONDS = ("sec", "secs", "seconds"), ("nsec", "nsecs", "nanos", "nanosec")
MAX_BYTES, MAX_DEPTH, MAX_VALUES = 1 << 20, 8, 4096  #: What a message of joints may be.
Document = dict[str, Any]  #: A message, flattened: dotted path → value.


class Documents:
    """Documents of all channels, flattened as they come in.

    JointState and WrenchStamped go to the decoder, unless --columns names other fields.
    """

    def __init__(self, path: Path, request: ReadChoice, decoder: Decoder) -> None:
        self.path, self.request, self.decoder = path, request, decoder
        asked = {(item.pattern or "").rpartition(".")[2] for item in request.spec.items}
        self.decodes = asked <= {"", "position", "velocity", "effort"}
        #: The other documents of each channel, and when each was recorded. [ns]
        self.found: dict[Channel, tuple[list[Document], list[int]]] = {}

    def take(self, batch: Batch, places: Integers) -> bool:
        """Take up a batch of JSON or JointStates; False if it is neither."""
        channel = batch.channel
        if channel.encoding != "json" and channel[1:3] != (FOXGLOVE, "protobuf"):
            return False
        shapes: dict[Shape | None, list[int]] = {}
        rows: list[Document] = []
        for content in batch.contents:
            try:
                rows.append(flattened(content, channel.encoding))
            except (ValueError, RecursionError) as error:
                raise LogError(
                    f"{self.path}: message {len(rows) + 1} of {channel.topic} is damaged "
                    f"({str(error)[:60]})"
                ) from None
            shape = shape_of(rows[-1]) if self.decodes else None
            shapes.setdefault(shape, []).append(len(rows) - 1)
        for shape, at in shapes.items():
            own = [rows[k] for k in at]
            if shape is None:
                left = self.found.setdefault(channel, ([], []))
                left[0].extend(own)
                left[1].extend(places[at, 1].tolist())
            else:
                kind, names, frame, _ = shape
                as_ros, texts = channel._replace(type=kind), {"name": names, FRAME: (frame,)}
                self.decoder.add(as_ros, partial(numbers_of, own), texts, places[at])
        return True

    def read(self, topics: set[str]) -> RawLog:
        """The log of the channel with joint positions; `topics` are all in the file."""
        failures: dict[int, LogError] = {}
        for channel, (rows, times) in self.found.items():
            try:
                raw = self._read(channel, rows, times)
            except LogError as error:
                failures.setdefault(len(rows), error)
                continue
            left = sorted(topics - {channel.topic})
            said = [fact("topics-left-out", topics=tuple(left[:6]))] if left else []
            return replace(raw, remarks=(*raw.remarks, *said))
        # What the fullest channel lacks the user can mend.
        raise failures[max(failures)]

    def _read(self, channel: Channel, rows: Sequence[Document], times: list[int]) -> RawLog:
        each = {key: column for key in rows[0] if (column := column_of(rows, key)).size}
        stamped = ("timestamp", "stamp", "header")
        columns = {key: c for key, c in each.items() if not key.lower().startswith(stamped)}
        stamps = [stamp_of(row) for row in rows]
        number = next((each[base] for base in STAMPS if base in each), None)
        clock = f"stamps in the messages of {channel.topic}"
        if None not in stamps:
            columns["timestamp_ns"] = np.array(stamps, dtype=np.int64)
        elif number is not None:
            columns["timestamp"] = number
        else:
            clock = "log time of the recorder"
            columns["timestamp_ns"] = np.array(times, dtype=np.int64)
        table = ArrayTable(path=f"{self.path}: topic {channel.topic}", columns=columns)
        layout = TABLE._replace(clock=clock)
        return from_table(table, self.request, layout, names=names_of(rows[0]))


def numbers_of(rows: Sequence[Document], paths: Sequence[str]) -> Array:
    """The numbers of each document at the first path that is there. (k, count)"""
    columns = (column_of(rows, name) for name in parts_at(paths, rows[0]))
    return np.hstack([np.empty((len(rows), 0)), *columns])


#: ROS type of a document, joint names, frame, lack of a stamp.
Shape = tuple[str, Names, str, bool]


def shape_of(row: Document) -> Shape | None:
    """The shape of a JointState or WrenchStamped with a whole stamp, or None."""
    stamp, names, positions = stamp_of(row), names_of(row), row.get("position")
    if stamp is not None:
        row["header.stamp.sec"], row["header.stamp.nanosec"] = divmod(stamp, 10**9)
    elif any(key.startswith(STAMPS) for key in row):
        return None
    frame = str(row.get(FRAME, ""))
    if all(f"wrench.{path}" in row for path in VECTORS):
        return "geometry_msgs/WrenchStamped", (), frame, stamp is None
    if names and isinstance(positions, list) and len(names) == len(positions):
        return "sensor_msgs/JointState", names, frame, stamp is None
    return None


def names_of(row: Document) -> Names:
    """The names of a document's joints, none where it has no list of texts."""
    names = row.get("name")
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        return ()
    return tuple(names)


def column_of(rows: Sequence[Document], path: str) -> Array:
    """The numbers at a path of all documents, empty if their widths differ. (k, n)"""
    none, first = np.empty((len(rows), 0)), rows[0].get(path, "")
    if isinstance(first, str | bool) or first == []:
        return none
    try:
        return np.array([row.get(path) for row in rows], dtype=np.float64).reshape(len(rows), -1)
    except (ValueError, TypeError, OverflowError):
        return none


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
    """A foxglove.JointStates message: timestamp 1, joints 2 {name 1, position 2, …}."""
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
