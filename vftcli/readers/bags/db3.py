"""ROS 2 bags in SQLite: with or without message definitions, compressed by message or not.

A database is code as much as data: a column may be computed by functions of SQLite from nothing.
So only stored columns of plain tables are read, no function runs, and what is read is bounded by
the size of the file.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import closing
from typing import Any

import numpy as np

from vftcli.readers.bags.container import Batch, Channel, Ingest, printable, type_name
from vftcli.readers.reader import LogFile
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import warning

ROWS = 4096
BATCH_BYTES = 16 * 1024 * 1024
ZSTD = b"\x28\xb5\x2f\xfd"
MESSAGE_LIMIT = 64 * 1024 * 1024
"""No message of a topic that is read comes near this; an image of 4000 × 4000 is smaller."""

TOPICS = {"id", "name", "type", "serialization_format"}
MESSAGES = {"id", "topic_id", "timestamp", "data"}
DEFINITIONS = {"topic_type", "encoding", "encoded_message_definition"}
TABLES = {"topics": TOPICS, "messages": MESSAGES, "message_definitions": DEFINITIONS}
"""The tables of a bag → the columns that are read."""

STEPS = 10_000
SPARE_STEPS, STEPS_PER_BYTE = 20_000_000, 200
"""What SQLite may do for a file: some ten steps a row and topic, and rows of a few bytes or more.

