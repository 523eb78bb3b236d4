"""MCAP files of ROS 2 messages, for PlotJuggler and Foxglove: estimates, and converted logs.

Topics of `estimates.mcap`: `/joint_states` (positions, velocities, measured drive torque as
effort), `/vftcli/external/<observer>` and `/vftcli/external/reference` (external torque as effort),
all sensor_msgs/JointState; `/robot_description` (std_msgs/String, URDF) once. Hyphens, which ROS
names may not hold, become underscores.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.analysis import Analysis
from vftcli.outputs.log.description import urdf_text
from vftcli.readers.bags.ros_messages import Value, long_name, schema_text, serialised, stamped
from vftcli.robots.drive import drive_torque
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

JOINT_STATE = "sensor_msgs/JointState"

LAST_STAMP = 2**31 - 1
"""ROS 2 counts seconds in 32 bits with a sign."""

BLOCK = 8192
"""Samples whose messages are held in memory at once."""

Nanoseconds = NDArray[np.int64]


class OutputTopic(NamedTuple):
    """Messages of one topic, one a sample.

    Attributes:
        name: The topic's name.
        kind: The type, as package/Name.
        values: Dotted path of a field → its value; of an array each message gets a row.
    """

    name: str
    kind: str
    values: Mapping[str, Value]

    def messages(self, stamps: Nanoseconds, span: slice) -> NDArray[np.uint8]:
        """The messages of some samples, one row of bytes each."""
        part = {k: v[span] if isinstance(v, np.ndarray) else v for k, v in self.values.items()}
        times = stamps[span]
        return serialised(self.kind, {**stamped(times), **part}, len(times))


def joint_topic(
    name: str,
    joints: Sequence[str],
    position: Array | None = None,
    velocity: Array | None = None,
    effort: Array | None = None,
) -> OutputTopic:
    """A topic of JointState messages; a signal that is None is left out of them. (T, n)"""
    signals = {"position": position, "velocity": velocity, "effort": effort}
    known = {key: values for key, values in signals.items() if values is not None}
    return OutputTopic(name, JOINT_STATE, {"name": list(joints), **known})


def write_mcap(path: Path, analysis: Analysis) -> None:
    """Write the recording's torques and its estimates; an existing file is replaced."""
    # The log's own names, so that the URDF moves with its /joint_states.
    names = analysis.recording.joint_names or analysis.robot.chain.names
    description = urdf_text(analysis.robot, names)
    write_topics(path, stamps_of(analysis.recording), topics(analysis, names), description)


def topics(analysis: Analysis, names: Sequence[str]) -> Iterator[OutputTopic]:
    """The log's own signals, every estimate, the reference."""
    recording = analysis.recording
    torque = drive_torque(recording, analysis.robot)
    yield joint_topic("/joint_states", names, recording.q, recording.dq, torque)
    for estimate in analysis.estimates:
        name = f"/vftcli/external/{ros_name(estimate.name)}"
        yield joint_topic(name, names, effort=estimate.tau)
    if analysis.reference is not None:
        yield joint_topic("/vftcli/external/reference", names, effort=analysis.reference.tau)


def ros_name(name: str) -> str:
    """A name as ROS allows it: letters, digits and underscores."""
    return "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in name)


def source_stamps(recording: Recording) -> Nanoseconds:
    """Time of every sample on the log's own clock, in whole nanoseconds. (T,) [ns]"""
    source = recording.source
    start = source.t0_ns if source.t0_ns is not None else round(source.t0 * 1e9)
    stamps: Nanoseconds = start + np.rint(recording.t * 1e9).astype(np.int64)
    return stamps


def stamps_of(recording: Recording) -> Nanoseconds:
    """The log's own stamps, from 0 where ROS cannot count them. (T,) [ns]"""
    stamps = source_stamps(recording)
    # A log may count from any time, even below zero; a viewer needs stamps that ROS can hold.
    countable = stamps[0] >= 0 and stamps[-1] // 10**9 <= LAST_STAMP
    return stamps if countable else stamps - stamps[0]


def write_topics(
    path: Path, stamps: Nanoseconds, found: Iterable[OutputTopic], description: str | None = None
) -> None:
    """Write a ros2-profile MCAP with zstd chunks, sample by sample, all topics side by side.

    Args:
        path: Where to; an existing file is replaced.
        stamps: Time of every sample. (T,) [ns]
        found: The topics.
        description: The robot's URDF, which comes first, or None.
    """
    from mcap.writer import CompressionType, Writer

    found = tuple(found)
    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="vftcli")
        if description is not None:
            number = channel(writer, "/robot_description", "std_msgs/String")
            body = serialised("std_msgs/String", {"data": description}, 1)
            writer.add_message(number, int(stamps[0]), body.tobytes(), int(stamps[0]))
        channels = [channel(writer, topic.name, topic.kind) for topic in found]
        # In blocks: all messages of an hour at 1 kHz at once would not fit in memory.
        for start in range(0, len(stamps), BLOCK):
            span = slice(start, start + BLOCK)
            bodies = [topic.messages(stamps, span) for topic in found]
            for k, stamp in enumerate(stamps[span].tolist()):
                for number, body in zip(channels, bodies, strict=True):
                    writer.add_message(number, stamp, body[k].tobytes(), stamp, start + k)
        writer.finish()


def channel(writer: Any, topic: str, kind: str) -> int:  # noqa: ANN401 - mcap is untyped
    """Register a topic with its type's definition; return its channel number."""
    schema = writer.register_schema(long_name(kind), "ros2msg", schema_text(kind).encode())
    return int(writer.register_channel(topic, "cdr", schema))
