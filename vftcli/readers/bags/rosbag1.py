"""ROS 1 bags, version 2.0: records walked from the start, so that an unclosed bag reads too.

Format: http://wiki.ros.org/Bags/Format/2.0. A record is a header length, header fields
`name=value`, a data length and the data; chunks hold connection and message records.
"""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.readers.bags.container import (
    ROSBAG1,
    RUN_AFTER,
    Batch,
    Channel,
    Ingest,
    MessageRun,
    batch_of,
    equal_rows,
    printable,
    type_name,
    u32,
    unpack_chunk,
)
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import caution, fact, warning

OP_MESSAGE, OP_BAG, OP_INDEX, OP_CHUNK, OP_CHUNK_INFO, OP_CONNECTION = 2, 3, 4, 5, 6, 7
MAX_HEADER = 64 * 1024

Header = dict[bytes, bytes]


class Record(NamedTuple):
    """One record: its parsed header, and where its data lies."""

    header: Header
    data: int
    end: int

    @property
    def op(self) -> int:
        """The record's kind, or −1."""
        code = self.header.get(b"op", b"")
        return code[0] if len(code) == 1 else -1


class Template(NamedTuple):
    """The header of a connection's messages, all alike but for the time in it."""

    connection: int
    length: int
    before: bytes
    time: int
    after: bytes


class Cut(Exception):  # noqa: N818 - not an error: the end of what can be read
    """The content ends inside a record."""


def parse_header(content: memoryview, start: int, end: int) -> Header:
    """Fields of a record header; a malformed field ends it.

    Raises:
        Cut: If a field is longer than the header.
    """
    fields = {}
    while start < end:
        if start + 4 > end:
            raise Cut
        length = u32(content, start)
        if length > end - start - 4:
            raise Cut
        name, _, value = bytes(content[start + 4 : start + 4 + length]).partition(b"=")
        fields[name] = value
        start += 4 + length
    return fields


def record_at(content: memoryview, start: int) -> Record:
    """The record that begins at an offset.

    Raises:
        Cut: If it does not end inside the content.
    """
    if start + 8 > len(content):
        raise Cut
    size = u32(content, start)
    if size > MAX_HEADER or start + 8 + size > len(content):
        raise Cut
    header = parse_header(content, start + 4, start + 4 + size)
    data = start + 8 + size
    end = data + u32(content, start + 4 + size)
    if end > len(content):
        raise Cut
    return Record(header, data, end)


