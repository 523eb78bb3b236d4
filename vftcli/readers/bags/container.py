"""Containers of messages: their files on disk, and the channels and batches that each yields."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.readers.opening import LogFile, check_unpacked, natural
from vftcli.signals import parsing
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Remark, Where, caution, fact, warning

Bytes = NDArray[np.uint8]
Integers = NDArray[np.int64]


class Channel(NamedTuple):
    """One topic of one container."""

    topic: str  #: Its name.
    type: str  #: Message type as package/Name, without the middle part that ROS 2 writes.
    encoding: str  #: How its messages are serialised: ros1, cdr, json, protobuf, or other.
    definition: str = ""  #: Text of the message definition, or nothing if the container has none.
    idl: bool = False  #: Whether the definition is in IDL.


class Batch(NamedTuple):
    """Messages of one channel, one behind the other."""

    channel: Channel  #: The topic of all of them.
    buffer: Bytes  #: Their bytes.
    offsets: Integers  #: Where each begins. (k,)
    lengths: Integers  #: How long each is. (k,)
    times: Integers  #: When each was recorded. (k,) [ns]


#: The channel of a message, None where the file does not say; its time [ns]; its bytes.
Message = tuple[Channel | None, int, bytes]
Messages = Iterator[Message]

BATCH_BYTES = 16 * 1024 * 1024
MESSAGE_COST = 128  #: Memory that a message takes beside its bytes. [B]


def batched(messages: Iterable[Message], budget: "ReadBudget") -> Iterator[Batch]:
    """Messages by channel, some megabytes at a time, channels in the order of their first ones."""
    found: dict[int, tuple[Channel, list[int], list[bytes]]] = {}
    held = 0
    for channel, time, content in messages:
        if channel is None:
            raise budget.error("messages of an unknown topic; the file is damaged.")
        _, times, contents = found.setdefault(id(channel), (channel, [], []))
        times.append(time)
        contents.append(content)
        held += len(content) + MESSAGE_COST
        if held > BATCH_BYTES:
            yield from map(_batch, found.values())
            found, held = {}, 0
    yield from map(_batch, found.values())


def _batch(found: tuple[Channel, list[int], list[bytes]]) -> Batch:
    channel, times, contents = found
    lengths = np.array([len(content) for content in contents])
    buffer, wrapped = np.frombuffer(b"".join(contents), dtype=np.uint8), np.array(times)
    # Recorders that count past 2⁶³ wrap.
    return Batch(channel, buffer, np.cumsum(lengths) - lengths, lengths, wrapped.astype(np.int64))


@dataclass
class MessageCount:
    """What a container says of its messages, and what was found."""

    kept: int = 0  #: Messages found.
    chunks: int = 0  #: Chunks found.
    counted: int | None = None  #: Messages that it counts, None where it does not say.
    counted_chunks: int | None = None  #: Chunks that it counts, None where it does not say.
    data_end: int = 0  #: Where its messages end, 0 where that is not known. [B]
    missing: int = 0  #: Bytes of messages that should stand before that place. [B]
    closed: bool = False  #: Whether its recorder closed it.

    def report(self, budget: "ReadBudget", left: int, counter: str) -> None:
        """Say so if the container is cut, and how much of it was kept."""
        kept, chunks, missing = self.kept, self.chunks, self.missing
        if self.counted is not None and kept > self.counted:
            raise budget.error(
                f"{counter} counts {self.counted} messages, the chunks hold {kept}; "
                "the file is damaged."
            )
        if self.counted is not None and kept < self.counted:
            budget.note(warning("messages-missing", kept=kept, counted=self.counted, by=counter))
        elif self.counted_chunks is not None and chunks != self.counted_chunks:
            counted = self.counted_chunks
            budget.note(warning("chunks-missing", kept=kept, chunks=chunks, counted=counted))
        elif self.counted is None and missing > 0:
            size = self.data_end + missing
            budget.note(warning("bytes-missing", kept=kept, missing_bytes=missing, bytes=size))
        elif left and self.closed:
            budget.note(fact("index-cut", kept=kept, chunks=chunks))
        elif left:
            budget.note(warning("chunks-cut", kept=kept, rest_bytes=left))
        elif not self.closed:
            budget.note(caution("recorder-stopped", kept=kept))


#: Records that may be read of a container: no recorded message takes less than some
#: bytes, and recorded numbers shrink by 3 to 15.
SPARE_PIECES, PIECES_PER_BYTE = 1_000_000, 2


@dataclass
class ReadBudget:
    """What reading a container may cost, and what had to be left behind."""

    path: Path  #: The file, for messages.
    size: int  #: Its size. [B]
    remarks: list[Remark] = field(default_factory=list)  #: What was left behind.
    unpacked: int = 0  #: Bytes that were unpacked.
    pieces: int = 0  #: Records and parts of records that may still be read.

    def __post_init__(self) -> None:
        self.pieces = SPARE_PIECES + PIECES_PER_BYTE * self.size

    def spend(self, pieces: int) -> None:
        """Count pieces that are about to be read."""
        self.pieces -= pieces
        if self.pieces < 0:
            raise self.error(
                "its chunks hold more records than a log of this size can. It is damaged or made "
                "to fill time."
            )

    def claim(self, size: int) -> None:
        """Count bytes that are about to be unpacked."""
        self.unpacked += size
        check_unpacked(self.path, self.unpacked if size >= 0 else size, self.size)

    def error(self, text: str) -> LogError:
        """An error that names the file."""
        return LogError(f"{self.path}: {text}")

    def note(self, remark: Remark) -> None:
        """Remember a remark once."""
        if remark not in self.remarks:
            self.remarks.append(remark)


#: Endings of the files of a bag folder that hold messages.
STORAGE = (".mcap", ".db3", ".mcap.zstd", ".db3.zstd", ".mcap.zst", ".db3.zst")


def storage_files(file: LogFile) -> list[str]:
    """The storage files of a bag folder, in the order in which they were recorded.

    Names in metadata.yaml are not followed: only files that lie in the folder itself are
    read.
    """
    names = {n for n in file.entries if n.endswith(STORAGE) and (file.path / n).is_file()}
    plain = {n for n in names if n.removesuffix(".zstd").removesuffix(".zst") not in names - {n}}
    return sorted(plain, key=natural)


#: How a file of a container begins → what of `records` reads it.
CONTAINERS = {
    b"#ROSBAG V2.0\n": "BagMessages",
    b"\x89MCAP0\r\n": "McapMessages",
    b"SQLite format 3\0": "db3_messages",
}


def batches(files: Sequence[LogFile], budget: ReadBudget) -> Iterator[Batch]:
    """The messages of files, one behind the other; what a library raises is said in one line."""
    for file in files:
        found = next((x for magic, x in CONTAINERS.items() if file.head.startswith(magic)), None)
        if found is None:
            raise LogError(f"{file.path}: neither a ROS bag nor an MCAP file.")
        try:
            messages_of = getattr(import_module("vftcli.readers.bags.records"), found)
            for batch in batched(messages_of(file, budget), budget):
                yield batch
                file.release()
        except LogError:
            raise
        except MemoryError:
            raise budget.error(
                "a part of it claims more memory than the file holds; it is damaged."
            ) from None
        except Exception as error:  # noqa: BLE001 - libraries document none of what damage raises
            reason = printable(f"{type(error).__name__}: {error}")[:100]
            raise budget.error(f"not a readable bag; it is damaged ({reason}).") from None
        if file.path != budget.path:
            for remark in file.remarks:
                budget.note(replace(remark, where=Where(about=file.path.name)))


def printable(name: str) -> str:
    """A name of a bag for messages: one line, no control characters, not too long."""
    return parsing.printable(name[:120])


def type_name(name: str) -> str:
    """A ROS message type without its middle part: sensor_msgs/msg/JointState → …/JointState."""
    parts = printable(name).replace("::", "/").split("/")
    return f"{parts[0]}/{parts[-1]}" if len(parts) > 1 else name


class CutError(ValueError):
    """The content ends inside a record."""


Content = Any  #: Bytes, or a mapped file.


def sized(content: Content, place: int, width: int = 4) -> tuple[bytes, int]:
    """The bytes behind their own length, which takes so many, and where they end."""
    start = place + width
    end = start + int.from_bytes(content[place:start], "little")
    if end > len(content):
        raise CutError("a record ends outside its content")
    return content[start:end], end


def unpacked(budget: ReadBudget, name: str, packed: bytes, size: int) -> bytes:
    """One chunk of a bag or MCAP, unpacked to the size that it claims."""
    import bz2

    import lz4.frame
    import zstandard

    if name in {"", "none"}:
        return packed
    budget.claim(size)
    content: bytes
    if name == "lz4":
        content = lz4.frame.LZ4FrameDecompressor().decompress(packed, max_length=size + 1)
    elif name == "bz2":
        content = bz2.BZ2Decompressor().decompress(packed, max_length=size + 1)
    elif name == "zstd":
        content = zstandard.ZstdDecompressor().stream_reader(packed).read(size + 1)
    else:
        raise budget.error(f"unknown chunk compression {name[:20]!r}.")
    if len(content) != size:
        raise budget.error(f"a {name} chunk is damaged; it does not unpack to {size} B.")
    return content


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
