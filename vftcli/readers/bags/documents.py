"""MCAP channels without ROS: JSON documents, and Foxglove's JointStates in protobuf."""

import json
import struct
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from vftcli.readers.bags.container import Batch, Channel, Ingest
from vftcli.readers.joints import UR_NAMES, in_order, kinematic_order, robot_of
from vftcli.readers.reader import LogFile, RawLog, ReadChoice
from vftcli.readers.table import Column
from vftcli.readers.tables import ArrayTable, from_table
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Remark, caution, fact
from vftcli.signals.series import median_step, resample_columns
from vftcli.signals.wrench import WrenchFrame

FOXGLOVE = "foxglove.JointStates"
NEAR = 3.0
"""A wrench further than this many of its own sample times from a pose is not taken for it."""

MAX_BYTES = 1 << 20
MAX_DEPTH = 8
MAX_VALUES = 4096


class DocumentError(ValueError):
    """A message is not the document it claims to be."""


class Documents:
    """Documents of all channels, flattened as they come in."""

    def __init__(self, ingest: Ingest) -> None:
        self.ingest = ingest
        self.rows: dict[Channel, list[dict[str, Any]]] = {}
        self.times: dict[Channel, list[int]] = {}

    def take(self, batch: Batch) -> bool:
        """Take up a batch of JSON or JointStates; False if it is neither.

        Raises:
            LogError: If a message is damaged.
        """
        channel = batch.channel
        json_like = channel.encoding == "json"
        if not json_like and not (channel.encoding == "protobuf" and channel.type == FOXGLOVE):
            return False
        rows = self.rows.setdefault(channel, [])
        times = self.times.setdefault(channel, [])
        for offset, length, time in zip(batch.offsets, batch.lengths, batch.times, strict=True):
            message = batch.buffer[offset : offset + length].tobytes()
            try:
                rows.append(flattened(_document(message, json_like=json_like)))
            except DocumentError as error:
                raise LogError(
                    f"{self.ingest.path}: message {len(rows) + 1} of {channel.topic} is damaged "
                    f"({error})"
                ) from None
            times.append(int(time))
        return True


def _document(message: bytes, *, json_like: bool) -> Any:  # noqa: ANN401
    """A message in JSON, or of JointStates.

    Raises:
        DocumentError: If it is damaged, or longer than any that tells of joints.
    """
    if len(message) > MAX_BYTES:
        raise DocumentError("longer than any message of joints")
    return _json(message) if json_like else joint_states(message)


def _json(message: bytes) -> Any:  # noqa: ANN401
    """A message in JSON."""
    try:
        return json.loads(message)
    except (ValueError, RecursionError) as error:
        raise DocumentError(str(error)[:60]) from None


def joint_states(message: bytes) -> dict[str, Any]:
    """A foxglove.JointStates message: timestamp = 1, joints = 2 {name 1, position 2, …}."""
    document: dict[str, Any] = {"joints": []}
    for number, value in fields(message):
        if number == 1 and isinstance(value, bytes):
            stamp = dict(fields(value))
            document["timestamp"] = {"sec": stamp.get(1, 0), "nsec": stamp.get(2, 0)}
        elif number == 2 and isinstance(value, bytes):
            document["joints"].append(_joint(value))
    return document


def _joint(message: bytes) -> dict[str, Any]:
    """One joint of a JointStates message: name = 1, position = 2 …"""
    names = {2: "position", 3: "velocity", 4: "acceleration", 5: "effort"}
    joint: dict[str, Any] = {}
    for number, value in fields(message):
        if number == 1 and isinstance(value, bytes):
            joint["name"] = value.decode("utf-8", "replace")
        elif number in names and isinstance(value, float):
            joint[names[number]] = value
    return joint


def fields(message: bytes) -> Iterator[tuple[int, int | float | bytes]]:
    """Field numbers and values of a protobuf message, one level deep.

    Raises:
        DocumentError: If the message is cut or holds an unknown kind of field.
    """
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
            raise DocumentError("a field ends outside its message")
        raw = message[position : position + size]
        position += size
        yield key >> 3, raw if kind == 2 else struct.unpack("<d" if kind == 1 else "<f", raw)[0]