A tree of pages that hold one another has rows without end.
"""


def batches(file: LogFile, ingest: Ingest) -> Iterator[Batch]:
    """Messages of a db3 file, some thousands at a time, topic by topic.

    Raises:
        LogError: If the database is damaged, holds no bag, or one whose columns are computed.
    """
    try:
        with closing(_opened(file)) as db:
            bag = _Bag(db, len(file.content), ingest)
            bag.check_tables()
            channels = bag.channels()
            bag.check_topics(channels)
            for number, channel in channels.items():
                yield from bag.messages(number, channel)
    except MemoryError:
        raise LogError(
            f"{ingest.path}: a row claims more memory than the file holds; it is damaged."
        ) from None
    except (sqlite3.Error, OverflowError, UnicodeDecodeError) as error:
        reason = printable(str(error))[:80]
        raise LogError(f"{ingest.path}: not a readable ROS 2 bag ({reason})") from None
    _tell_journal(file, ingest)


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


def _tell_journal(file: LogFile, ingest: Ingest) -> None:
    """Say so if messages lie in a journal beside the database, which is not read."""
    journal = file.path.with_name(f"{file.path.name}-wal")
    if file.wrapping is None and journal.is_file() and (size := journal.stat().st_size):
        ingest.note(warning("journal-left", journal=printable(journal.name), bytes=size))


class _Bag:
    """A database whose tables are those of a bag.

    Attributes:
        size: Size of the database. [B]
        tables: Its plain tables with the columns that are stored.
    """

    def __init__(self, db: sqlite3.Connection, size: int, ingest: Ingest) -> None:
        self.db = db
        self.size = size
        self.ingest = ingest
        self.tables = self._plain_tables()
        self._read = 0
        db.set_authorizer(_permission)

    def _plain_tables(self) -> dict[str, set[str]]:
        """The plain tables of a bag that are there, each with its stored columns."""
        found = {}
        for name in TABLES:
            # A view and a virtual table have no root page.
            query = "SELECT 1 FROM sqlite_master WHERE type = 'table' AND name = ? AND rootpage > 0"
            if self.db.execute(query, (name,)).fetchone() is None:
                continue
            rows = self.db.execute(f"PRAGMA table_xinfo({name})")
            # The last of a column's traits says whether it is hidden or computed.
            found[name] = {str(row[1], "utf-8", "replace") for row in rows if row[6] == 0}
        return found

    def check_tables(self) -> None:
        """Check that the tables are those of a bag.

        Raises:
            LogError: If one is missing, is no plain table, or lacks a stored column.
        """
        for name in ("topics", "messages"):
            if name not in self.tables:
                there = ", ".join(sorted(self.tables)) or "none of them"
                raise LogError(
                    f"{self.ingest.path}: an SQLite database without plain tables of a ROS 2 bag "
                    f"(topics, messages; it has {there})."
                )
        for name, columns in self.tables.items():
            if missing := sorted(TABLES[name] - columns):
                raise LogError(
                    f"{self.ingest.path}: the table {name} has no stored column {missing[0]}: it "
                    "is computed or not there. No recorder writes such a bag; it was edited."
                )

    def rows(self, query: str, *values: int) -> Iterator[tuple[Any, ...]]:
        """The rows of a query; what is read of a file in all cannot be more than it holds.

        Raises:
            LogError: If it is: rows that share their pages.
        """
        limit = 2 * self.size + 4096  # topics and definitions are read beside the messages
        for row in self.db.execute(query, values):
            self._read += 4 + sum(len(value) for value in row if isinstance(value, bytes))
            if self._read > limit:
                raise LogError(
                    f"{self.ingest.path}: its rows hold more than the file does; it is damaged."
                )
            yield row

    def channels(self) -> dict[int, Channel]:
        """The topics by their number, with the definitions that the bag has."""
        texts: dict[str, tuple[str, bool]] = {}
        if "message_definitions" in self.tables:
            query = (
                "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            )
            for kind, encoding, text in self.rows(query):
                texts[_text(kind)] = _text(text), _text(encoding) == "ros2idl"
        channels = {}
        for number, topic, kind, encoding in self.rows(
            "SELECT id, name, type, serialization_format FROM topics"
        ):
            if not isinstance(number, int):
                raise LogError(
                    f"{self.ingest.path}: a topic without a number; the database is damaged."
                )
            text, idl = texts.get(_text(kind), ("", False))
            channels[number] = Channel(
                topic=printable(_text(topic)),
                type=type_name(_text(kind)),
                encoding="cdr" if _text(encoding) == "cdr" else "other",
                definition=text,
                idl=idl,
            )
        return channels

    def check_topics(self, channels: dict[int, Channel]) -> None:
        """Raise a LogError if messages belong to no topic: they would be lost without a word."""
        there = {row[0] for row in self.rows("SELECT DISTINCT topic_id FROM messages")}
        if there - set(channels):
            raise LogError(
                f"{self.ingest.path}: messages of an unknown topic; the database is damaged."
            )

    def messages(self, number: int, channel: Channel) -> Iterator[Batch]:
        """The messages of one topic, some thousands or megabytes at a time."""
        query = "SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY id"
        times: list[int] = []
        messages: list[bytes] = []
        held = 0
        for time, data in self.rows(query, number):
            if not isinstance(data, bytes) or not isinstance(time, int):
                raise LogError(
                    f"{self.ingest.path}: a message of {channel.topic} is no bytes; damaged."
                )
            times.append(time)
            messages.append(_unzstd(data, self.ingest) if data.startswith(ZSTD) else data)
            held += len(messages[-1])
            if len(times) == ROWS or held > BATCH_BYTES:
                yield _batch(channel, times, messages)
                times, messages, held = [], [], 0
        if times:
            yield _batch(channel, times, messages)


def _text(value: Any) -> str:  # noqa: ANN401 - whatever a cell holds
    """A cell's text, nothing for a cell that holds none."""
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else ""


def _batch(channel: Channel, times: list[int], messages: list[bytes]) -> Batch:
    """Messages of one channel, one behind the other in a buffer."""
    lengths = np.array([len(message) for message in messages], dtype=np.int64)
    return Batch(
        channel=channel,
        buffer=np.frombuffer(b"".join(messages), dtype=np.uint8),
        offsets=np.concatenate([[0], np.cumsum(lengths)[:-1]]),
        lengths=lengths,
        times=np.array(times, dtype=np.int64),
    )


def _unzstd(message: bytes, ingest: Ingest) -> bytes:
    """One message that was compressed on its own, within bounds."""
    import zstandard

    try:
        size = zstandard.frame_content_size(message)
        ingest.claim(size if size >= 0 else MESSAGE_LIMIT)
        unpacker = zstandard.ZstdDecompressor(max_window_size=1 << 27)
        return unpacker.decompress(message, max_output_size=MESSAGE_LIMIT)
    except zstandard.ZstdError as error:
        raise LogError(f"{ingest.path}: a compressed message is damaged ({error!s:.60})") from None
