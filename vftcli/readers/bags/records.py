"""Records of ROS 1 bags, of MCAP files and of ROS 2's SQLite databases.

ROS 1 bags (http://wiki.ros.org/Bags/Format/2.0) and MCAP files (https://mcap.dev/spec)
are read from the start, a cut one up to its last chunk; rosbags and mcap need the index
at the end.

A database can compute a column from nothing. So only stored columns of plain tables are
read, no function runs, and the file's size bounds the reading.
"""

import sqlite3
import struct
import zlib
from collections import defaultdict
from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import replace
from io import BytesIO
from typing import Any

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel as McapChannel
from mcap.records import Chunk, Schema
from mcap.stream_reader import MAGIC_SIZE

from vftcli.readers.bags.container import (
    Batch,
    Channel,
    Content,
    CutError,
    MessageCount,
    Messages,
    ReadBudget,
    batched,
    of_chunk,
    printable,
    sized,
    type_name,
    unpacked,
)
from vftcli.readers.opening import LogFile
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Where, warning

BAG_MAGIC = 13  #: Bytes before the first record of a ROS 1 bag.
#: Numbers of the kinds of records in a ROS 1 bag.
MESSAGE, BAG_HEADER, INDEX, CHUNK, CHUNK_INFO, CONNECTION = range(2, 8)
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


