"""ROS 2 bags in SQLite: with or without message definitions, compressed by message or not.

A database is code as much as data: a column may be computed by functions of SQLite from nothing.
So only stored columns of plain tables are read, no function runs, and what is read is bounded by
the size of the file.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from typing import Any

from vftcli.readers.bags.container import (
    Batch,
    Channel,
    ChannelRun,
    Ingest,
    batched,
    printable,
    type_name,
)
from vftcli.readers.reader import LogFile
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import warning

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
#: What SQLite may do for a file: some ten steps a row and topic, and rows of a few bytes or more.
#:
#: A tree of pages that hold one another has rows without end.
SPARE_STEPS, STEPS_PER_BYTE = 20_000_000, 200


def batches(file: LogFile, ingest: Ingest) -> Iterator[Batch]:
    """Messages of a db3 file, in the order of recording."""
    with closing(_opened(file)) as db:
        yield from batched(_runs(db, len(file.content), ingest), ingest)
    journal = file.path.with_name(f"{file.path.name}-wal")
    if file.wrapping is None and journal.is_file() and (size := journal.stat().st_size):
        ingest.note(warning("journal-left", journal=printable(journal.name), bytes=size))


def _opened(file: LogFile) -> sqlite3.Connection:
    """The database, read-only; an unpacked one is held in memory."""
    if file.wrapping is None:
        # Immutable: SQLite must not look for a journal, nor write one beside a user's bag.
        uri = f"{file.path.absolute().as_uri()}?mode=ro&immutable=1"
        db = sqlite3.connect(uri, uri=True)
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
    """What a query of ours may do: select, and read columns; no function, no other table."""
    reads = action == sqlite3.SQLITE_READ and name in TABLES
    return sqlite3.SQLITE_OK if reads or action == sqlite3.SQLITE_SELECT else sqlite3.SQLITE_DENY


def _runs(db: sqlite3.Connection, size: int, ingest: Ingest) -> Iterator[ChannelRun]:
    """The messages of a database of a size, one by one."""
    tables = _checked_tables(db, ingest)
    db.set_authorizer(_permission)
    # Topics and definitions are read beside the messages.
    left = 2 * size + 4096

    def rows(table: str, columns: str) -> Iterator[tuple[Any, ...]]:
        """Rows of a table; what is read in all cannot be more than the file holds."""
        nonlocal left
        for row in db.execute(f"SELECT {columns} FROM {table}"):
            left -= 4 + sum(len(value) for value in row if isinstance(value, bytes))
            if left < 0:
                raise LogError(f"{ingest.path}: its rows hold more than the file does; damaged.")
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
            raise LogError(
                f"{ingest.path}: a message of topic {number!s:.20} is no bytes; damaged."
            )
        is_packed = content.startswith(ZSTD)
        yield ChannelRun(
            channels.get(number), [time], [_unzstd(content, ingest) if is_packed else content]
        )


def _checked_tables(db: sqlite3.Connection, ingest: Ingest) -> set[str]:
    """The tables of a bag that a database has."""
    # A view and a virtual table have no root page.
    query = "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ? AND rootpage > 0"
    found = {name for name in TABLES if db.execute(query, (name,)).fetchone() is not None}
    if not found >= {"topics", "messages"}:
        raise LogError(
            f"{ingest.path}: an SQLite database without plain tables of a ROS 2 bag (topics, "
            f"messages; it has {', '.join(sorted(found)) or 'none of them'})."
        )
    for name in sorted(found):
        # The last of a column's traits says whether it is hidden or computed.
        traits = db.execute(f"PRAGMA table_xinfo({name})").fetchall()
        if missing := sorted(TABLES[name] - {_text(row[1]) for row in traits if row[6] == 0}):
            raise LogError(
                f"{ingest.path}: the table {name} has no stored column {missing[0]}: it is "
                "computed or not there. No recorder writes such a bag; it was edited."
            )
    return found


def _text(value: Any) -> str:  # noqa: ANN401 - whatever a cell holds
    """A cell's text, nothing for a cell that holds none."""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else ""


def _unzstd(message: bytes, ingest: Ingest) -> bytes:
    """One message that was compressed on its own, within bounds."""
    import zstandard

    size = zstandard.frame_content_size(message)
    ingest.claim(size if size >= 0 else MESSAGE_LIMIT)
    unpacker = zstandard.ZstdDecompressor(max_window_size=1 << 27)
    return unpacker.decompress(message, max_output_size=MESSAGE_LIMIT)
