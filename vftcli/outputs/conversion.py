"""Logs as files: flat tables or MCAP; simulated ones with their truth.

An MCAP holds ROS 2 messages, with the topics in docs/outputs.md. All are CDR: JSON in a
ros2 file stops rosbags' reader.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.analysis import Analysis
from vftcli.outputs.files import SEAL, OutputFolder, atomic, check_file, put_table, table_file
from vftcli.outputs.run_record import envelope, seal
from vftcli.readers.bags.decode import long_name
from vftcli.robots.terms import drive_torque
from vftcli.signals.arrays import Array
from vftcli.signals.errors import OutputError
from vftcli.signals.recording import COLUMN_NAMES, JOINT_SIGNALS, Recording, units_of
from vftcli.simulation.writers.rosbag2 import Value, schema_text, serialised, six, stamped

if TYPE_CHECKING:
    import polars as pl

    from vftcli.simulation.experiment import Simulation

JOINT_STATE, WRENCH = "sensor_msgs/JointState", "geometry_msgs/WrenchStamped"
BLOCK = 8192  #: Samples with messages in memory at once.
LAST_STAMP = 2**31 - 1  #: ROS 2 counts seconds in 32 bits with a sign.

Nanoseconds = NDArray[np.int64]


class OutputTopic(NamedTuple):
    """Messages of one topic, one a sample."""

    name: str
    kind: str  #: The type, as package/Name.
    #: Dotted path of a field → value; an array has a row a message.
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
    """A topic of JointState messages of known signals. (T, n)"""
    signals = {"position": position, "velocity": velocity, "effort": effort}
    known = {key: values for key, values in signals.items() if values is not None}
    return OutputTopic(name, JOINT_STATE, {"name": list(joints), **known})


def write_mcap(path: Path, analysis: Analysis) -> None:
    """Write the log's signals, every estimate and the reference."""
    recording, stamps = analysis.recording, stamps_of(analysis.recording)
    names = recording.joint_names or analysis.robot.chain.names
    torque = drive_torque(recording, analysis.robot)
    topics = [joint_topic("/joint_states", names, recording.q, recording.dq, torque)]
    for estimate in analysis.estimates:
        name = f"/vftcli/external/{ros_name(estimate.name)}"
        topics.append(joint_topic(name, names, effort=estimate.tau))
    if analysis.reference is not None:
        tau = analysis.reference.tau
        topics.append(joint_topic("/vftcli/external/reference", names, effort=tau))
    for wrench in analysis.wrenches:
        # Flange, tool or sensor, or base axes there.
        frame = "base@flange" if wrench.frame == "base" else wrench.frame
        name = f"/vftcli/wrench/{ros_name(wrench.name)}"
        topics.append(wrench_topic(name, frame, wrench.known))
    write_topics(path, stamps, topics)


def wrench_topic(name: str, frame: str, values: Array) -> OutputTopic:
    """A topic of WrenchStamped messages. (T, 6) [N, N·m]"""
    parts = six("wrench", ("force", "torque"), values)
    return OutputTopic(name, WRENCH, {"header.frame_id": frame, **parts})


def ros_name(name: str) -> str:
    """A name as ROS allows it."""
    return "".join(letter if letter.isascii() and letter.isalnum() else "_" for letter in name)


def source_stamps(recording: Recording) -> Nanoseconds:
    """Time of every sample on its own clock. (T,) [ns]"""
    source = recording.source
    start = source.t0_ns if source.t0_ns is not None else round(source.t0 * 1e9)
    stamps: Nanoseconds = start + np.rint(recording.t * 1e9).astype(np.int64)
    return stamps


def stamps_of(recording: Recording) -> Nanoseconds:
    """The log's stamps, from 0 if ROS cannot count them. (T,) [ns]"""
    stamps = source_stamps(recording)
    # A log may count from below zero; ROS cannot.
    countable = stamps[0] >= 0 and stamps[-1] // 10**9 <= LAST_STAMP
    return stamps if countable else stamps - stamps[0]


def write_topics(path: Path, stamps: Nanoseconds, found: Sequence[OutputTopic]) -> None:
    """Write a ros2-profile MCAP with zstd chunks, sample by sample, stamps (T,) [ns]."""
    from mcap.writer import CompressionType, Writer

    with path.open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start(profile="ros2", library="vftcli")
        channels = [channel(writer, topic.name, topic.kind) for topic in found]
        # In blocks: an hour's messages at 1 kHz do not fit in memory.
        for start in range(0, len(stamps), BLOCK):
            span = slice(start, start + BLOCK)
            bodies = [topic.messages(stamps, span) for topic in found]
            for k, stamp in enumerate(stamps[span].tolist()):
                for number, body in zip(channels, bodies, strict=True):
                    writer.add_message(number, stamp, body[k].tobytes(), stamp, start + k)
        writer.finish()


def channel(writer: Any, topic: str, kind: str) -> int:  # noqa: ANN401
    """Register a topic; return its channel number."""
    schema = writer.register_schema(long_name(kind), "ros2msg", schema_text(kind).encode())
    return int(writer.register_channel(topic, "cdr", schema))


def convert(recording: Recording, path: Path, *, force: bool = False) -> None:
    """Write a log in the format of the file's ending."""
    check_conversion(path, force)
    with atomic(path, force=force) as temporary:
        WRITERS[path.suffix.lower()](recording, temporary)