def _bag_records(
    content: Content, budget: ReadBudget, counts: MessageCount | None = None
) -> Iterator[tuple[int, Header, bytes, int]]:
    """Kind, header, data and place of each record; in a chunk without counts."""
    place = counts.end if counts else 0
    while place < len(content):
        start = place
        head, place = sized(content, place)
        budget.spend(1 + len(head) // BYTES_PER_FIELD)
        data, place = sized(content, place)
        header = _fields(head)
        kind = header[b"op"][0]
        if counts:
            counts.end = place
        yield kind, header, data, start
        if counts and kind == CHUNK:
            size = int.from_bytes(header[b"size"], "little")
            chunk = unpacked(budget, header[b"compression"].decode(), data, size)
            yield from of_chunk(_bag_records(chunk, budget), budget)


def _check_index(starts: list[int], indexed: list[int], budget: ReadBudget) -> None:
    if indexed and sorted(indexed) != starts:
        raise budget.error("a chunk and its index count differently; it is damaged.")


def bag_messages(file: LogFile, budget: ReadBudget) -> Messages:
    """Messages of a ROS 1 bag, chunk by chunk."""
    counts = MessageCount(end=BAG_MAGIC)
    channels: dict[bytes, Channel] = {}
    starts, indexed = list[int](), list[int]()  # of messages, by a chunk and by its index
    # Chunks found, by the header, and in the index at the end; messages in that index.
    chunks = said = listed = counted = 0
    with suppress(CutError):
        for kind, header, data, start in _bag_records(file.content.obj, budget, counts):
            if kind == MESSAGE:
                starts.append(start)
                counts.kept += 1
                seconds, rest = struct.unpack("<II", header[b"time"])
                yield channels.get(header[b"conn"]), seconds * 10**9 + rest, data
            elif kind == CONNECTION:
                fields = _fields(data)
                given = (header[b"topic"], fields[b"type"], fields[b"message_definition"])
                topic, ros_type, definition = (text.decode("utf-8", "replace") for text in given)
                channels[header[b"conn"]] = Channel(
                    printable(topic), type_name(ros_type), "ros1", definition
                )
            elif kind == INDEX:
                indexed += [place for *_, place in struct.iter_unpack("<III", data)]
            elif kind == CHUNK:
                _check_index(starts, indexed, budget)
                starts, indexed = [], []
                chunks += 1
            elif kind == CHUNK_INFO:
                _check_index(starts, indexed, budget)
                listed += 1
                counted += sum(count for _, count in struct.iter_unpack("<II", data))
                counts.counted = counted if listed == said else None
            elif kind == BAG_HEADER:
                if header.get(b"encryptor"):
                    raise budget.error("the bag is encrypted. Decrypt it first.")
                # The place of the index is written when the bag is closed.
                closed = any(header[b"index_pos"])
                said = int.from_bytes(header[b"chunk_count"], "little") if closed else -1
            else:
                raise budget.error("an unknown record; the bag is damaged.")
    cut = chunks != said or len(file.content) > counts.end
    counts.report(budget, "its index", cut=cut)


#: How messages are serialised that may be read.
ENCODINGS = {"cdr", "ros1", "json", "protobuf"}


def _mcap_records(
    content: Content, budget: ReadBudget, counts: MessageCount | None = None
) -> Iterator[tuple[int, bytes]]:
    """Kind and content of each record; in a chunk without counts."""
    place = counts.end if counts else 0
    while place < len(content):
        kind = content[place]
        body, place = sized(content, place + 1, 8)
        budget.spend(1)
        if counts:
            counts.end = place
        yield kind, body
        if counts and kind == Opcode.CHUNK:
            chunk = Chunk.read(ReadDataStream(BytesIO(body)))
            own = unpacked(budget, chunk.compression, chunk.data, chunk.uncompressed_size)
            # A checksum of zero means that the writer made none.
            if chunk.uncompressed_crc not in {0, zlib.crc32(own)}:
                raise budget.error("a chunk does not match its checksum; damaged.")
            yield from of_chunk(_mcap_records(own, budget), budget)


def mcap_messages(file: LogFile, budget: ReadBudget) -> Messages:
    """Messages of an MCAP file, chunk by chunk, those outside chunks one by one."""
    counts, size, message = MessageCount(end=MAGIC_SIZE), len(file.content), int(Opcode.MESSAGE)
    data_end, cut = 0, True
    schemas = defaultdict(lambda: Schema(0, b"", "", ""))
    channels: dict[int, Channel] = {}
    with suppress(CutError):
        for kind, body in _mcap_records(file.content.obj, budget, counts):
            if kind == message:
                counts.kept += 1
                number, _, time, _ = struct.unpack_from("<HIqq", body)
                yield channels.get(number), time, body[22:]
            elif kind == Opcode.SCHEMA:
                schema = Schema.read(ReadDataStream(BytesIO(body)))
                schemas[schema.id] = schema
            elif kind == Opcode.CHANNEL:
                given = McapChannel.read(ReadDataStream(BytesIO(body)))
                schema, encoding = schemas[given.schema_id], given.message_encoding
                known = schema.encoding in {"ros1msg", "ros2msg", "ros2idl"}
                channels[given.id] = Channel(
                    topic=printable(given.topic),
                    type=(type_name if known else printable)(schema.name),
                    encoding=encoding if encoding in ENCODINGS else "other",
                    definition=schema.data.decode("utf-8", "replace") if known else "",
                    idl=schema.encoding == "ros2idl",
                )
            elif kind == Opcode.STATISTICS:
                counts.counted = struct.unpack_from("<Q", body)[0]
            elif kind == Opcode.DATA_END:
                data_end = counts.end
            elif kind == Opcode.FOOTER:
                if (left := size - counts.end) != MAGIC_SIZE:
                    raise budget.error(f"{left} bytes follow its end, not {MAGIC_SIZE}; damaged.")
                # The summary, if there is one, lies behind the end of the messages.
                cut = counts.counted is None and struct.unpack_from("<Q", body)[0] > data_end
                break
    counts.report(budget, "its statistics", cut=cut)


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
#: Most steps of SQLite for a file, some ten a row: looping pages have rows without end.
SPARE_STEPS, STEPS_PER_BYTE = 20_000_000, 200


def _text(value: object) -> str:
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else ""


def _opened(file: LogFile) -> sqlite3.Connection:
    """The database, read-only; an unpacked one is held in memory."""
    if file.wrapping is None:
        # Immutable: SQLite neither looks for a journal nor writes one.
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


def db3_messages(file: LogFile, budget: ReadBudget) -> Messages:
    """Messages of a db3 file, in the order of recording."""
    # Topics and definitions are read beside the messages.
    left = 2 * len(file.content) + 4096

    def rows(table: str, columns: str) -> Iterator[tuple[Any, ...]]:
        """Rows of a table; what is read in all cannot be more than the file holds."""
        nonlocal left
        for row in db.execute(f"SELECT {columns} FROM {table}"):
            left -= 4 + sum(len(value) for value in row if isinstance(value, bytes))
            if left < 0:
                raise budget.error("its rows hold more than the file does; damaged.")
            yield row

    with closing(_opened(file)) as db:
        tables = _checked_tables(db, budget)
        db.set_authorizer(_permission)
        columns = "topic_type, encoding, encoded_message_definition"
        of_types = rows("message_definitions", columns) if len(tables) > 2 else ()
        definitions = {kind: more for kind, *more in of_types}
        channels = {}
        for number, topic, kind, encoding in rows(
            "topics", "id, name, type, serialization_format"
        ):
            language, text = definitions.get(kind, (b"", b""))
            channels[number] = Channel(
                topic=printable(_text(topic)),
                type=type_name(_text(kind)),
                encoding="cdr" if encoding == b"cdr" else "other",
                definition=_text(text),
                idl=language == b"ros2idl",
            )
        for number, time, data in rows("messages ORDER BY id", "topic_id, timestamp, data"):
            if not isinstance(data, bytes) or not isinstance(time, int):
                raise budget.error(f"a message of topic {number!s:.20} is no bytes; damaged.")
            packing = "zstd" if data.startswith(ZSTD) else ""  # on its own
            size = zstandard.frame_content_size(data) if packing else 0
            yield channels.get(number), time, unpacked(budget, packing, data, size)
    journal = file.path.with_name(f"{file.path.name}-wal")
    if file.wrapping is None and journal.is_file() and (size := journal.stat().st_size):
        budget.note(warning("journal-left", journal=printable(journal.name), bytes=size))


def _checked_tables(db: sqlite3.Connection, budget: ReadBudget) -> set[str]:
    # A view and a virtual table have no root page.
    query = "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ? AND rootpage > 0"
    found = {name for name in TABLES if db.execute(query, (name,)).fetchone() is not None}
    if not found >= {"topics", "messages"}:
        raise budget.error("an SQLite database without plain tables of a ROS 2 bag.")
    for name in sorted(found):
        # The last of a column's traits says whether it is hidden or computed.
        traits = db.execute(f"PRAGMA table_xinfo({name})").fetchall()
        if missing := sorted(TABLES[name] - {_text(row[1]) for row in traits if row[6] == 0}):
            raise budget.error(
                f"the table {name} has no stored column {missing[0]}; no recorder writes that."
            )
    return found


#: How a file of a container begins → what reads it.
CONTAINERS = {
    b"#ROSBAG V2.0\n": bag_messages,
    b"\x89MCAP0\r\n": mcap_messages,
    b"SQLite format 3\0": db3_messages,
}


def batches(files: Sequence[LogFile], budget: ReadBudget) -> Iterator[Batch]:
    """The batches of the files' messages in turn; a library's error becomes one line."""
    for file in files:
        messages_of = next(
            (x for magic, x in CONTAINERS.items() if file.head.startswith(magic)), None
        )
        if messages_of is None:
            raise LogError(f"{file.path}: neither a ROS bag nor an MCAP file.")
        try:
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