@dataclass
class Census:
    """What a bag's header and index say of its messages, and what was found.

    Attributes:
        messages: Messages found.
        chunks: Chunks found.
        counted_chunks: Chunks that the header counts, None where the recorder never closed the bag.
        listed: Chunks that the index at the end lists.
        counted: Messages that it counts.
    """

    messages: int = 0
    chunks: int = 0
    counted_chunks: int | None = None
    listed: int = 0
    counted: int = 0

    def take_header(self, header: Header) -> None:
        """Take up the header of the bag: a recorder fills it in when it closes the bag."""
        place, chunks = header.get(b"index_pos", b""), header.get(b"chunk_count", b"")
        if len(place) == 8 and place != bytes(8) and len(chunks) == 4:
            self.counted_chunks = u32(chunks, 0)

    def take_index(self, content: memoryview, record: Record) -> None:
        """Take up what the index says of one chunk: connections and their messages."""
        self.listed += 1
        words = content[record.data : record.data + (record.end - record.data) // 8 * 8]
        pairs = np.frombuffer(words, dtype="<u4")
        self.counted += int(pairs[1::2].sum())

    def tell(self, ingest: Ingest, left: int) -> None:
        """Say so if the bag is cut, and how much of it was kept.

        Args:
            ingest: Where it is said.
            left: Bytes behind the last whole record.
        """
        kept, counted = self.messages, self.counted_chunks
        if counted is None:
            unclosed = caution("recorder-stopped", kept=kept)
            ingest.note(warning("chunks-cut", kept=kept, rest_bytes=left) if left else unclosed)
        elif self.listed == counted and kept != self.counted:
            ingest.note(
                warning("messages-missing", kept=kept, counted=self.counted, by="its index")
            )
        elif self.chunks != counted:
            ingest.note(warning("chunks-missing", kept=kept, chunks=self.chunks, counted=counted))
        elif left:
            ingest.note(fact("index-cut", kept=kept, chunks=counted))


def batches(content: memoryview, ingest: Ingest) -> Iterator[Batch]:
    """Messages of a bag, chunk by chunk, up to the last whole chunk.

    Raises:
        LogError: If a chunk is damaged or the bag is encrypted.
    """
    connections: dict[int, Channel] = {}
    counts: dict[int, int] = {}
    census = Census()
    position = len(ROSBAG1)
    while position < len(content):
        try:
            record = record_at(content, position)
        except Cut:
            break
        if record.op == OP_BAG:
            census.take_header(record.header)
            if record.header.get(b"encryptor"):
                raise LogError(f"{ingest.path}: the bag is encrypted. Decrypt it first.")
        elif record.op == OP_CONNECTION:
            _connect(connections, content, record)
        elif record.op == OP_CHUNK:
            counts = {}
            yield from _chunk(content, record, connections, counts, ingest)
            census.chunks += 1
            census.messages += sum(counts.values())
        elif record.op == OP_INDEX:
            _compare(record, counts, ingest)
        elif record.op == OP_CHUNK_INFO:
            census.take_index(content, record)
        else:
            raise LogError(f"{ingest.path}: an unknown record at byte {position}; damaged.")
        position = record.end
    census.tell(ingest, len(content) - position)


def _compare(record: Record, counts: dict[int, int], ingest: Ingest) -> None:
    """Compare the messages found in the last chunk with its index.

    Raises:
        LogError: If the index counts another number of messages.
    """
    number, count = record.header.get(b"conn", b""), record.header.get(b"count", b"")
    if len(number) != 4 or len(count) != 4 or counts.get(u32(number, 0), 0) != u32(count, 0):
        raise LogError(f"{ingest.path}: a chunk and its index count differently; it is damaged.")


def _connect(connections: dict[int, Channel], content: memoryview, record: Record) -> None:
    """Take up a connection record; a malformed one leaves its messages unknown."""
    number = record.header.get(b"conn", b"")
    if len(number) != 4:
        return
    try:
        fields = parse_header(content, record.data, record.end)
    except Cut:
        return
    topic = record.header.get(b"topic", fields.get(b"topic", b""))
    connections[u32(number, 0)] = Channel(
        topic=printable(topic.decode("utf-8", "replace")),
        type=type_name(fields.get(b"type", b"").decode("utf-8", "replace")),
        encoding="ros1",
        definition=fields.get(b"message_definition", b"").decode("utf-8", "replace"),
    )


def _chunk(
    content: memoryview,
    record: Record,
    connections: dict[int, Channel],
    counts: dict[int, int],
    ingest: Ingest,
) -> Iterator[Batch]:
    """The messages of a chunk, one batch a connection, and how many there were of each."""
    size = record.header.get(b"size", b"")
    if len(size) != 4:
        raise LogError(f"{ingest.path}: a chunk without its size; the bag is damaged.")
    name = record.header.get(b"compression", b"none").decode("ascii", "replace")
    packed = content[record.data : record.end]
    chunk = unpack_chunk(ingest, name, packed, u32(size, 0))
    found = _walk(chunk, connections, ingest)
    buffer = np.frombuffer(chunk, dtype=np.uint8)
    for connection, runs in found.items():
        counts[connection] = sum(run.messages for run in runs)
        if connection not in connections:
            raise LogError(f"{ingest.path}: messages of an unknown connection; damaged.")
        yield batch_of(connections[connection], buffer, runs, nanoseconds=False)


def _walk(
    chunk: memoryview, connections: dict[int, Channel], ingest: Ingest
) -> dict[int, list[MessageRun]]:
    """Find the messages of a chunk. Connection → runs of its messages.

    Raises:
        LogError: If the chunk's records do not fill it.
    """
    buffer = np.frombuffer(chunk, dtype=np.uint8)
    found: dict[int, list[MessageRun]] = {}
    templates: list[Template] = []
    position, alike, before = 0, 0, (-1, -1)
    while position < len(chunk):
        template = _known(chunk, position, templates)
        if template is None:
            try:
                record = record_at(chunk, position)
            except Cut:
                raise LogError(
                    f"{ingest.path}: a chunk ends inside a record; the bag is damaged."
                ) from None
            if record.op == OP_CONNECTION:
                _connect(connections, chunk, record)
                position = record.end
                continue
            template = _template(chunk, position, record) if record.op == OP_MESSAGE else None
            if template is None:
                raise LogError(f"{ingest.path}: an unknown record in a chunk; damaged.")
            # The newest first: messages of one topic come in a row.
            templates.insert(0, template)
        data = position + 8 + template.length
        length = u32(chunk, data - 4)
        if data + length > len(chunk):
            raise LogError(f"{ingest.path}: a message ends outside its chunk; the bag is damaged.")
        stride = 8 + template.length + length
        alike = alike + 1 if before == (template.connection, stride) else 0
        before = (template.connection, stride)
        count = 1
        if alike >= RUN_AFTER:
            after = template.time + 8
            count = equal_rows(
                buffer, position, stride, ((0, template.time), (after, 8 + template.length))
            )
        run = MessageRun(data, stride, count, length, data - position - template.time)
        found.setdefault(template.connection, []).append(run)
        position += stride * count
    return found


def _known(chunk: memoryview, position: int, templates: list[Template]) -> Template | None:
    """The template that a message's header fits, None where none does."""
    for template in templates:
        time = position + template.time
        if (
            chunk[position:time] == template.before
            and chunk[time + 8 : position + 4 + template.length] == template.after
            and position + 8 + template.length <= len(chunk)
        ):
            return template
    return None


def _template(chunk: memoryview, position: int, record: Record) -> Template | None:
    """The pattern of a message record's header, with the place of its time."""
    connection, time = record.header.get(b"conn", b""), record.header.get(b"time", b"")
    if len(connection) != 4 or len(time) != 8:
        return None
    length = u32(chunk, position)
    raw = bytes(chunk[position : position + 4 + length])
    place = raw.find(struct.pack("<I", 13) + b"time=" + time)
    if place < 0:
        return None
    place += 9
    return Template(u32(connection, 0), length, raw[:place], place, raw[place + 8 :])
