"""ROS 2 bags in SQLite: with or without message definitions, compressed by message or not."""

import sqlite3
from collections.abc import Iterator
from contextlib import closing

import numpy as np

from vftcli.readers.bags.container import Batch, Channel, Ingest, printable, type_name
from vftcli.readers.reader import LogFile
from vftcli.signals.errors import LogError

ROWS = 4096
ZSTD = b"\x28\xb5\x2f\xfd"
MESSAGE_LIMIT = 64 * 1024 * 1024


def batches(file: LogFile, ingest: Ingest) -> Iterator[Batch]:
    """Messages of a db3 file, some thousands at a time, topic by topic.

    Raises:
        LogError: If the database is damaged or holds no bag.
    """
    try:
        with closing(_opened(file)) as db:
            db.text_factory = lambda raw: raw.decode("utf-8", "replace")
            channels = _channels(db, ingest)
            _check_topics(db, channels, ingest)
            for number, channel in channels.items():
                yield from _messages(db, number, channel, ingest)
    except (sqlite3.Error, OverflowError, UnicodeDecodeError) as error:
        reason = printable(str(error))[:80]
        raise LogError(f"{ingest.path}: not a readable ROS 2 bag ({reason})") from None


def _opened(file: LogFile) -> sqlite3.Connection:
    """The database, read-only; an unpacked one is held in memory."""
    if file.wrapping is None:
        # Immutable: SQLite must not look for a journal, nor write one beside a user's bag.
        uri = f"{file.path.absolute().as_uri()}?mode=ro&immutable=1"
        return sqlite3.connect(uri, uri=True)
    db = sqlite3.connect(":memory:")
    db.deserialize(bytes(file.content))
    return db


def _channels(db: sqlite3.Connection, ingest: Ingest) -> dict[int, Channel]:
    """The topics by their number, with the definitions that the bag has."""
    tables = {row[0] for row in db.execute("SELECT name FROM sqlite_master WHERE type='table'")}
    if not {"topics", "messages"} <= tables:
        raise LogError(
            f"{ingest.path}: an SQLite database with the tables {', '.join(sorted(tables)[:8])}, "
            "not a ROS 2 bag (topics, messages)."
        )
    texts: dict[str, tuple[str, bool]] = {}
    if "message_definitions" in tables:
        rows = db.execute(
            "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
        )
        texts = {str(kind): (str(text), encoding == "ros2idl") for kind, encoding, text in rows}
    channels = {}
    for number, topic, kind, encoding in db.execute(
        "SELECT id, name, type, serialization_format FROM topics"
    ):
        if not isinstance(number, int):
            raise LogError(f"{ingest.path}: a topic without a number; the database is damaged.")
        text, idl = texts.get(str(kind), ("", False))
        channels[number] = Channel(
            topic=printable(str(topic)),
            type=type_name(str(kind)),
            encoding="cdr" if encoding == "cdr" else "other",
            definition=text,
            idl=idl,
        )
    return channels


def _check_topics(db: sqlite3.Connection, channels: dict[int, Channel], ingest: Ingest) -> None:
    """Raise a LogError if messages belong to no topic: they would be lost without a word."""
    strays = {row[0] for row in db.execute("SELECT DISTINCT topic_id FROM messages")} - set(
        channels
    )
    if strays:
        raise LogError(f"{ingest.path}: messages of an unknown topic; the database is damaged.")


def _messages(
    db: sqlite3.Connection, number: int, channel: Channel, ingest: Ingest
) -> Iterator[Batch]:
    """The messages of one topic, some thousands at a time."""
    query = "SELECT timestamp, data FROM messages WHERE topic_id = ? ORDER BY id"
    cursor = db.execute(query, (number,))
    while rows := cursor.fetchmany(ROWS):
        times = [row[0] for row in rows]
        messages = [bytes(row[1]) for row in rows if isinstance(row[1], bytes)]
        if len(messages) != len(rows) or not all(isinstance(time, int) for time in times):
            raise LogError(f"{ingest.path}: a message of {channel.topic} is no bytes; damaged.")
        if messages[0].startswith(ZSTD):
            messages = [_unzstd(message, ingest) for message in messages]
        lengths = np.array([len(message) for message in messages], dtype=np.int64)
        yield Batch(
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
