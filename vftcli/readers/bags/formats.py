"""The bag formats: ROS 1 bags, ROS 2 bags as folder or bare file, and other MCAP files."""

import re
from collections.abc import Iterator
from dataclasses import replace

from vftcli.errors import LogError
from vftcli.readers.bags import db3, mcap_file, rosbag1
from vftcli.readers.bags.container import Batch, Ingest
from vftcli.readers.bags.decode import Decoder
from vftcli.readers.bags.documents import Documents, read_documents
from vftcli.readers.bags.topics import aligned
from vftcli.readers.reader import LogFile, RawLog, Reader, Request, open_log

METADATA_BYTES = 1024 * 1024

STORAGE = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd", ".mcap.zst", ".db3.zst")


def read_bag(file: LogFile, request: Request) -> RawLog:
    """Read any container of messages.

    Raises:
        LogError: If it is damaged before its first whole chunk, or holds no joint positions.
    """
    ingest = Ingest(path=file.path, size=_size(file))
    decoder, documents = Decoder(ingest), Documents(ingest)
    messages = 0
    for batch in _batches(file, ingest):
        messages += len(batch.offsets)
        if not documents.take(batch):
            decoder.take(batch)
    _check_count(file, messages, ingest)
    if messages == 0:
        cut = f" ({ingest.repairs[0]})" if ingest.repairs else ""
        raise LogError(f"{file.path}: no messages in any whole chunk{cut}.")
    streams = decoder.streams()
    if documents.rows and not any("q" in stream.signals for stream in streams):
        raw = read_documents(file, documents, request)
    else:
        others = decoder.others | {c.topic: c.type or c.encoding for c in documents.rows}
        raw = aligned(streams, file.path, request, others)
    return replace(raw, repairs=(*ingest.repairs, *raw.repairs))


def _size(file: LogFile) -> int:
    if not file.is_folder:
        return len(file.content)
    return sum((file.path / name).stat().st_size for name in storage_files(file))


def _batches(file: LogFile, ingest: Ingest) -> Iterator[Batch]:
    if not file.is_folder:
        yield from _file_batches(file, ingest)
        return
    for name in storage_files(file):
        inner = open_log(file.path / name)
        yield from _file_batches(inner, ingest)
        for repair in inner.repairs:
            ingest.note(f"{name}: {repair}")


def _file_batches(file: LogFile, ingest: Ingest) -> Iterator[Batch]:
    if file.head.startswith(rosbag1.MAGIC):
        yield from rosbag1.batches(file.content, ingest)
    elif file.head.startswith(mcap_file.MAGIC):
        yield from mcap_file.batches(file.content, ingest)
    elif file.head.startswith(db3.MAGIC):
        yield from db3.batches(file, ingest)
    else:
        raise LogError(f"{file.path}: neither a ROS bag nor an MCAP file.")


def storage_files(file: LogFile) -> list[str]:
    """The storage files of a bag folder, in the order in which they were recorded.

    Names in metadata.yaml are not followed: only files that lie in the folder itself are read.
    """
    names = {n for n in file.entries if n.endswith(STORAGE) and (file.path / n).is_file()}
    plain = {n for n in names if n.removesuffix(".zstd").removesuffix(".zst") not in names - {n}}
    return sorted(plain, key=_numbers_in)


def _check_count(file: LogFile, messages: int, ingest: Ingest) -> None:
    """Say so if metadata.yaml counts another number of messages than were found."""
    if "metadata.yaml" not in file.entries:
        return
    with (file.path / "metadata.yaml").open("rb") as metadata:
        text = metadata.read(METADATA_BYTES)
    match = re.search(rb"^  message_count: (\d{1,15})\s*$", text, flags=re.MULTILINE)
    if match is not None and int(match[1]) != messages:
        ingest.note(f"metadata.yaml counts {int(match[1])} messages, {messages} were found")


def _numbers_in(name: str) -> tuple[list[int], str]:
    stem = name.split(".", maxsplit=1)[0]
    tail = stem.rpartition("_")[2]
    return ([int(tail)] if tail.isdigit() else [], name)


def is_bag_folder(file: LogFile) -> bool:
    """Whether a folder holds ROS 2 storage files."""
    return file.is_folder and bool(storage_files(file))


_TAKES = (
    "JointState by joint name (UR: effort is motor current), FrankaState and FrankaRobotState in "
    "all variants, WrenchStamped; other topics are left out and named."
)

ROS1 = Reader(
    name="rosbag1",
    title="ROS 1 bag (.bag, .bag.active)",
    recording="rosbag record /joint_states /wrench, or /franka_state_controller/franka_states.",
    takes=_TAKES,
    pitfalls=(
        "franka_states comes at 30 Hz unless publish_rate is raised. A cut bag is read up to its "
        "last whole chunk."
    ),
    recognises=lambda file: file.head.startswith(rosbag1.MAGIC),
    read=read_bag,
    columns=True,
)

ROS2 = Reader(
    name="rosbag2",
    title="ROS 2 bag folder (mcap or db3, compressed or not)",
    recording="ros2 bag record /joint_states /force_torque_sensor_broadcaster/wrench …",
    takes=_TAKES,
    pitfalls="effort of UR joints is current [A]; in simulation torque: --columns tau=effort.",
    recognises=is_bag_folder,
    read=read_bag,
    columns=True,
)

DB3 = Reader(
    name="db3",
    title="ROS 2 bag file, SQLite (.db3)",
    recording="ros2 bag record --storage sqlite3; the file inside the folder.",
    takes=_TAKES,
    pitfalls=(
        "Humble and older store no message definitions: ROS's own types and FrankaRobotState are "
        "known, others are left out."
    ),
    recognises=lambda file: file.head.startswith(db3.MAGIC),
    read=read_bag,
    columns=True,
)

MCAP = Reader(
    name="mcap",
    title="MCAP file: ROS 2, ROS 1, JSON or Foxglove JointStates",
    recording="ros2 bag record --storage mcap; foxglove-sdk; any MCAP writer.",
    takes=_TAKES + " JSON documents by alias, arrays as joints; foxglove.JointStates by name.",
    pitfalls="A cut file is read up to its last whole chunk; one cut chunk holds nothing.",
    recognises=lambda file: file.head.startswith(mcap_file.MAGIC),
    read=read_bag,
    columns=True,
)
