"""Mutations of logs that hold messages: MCAP, ROS 1 bags, ROS 2 databases and folders."""

import io
import json
import shutil
import sqlite3
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from bytes_mutants import cut, flip, huge_count, mutate_bytes, token
from text_mutants import odd_value
from tokens import NUMBERS, WORDS, Mutant, Rng, Seed, pick, some

TIMES = (0, 1, -1, 2**31, 2**63 - 1, 2**64 - 1, 10**9)


class Message(NamedTuple):
    """One message of an MCAP, with all that says what it is."""

    topic: str
    encoding: str
    schema: tuple[str, str, bytes]
    time: int
    data: bytes


def mcap_messages(path: Path) -> list[Message]:
    """The messages of an MCAP, at most as many as a seed may have."""
    from mcap.reader import make_reader

    found = []
    with path.open("rb") as file:
        for schema, channel, message in make_reader(file).iter_messages():
            about = (schema.name, schema.encoding, schema.data) if schema else ("", "", b"")
            how = channel.topic, channel.message_encoding, about
            found.append(Message(*how, message.log_time, message.data))
    return found


def write_mcap(path: Path, messages: list[Message], rng: Rng | None = None) -> None:
    """An MCAP of messages, written in one of the ways that writers have."""
    from mcap.writer import CompressionType, Writer

    with path.open("wb") as file:
        chosen: dict[str, Any] = {"chunk_size": 16 * 1024}
        if rng is not None:
            chosen = {
                "chunk_size": pick(rng, (256, 4096, 10**6)),
                "use_chunking": rng.random() < 0.8,
                "compression": pick(rng, tuple(CompressionType)),
                "use_statistics": rng.random() < 0.7,
                "use_summary_offsets": rng.random() < 0.7,
            }
        writer = Writer(file, **chosen)
        profile = "ros2" if rng is None else pick(rng, ("ros2", "ros1", "", "x"))
        writer.start(profile=profile, library="test")
        channels: dict[tuple[str, str, Any], int] = {}
        for k, message in enumerate(messages):
            key = (message.topic, message.encoding, message.schema)
            if key not in channels:
                name, encoding, data = message.schema
                number = writer.register_schema(name, encoding, data) if name else 0
                channels[key] = writer.register_channel(message.topic, message.encoding, number)
            time = message.time % 2**64
            writer.add_message(channels[key], time, message.data, time, k)
        writer.finish()


def mcap_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """An MCAP with its bytes, a record or a message changed."""
    data = seed.path.read_bytes()
    kind = rng.random()
    if kind < 0.15:
        data, how = mutate_bytes(data, rng)
        path.write_bytes(data)
        return Mutant(how)
    if kind < 0.2:
        path.write_bytes(cut(data, rng))
        return Mutant("cut", seed.samples)
    if kind < 0.45:
        records = list(mcap_records(data))
        how = records_changed(records, rng)
        body = b"".join(struct.pack("<BQ", op, len(content)) + content for op, content in records)
        path.write_bytes(data[:8] + body + data[-8:])
        return Mutant(how)
    messages = list(seed.model)
    how = messages_changed(messages, rng)
    try:
        write_mcap(path, messages, rng)
    except (ValueError, struct.error, OverflowError, TypeError):
        path.write_bytes(flip(data, rng))
        return Mutant("flip")
    return Mutant(how)


def mcap_records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """The records of an MCAP, as they lie in the file."""
    place = 8
    while place + 9 <= len(data) - 8:
        op, size = struct.unpack_from("<BQ", data, place)
        yield op, data[place + 9 : place + 9 + size]
        place += 9 + size


def records_changed(records: list[tuple[int, bytes]], rng: Rng) -> str:
    """Change one record: drop it, repeat it, move it, or change its content."""
    k = int(rng.integers(len(records)))
    op, content = records[k]
    kind = int(rng.integers(7))
    if kind == 0:
        del records[k]
    elif kind == 1:
        records.insert(int(rng.integers(len(records))), records[k])
    elif kind == 2:
        records[k] = (int(rng.integers(1, 20)), content)
    elif content:
        change = pick(rng, (flip, flip, huge_count, token, cut))
        records[k] = (op, change(content, rng))
    return f"record {op} {kind}"


def messages_changed(messages: list[Message], rng: Rng) -> str:
    """Change messages: lose some, move them, or change what some or a topic's all have."""
    chosen = some(rng, len(messages))
    kind = int(rng.integers(9))
    if kind == 0:
        messages[:] = [message for k, message in enumerate(messages) if k not in chosen]
        return "messages lost"
    if kind == 1:
        messages[:] = messages[: int(rng.integers(0, 4))]
        return "few messages"
    if kind == 2:
        messages[:] = [messages[k] for k in rng.permutation(len(messages))]
        return "messages moved"
    change = pick(rng, (flip, flip, flip, huge_count, cut, token))
    if kind <= 4:
        put = pick(rng, TIMES)
        for k in chosen:
            data = data_changed(messages[k], change, rng)
            messages[k] = messages[k]._replace(**{"data": data} if kind == 3 else {"time": put})
        return f"data {change.__name__}" if kind == 3 else "times"
    first = messages[chosen[0]]
    about = described_otherwise(first, kind, change, rng)
    for k, message in enumerate(messages):
        if message.topic == first.topic:
            messages[k] = message._replace(**about)
    return f"topic {kind}"


