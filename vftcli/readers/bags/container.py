"""Containers of messages: their files on disk, their channels and batches."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import starmap
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.readers.opening import LogFile, check_unpacked, natural
from vftcli.signals import parsing
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Remark, warning

Bytes = NDArray[np.uint8]
Integers = NDArray[np.int64]


class Channel(NamedTuple):
    """One topic of one container."""

    topic: str
    type: str  #: Message type as package/Name, without ROS 2's middle part.
    encoding: str  #: ros1, cdr, json, protobuf, or other.
    #: Text of the message definition, or nothing if the container has none.
    definition: str = ""
    idl: bool = False  #: Whether the definition is in IDL.


class Batch(NamedTuple):
    """Messages of one channel."""

    channel: Channel  #: The topic of all of them.
    times: list[int]  #: When each was recorded. [ns]
    contents: list[bytes]


#: The channel of a message, None where the file does not say; its time [ns]; its bytes.
Messages = Iterator[tuple[Channel | None, int, bytes]]

BATCH_BYTES = 16 * 1024 * 1024
MESSAGE_COST = 128  #: Memory that a message takes beside its bytes. [B]


def batched(messages: Messages, budget: "ReadBudget") -> Iterator[Batch]:
    """Batches of some megabytes, one a channel, in the order of first messages."""
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
            yield from starmap(Batch, found.values())
            found, held = {}, 0
    yield from starmap(Batch, found.values())


@dataclass
class MessageCount:
    """Messages found in a container, and its own count."""

    end: int  #: Where its last whole record ends. [B]
    kept: int = 0
    counted: int | None = None  #: Messages by its own count, or None.

    def report(self, budget: "ReadBudget", counter: str, *, cut: bool) -> None:
        """Say so if messages are missing by its own count, or may be as it is cut."""
        kept = self.kept
        counted = kept if self.counted is None else self.counted
        if kept > counted:
            raise budget.error(
                f"{counter} counts {counted} messages, the chunks hold {kept}; damaged."
            )
        if kept < counted:
            budget.note(warning("messages-missing", kept=kept, counted=counted, by=counter))
        elif cut:
            budget.note(warning("bag-cut", kept=kept))


#: Most records of a container: a message takes some bytes, numbers shrink 3 to 15 times.
SPARE_PIECES, PIECES_PER_BYTE = 1_000_000, 2


@dataclass
class ReadBudget:
    """Bounds on reading a container, and remarks on the parts left out."""

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
                "more records than a log of this size can hold. Damaged, or made to fill time."
            )

    def claim(self, size: int) -> None:
        """Count bytes that are about to be unpacked."""
        self.unpacked += size
        check_unpacked(self.path, self.unpacked, self.size)

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

    Only files in the folder itself are read; names in metadata.yaml are not followed.
    """
    names = {n for n in file.entries if n.endswith(STORAGE) and (file.path / n).is_file()}
    plain = {n for n in names if n.removesuffix(".zstd").removesuffix(".zst") not in names - {n}}
    return sorted(plain, key=natural)


def printable(name: str) -> str:
    """A name of a bag for messages: one line, no control characters, not too long."""
    return parsing.printable(name[:120])


def type_name(name: str) -> str:
    """A ROS type without its middle part: sensor_msgs/msg/JointState → …/JointState."""
    parts = printable(name).replace("::", "/").split("/")
    return f"{parts[0]}/{parts[-1]}" if len(parts) > 1 else name


Content = Any  #: Bytes, or a mapped file.


class CutError(ValueError):
    """The content ends inside a record."""


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


def of_chunk(records: Iterator[Any], budget: ReadBudget) -> Iterator[Any]:
    """The records of a chunk, all of which must be whole."""
    try:
        yield from records
    except CutError:
        raise budget.error("a record ends outside its chunk; damaged.") from None
