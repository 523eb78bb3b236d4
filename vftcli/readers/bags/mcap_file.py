"""MCAP files: records walked from the start, so that a cut file reads up to its last whole chunk.

Format: https://mcap.dev/spec. A record is an opcode, a 64-bit length and the content.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vftcli.readers.bags.container import (
    MCAP,
    RUN_AFTER,
    Batch,
    Bytes,
    Channel,
    Encoding,
    Ingest,
    MessageRun,
    batch_of,
    equal_rows,
    printable,
    type_name,
    u32,
    u64,
    unpack_chunk,
)
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import caution, warning

FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX = 2, 3, 4, 5, 6, 7
CHUNK_INDEX, ATTACHMENT, STATISTICS, METADATA, DATA_END = 8, 9, 11, 12, 15
DATA_RECORDS = {SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, ATTACHMENT, METADATA}
DATA_END_BYTES = 13
"""Length of the record that ends the data, its head included."""
HEADER = 9
"""Bytes before a record's content: opcode and length."""
MESSAGE_HEAD = 22
"""Bytes of a message before its data: channel, sequence, log time, publish time."""
LOG_TIME = 16
"""How far before its data a message's log time stands."""

ENCODINGS: dict[str, Encoding] = {
    "cdr": "cdr", "ros1": "ros1", "json": "json", "protobuf": "protobuf",
}  # fmt: skip


@dataclass
class End:
    """What the records behind the messages say of them, and what was found.

    Attributes:
        messages: Messages found.
        chunks: Chunks found.
        counted: Messages that the statistics count, None without statistics.
        indexed: Chunks that the summary lists.
        data_end: Where the record that ends the data ends, None if there is none.
        summary: Where the footer says that the summary begins; 0 if it has none.
        data: Where the last record of the data ends.
        closed: Whether there is a footer.
    """

    messages: int = 0
    chunks: int = 0
    counted: int | None = None
    indexed: int = 0
    data_end: int | None = None
    summary: int = 0
    data: int = 0
    closed: bool = False


class Catalogue:
    """Schemas and channels met so far."""

    def __init__(self, ingest: Ingest) -> None:
        self.ingest = ingest
        self.schemas: dict[int, tuple[str, str, bytes]] = {}
        self.channels: dict[int, Channel] = {}
        self.loose: dict[int, list[MessageRun]] = {}
        self.end = End()

    def take(self, opcode: int, content: memoryview) -> None:
        """Take up a schema or channel record."""
        if opcode == CHANNEL:
            self._channel(content)
            return
        name, position = self._text(content, 2)
        encoding, position = self._text(content, position)
        size = u32(content, position)
        data = bytes(content[position + 4 : position + 4 + size])
        self.schemas[int(struct.unpack_from("<H", content)[0])] = (name, encoding, data)

    def _channel(self, content: memoryview) -> None:
        """Take up a channel record."""
        number, schema = struct.unpack_from("<HH", content)
        topic, position = self._text(content, 4)
        encoding, _ = self._text(content, position)
        name, kind, data = self.schemas.get(schema, ("", "", b""))
        text = data.decode("utf-8", "replace") if kind in {"ros1msg", "ros2msg", "ros2idl"} else ""
        self.channels[number] = Channel(
            topic=printable(topic),
            type=type_name(name) if text else printable(name),
            encoding=ENCODINGS.get(encoding, "other"),
            definition=text,
            idl=kind == "ros2idl",
        )

    @staticmethod
    def _text(content: memoryview, position: int) -> tuple[str, int]:
        """A string with its length before it, and where it ends."""
        end = position + 4 + u32(content, position)
        if end > len(content):
            raise struct.error
        return bytes(content[position + 4 : end]).decode("utf-8", "replace"), end


def batches(content: memoryview, ingest: Ingest) -> Iterator[Batch]:
    """Messages of an MCAP file, chunk by chunk, up to the last whole chunk.

    Raises:
        LogError: If a chunk or a record is damaged.
    """
    catalogue = Catalogue(ingest)
    position = len(MCAP)
    try:
        while position + HEADER <= len(content) and not catalogue.end.closed:
            opcode, end = content[position], position + HEADER + u64(content, position + 1)
            if end > len(content):
                break
            # Messages outside chunks are gathered and yielded at the end, all at once.
            if opcode == CHUNK:
                catalogue.end.chunks += 1
                yield from _chunk(content[position + HEADER : end], catalogue)
            else:
                _record(catalogue, opcode, content, position, end)
            if opcode in DATA_RECORDS and catalogue.end.data_end is None:
                catalogue.end.data = end
            position = end
    except struct.error:
        raise LogError(f"{ingest.path}: a record is damaged at byte {position}.") from None
    yield from _yielded(catalogue.loose, np.frombuffer(content, dtype=np.uint8), catalogue)
    _check_end(catalogue.end, ingest, len(content) - position)