def described_otherwise(message: Message, kind: int, change: Any, rng: Rng) -> dict[str, Any]:
    """Another topic's name, or another name, encoding or definition of its type."""
    name, encoding, definition = message.schema
    word = pick(rng, WORDS)[:200]
    if kind == 5:
        return {"topic": word}
    if kind == 6:
        return {"schema": (word, encoding, definition)}
    if kind == 7:
        return {"schema": (name, pick(rng, ("ros1msg", "x", "")), definition)}
    return {"schema": (name, encoding, change(definition, rng) if definition else b"x")}


def data_changed(message: Message, change: Any, rng: Rng) -> bytes:
    """A message's data changed: its bytes, or one value of a JSON document."""
    if message.encoding == "json" and rng.random() < 0.8:
        document = json.loads(message.data)
        key = pick(rng, list(document))
        document[key] = odd_value(rng)
        return json.dumps(document).encode("utf-8", "replace")
    if rng.random() < 0.3 and len(message.data) > 16:
        place = 4 + 8 * int(rng.integers((len(message.data) - 8) // 8))
        value = struct.pack("<d", float(min(pick(rng, NUMBERS), 1.7e308)))
        return message.data[:place] + value + message.data[place + 8 :]
    return change(message.data, rng) if message.data else b"\0"


def bag_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A ROS 1 bag with its bytes, or a field of one of its records, changed."""
    data = seed.path.read_bytes()
    kind = rng.random()
    if kind < 0.25:
        data, how = mutate_bytes(data, rng)
        path.write_bytes(data)
        return Mutant(how)
    if kind < 0.35:
        path.write_bytes(cut(data, rng))
        return Mutant("cut", seed.samples)
    line = data.index(b"\n") + 1
    records = list(bag_records(data[line:]))
    k = int(rng.integers(len(records)))
    if rng.random() < 0.5:  # among the records of a chunk there are most
        chunks = [i for i, (fields, _) in enumerate(records) if fields.get(b"op") == b"\x05"]
        k = int(pick(rng, chunks)) if chunks else k
    fields, content = records[k]
    inner = fields.get(b"op") == b"\x05" and fields.get(b"compression") == b"none"
    if inner and content:
        nested = list(bag_records(content))
        how = bag_record_changed(nested, int(rng.integers(len(nested))), rng)
        content = b"".join(bag_bytes(*record) for record in nested)
        records[k] = ({**fields, b"size": struct.pack("<I", len(content))}, content)
    else:
        how = bag_record_changed(records, k, rng)
    path.write_bytes(data[:line] + b"".join(bag_bytes(*record) for record in records))
    return Mutant(f"bag {how}")


BagRecord = tuple[dict[bytes, bytes], bytes]


def bag_records(data: bytes) -> Iterator[BagRecord]:
    """The records of a bag or of a chunk: their header fields and their data."""
    pieces = sized(data)
    for head, body in zip(pieces, pieces, strict=False):
        named = (field.partition(b"=") for field in sized(head))
        yield {name: value for name, _, value in named}, body


def sized(data: bytes) -> Iterator[bytes]:
    """Pieces that each stand behind their length."""
    place = 0
    while place + 4 <= len(data):
        (size,) = struct.unpack_from("<I", data, place)
        yield data[place + 4 : place + 4 + size]
        place += 4 + size


def bag_bytes(fields: dict[bytes, bytes], body: bytes) -> bytes:
    """A record as it lies in a bag."""
    parts = [name + b"=" + value for name, value in fields.items()]
    head = b"".join(struct.pack("<I", len(part)) + part for part in parts)
    return struct.pack("<I", len(head)) + head + struct.pack("<I", len(body)) + body


def bag_record_changed(records: list[BagRecord], k: int, rng: Rng) -> str:
    """Change one record: a field of its header, its data, or whether it is there."""
    fields, body = records[k]
    op = fields.get(b"op", b"?").hex()
    kind = int(rng.integers(8))
    name = pick(rng, list(fields)) if fields else b"op"
    change = pick(rng, (flip, flip, huge_count, token, cut))
    if kind == 0:
        del records[k]
    elif kind == 1:
        records.insert(int(rng.integers(len(records))), records[k])
    elif kind == 2:
        records[k] = ({n: v for n, v in fields.items() if n != name}, body)
    elif kind <= 4 and fields.get(name):
        records[k] = ({**fields, name: flip(fields[name], rng)}, body)
    elif kind == 5 and fields.get(name):
        records[k] = ({**fields, name: change(fields[name], rng)}, body)
    elif body:
        records[k] = (fields, change(body, rng))
    return f"{op} {kind} {name.decode(errors='replace')}"


STATEMENTS = (
    "UPDATE messages SET data = NULL WHERE id % 7 = 0",
    "UPDATE messages SET data = 'text' WHERE id = 5",
    "UPDATE messages SET data = zeroblob(3)",
    "UPDATE messages SET timestamp = 0",
    "UPDATE messages SET timestamp = 'now' WHERE id = 3",
    "UPDATE messages SET timestamp = -timestamp",
    "UPDATE messages SET timestamp = 9223372036854775807 WHERE id > 20",
    "UPDATE messages SET timestamp = 1e300 WHERE id = 4",
    "UPDATE messages SET topic_id = 99",
    "UPDATE messages SET topic_id = NULL WHERE id % 2 = 0",
    "UPDATE topics SET type = 'sensor_msgs/msg/Imu'",
    "UPDATE topics SET type = NULL",
    "UPDATE topics SET type = 'x'",
    "UPDATE topics SET name = NULL",
    "UPDATE topics SET name = 'same'",
    "UPDATE topics SET serialization_format = 'json'",
    "DELETE FROM topics",
    "DELETE FROM messages",
    "DELETE FROM messages WHERE id > 2",
    "DROP TABLE messages",
    "DROP TABLE topics",
    "ALTER TABLE messages RENAME COLUMN data TO blob",
    "ALTER TABLE topics ADD COLUMN more TEXT",
    "CREATE VIEW v AS SELECT * FROM messages",
    "CREATE TRIGGER tr AFTER INSERT ON messages BEGIN DELETE FROM messages; END",
    "UPDATE messages SET id = id + 1000000000",
    "INSERT INTO messages SELECT id + 100000, topic_id, timestamp, data FROM messages",
    "PRAGMA user_version = 77",
    "DELETE FROM message_definitions",
    "UPDATE message_definitions SET encoded_message_definition = 'float64 x'",
    "PRAGMA encoding = 'UTF-16'",
)

VALUES = (
    "", "x", "-1", "0", "{}", "[]", "null", "1e20", "[1, 2]", "2026-01-02", "*a", "!!python/x", "'",
)  # fmt: skip


def folder_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A ROS 2 bag: its database, or the metadata.yaml beside it, changed."""
    if seed.path.is_file():
        target = path
        shutil.copyfile(seed.path, path)
    else:
        shutil.copytree(seed.path, path)
        target = next(p for p in sorted(path.iterdir()) if p.suffix != ".yaml")
        if rng.random() < 0.5:
            return Mutant(yaml_changed(path / "metadata.yaml", rng), path=path)
    data = target.read_bytes()
    if rng.random() < 0.4 or target.suffix == ".mcap" or not data.startswith(b"SQLite"):
        data, how = mutate_bytes(data, rng)
        target.write_bytes(data)
        return Mutant(how, path=path)
    how = []
    with sqlite3.connect(target) as database:
        for _ in range(int(rng.integers(1, 3))):
            statement = pick(rng, STATEMENTS)
            how.append(statement)
            try:
                database.execute(statement)
            except sqlite3.Error:
                continue
        there = "DROP" not in "".join(how) and "RENAME" not in "".join(how)
        if rng.random() < 0.4 and there:
            rows = database.execute("SELECT id, data FROM messages LIMIT 20").fetchall()
            for number, blob in rows:
                if isinstance(blob, bytes) and blob:
                    changed = (flip(blob, rng), number)
                    database.execute("UPDATE messages SET data = ? WHERE id = ?", changed)
    database.close()
    return Mutant("; ".join(how), path=path)


def yaml_changed(path: Path, rng: Rng) -> str:
    """Change one line of a bag's metadata."""
    if rng.random() < 0.1:
        path.unlink()
        return "no yaml"
    lines = path.read_text(encoding="utf-8").split("\n")
    k = int(rng.integers(len(lines)))
    key, colon, _ = lines[k].partition(":")
    kind = int(rng.integers(5))
    if kind <= 1 and colon:
        lines[k] = f"{key}: {pick(rng, VALUES)}"
    elif kind == 2:
        del lines[k]
    elif kind == 3:
        lines[k] = " " + lines[k]
    else:
        data, _ = mutate_bytes("\n".join(lines).encode(), rng)
        path.write_bytes(data)
        return "yaml bytes"
    path.write_text("\n".join(lines), encoding="utf-8")
    return f"yaml {key.strip()}"


def shrunk_mcap(source: Path, target: Path, most: int) -> None:
    """The first messages of an MCAP as a file of their own."""
    write_mcap(target, mcap_messages(source)[:most])


def shrunk_database(source: Path, target: Path, most: int) -> None:
    """The first messages of a ROS 2 database, as a file of their own."""
    shutil.copyfile(source, target)
    target.chmod(0o644)
    database = sqlite3.connect(target)
    database.execute("DELETE FROM messages WHERE id > ?", (most,))
    database.commit()
    database.execute("VACUUM")
    database.close()


def shrunk_archive(data: bytes, most: int) -> bytes:
    """The first rows of every array of an .npz."""
    import numpy as np

    arrays = {key: value[:most] for key, value in np.load(io.BytesIO(data)).items()}
    np.savez(file := io.BytesIO(), **arrays)
    return file.getvalue()
