"""Containers of messages: their files on disk, and the channels and batches that each yields."""

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.readers.opening import UNPACKED_LIMIT, UNPACKED_RATIO
from vftcli.readers.reader import LogFile
from vftcli.signals import letters
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Remark

Bytes = NDArray[np.uint8]
Integers = NDArray[np.int64]
Encoding = Literal["ros1", "cdr", "json", "protobuf", "other"]

ROSBAG1 = b"#ROSBAG V2.0\n"
MCAP = b"\x89MCAP0\r\n"
SQLITE = b"SQLite format 3\0"

STORAGE = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd", ".mcap.zst", ".db3.zst")
"""Endings of the files of a bag folder that hold messages."""


@dataclass(frozen=True, kw_only=True)
class Channel:
    """One topic of one container.

    Attributes:
        topic: Its name.
        type: Message type as package/Name, without the middle part that ROS 2 writes.
        encoding: How its messages are serialised.
        definition: Text of the message definition, or nothing if the container has none.
        idl: Whether the definition is in IDL.
    """

    topic: str
    type: str
    encoding: Encoding
    definition: str = ""
    idl: bool = False


@dataclass(frozen=True, kw_only=True)
class Batch:
    """Messages of one channel that lie in one buffer.

    Attributes:
        channel: Whose messages they are.
        buffer: The bytes they lie in.
        offsets: Where each begins. (k,)
        lengths: How long each is. (k,)
        times: When each was recorded. (k,) [ns]
    """

    channel: Channel
    buffer: Bytes
    offsets: Integers
    lengths: Integers
    times: Integers


class MessageRun(NamedTuple):
    """Messages of one channel that follow one another at one stride, so are equally long.

    Attributes:
        start: Where the first one's data begin.
        stride: From one to the next.
        messages: How many.
        length: Of each one's data.
        back: How far before its data the receive time of each stands.
    """

    start: int
    stride: int
    messages: int
    length: int
    back: int


RUN_AFTER = 3
"""Messages of one kind in a row after which a longer run is looked for at once."""


def batch_of(
    channel: Channel, buffer: Bytes, runs: Sequence[MessageRun], nanoseconds: bool
) -> Batch:
    """One batch of all runs of a channel.

    Args:
        channel: Whose messages they are.
        buffer: The bytes they lie in.
        runs: Where they lie.
        nanoseconds: Whether a receive time is one count of nanoseconds, or seconds and the rest.
    """
    counts = [run.messages for run in runs]
    offsets = np.concatenate([run.start + run.stride * np.arange(run.messages) for run in runs])
    back = np.repeat([run.back for run in runs], counts)
    stamps = buffer[(offsets - back)[:, None] + np.arange(8)]
    words = stamps.view("<u8" if nanoseconds else "<u4").astype(np.int64)
    return Batch(
        channel=channel,
        buffer=buffer,
        offsets=offsets,
        lengths=np.repeat([run.length for run in runs], counts),
        times=words[:, 0] if nanoseconds else words[:, 0] * 1_000_000_000 + words[:, 1],
    )


@dataclass
class Ingest:
    """What reading a container may cost, and what had to be left behind.

    Attributes:
        path: The file, for messages.
        size: Its size. [B]
        remarks: What was left behind.
    """

    path: Path
    size: int
    remarks: list[Remark] = field(default_factory=list)
    unpacked: int = 0

    def claim(self, size: int) -> None:
        """Count bytes that are about to be unpacked.

        Raises:
            LogError: If the file claims more than a log of its size can hold.
        """
        self.unpacked += size
        limit = max(UNPACKED_LIMIT, UNPACKED_RATIO * self.size)
        if size < 0 or self.unpacked > limit:
            raise LogError(
                f"{self.path}: its chunks claim to unpack to more than {limit >> 20} MiB, more "
                "than a log of this size can hold. It is damaged or made to fill memory."
            )

    def note(self, remark: Remark) -> None:
        """Remember a remark once."""
        if remark not in self.remarks:
            self.remarks.append(remark)


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
    return ([int(tail)] if tail.isdecimal() else [], name)


def printable(name: str) -> str:
    """A name of a bag for messages: one line, no control characters, not too long."""
    return letters.printable(name[:120])