def _record(
    catalogue: Catalogue, opcode: int, content: memoryview, position: int, end: int
) -> None:
    """Take up a record outside chunks; kinds that say nothing of messages are passed over."""
    if opcode == MESSAGE:
        _message(content, position, end, catalogue.loose)
    elif opcode in {SCHEMA, CHANNEL}:
        catalogue.take(opcode, content[position + HEADER : end])
    end_of = catalogue.end
    if opcode == STATISTICS:
        end_of.counted = u64(content, position + HEADER)
    elif opcode == CHUNK_INDEX:
        end_of.indexed += 1
    elif opcode == DATA_END:
        end_of.data_end = end
    elif opcode == FOOTER:
        end_of.closed, end_of.summary = True, u64(content, position + HEADER)


def _check_end(end: End, ingest: Ingest, left: int) -> None:
    """Say so if the file is cut, at its end or anywhere else, and how much of it was kept.

    Raises:
        LogError: If it holds more messages than it counts, or bytes behind its end.
    """
    kept = end.messages
    if end.counted is not None and end.counted < kept:
        raise LogError(
            f"{ingest.path}: its statistics count {end.counted} messages, the chunks hold {kept}; "
            "the file is damaged."
        )
    if end.closed and left != len(MCAP):
        raise LogError(
            f"{ingest.path}: {left} bytes follow its end where {len(MCAP)} should; it is damaged."
        )
    data = end.data if end.data_end is None else end.data_end - DATA_END_BYTES
    missing = end.summary - DATA_END_BYTES - data if end.summary else 0
    if end.counted is not None:
        if kept < end.counted:
            ingest.note(
                warning("messages-missing", kept=kept, counted=end.counted, by="its statistics")
            )
    elif end.chunks < end.indexed:
        ingest.note(warning("chunks-missing", kept=kept, chunks=end.chunks, counted=end.indexed))
    elif missing > 0:
        ingest.note(
            warning("bytes-missing", kept=kept, missing_bytes=missing, bytes=data + missing)
        )
    elif left > 0 and not end.closed:
        ingest.note(warning("chunks-cut", kept=kept, rest_bytes=left))
    elif end.data_end is None:
        ingest.note(caution("recorder-stopped", kept=kept))


def _message(
    content: memoryview, position: int, end: int, found: dict[int, list[MessageRun]]
) -> None:
    """Note a message outside chunks."""
    length = end - position - HEADER - MESSAGE_HEAD
    if length < 0:
        raise struct.error
    channel = int(struct.unpack_from("<H", content, position + HEADER)[0])
    start = position + HEADER + MESSAGE_HEAD
    found.setdefault(channel, []).append(MessageRun(start, end - position, 1, length, LOG_TIME))


def _chunk(content: memoryview, catalogue: Catalogue) -> Iterator[Batch]:
    """The messages of a chunk, unpacked and checked."""
    ingest = catalogue.ingest
    size, checksum = u64(content, 16), u32(content, 24)
    compression, position = Catalogue._text(content, 28)
    stored = u64(content, position)
    packed = content[position + 8 : position + 8 + stored]
    if len(packed) != stored:
        raise struct.error
    chunk = unpack_chunk(ingest, compression, packed, size)
    # A checksum of zero means that the writer made none.
    if checksum and zlib.crc32(chunk) != checksum:
        raise LogError(f"{ingest.path}: a chunk does not match its checksum; the file is damaged.")
    buffer = np.frombuffer(chunk, dtype=np.uint8)
    yield from _yielded(_walk(chunk, buffer, catalogue), buffer, catalogue)


def _walk(chunk: memoryview, buffer: Bytes, catalogue: Catalogue) -> dict[int, list[MessageRun]]:
    """Find the messages of a chunk. Channel → runs of its messages."""
    found: dict[int, list[MessageRun]] = {}
    position, alike, before = 0, 0, (-1, -1)
    while position < len(chunk):
        opcode, length = struct.unpack_from("<BQ", chunk, position)
        stride = HEADER + length
        if position + stride > len(chunk):
            raise LogError(f"{catalogue.ingest.path}: a record ends outside its chunk; damaged.")
        if opcode in {SCHEMA, CHANNEL}:
            catalogue.take(opcode, chunk[position + HEADER : position + stride])
            position += stride
            continue
        if opcode != MESSAGE:
            raise LogError(f"{catalogue.ingest.path}: an unknown record in a chunk; damaged.")
        if length < MESSAGE_HEAD:
            raise struct.error
        channel = int(struct.unpack_from("<H", chunk, position + HEADER)[0])
        alike = alike + 1 if before == (channel, stride) else 0
        before, count = (channel, stride), 1
        if alike >= RUN_AFTER:
            count = equal_rows(buffer, position, stride, ((0, HEADER + 2),))
        start, size = position + HEADER + MESSAGE_HEAD, length - MESSAGE_HEAD
        run = MessageRun(start, stride, count, size, LOG_TIME)
        found.setdefault(channel, []).append(run)
        position += stride * count
    return found


def _yielded(
    found: dict[int, list[MessageRun]], buffer: Bytes, catalogue: Catalogue
) -> Iterator[Batch]:
    """One batch a channel, of all the runs that were found."""
    for number, runs in found.items():
        if (channel := catalogue.channels.get(number)) is None:
            raise LogError(f"{catalogue.ingest.path}: messages of an unknown channel; damaged.")
        catalogue.end.messages += sum(run.messages for run in runs)
        yield batch_of(channel, buffer, runs, nanoseconds=True)
