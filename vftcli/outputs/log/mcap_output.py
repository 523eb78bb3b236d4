"""estimates.mcap: the log and its estimates as ROS 2 messages, for PlotJuggler and Foxglove.

Topics: `/joint_states` (positions, velocities, measured drive torque as effort),
`/vftcli/external/<observer>` and `/vftcli/external/reference` (external torque as effort), all
sensor_msgs/JointState; `/robot_description` (std_msgs/String, URDF) once. Hyphens, which ROS names
may not hold, become underscores.
"""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.analysis import Analysis
from vftcli.outputs.log.description import urdf_text
from vftcli.robots.drive import drive_torque
from vftcli.signals.arrays import Array

JOINT_STATE = "sensor_msgs/msg/JointState"
STRING = "std_msgs/msg/String"

LAST_STAMP = 2**31 - 1
"""ROS 2 counts seconds in 32 bits with a sign."""

BLOCK = 8192
"""Samples whose messages are held in memory at once."""

Bytes = NDArray[np.uint8]
Nanoseconds = NDArray[np.int64]


class OutputTopic(NamedTuple):
    """One JointState topic; a signal of no columns is left out of the messages.

    Attributes:
        name: The topic's name.
        position: (T, n) or (T, 0) [rad]
        velocity: (T, n) or (T, 0) [rad/s]
        effort: (T, n) [N·m]
    """

    name: str
    position: Array
    velocity: Array
    effort: Array


def write_mcap(path: Path, analysis: Analysis) -> None:
    """Write the recording's torques as a ros2-profile MCAP with zstd chunks.

    Args:
        path: Where to; an existing file is replaced.
        analysis: What to write.
    """
    names = analysis.recording.joint_names or analysis.robot.chain.names
    description = urdf_text(analysis.robot, names)
    stamps = stamps_of(analysis)
    write_joint_states(path, stamps, names, list(topics(analysis)), description)


def topics(analysis: Analysis) -> Iterator[OutputTopic]:
    """The log's own signals, every estimate, the reference."""
    recording = analysis.recording
    none = np.empty((recording.samples, 0))
    velocity = recording.dq if recording.dq is not None else none
    torque = drive_torque(recording, analysis.robot)
    yield OutputTopic("/joint_states", recording.q, velocity, torque)
    for estimate in analysis.estimates:
        yield OutputTopic(f"/vftcli/external/{ros_name(estimate.name)}", none, none, estimate.tau)
    if analysis.reference is not None:
        yield OutputTopic("/vftcli/external/reference", none, none, analysis.reference.tau)


def ros_name(name: str) -> str:
    """A name as ROS allows it: letters, digits and underscores."""
    return "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in name)


def stamps_of(analysis: Analysis) -> Nanoseconds:
    """Time of every sample on the log's own clock, from 0 where ROS cannot count it. (T,) [ns]"""
    source = analysis.recording.source
    start = source.t0_ns if source.t0_ns is not None else round(source.t0 * 1e9)
    since = np.round(analysis.t * 1e9).astype(np.int64)
    if start < 0 or (start + int(since[-1])) // 10**9 > LAST_STAMP:
        return since
    return since + start


def write_joint_states(
    path: Path,
    stamps: Nanoseconds,
    names: Sequence[str],
    found: Sequence[OutputTopic],
    description: str | None = None,
) -> None:
    """Write JointState topics, sample by sample, and the robot's URDF first if there is one."""
    from mcap.writer import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="ros2", library="vftcli")
        if description is not None:
            say(writer, store, "/robot_description", description, int(stamps[0]))
        channels = [channel(writer, store, topic.name, JOINT_STATE) for topic in found]
        for start in range(0, len(stamps), BLOCK):
            span = slice(start, start + BLOCK)
            bodies = [messages(store, stamps[span], names, part(topic, span)) for topic in found]
            for k, stamp in enumerate(stamps[span].tolist()):
                for number, body in zip(channels, bodies, strict=True):
                    writer.add_message(number, stamp, body[k].tobytes(), stamp, start + k)
        writer.finish()


def part(topic: OutputTopic, span: slice) -> OutputTopic:
    """Some samples of a topic."""
    return OutputTopic(topic.name, topic.position[span], topic.velocity[span], topic.effort[span])


def say(writer: Any, store: Any, topic: str, text: str, stamp: int) -> None:  # noqa: ANN401
    """Write one std_msgs/String."""
    message = store.types[STRING](data=text)
    body = bytes(store.serialize_cdr(message, STRING))
    writer.add_message(channel(writer, store, topic, STRING), stamp, body, stamp)


def channel(writer: Any, store: Any, topic: str, kind: str) -> int:  # noqa: ANN401
    """Register a topic; return its number."""
    text = store.generate_msgdef(kind, ros_version=2)[0]
    schema = writer.register_schema(kind, "ros2msg", text.encode())
    return int(writer.register_channel(topic, "cdr", schema))


def messages(store: Any, stamps: Nanoseconds, names: Sequence[str], topic: OutputTopic) -> Bytes:  # noqa: ANN401
    """Every message of a topic as one row of bytes. (T, length)

    All messages of a topic have the same layout, so the first is serialised by rosbags and the
    stamp and the numbers of the others are put where those of the first are found.
    """
    columns = [topic.position, topic.velocity, topic.effort]
    counts = [values.shape[1] for values in columns]
    marks = np.split(-1.5e300 - 1e290 * np.arange(sum(counts)), np.cumsum(counts)[:-1])
    first = bytes(store.serialize_cdr(joint_state(store, names, marks), JOINT_STATE))
    rows = np.tile(np.frombuffer(first, dtype=np.uint8), (len(stamps), 1))
    put(rows, 4, (stamps // 10**9).astype("<i4")[:, None])
    put(rows, 8, (stamps % 10**9).astype("<u4")[:, None])
    for mark, values in zip(marks, columns, strict=True):
        if mark.size:
            put(rows, first.index(mark.astype("<f8").tobytes()), values.astype("<f8"))
    return rows


def joint_state(store: Any, names: Sequence[str], values: Sequence[Array]) -> Any:  # noqa: ANN401
    """One JointState message with stamp 0."""
    stamp = store.types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    header = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="")
    position, velocity, effort = values
    return store.types[JOINT_STATE](
        header=header, name=list(names), position=position, velocity=velocity, effort=effort
    )


def put(rows: Bytes, start: int, values: NDArray[Any]) -> None:
    """Overwrite bytes of every row with that row's values."""
    packed = np.ascontiguousarray(values)
    width = packed.shape[1] * packed.itemsize
    rows[:, start : start + width] = packed.view(np.uint8).reshape(len(packed), width)
