"""Conversion: any log as a flat Parquet or CSV table, or as an MCAP that ROS 2 viewers open."""

import json
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.outputs.files import atomic
from vftcli.signals.arrays import Array
from vftcli.signals.errors import OutputError
from vftcli.signals.recording import JOINT_SIGNALS, Recording

AXES = ("fx", "fy", "fz", "mx", "my", "mz")

COLUMN_NAMES = {"torque": "tau"}
"""Signals whose columns are called otherwise than the field of a Recording."""


def convert(recording: Recording, path: Path, *, force: bool = False) -> None:
    """Write a log in the format that the file's name ends in.

    Raises:
        OutputError: If the ending is unknown, the file exists, or it cannot be written.
    """
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        raise OutputError(
            f"{path}: no format ends in {path.suffix or 'nothing'!r}; there is {', '.join(WRITERS)}"
        )
    with atomic(path, force=force) as temporary:
        writer(recording, temporary)


def columns_of(recording: Recording) -> Iterator[tuple[str, Array]]:
    """Name and values of every column: t from 0, the source's own stamps, then the signals.

    The names are among the aliases of the table reader, so that the file reads back.
    """
    yield "t", recording.t
    yield "t_src_ns", source_stamps(recording)
    for name in JOINT_SIGNALS:
        value = getattr(recording, name)
        if value is not None:
            for j, column in enumerate(np.ascontiguousarray(value.T), start=1):
                yield f"{COLUMN_NAMES.get(name, name)}/{j}", column
    if recording.wrench is not None:
        for axis, column in zip(AXES, np.ascontiguousarray(recording.wrench.T), strict=True):
            yield f"wrench/{axis}", column


def source_stamps(recording: Recording) -> Any:  # noqa: ANN401 - whole numbers
    """The log's own stamps in whole nanoseconds. (T,) [ns]"""
    start = recording.source.t0_ns
    if start is None:
        start = round(recording.source.t0 * 1e9)
    return start + np.rint(recording.t * 1e9).astype(np.int64)


def write_parquet(recording: Recording, path: Path) -> None:
    """Write flat columns, zstd; what has no column (joint names, frame) is in the metadata."""
    import polars as pl

    table = pl.DataFrame(dict(columns_of(recording)))
    frame = recording.wrench_frame
    told = {
        "format": recording.source.format,
        "sha256": recording.source.sha256,
        "joint_names": recording.joint_names,
        "wrench_frame": frame.notation if frame is not None else None,
        "robot": recording.robot_hint,
        "repairs": recording.source.repairs,
    }
    table.write_parquet(path, compression="zstd", metadata={"vftcli": json.dumps(told)})


def write_csv(recording: Recording, path: Path) -> None:
    """Write flat columns as CSV, every number with the digits that restore it exactly."""
    import polars as pl

    pl.DataFrame(dict(columns_of(recording))).write_csv(path)


def write_mcap(recording: Recording, path: Path) -> None:
    """Write a ros2-profile MCAP: /joint_states, and one /vftcli/… topic for each further signal.

    The effort of /joint_states is the torque, or the motor current of a log that has no torque, as
    UR's driver publishes it.
    """
    from mcap.writer import CompressionType, Writer

    times = source_stamps(recording)
    times -= min(int(times[0]), 0)  # stamps of a message cannot lie before 1970
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="vftcli")
        joint_state = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", JOINT_STATE)
        wrench = writer.register_schema("geometry_msgs/msg/WrenchStamped", "ros2msg", WRENCH)
        topics = []
        for topic, content in messages_of(recording, times):
            schema = wrench if topic.endswith("/wrench") else joint_state
            channel = writer.register_channel(topic, "cdr", schema)
            topics.append((channel, content))
        for k, time in enumerate(times.tolist()):
            for channel, content in topics:
                writer.add_message(channel, time, content[k].tobytes(), time, k)
        writer.finish()