def _varint(message: bytes, position: int) -> tuple[int, int]:
    """A whole number in protobuf's base-128, and where it ends."""
    value = shift = 0
    while True:
        if position >= len(message) or shift > 63:
            raise DocumentError("a number ends outside its message")
        byte = message[position]
        value |= (byte & 127) << shift
        position, shift = position + 1, shift + 7
        if byte < 128:
            return value, position


def flattened(document: Any) -> dict[str, Any]:  # noqa: ANN401
    """A document as dotted paths; joints given one object each become lists by field.

    Raises:
        DocumentError: If it is no object, or nested or long beyond any message of joints.
    """
    if not isinstance(document, dict):
        raise DocumentError("not an object")
    flat: dict[str, Any] = {}
    _flatten(document, "", flat, 0)
    return flat


def _flatten(value: Any, path: str, flat: dict[str, Any], depth: int) -> None:  # noqa: ANN401
    """Put the values below a path into the flat document."""
    if depth > MAX_DEPTH or len(flat) > MAX_VALUES:
        raise DocumentError("nested or long beyond any message of joints")
    if isinstance(value, dict):
        for key, inner in value.items():
            _flatten(inner, f"{path}.{key}" if path else str(key), flat, depth + 1)
    elif isinstance(value, list) and value and all(isinstance(v, dict) for v in value):
        for key in ("name", "position", "velocity", "effort"):
            found = [v[key] for v in value if key in v]
            if len(found) == len(value):
                flat[key] = found
    elif isinstance(value, list) and len(value) > MAX_VALUES:
        raise DocumentError("nested or long beyond any message of joints")
    elif isinstance(value, list | int | float | str | bool):
        flat[path] = value


def read_documents(file: LogFile, documents: Documents, request: ReadChoice) -> RawLog:
    """Read the channel whose documents hold joint positions.

    Raises:
        LogError: If none does; the message says what each holds.
    """
    failures = []
    for channel, rows in documents.rows.items():
        try:
            raw = _read(file, channel, rows, documents.times[channel], request)
        except LogError as error:
            failures.append((len(rows), error))
        else:
            return _with_wrench(raw, documents, channel, request)
    if not failures:
        raise LogError(f"{file.path}: no messages of a kind that is known.")
    # The fullest channel is the one that was meant; what it lacks is what the user can mend.
    raise max(failures, key=lambda failure: failure[0])[1]


def _read(
    file: LogFile,
    channel: Channel,
    rows: list[dict[str, Any]],
    times: list[int],
    request: ReadChoice,
) -> RawLog:
    """The documents of one channel as a table, read by aliases or by --columns."""
    names = _names(rows[0])
    order = kinematic_order(names)
    columns: dict[str, Column] = {}
    for key, first in rows[0].items():
        column = _column(first, [row.get(key) for row in rows])
        if column is not None and not key.lower().startswith(("timestamp", "stamp", "header")):
            columns[key] = in_order(column, order, len(names)) if names else column
    clock = "log time of the recorder"
    if (stamps := _stamps(rows)) is not None:
        clock = f"stamps in the messages of {channel.topic}"
        columns["timestamp_ns" if stamps.dtype == np.int64 else "timestamp"] = stamps
    else:
        columns["timestamp_ns"] = np.array(times, dtype=np.int64)
    table = ArrayTable(path=f"{file.path}: topic {channel.topic}", columns=columns)
    raw = from_table(table, request, clock_name=clock)
    if request.columns is not None or not names:
        return raw
    ordered = tuple(names[k] for k in order)
    raw = replace(raw, joint_names=ordered, robot_hint=robot_of(ordered))
    return _told_effort(raw) if "effort" in columns and "torque" in raw.signals else raw


def _told_effort(raw: RawLog) -> RawLog:
    """The log with the effort of UR joints as current, as the UR drivers publish it."""
    names = raw.joint_names
    if len(names) != len(UR_NAMES) or not all(name.endswith(UR_NAMES) for name in names):
        return raw
    signals = dict(raw.signals)
    signals["current"] = signals.pop("torque")
    return replace(raw, signals=signals, remarks=(*raw.remarks, fact("effort-is-current")))


