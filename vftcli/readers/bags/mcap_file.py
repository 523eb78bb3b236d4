"""MCAP files: records walked from the start, so that a cut file reads up to its last whole chunk.

Format: https://mcap.dev/spec. A record is an opcode, a 64-bit length and the content.
"""

import struct
import zlib
from collections.abc import Iterator

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
from vftcli.signals.remarks import fact

SCHEMA, CHANNEL, MESSAGE, CHUNK, STATISTICS, FOOTER, DATA_END = 3, 4, 5, 6, 11, 2, 15
HEADER = 9
"""Bytes before a record's content: opcode and length."""
MESSAGE_HEAD = 22
"""Bytes of a message before its data: channel, sequence, log time, publish time."""
LOG_TIME = 16
"""How far before its data a message's log time stands."""

ENCODINGS: dict[str, Encoding] = {
    "cdr": "cdr", "ros1": "ros1", "json": "json", "protobuf": "protobuf",
}  # fmt: skip


class Catalogue:
    """Schemas and channels met so far."""

    def __init__(self, ingest: Ingest) -> None:
        self.ingest = ingest
        self.schemas: dict[int, tuple[str, str, bytes]] = {}
        self.channels: dict[int, Channel] = {}
        self.messages = 0
        self.counted: int | None = None
        self.loose: dict[int, list[MessageRun]] = {}
        self.ended = self.closed = False

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
        while position + HEADER <= len(content) and not catalogue.closed:
            opcode, end = content[position], position + HEADER + u64(content, position + 1)
            if end > len(content):
                break
            # Messages outside chunks are gathered and yielded at the end, all at once.
            if opcode == CHUNK:
                yield from _chunk(content[position + HEADER : end], catalogue)
            else:
                _record(catalogue, opcode, content, position, end)
            position = end
    except struct.error:
        raise LogError(f"{ingest.path}: a record is damaged at byte {position}.") from None
    yield from _yielded(catalogue.loose, np.frombuffer(content, dtype=np.uint8), catalogue)
    _check_end(catalogue, len(content) - position)


def _record(
    catalogue: Catalogue, opcode: int, content: memoryview, position: int, end: int
) -> None:
    """Take up a record outside chunks; kinds that say nothing of messages are passed over."""
    if opcode == MESSAGE:
        _message(content, position, end, catalogue.loose)
    elif opcode in {SCHEMA, CHANNEL}:
        catalogue.take(opcode, content[position + HEADER : end])
    elif opcode == STATISTICS:
        catalogue.counted = u64(content, position + HEADER)
    elif opcode in {DATA_END, FOOTER}:
        catalogue.ended = True
        catalogue.closed = opcode == FOOTER


def _check_end(catalogue: Catalogue, left: int) -> None:
    """Say so if the file is cut.

    Raises:
        LogError: If its statistics count another number of messages.
    """
    ingest = catalogue.ingest
    if catalogue.counted is not None and catalogue.counted != catalogue.messages:
        raise LogError(
            f"{ingest.path}: its statistics count {catalogue.counted} messages, the chunks hold "
            f"{catalogue.messages}; the file is damaged."
        )
    if catalogue.closed and left != len(MCAP):
        raise LogError(
            f"{ingest.path}: {left} bytes follow its end where {len(MCAP)} should; it is damaged."
        )
    if not catalogue.ended:
        is_cut = left > 0
        ingest.note(fact("chunks-cut", rest_bytes=left) if is_cut else fact("recorder-stopped"))


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
        catalogue.messages += sum(run.messages for run in runs)
        yield batch_of(channel, buffer, runs, nanoseconds=True)
