"""Records of ROS 1 bags, of MCAP files and of ROS 2's SQLite databases.

ROS 1 bags (http://wiki.ros.org/Bags/Format/2.0) and MCAP files (https://mcap.dev/spec)
are read from the start, so that a cut or unclosed one reads up to its last chunk. The
readers of rosbags and mcap need the index at the end, or unpack a chunk to whatever it
holds, and take longer.

A database is code as much as data: a column may be computed by functions of SQLite from
nothing. So only stored columns of plain tables are read, no function runs, and what is
read is bounded by the size of the file.
"""

import sqlite3
import struct
import zlib
from collections.abc import Iterator
from contextlib import closing, suppress
from typing import Any

from mcap.opcode import Opcode
from mcap.stream_reader import MAGIC_SIZE
from rosbags.rosbag1.reader import RecordType

from vftcli.readers.bags.container import (
    Channel,
    Content,
    CutError,
    MessageCount,
    Messages,
    ReadBudget,
    printable,
    sized,
    type_name,
    unpacked,
)
from vftcli.readers.opening import LogFile
from vftcli.signals.remarks import warning

BAG_MAGIC = 13  #: Bytes before the first record of a ROS 1 bag.
MESSAGE, CONNECTION = bytes([RecordType.MSGDATA]), bytes([RecordType.CONNECTION])
#: What a field of a header takes at least, but for those that no recorder writes.
BYTES_PER_FIELD = 8

Header = dict[bytes, bytes]  #: Name of a field → its bytes.


def _fields(head: bytes) -> Header:
    fields, place = {}, 0
    while place < len(head):
        field, place = sized(head, place)
        name, equal, value = field.partition(b"=")
        if not equal:
            raise CutError("a header without fields")
        fields[name] = value
    return fields


