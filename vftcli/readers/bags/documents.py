"""MCAP channels without ROS: JSON documents, and Foxglove's JointStates in protobuf."""

import json
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.readers.aliases import along_arm, laid_along
from vftcli.readers.bags.container import Batch, Channel, Ingest
from vftcli.readers.bags.decode import KINDS, VECTORS, Stream
from vftcli.readers.reader import RawLog, ReadChoice
from vftcli.readers.table import Column
from vftcli.readers.tables import ArrayTable, from_table
from vftcli.signals.arrays import Array
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import fact

JOINT_STATE, WRENCH = "sensor_msgs/JointState", "geometry_msgs/WrenchStamped"

#: Names of a document's stamp, and of the seconds and nanoseconds in it.
STAMPS = ("header.stamp", "timestamp", "stamp")
SECONDS, NANOSECONDS = ("sec", "secs", "seconds"), ("nsec", "nsecs", "nanos", "nanosec")
Json = Any  #: A value of a document.
Document = Mapping[str, Any]  #: A message, flattened: dotted path → value.


def _is_joint_state(row: Document) -> bool:
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
) -> Stream | None:
    """One stream, None where its numbers or stamps are not what they should be."""
    stamps = [stamp_of(row) for row in rows]
    without = all(stamp is None for stamp in stamps)
    if any(key.startswith(STAMPS) for key in rows[0]) if without else None in stamps:
        return None
    signals = {}
    for signal, paths in KINDS[kind].signals.items():
        keys = [f"wrench.{path}" for path in VECTORS] if signal == "wrench" else paths
        values = matrix(rows, keys, len(names) if names else len(VECTORS))
        if values is not None:
            signals[signal] = values
    if "q" not in signals and "wrench" not in signals:
        return None
    ordered, signals = along_arm(names, signals)
    return Stream(
        channel=replace(channel, type=kind),
        kind=KINDS[kind],
        names=ordered,
        mixed=ordered != names,
        frame=str(rows[0].get("header.frame_id", "")),
        receive=np.array(times, dtype=np.int64),
        header=None if without else np.array(stamps, dtype=np.int64),
        signals=signals,
    )


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
    for base, sec, nsec in product(STAMPS, SECONDS, NANOSECONDS):
        whole, rest = row.get(f"{base}.{sec}"), row.get(f"{base}.{nsec}")
        if not isinstance(whole, int) or not isinstance(rest, int):
            continue
        if abs(whole) < 9e9 and abs(rest) < 1e10:
            return whole * 10**9 + rest
    return None


FOXGLOVE = "foxglove.JointStates"
MAX_BYTES = 1 << 20
MAX_DEPTH = 8
MAX_VALUES = 4096


class Documents:
    """Documents of all channels, flattened as they come in."""

    def __init__(self, ingest: Ingest) -> None:
        self.ingest = ingest
        #: The documents of each channel, and when each was recorded. [ns]
        self.found: dict[Channel, tuple[list[dict[str, Any]], list[int]]] = {}

    def take(self, batch: Batch) -> bool:
        """Take up a batch of JSON or JointStates; False if it is neither."""
        channel = batch.channel
        json_like = channel.encoding == "json"
        if not json_like and not (channel.encoding == "protobuf" and channel.type == FOXGLOVE):
            return False
        rows, times = self.found.setdefault(channel, ([], []))
        for offset, length, time in zip(batch.offsets, batch.lengths, batch.times, strict=True):
            message = batch.buffer[offset : offset + length].tobytes()
            try:
                rows.append(flattened(message, json_like=json_like))
            except (ValueError, RecursionError) as error:
                raise LogError(
                    f"{self.ingest.path}: message {len(rows) + 1} of {channel.topic} is damaged "
                    f"({str(error)[:60]})"
                ) from None
            times.append(int(time))
        return True

    def streams(self, request: ReadChoice) -> list[Stream]:
        """The channels whose documents are JointState or WrenchStamped messages.

        None where --columns speaks of other fields; no channel where its stamps are no whole
        seconds and nanoseconds.
        """
        asked = {(item.pattern or "").rpartition(".")[2] for item in request.spec.items}
        if not asked <= {"", "position", "velocity", "effort"}:
            return []
        streams: list[Stream | None] = []
        for channel, (rows, times) in self.found.items():
            if all(f"wrench.{path}" in row for row in rows for path in VECTORS):
                streams.append(_stream(channel, WRENCH, rows, times, ()))
            elif all(map(_is_joint_state, rows)):
                by_names: dict[tuple[str, ...], list[int]] = {}
                for k, row in enumerate(rows):
                    by_names.setdefault(tuple(row["name"]), []).append(k)
                for names, at in by_names.items():
                    own, stamps = [rows[k] for k in at], [times[k] for k in at]
                    streams.append(_stream(channel, JOINT_STATE, own, stamps, names))
        return [stream for stream in streams if stream is not None]

    def read(self, request: ReadChoice) -> RawLog:
        """Read the channel whose documents hold joint positions."""
        path = self.ingest.path
        failures = []
        for channel, (rows, times) in self.found.items():
            try:
                raw = _read(path, channel, rows, times, request)
            except LogError as error:
                failures.append((len(rows), error))
                continue
            left = sorted({other.topic for other in self.found} - {channel.topic})
            said = [fact("topics-left-out", topics=tuple(left[:6]))] if left else []
            return replace(raw, remarks=(*raw.remarks, *said))
        # The fullest channel is the one that was meant; what it lacks is what the user can mend.
        raise max(failures, key=lambda failure: failure[0])[1]


