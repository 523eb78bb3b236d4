"""Mutations of logs that hold messages: MCAP, ROS 1 bags, ROS 2 databases and folders."""

import json
import shutil
import sqlite3
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

from changes import bytes_changed, cut, flip, list_changed, odd_bytes, tree_changed
from text_mutants import bytes_mutant, settings_changed
from tokens import WORDS, Mutant, Rng, Seed, pick

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
    """An MCAP with its bytes, a record or messages changed."""
    data = seed.path.read_bytes()
    kind = rng.random()
    if kind < 0.05:
        path.write_bytes(cut(data, rng))
        return Mutant("cut", seed.samples)
    if kind < 0.4:
        records: list[Any] = [list(record) for record in mcap_records(data)]
        how = list_changed(records, rng, mcap_record_changed)
        body = b"".join(struct.pack("<BQ", op, len(content)) + content for op, content in records)
        path.write_bytes(data[:8] + body + data[-8:])
        return Mutant(f"records {how}")
    if kind < 0.85:
        messages = list(seed.model)
        how = messages_changed(messages, rng)
        try:
            write_mcap(path, messages, rng)
            return Mutant(how)
        except (ValueError, struct.error, OverflowError, TypeError):
            pass
    return bytes_mutant(seed, rng, path)


def mcap_records(data: bytes) -> Iterator[tuple[int, bytes]]:
    """The records of an MCAP, as they lie in the file."""
    place = 8
    while place + 9 <= len(data) - 8:
        op, size = struct.unpack_from("<BQ", data, place)
        yield op, data[place + 9 : place + 9 + size]
        place += 9 + size


def mcap_record_changed(record: list[Any], rng: Rng) -> list[Any]:
    op, content = record
    other = rng.random() < 0.15
    return [int(rng.integers(1, 20)), content] if other else [op, odd_bytes(content, rng)]


def messages_changed(messages: list[Message], rng: Rng) -> str:
    """Change messages, or what all of one topic have in common."""
    if rng.random() < 0.6:
        return f"messages {list_changed(messages, rng, message_changed)}"
    first = messages[int(rng.integers(len(messages)))]
    name, encoding, definition = first.schema
    word = pick(rng, WORDS)[:200]
    field, value = pick(rng, (
        ("topic", word),
        ("schema", (word, encoding, definition)),
        ("schema", (name, pick(rng, ("ros1msg", "x", "")), definition)),
        ("schema", (name, encoding, odd_bytes(definition, rng) or b"x")),
    ))  # fmt: skip
    for k, message in enumerate(messages):
        if message.topic == first.topic:
            messages[k] = message._replace(**{field: value})
    return f"{field} of {first.topic}"


def message_changed(message: Message, rng: Rng) -> Message:
    """A message at another time, or of other data: its bytes, or a value of a JSON document."""
    if rng.random() < 0.3:
        return message._replace(time=pick(rng, TIMES))
    if message.encoding == "json" and rng.random() < 0.8:
        document = tree_changed(json.loads(message.data), rng)
        return message._replace(data=json.dumps(document).encode("utf-8", "replace"))
    return message._replace(data=odd_bytes(message.data, rng) or b"\0")


BagRecord = tuple[dict[bytes, bytes], bytes]


def bag_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A ROS 1 bag with its bytes, or its records, changed."""
    data = seed.path.read_bytes()
    kind = rng.random()
    if kind < 0.25:
        return bytes_mutant(seed, rng, path)
    if kind < 0.35:
        path.write_bytes(cut(data, rng))
        return Mutant("cut", seed.samples)
    line = data.index(b"\n") + 1
    records: list[Any] = list(bag_records(data[line:]))
    chunks = [k for k, (fields, _) in enumerate(records) if fields.get(b"compression") == b"none"]
    if chunks and rng.random() < 0.5:  # among the records of a chunk there are most
        fields, content = records[k := int(pick(rng, chunks))]
        nested: list[Any] = list(bag_records(content))
        how = list_changed(nested, rng, bag_record_changed)
        content = b"".join(bag_bytes(*record) for record in nested)
        records[k] = ({**fields, b"size": struct.pack("<I", len(content))}, content)
    else:
        how = list_changed(records, rng, bag_record_changed)
    path.write_bytes(data[:line] + b"".join(bag_bytes(*record) for record in records))
    return Mutant(f"bag {how}")


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


def bag_record_changed(record: BagRecord, rng: Rng) -> BagRecord:
    """A record with a field of its header changed or gone, or other data."""
    fields, body = record
    kind = rng.random()
    if kind < 0.4 or not fields:
        return fields, odd_bytes(body, rng)
    name = pick(rng, list(fields))
    left = {n: v for n, v in fields.items() if n != name}
    return (left if kind < 0.5 else {**left, name: odd_bytes(fields[name], rng)}), body


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


def folder_mutant(seed: Seed, rng: Rng, path: Path) -> Mutant:
    """A ROS 2 bag: its database, or the metadata.yaml beside it, changed."""
    target = path
    if seed.path.is_file():
        shutil.copyfile(seed.path, path)
    else:
        shutil.copytree(seed.path, path)
        target = next(p for p in sorted(path.iterdir()) if p.suffix != ".yaml")
        if rng.random() < 0.5:
            return Mutant(yaml_changed(path / "metadata.yaml", rng), path=path)
    data = target.read_bytes()
    if rng.random() < 0.4 or not data.startswith(b"SQLite"):
        data, how = bytes_changed(data, rng)
        target.write_bytes(data)
        return Mutant(how, path=path)
    said = [pick(rng, STATEMENTS) for _ in range(int(rng.integers(1, 3)))]
    with sqlite3.connect(target) as database:
        database.create_function("changed", 1, lambda blob: flip(blob, rng) if blob else blob)
        if rng.random() < 0.4:
            said.append("UPDATE messages SET data = changed(data) WHERE id < 20")
        for statement in said:
            try:
                database.execute(statement)
            except sqlite3.Error:
                continue
    database.close()
    return Mutant("; ".join(said), path=path)


def yaml_changed(path: Path, rng: Rng) -> str:
    """Change a bag's metadata: a line, its bytes, or whether it is there."""
    text, kind = path.read_bytes(), rng.random()
    if kind < 0.1:
        path.unlink()
        return "no yaml"
    if kind < 0.3:
        path.write_bytes(bytes_changed(text, rng)[0])
        return "yaml bytes"
    changed, how = settings_changed(text.decode(), rng)
    path.write_text(changed, encoding="utf-8")
    return f"yaml {how}"


def shrunk_database(source: Path, target: Path, most: int) -> None:
    """The first messages of a ROS 2 database, as a file of their own."""
    shutil.copyfile(source, target)
    target.chmod(0o644)
    database = sqlite3.connect(target)
    database.execute("DELETE FROM messages WHERE id > ?", (most,))
    database.commit()
    database.execute("VACUUM")
    database.close()