class BagMessages:
    """Messages of a bag, chunk by chunk, and what is known of it while its records come in.

    Attributes:
        counts: What its header and index count, and what was found.
        channels: Connection → topic.
        starts, indexed: Where messages begin in the last chunk, by it and by the records behind it.
        listed, counted: Chunks that the index at the end lists; messages that it counts.
    """

    def __init__(self, file: LogFile, budget: ReadBudget) -> None:
        self.content: Content = file.content.obj
        self.budget = budget
        self.counts = MessageCount()
        self.channels: dict[bytes, Channel] = {}
        self.starts: list[int] = []
        self.indexed: list[int] = []
        self.listed = self.counted = 0

    def __iter__(self) -> Messages:
        end = BAG_MAGIC
        while True:
            try:
                header, data, place = self._record(self.content, end)
            except CutError:
                break
            yield from self._take(header, data)
            end = place
        self._check_index()
        self.counts.report(self.budget, len(self.content) - end, "its index")

    def _record(self, content: Content, place: int) -> tuple[Header, bytes, int]:
        head, place = sized(content, place)
        self.budget.spend(1 + len(head) // BYTES_PER_FIELD)
        data, place = sized(content, place)
        return _fields(head), data, place

    def _take(self, header: Header, data: bytes) -> Messages:
        op, counts = header[b"op"][0], self.counts
        if op == RecordType.IDXDATA:
            self.indexed += [place for *_, place in struct.iter_unpack("<III", data)]
            return
        self._check_index()
        if op == RecordType.CHUNK:
            counts.chunks += 1
            yield from self._chunk(header, data)
        elif op == RecordType.CONNECTION:
            self._connect(header, data)
        elif op == RecordType.CHUNK_INFO:
            self.listed += 1
            self.counted += sum(count for _, count in struct.iter_unpack("<II", data))
            counts.counted = self.counted if self.listed == counts.counted_chunks else None
        elif op == RecordType.BAGHEADER:
            if header.get(b"encryptor"):
                raise self.budget.error("the bag is encrypted. Decrypt it first.")
            # The place of the index is written when the bag is closed.
            counts.closed = any(header[b"index_pos"])
            chunks = int.from_bytes(header[b"chunk_count"], "little")
            counts.counted_chunks = chunks if counts.closed else None
        else:
            raise self.budget.error("an unknown record; the bag is damaged.")

    def _connect(self, header: Header, data: bytes) -> None:
        about = {name: value.decode("utf-8", "replace") for name, value in _fields(data).items()}
        self.channels[header[b"conn"]] = Channel(
            topic=printable(header[b"topic"].decode("utf-8", "replace")),
            type=type_name(about[b"type"]),
            encoding="ros1",
            definition=about[b"message_definition"],
        )

    def _chunk(self, header: Header, data: bytes) -> Messages:
        name, size = header[b"compression"].decode(), int.from_bytes(header[b"size"], "little")
        chunk, place = unpacked(self.budget, name, data, size), 0
        while place < len(chunk):
            start = place
            inner, content, place = self._record(chunk, start)
            if inner[b"op"] == MESSAGE:
                self.starts.append(start)
                seconds, rest = struct.unpack("<II", inner[b"time"])
                yield self.channels.get(inner[b"conn"]), seconds * 10**9 + rest, content
            elif inner[b"op"] == CONNECTION:
                self._connect(inner, content)
            else:
                raise self.budget.error("an unknown record; the bag is damaged.")
        self.counts.kept += len(self.starts)

    def _check_index(self) -> None:
        if self.indexed and sorted(self.indexed) != self.starts:
            raise self.budget.error("a chunk and its index count differently; it is damaged.")
        self.starts, self.indexed = [], []


DATA = {
    Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.CHUNK, Opcode.MESSAGE_INDEX,
    Opcode.ATTACHMENT, Opcode.METADATA,
}  # fmt: skip
DATA_END_BYTES = 13  #: Length of the record that ends the data, its head included.

ENCODINGS = {"cdr", "ros1", "json", "protobuf"}  #: How messages are serialised that may be read.


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else ""


class McapMessages:
    """Messages of an MCAP file, chunk by chunk, those outside chunks one by one."""

    def __init__(self, file: LogFile, budget: ReadBudget) -> None:
        self.content: Content = file.content.obj
        self.budget = budget
        self.counts = MessageCount()
        #: Number of a schema → its name, encoding and data.
        self.schemas: dict[int, tuple[bytes, bytes, bytes]] = {}
        self.channels: dict[int, Channel] = {}
        self.indexed = 0

    def __iter__(self) -> Messages:
        content, counts, end = self.content, self.counts, MAGIC_SIZE
        with suppress(CutError, struct.error):
            for op, body, place in self._records(content, MAGIC_SIZE):
                end = place
                if op in DATA and not counts.closed:
                    counts.data_end = end
                if op == Opcode.CHUNK:
                    counts.chunks += 1
                    yield from self._chunk(body)
                elif op == Opcode.FOOTER:
                    if (left := len(content) - end) != MAGIC_SIZE:
                        raise self.budget.error(
                            f"{left} bytes follow its end where {MAGIC_SIZE} should; it is damaged."
                        )
                    (summary,) = struct.unpack_from("<Q", body)
                    if summary:  # the messages should end before it
                        counts.missing = summary - DATA_END_BYTES - counts.data_end
                    end = len(content)
                    break
                else:
                    yield from self._take(op, body, end)
        if self.indexed > counts.chunks:
            counts.counted_chunks = self.indexed
        counts.report(self.budget, len(content) - end, "its statistics")

    def _records(self, content: Content, place: int) -> Iterator[tuple[int, bytes, int]]:
        while place < len(content):
            op = content[place]
            body, place = sized(content, place + 1, 8)
            self.budget.spend(1)
            yield op, body, place

    def _take(self, op: int, body: bytes, end: int) -> Messages:
        if op == Opcode.MESSAGE:
            self.counts.kept += 1
            number, _, time, _ = struct.unpack_from("<HIQQ", body)
            yield self.channels.get(number), time, body[22:]
        elif op == Opcode.SCHEMA:
            name, place = sized(body, 2)
            encoding, place = sized(body, place)
            number = int.from_bytes(body[:2], "little")
            self.schemas[number] = name, encoding, sized(body, place)[0]
        elif op == Opcode.CHANNEL:
            number, schema = struct.unpack_from("<HH", body)
            topic, place = sized(body, 4)
            serialised = _text(sized(body, place)[0])
            name, language, data = self.schemas.get(schema, (b"", b"", b""))
            text = _text(data) if language in {b"ros1msg", b"ros2msg", b"ros2idl"} else ""
            self.channels[number] = Channel(
                topic=printable(_text(topic)),
                type=type_name(_text(name)) if text else printable(_text(name)),
                encoding=serialised if serialised in ENCODINGS else "other",
                definition=text,
                idl=language == b"ros2idl",
            )
        elif op == Opcode.STATISTICS:
            self.counts.closed, self.counts.counted = True, struct.unpack_from("<Q", body)[0]
        elif op == Opcode.CHUNK_INDEX:
            self.indexed += 1
        elif op == Opcode.DATA_END:
            self.counts.closed, self.counts.data_end = True, end - DATA_END_BYTES

    def _chunk(self, body: bytes) -> Messages:
        *_, size, checksum = struct.unpack_from("<QQQI", body)
        compression, place = sized(body, 28)
        packed, _ = sized(body, place, 8)
        content, end = unpacked(self.budget, _text(compression), packed, size), 0
        # A checksum of zero means that the writer made none.
        if checksum and zlib.crc32(content) != checksum:
            raise self.budget.error("a chunk does not match its checksum; damaged.")
        with suppress(CutError, struct.error):
            for op, inner, place in self._records(content, 0):
                yield from self._take(op, inner, 0)  # a chunk inside a chunk is none
                end = place
        if end < len(content):
            raise self.budget.error("a record ends outside its chunk; damaged.")


ZSTD = b"\x28\xb5\x2f\xfd"
#: No message of a topic that is read comes near this; an image of 4000 × 4000 is smaller.
MESSAGE_LIMIT = 64 * 1024 * 1024
#: The tables of a bag → the columns that are read.
TABLES = {
    "topics": {"id", "name", "type", "serialization_format"},
    "messages": {"id", "topic_id", "timestamp", "data"},
    "message_definitions": {"topic_type", "encoding", "encoded_message_definition"},
}

STEPS = 10_000
#: What SQLite may do for a file: some ten steps a row and topic, and rows of a few bytes
#: or more.
#:
#: A tree of pages that hold one another has rows without end.
SPARE_STEPS, STEPS_PER_BYTE = 20_000_000, 200


def db3_messages(file: LogFile, budget: ReadBudget) -> Messages:
    """Messages of a db3 file, in the order of recording."""
    with closing(_opened(file)) as db:
        yield from _messages(db, len(file.content), budget)
    journal = file.path.with_name(f"{file.path.name}-wal")
    if file.wrapping is None and journal.is_file() and (size := journal.stat().st_size):
        budget.note(warning("journal-left", journal=printable(journal.name), bytes=size))


def _opened(file: LogFile) -> sqlite3.Connection:
    """The database, read-only; an unpacked one is held in memory."""
    if file.wrapping is None:
        # Immutable: SQLite must not look for a journal, nor write one beside a user's
        # bag.
        db = sqlite3.connect(f"{file.path.absolute().as_uri()}?mode=ro&immutable=1", uri=True)
    else:
        db = sqlite3.connect(":memory:")
        db.deserialize(bytes(file.content))
    db.text_factory = bytes
    size = len(file.content)
    db.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, min(MESSAGE_LIMIT, max(size, 1 << 16)))
    db.setlimit(sqlite3.SQLITE_LIMIT_ATTACHED, 0)
    db.execute("PRAGMA trusted_schema = OFF")
    steps = iter(range((SPARE_STEPS + STEPS_PER_BYTE * size) // STEPS))
    db.set_progress_handler(lambda: next(steps, None) is None, STEPS)
    return db


def _permission(action: int, name: str | None, *_: str | None) -> int:
    reads = action == sqlite3.SQLITE_READ and name in TABLES
    return sqlite3.SQLITE_OK if reads or action == sqlite3.SQLITE_SELECT else sqlite3.SQLITE_DENY


def _messages(db: sqlite3.Connection, size: int, budget: ReadBudget) -> Messages:
    tables = _checked_tables(db, budget)
    db.set_authorizer(_permission)
    # Topics and definitions are read beside the messages.
    left = 2 * size + 4096

    def rows(table: str, columns: str) -> Iterator[tuple[Any, ...]]:
        """Rows of a table; what is read in all cannot be more than the file holds."""
        nonlocal left
        for row in db.execute(f"SELECT {columns} FROM {table}"):
            left -= 4 + sum(len(value) for value in row if isinstance(value, bytes))
            if left < 0:
                raise budget.error("its rows hold more than the file does; damaged.")
            yield row

    definitions = {}
    if "message_definitions" in tables:
        columns = "topic_type, encoding, encoded_message_definition"
        definitions = {row[0]: row[1:] for row in rows("message_definitions", columns)}
    channels = {}
    for number, topic, kind, encoding in rows("topics", "id, name, type, serialization_format"):
        language, text = definitions.get(kind, (b"", b""))
        channels[number] = Channel(
            topic=printable(_text(topic)),
            type=type_name(_text(kind)),
            encoding="cdr" if encoding == b"cdr" else "other",
            definition=_text(text),
            idl=language == b"ros2idl",
        )
    for number, time, content in rows("messages ORDER BY id", "topic_id, timestamp, data"):
        if not isinstance(content, bytes) or not isinstance(time, int):
            raise budget.error(f"a message of topic {number!s:.20} is no bytes; damaged.")
        data = content
        if content.startswith(ZSTD):  # on its own
            import zstandard

            length = zstandard.frame_content_size(content)
            budget.claim(length if length >= 0 else MESSAGE_LIMIT)
            unpacker = zstandard.ZstdDecompressor(max_window_size=1 << 27)
            data = unpacker.decompress(content, max_output_size=MESSAGE_LIMIT)
        yield channels.get(number), time, data


def _checked_tables(db: sqlite3.Connection, budget: ReadBudget) -> set[str]:
    # A view and a virtual table have no root page.
    query = "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ? AND rootpage > 0"
    found = {name for name in TABLES if db.execute(query, (name,)).fetchone() is not None}
    if not found >= {"topics", "messages"}:
        raise budget.error(
            f"an SQLite database without plain tables of a ROS 2 bag (topics, "
            f"messages; it has {', '.join(sorted(found)) or 'none of them'})."
        )
    for name in sorted(found):
        # The last of a column's traits says whether it is hidden or computed.
        traits = db.execute(f"PRAGMA table_xinfo({name})").fetchall()
        if missing := sorted(TABLES[name] - {_text(row[1]) for row in traits if row[6] == 0}):
            raise budget.error(
                f"the table {name} has no stored column {missing[0]}: it is "
                "computed or not there. No recorder writes such a bag; it was edited."
            )
    return found
