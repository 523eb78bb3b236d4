"""The bag formats: ROS 1 bags, ROS 2 bags as folder or bare file, and other MCAP files."""

from vftcli.readers.bags.container import MCAP as MCAP_MAGIC
from vftcli.readers.bags.container import ROSBAG1, SQLITE, storage_files
from vftcli.readers.reader import LogFile, RawLog, ReadChoice, Reader


def read_bag(file: LogFile, request: ReadChoice) -> RawLog:
    """Read any container of messages; the decoders are loaded only when there is one."""
    from vftcli.readers.bags import reading

    return reading.read_bag(file, request)


ROS1 = Reader(name="rosbag1", recognises=lambda file: file.head.startswith(ROSBAG1), read=read_bag)

ROS2 = Reader(
    name="rosbag2",
    recognises=lambda file: file.is_folder and bool(storage_files(file)),
    read=read_bag,
)

DB3 = Reader(name="db3", recognises=lambda file: file.head.startswith(SQLITE), read=read_bag)

MCAP = Reader(name="mcap", recognises=lambda file: file.head.startswith(MCAP_MAGIC), read=read_bag)