def _with_wrench(raw: RawLog, documents: Documents, lead: Channel, request: ReadChoice) -> RawLog:
    """The log with a sensor's wrench of another channel at its times; other channels are named."""
    remarks: list[Remark] = []
    rows = {channel: found for channel, found in documents.rows.items() if channel != lead}
    found = {channel: keys for channel in rows if (keys := _wrench_keys(rows[channel][0]))}
    best = max(found, key=lambda channel: len(rows[channel]), default=None)
    wanted = "wrench" not in raw.signals and request.wants("wrench")
    if best is not None and wanted:
        values = _column([0.0], [[row.get(key) for key in found[best]] for row in rows.pop(best)])
        raw, remark = _interpolated(raw, documents, (lead, best), values)
        remarks.append(remark)
    if rows:
        left = sorted(channel.topic for channel in rows)
        remarks.append(fact("topics-left-out", topics=tuple(left[:6])))
    return replace(raw, remarks=(*raw.remarks, *remarks))


def _wrench_keys(row: dict[str, Any]) -> tuple[str, ...]:
    """The six paths of a wrench in a document, () where one is missing or stands twice."""
    ends = [f"{part}.{axis}" for part in ("force", "torque") for axis in "xyz"]
    found = [[key for key in row if f".{key}".endswith(f".{end}")] for end in ends]
    return tuple(keys[0] for keys in found) if all(len(keys) == 1 for keys in found) else ()


def _interpolated(
    raw: RawLog, documents: Documents, channels: tuple[Channel, Channel], values: Column | None
) -> tuple[RawLog, Remark]:
    """The log with a channel's wrench at its times, and what is said of it.

    The two are laid together by the stamps in their messages, or by those of the recorder.
    """
    stamps = [_stamps(documents.rows[channel]) for channel in channels]
    if any(s is None or s.dtype != np.int64 for s in stamps):
        stamps = [np.array(documents.times[channel], dtype=np.int64) for channel in channels]
    lead, own = (s for s in stamps if s is not None)
    topic = channels[1].topic
    start = int(own[0])  # whole nanoseconds are subtracted before they are scaled
    x, xp = (lead - start) * 1e-9, (own - start) * 1e-9
    usual = median_step(xp) if len(xp) > 1 else 0.0
    outside = (x < xp[0] - NEAR * usual) | (x > xp[-1] + NEAR * usual)
    if values is None or usual <= 0 or np.any(np.diff(xp) < 0) or np.mean(outside) > 0.05:
        return raw, caution("topic-too-short", signal="wrench", topic=topic)
    fresh = np.concatenate([[True], np.diff(xp) > 0])
    signals = {**raw.signals, "wrench": resample_columns(x, xp[fresh], values[fresh])}
    frame = documents.rows[channels[1]][0].get("header.frame_id")
    told = WrenchFrame(frame, frame) if isinstance(frame, str) and frame else None
    remark = fact(
        "signal-interpolated", signal="wrench", topic=topic, rate_Hz=1 / usual,
        lead=channels[0].topic,
    )  # fmt: skip
    return replace(raw, signals=signals, wrench_frame=told), remark


def _names(row: dict[str, Any]) -> tuple[str, ...]:
    """The joints' names that a document holds, or none."""
    names = row.get("name", [])
    good = isinstance(names, list) and all(isinstance(name, str) for name in names)
    return tuple(names) if good else ()


def _column(first: Any, values: list[Any]) -> Column | None:  # noqa: ANN401
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
    for base in ("timestamp", "header.stamp", "stamp"):
        for sec in ("sec", "seconds"):
            for nsec in ("nsec", "nanos", "nanosec"):
                if f"{base}.{sec}" in rows[0] and f"{base}.{nsec}" in rows[0]:
                    pairs = [(row.get(f"{base}.{sec}"), row.get(f"{base}.{nsec}")) for row in rows]
                    whole = [
                        s * 10**9 + n for s, n in pairs if isinstance(s, int) and isinstance(n, int)
                    ]
                    if len(whole) == len(pairs) and all(abs(w) < 2**62 for w in whole):
                        return np.array(whole, dtype=np.int64)
        if isinstance(rows[0].get(base), int | float):
            return _column(0.0, [row.get(base) for row in rows])
    return None