def type_name(name: str) -> str:
    """A ROS message type without its middle part: sensor_msgs/msg/JointState → …/JointState."""
    parts = printable(name).replace("::", "/").split("/")
    return f"{parts[0]}/{parts[-1]}" if len(parts) > 1 else name


def unpack_chunk(ingest: Ingest, name: str, packed: memoryview, size: int) -> memoryview:
    """Unpack one chunk of a bag or MCAP, bounded by the size that it claims.

    Raises:
        LogError: If the compression is unknown or the chunk is damaged.
    """
    if name in {"", "none"}:
        return packed
    unpacker = UNPACKERS.get(name)
    if unpacker is None:
        raise LogError(f"{ingest.path}: unknown chunk compression {name[:20]!r}.")
    ingest.claim(size)
    content = unpacker(packed, size)
    if content is None or len(content) != size:
        raise LogError(f"{ingest.path}: a {name} chunk is damaged; it does not unpack to {size} B.")
    return memoryview(content)


def _unlz4(packed: memoryview, size: int) -> bytes | None:
    """Unpack lz4 up to a size; None if damaged."""
    import lz4.frame

    try:
        unpacker = lz4.frame.LZ4FrameDecompressor()
        content: bytes = unpacker.decompress(bytes(packed), max_length=size + 1)
        while len(content) <= size and not unpacker.eof and not unpacker.needs_input:
            content += unpacker.decompress(b"", max_length=size + 1 - len(content))
    except (RuntimeError, EOFError, ValueError):
        return None
    return content


def _unbz2(packed: memoryview, size: int) -> bytes | None:
    """Unpack bz2 up to a size; None if damaged."""
    import bz2

    try:
        return bz2.BZ2Decompressor().decompress(bytes(packed), max_length=size + 1)
    except (OSError, ValueError, EOFError):
        return None


def _unzstd(packed: memoryview, size: int) -> bytes | None:
    """Unpack zstd up to a size; None if damaged."""
    import zstandard

    try:
        with zstandard.ZstdDecompressor(max_window_size=1 << 27).stream_reader(
            bytes(packed), read_across_frames=True
        ) as reader:
            content = b""
            while len(content) <= size and (piece := reader.read(size + 1 - len(content))):
                content += piece
            return content
    except zstandard.ZstdError:
        return None


UNPACKERS: dict[str, Callable[[memoryview, int], bytes | None]] = {
    "lz4": _unlz4,
    "bz2": _unbz2,
    "zstd": _unzstd,
}
"""Name of a chunk's compression → a function that unpacks at most the stated size."""


def equal_rows(buffer: Bytes, start: int, stride: int, ranges: Sequence[tuple[int, int]]) -> int:
    """How many records of one stride in a row repeat the first one's bytes in some ranges.

    Records of one topic are as long as one another, so a long run is found by comparing a few
    columns of a matrix laid over the buffer instead of parsing every record.
    """
    total = (len(buffer) - start) // stride
    count, step = 1, 16
    # Ever longer steps: a short run costs little, a long one few comparisons.
    while count < total:
        rows = min(step, total - count)
        view = np.ndarray((rows, stride), np.uint8, buffer, start + count * stride, (stride, 1))
        same = np.ones(rows, dtype=bool)
        for a, b in ranges:
            same &= (view[:, a:b] == buffer[start + a : start + b]).all(axis=1)
        if not same.all():
            return count + int(np.argmin(same))
        count += rows
        step *= 8
    return count


def strided(buffer: Bytes, offsets: Integers, a: int, b: int) -> Bytes:
    """Bytes a to b of each message. (k, b − a)"""
    if len(offsets) > 1:
        stride = int(offsets[1] - offsets[0])
        if stride > 0 and (offsets[1:] - offsets[:-1] == stride).all():
            return np.ndarray(
                (len(offsets), b - a), np.uint8, buffer, int(offsets[0]) + a, (stride, 1)
            )
    picked: Bytes = buffer[offsets[:, None] + np.arange(a, b)]
    return picked


def u32(content: Any, offset: int) -> int:  # noqa: ANN401 - any buffer
    """A little-endian 32-bit count."""
    return int(struct.unpack_from("<I", content, offset)[0])


def u64(content: Any, offset: int) -> int:  # noqa: ANN401
    """A little-endian 64-bit count."""
    return int(struct.unpack_from("<Q", content, offset)[0])
