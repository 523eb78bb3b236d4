"""Conversion: any log as a flat Parquet or CSV table, or as an MCAP that ROS 2 viewers open."""

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from vftcli.outputs.files import atomic, check_file, table_file
from vftcli.outputs.log.mcap_output import (
    OutputTopic,
    joint_topic,
    source_stamps,
    stamps_of,
    wrench_topic,
    write_topics,
)
from vftcli.signals.columns import StatedFrame, described_schema
from vftcli.signals.errors import OutputError
from vftcli.signals.recording import COLUMN_NAMES, JOINT_SIGNALS, Recording


def convert(recording: Recording, path: Path, *, force: bool = False) -> None:
    """Write a log in the format that the file's name ends in."""
    check_conversion(path, force)
    with atomic(path, force=force) as temporary:
        WRITERS[path.suffix.lower()](recording, temporary)


def check_conversion(path: Path, force: bool) -> None:
    """See before the log is read whether it could be written to `path`."""
    if path.suffix.lower() not in WRITERS:
        raise OutputError(
            f"{path}: no format ends in {path.suffix or 'nothing'!r}; there is {', '.join(WRITERS)}"
        )
    check_file(path, force)


def columns_of(recording: Recording) -> Iterator[tuple[str, Any]]:
    """Name and values of every column: t from 0, the source's own stamps, then the signals.

    The names are among the aliases of the table reader, so that the file reads back.
    """
    yield "t", recording.t
    # Whole numbers: a float of today's date in seconds is exact to 240 ns only.
    yield "t_src_ns", source_stamps(recording)
    yield from recording.columns()


def write_parquet(recording: Recording, path: Path) -> None:
    """Write flat columns, zstd; what has no column (joint names, frame) is in the metadata."""
    import polars as pl

    table = pl.DataFrame(dict(columns_of(recording)))
    frame = recording.wrench_frame
    metadata = {
        "format": recording.source.format,
        "sha256": recording.source.sha256,
        "joint_names": recording.joint_names,
        "wrench_frame": frame.notation if frame is not None else None,
        "robot": recording.robot_hint,
        "repairs": [str(repair) for repair in recording.source.repairs],
    }
    stated = {"wrench": StatedFrame(str(frame), frame.sign)} if frame is not None else None
    schema = described_schema(table, stated)
    about = {"vftcli": json.dumps(metadata)}
    with table_file(path) as file:
        table.write_parquet(file, compression="zstd", metadata=about, arrow_schema=schema)


def write_csv(recording: Recording, path: Path) -> None:
    """Write flat columns as CSV, every number with the digits that restore it exactly."""
    import polars as pl

    with table_file(path) as file:
        pl.DataFrame(dict(columns_of(recording))).write_csv(file)


def write_mcap(recording: Recording, path: Path) -> None:
    """Write a ros2-profile MCAP: /joint_states, and one /vftcli/… topic for each further signal."""
    write_topics(path, stamps_of(recording), topics(recording))


def topics(recording: Recording) -> Iterator[OutputTopic]:
    """The topics of a log.

    The effort of /joint_states is the torque, or of a log that has no torque the motor current or
    the torque without gravity, as UR's driver publishes them.
    """
    names = recording.joint_names or tuple(f"joint_{j + 1}" for j in range(recording.joints))
    efforts = (getattr(recording, name) for name in ("torque", "current", "torque_without_gravity"))
    effort = next((value for value in efforts if value is not None), None)
    yield joint_topic("/joint_states", names, recording.q, recording.dq, effort)
    # JointState has no field for these: each is the effort of its own topic.
    for name in JOINT_SIGNALS:
        value = getattr(recording, name)
        if value is not None and name not in {"q", "dq"}:
            yield joint_topic(f"/vftcli/{COLUMN_NAMES.get(name, name)}", names, effort=value)
    if recording.wrench is not None:
        frame = recording.wrench_frame
        notation = frame.notation if frame is not None else ""
        yield wrench_topic("/vftcli/wrench", notation, recording.wrench)


#: Ending of the file's name → how it is written.
WRITERS: dict[str, Callable[[Recording, Path], None]] = {
    ".parquet": write_parquet,
    ".mcap": write_mcap,
    ".csv": write_csv,
}
