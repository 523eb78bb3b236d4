"""How bags lie on disk: the first bytes of each container, and the files of a bag folder."""

from vftcli.readers.reader import LogFile

ROSBAG1 = b"#ROSBAG V2.0\n"
MCAP = b"\x89MCAP0\r\n"
SQLITE = b"SQLite format 3\0"

STORAGE = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd", ".mcap.zst", ".db3.zst")
"""Endings of the files of a bag folder that hold messages."""


def storage_files(file: LogFile) -> list[str]:
    """The storage files of a bag folder, in the order in which they were recorded.

    Names in metadata.yaml are not followed: only files that lie in the folder itself are read.
    """
    names = {n for n in file.entries if n.endswith(STORAGE) and (file.path / n).is_file()}
    plain = {n for n in names if n.removesuffix(".zstd").removesuffix(".zst") not in names - {n}}
    return sorted(plain, key=_numbers_in)


def _numbers_in(name: str) -> tuple[list[int], str]:
    """What sorts bag_10.mcap behind bag_9.mcap."""
    stem = name.split(".", maxsplit=1)[0]
    tail = stem.rpartition("_")[2]
    return ([int(tail)] if tail.isdigit() else [], name)