def messages_of(recording: Recording, times: Any) -> Iterator[tuple[str, Any]]:  # noqa: ANN401
    """Topic and serialised messages, one row of bytes each. (T, length)"""
    names = recording.joint_names or tuple(f"joint_{j + 1}" for j in range(recording.joints))
    effort = recording.torque if recording.torque is not None else recording.current
    yield "/joint_states", joint_states(times, names, recording.q, recording.dq, effort)
    for name in JOINT_SIGNALS:
        value = getattr(recording, name)
        if value is not None and name not in {"q", "dq"}:
            topic = f"/vftcli/{COLUMN_NAMES.get(name, name)}"
            yield topic, joint_states(times, names, None, None, value)
    if recording.wrench is not None:
        frame = recording.wrench_frame
        notation = frame.notation if frame is not None else ""
        yield "/vftcli/wrench", wrenches(times, notation, recording.wrench)


def joint_states(
    times: Any,  # noqa: ANN401
    names: tuple[str, ...],
    position: Array | None,
    velocity: Array | None,
    effort: Array | None,
) -> Any:  # noqa: ANN401
    """Serialised JointState messages, all of one layout. (T, length)"""
    head = header("") + text_list(names)
    blocks: list[tuple[int, Array]] = []
    for value in (position, velocity, effort):
        head += padding(head, 4) + struct.pack("<I", 0 if value is None else value.shape[1])
        if value is not None:
            head += padding(head, 8)
            blocks.append((len(head), value))
            head += bytes(8 * value.shape[1])
    return patched(head, times, blocks)


def wrenches(times: Any, frame: str, wrench: Array) -> Any:  # noqa: ANN401
    """Serialised WrenchStamped messages. (T, length)"""
    head = header(frame)
    head += padding(head, 8)
    return patched(head + bytes(48), times, [(len(head), wrench)])


def patched(template: bytes, times: Any, blocks: list[tuple[int, Array]]) -> Any:  # noqa: ANN401
    """The template once a sample, with its stamp and numbers put in. (T, length)"""
    rows = np.tile(np.frombuffer(template, dtype=np.uint8), (len(times), 1))
    stamps = np.empty((len(times), 2), dtype="<i4")
    stamps[:, 0], stamps[:, 1] = times // 10**9, times % 10**9
    rows[:, 4:12] = stamps.view(np.uint8)
    for start, value in blocks:
        numbers = np.ascontiguousarray(value, dtype="<f8").view(np.uint8)
        rows[:, start : start + 8 * value.shape[1]] = numbers
    return rows


def header(frame: str) -> bytes:
    """Encapsulation (CDR, little endian), an empty stamp and the frame's name."""
    return b"\0\1\0\0" + bytes(8) + text(frame)


def text(value: str) -> bytes:
    """A CDR string: its length with the closing zero, then its bytes."""
    raw = value.encode()[:200] + b"\0"
    return struct.pack("<I", len(raw)) + raw


def text_list(values: tuple[str, ...]) -> bytes:
    """A CDR sequence of strings; aligned after a header without a frame."""
    content = header("")
    start = len(content)
    content += padding(content, 4) + struct.pack("<I", len(values))
    for value in values:
        content += padding(content, 4) + text(value)
    return content[start:]


def padding(content: bytes, size: int) -> bytes:
    """Zeros up to the next multiple of `size`, counted after the encapsulation."""
    return bytes(-(len(content) - 4) % size)


SEPARATOR = "=" * 80
HEADER = f"""{SEPARATOR}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{SEPARATOR}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
JOINT_STATE = f"""std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{HEADER}""".encode()
WRENCH = f"""std_msgs/Header header
geometry_msgs/Wrench wrench
{HEADER}{SEPARATOR}
MSG: geometry_msgs/Wrench
geometry_msgs/Vector3 force
geometry_msgs/Vector3 torque
{SEPARATOR}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
""".encode()
"""Definitions of the two message types, as a ros2-profile MCAP carries them."""

WRITERS: dict[str, Callable[[Recording, Path], None]] = {
    ".parquet": write_parquet,
    ".mcap": write_mcap,
    ".csv": write_csv,
}
"""Ending of the file's name → how it is written."""