#: Number of a field of a joint in foxglove.JointStates → its name.
JOINT_FIELDS = {2: "position", 3: "velocity", 4: "acceleration", 5: "effort"}


def joint_states(message: bytes) -> dict[str, Any]:
    """A foxglove.JointStates message: timestamp = 1, joints = 2 {name 1, position 2, …}."""
    document: dict[str, Any] = {"joints": []}
    for number, value in fields(message):
        if number == 1 and isinstance(value, bytes):
            stamp = dict(fields(value))
            document["timestamp"] = {"sec": stamp.get(1, 0), "nsec": stamp.get(2, 0)}
        elif number == 2 and isinstance(value, bytes):
            joint: dict[str, Any] = {}
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
    while position < len(message):
        key, position = _varint(message, position)
        kind = key & 7
        if kind == 0:
            value, position = _varint(message, position)
            yield key >> 3, value
            continue
        size, position = (
            _varint(message, position) if kind == 2 else ({1: 8, 5: 4}.get(kind, -1), position)
        )
        if size < 0 or position + size > len(message):
            raise ValueError("a field ends outside its message")
        raw = message[position : position + size]
        position += size
        yield key >> 3, raw if kind == 2 else struct.unpack("<d" if kind == 1 else "<f", raw)[0]


def _varint(message: bytes, position: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        if position >= len(message) or shift > 63:
            raise ValueError("a number ends outside its message")
        byte = message[position]
        value |= (byte & 127) << shift
        position, shift = position + 1, shift + 7
        if byte < 128:
            return value, position


def flattened(message: bytes, *, json_like: bool) -> dict[str, Any]:
    """A document as dotted paths; joints given one object each become lists by field."""
    if len(message) > MAX_BYTES:
        raise ValueError("longer than any message of joints")
    document = json.loads(message) if json_like else joint_states(message)
    if not isinstance(document, dict):
        raise ValueError("not an object")  # noqa: TRY004 - damage, as what json finds
    flat: dict[str, Any] = {}
    _flatten(document, "", flat, 0)
    return flat


def _flatten(value: Json, path: str, flat: dict[str, Json], depth: int) -> None:
    if depth > MAX_DEPTH or len(flat) > MAX_VALUES:
        raise ValueError("nested or long beyond any message of joints")
    if isinstance(value, dict):
        for key, inner in value.items():
            _flatten(inner, f"{path}.{key}" if path else str(key), flat, depth + 1)
    elif isinstance(value, list) and value and all(isinstance(v, dict) for v in value):
        for key in ("name", "position", "velocity", "effort"):
            found = [v[key] for v in value if key in v]
            if len(found) == len(value):
                flat[key] = found
    elif isinstance(value, list) and len(value) > MAX_VALUES:
        raise ValueError("nested or long beyond any message of joints")
    elif isinstance(value, list | int | float | str | bool):
        flat[path] = value


def _read(
    path: Path,
    channel: Channel,
    rows: list[dict[str, Any]],
    times: list[int],
    request: ReadChoice,
) -> RawLog:
    names = rows[0].get("name", [])
    named = isinstance(names, list) and all(isinstance(name, str) for name in names)
    columns: dict[str, Column] = {}
    for key, first in rows[0].items():
        column = _column(first, [row.get(key) for row in rows])
        if column is not None and not key.lower().startswith(("timestamp", "stamp", "header")):
            columns[key] = column
    clock = "log time of the recorder"
    if (stamps := _stamps(rows)) is not None:
        clock = f"stamps in the messages of {channel.topic}"
        columns["timestamp_ns" if stamps.dtype == np.int64 else "timestamp"] = stamps
    else:
        columns["timestamp_ns"] = np.array(times, dtype=np.int64)
    table = ArrayTable(path=f"{path}: topic {channel.topic}", columns=columns)
    raw = from_table(table, request, clock_name=clock)
    if not named or len(names) != raw.signals["q"].shape[1]:
        return raw
    return laid_along(raw, tuple(names), request)


def _column(first: Json, values: list[Json]) -> Column | None:
    """Values of all messages as an array, or None if they are not numbers of one shape."""
    if isinstance(first, str | bool) or (isinstance(first, list) and not first):
        return None
    try:
        column = np.array(values, dtype=np.float64)
    except (ValueError, TypeError, OverflowError):
        return None
    return column if column.ndim in {1, 2} else None


def _stamps(rows: list[dict[str, Any]]) -> Column | None:
    """Stamps in the documents, in nanoseconds, or as they are if they are one number."""
    stamps = [stamp_of(row) for row in rows]
    if None not in stamps:
        return np.array(stamps, dtype=np.int64)
    for base in STAMPS:
        if isinstance(rows[0].get(base), int | float):
            return _column(0.0, [row.get(base) for row in rows])
    return None