def check_conversion(path: Path, force: bool) -> None:
    """Raise an OutputError if no log can be written to `path`."""
    if path.suffix.lower() not in WRITERS:
        raise OutputError(
            f"{path}: no format ends in {path.suffix or 'nothing'!r}; there is {', '.join(WRITERS)}"
        )
    check_file(path, force)


def flat_table(recording: Recording) -> "pl.DataFrame":
    """A log as columns: t from 0, own stamps, signals."""
    import polars as pl

    # Whole numbers: a float of today's date [s] is exact to 240 ns only.
    clocks = {"t": recording.t, "t_src_ns": source_stamps(recording)}
    return pl.DataFrame({**clocks, **dict(recording.columns())})


def write_parquet(recording: Recording, path: Path) -> None:
    """Write flat columns; units, joint names, frame … in the metadata."""
    frame = recording.wrench_frame
    metadata = {
        "columns": {"t_src_ns": "ns", **units_of(recording.signals)},
        "format": recording.source.format,
        "sha256": recording.source.sha256,
        "joint_names": recording.joint_names,
        "wrench_frame": frame and frame.notation,
        "robot": recording.robot_hint,
        "repairs": list(map(str, recording.source.repairs)),
    }
    put_table(path, flat_table(recording), metadata)


def write_csv(recording: Recording, path: Path) -> None:
    """Write flat columns as CSV, with all digits."""
    with table_file(path) as file:
        flat_table(recording).write_csv(file)


def write_messages(recording: Recording, path: Path) -> None:
    """Write a log's topics: /joint_states, and /vftcli/… for each further signal.

    The effort of /joint_states is the torque, else the motor current or the torque without
    gravity, as UR's driver publishes them.
    """
    names = recording.joint_names or tuple(f"joint_{j + 1}" for j in range(recording.joints))
    efforts = (recording.torque, recording.current, recording.torque_without_gravity)
    effort = next((value for value in efforts if value is not None), None)
    topics = [joint_topic("/joint_states", names, recording.q, recording.dq, effort)]
    # JointState has no field for these: each is the effort of its own topic.
    for name in JOINT_SIGNALS:
        value = getattr(recording, name)
        if value is not None and name not in {"q", "dq"}:
            own = f"/vftcli/{COLUMN_NAMES.get(name, name)}"
            topics.append(joint_topic(own, names, effort=value))
    if recording.wrench is not None:
        notation = "" if recording.wrench_frame is None else recording.wrench_frame.notation
        topics.append(wrench_topic("/vftcli/wrench", notation, recording.wrench))
    write_topics(path, stamps_of(recording), topics)


#: Ending of the file's name → how it is written.
WRITERS = {".parquet": write_parquet, ".mcap": write_messages, ".csv": write_csv}


def companions(path: Path) -> tuple[Path, Path, Path]:
    """The truth, the scenario and the record beside a log."""
    return (
        path.with_name(f"{path.name}.truth.parquet"),
        path.with_name(f"{path.name}.scenario.toml"),
        path.with_name(f"{path.name}.{SEAL}"),
    )


def log_folder(paths: Iterable[Path], force: bool) -> OutputFolder:
    """The checked folder of logs beside one another."""
    names: list[str] = []
    for path in paths:
        if not path.name:
            raise OutputError(f"{path} is a folder; give the name of a log file with -o")
        # A bag is a folder: new files replace those of an earlier one.
        inside = [file for file in path.rglob("*") if not file.is_dir()]
        # A killed run may have left it without its metadata, or empty.
        if any(file.suffix not in {".mcap", ".db3", ".yaml"} for file in inside):
            raise OutputError(f"{path} is a folder and no bag; give another -o")
        if not path.parent.is_dir():
            raise OutputError(
                f"{path.parent}: there is no such folder; make it, or give another -o"
            )
        if inside and not force:
            raise OutputError(f"{path} exists; give another -o, or --force to overwrite it")
        own = inside if path.is_dir() else [path]
        names += [f.relative_to(path.parent).as_posix() for f in (*own, *companions(path))]
    folder = OutputFolder(path.parent, force, names)
    folder.check()
    return folder


def save(
    runs: "Mapping[Path, Simulation]", format: str = "", force: bool = False, command: str = ""
) -> list[Path]:
    """Write each log and its companions; the paths of all files."""
    from vftcli.simulation import writers
    from vftcli.simulation.scenario import to_toml

    formats = [writers.usual_format(run.scenario, run.robot, format) for run in runs.values()]
    with log_folder(runs, force) as folder:
        for (path, run), form in zip(runs.items(), formats, strict=True):
            truth, scenario, record = (file.name for file in companions(path))
            with table_file(folder / path.name) as file:
                writers.WRITERS[form](file, run)
            with table_file(folder / truth) as file:
                writers.write_truth(file, run.truth, run.scenario.sensing.start)
            folder.write(scenario, to_toml(replace(run.scenario, format=form, seed=run.seed)))
            own = {truth, scenario, path.name}
            files = {n: sha for n, sha in folder.digests().items() if n.partition("/")[0] in own}
            about = {
                "scenario": run.scenario.name,
                "seed": run.seed,
                "robot": run.scenario.robot,
                "format": form,
                "samples": len(run.measured.rows),
            }
            seal(folder, record, envelope(command, found=about), files)
    return [file for path in runs for file in (path, *companions(path))]
