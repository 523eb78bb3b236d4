"""Hostile files: bombs, claims beyond what a file holds, and what broke a reader before."""

import os
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
import zstandard
from message_mutants import bag_bytes, bag_records, mcap_records
from pyarrow.parquet import write_table
from seed_logs import (
    ROWS,
    bare_db3,
    bare_mcap,
    motion,
    panda_py_log,
    patched,
    rosbag1,
    rows_of,
    ur_csv,
    write_mcap,
)

from vftcli.readers.bags import container
from vftcli.readers.reading import read
from vftcli.signals.errors import LogError, VftError

TOO_MUCH = "unpacks to more than 128 MiB"


def mcap_without_its_middle(path: Path, keep_summary: bool) -> Path:
    """An MCAP without the second half of its chunks, the summary behind it or its footer only."""
    content = bare_mcap(path).read_bytes()
    records = list(mcap_records(content))
    chunks = [k for k, (opcode, _) in enumerate(records) if opcode == 6]
    data_end = next(k for k, (opcode, _) in enumerate(records) if opcode == 15)
    kept = records[: chunks[len(chunks) // 2]]
    kept += records[data_end if keep_summary else -1 :]
    body = (struct.pack("<BQ", opcode, len(record)) + record for opcode, record in kept)
    path.write_bytes(content[:8] + b"".join(body) + content[-8:])
    return path


def mcap_of_type(path: Path, definition: str | None = None, position: float = 0.1) -> Path:
    """Twenty joint states in an MCAP that says their type is what a text defines."""
    from rosbags.typesys import Stores, get_typestore

    kind, store = "sensor_msgs/msg/JointState", get_typestore(Stores.ROS2_HUMBLE)
    types, messages = store.types, []
    for k in range(20):
        time = types["builtin_interfaces/msg/Time"](sec=1, nanosec=8_000_000 * k)
        message = types[kind](
            header=types["std_msgs/msg/Header"](stamp=time, frame_id=""),
            name=[f"j{j}" for j in range(6)],
            position=np.full(6, position),
            velocity=np.zeros(6),
            effort=np.zeros(6),
        )
        messages.append(("/j", 8_000_000 * k, bytes(store.serialize_cdr(message, kind))))
    if definition is None:
        definition, _ = store.generate_msgdef(kind, ros_version=2)
    schemas = {"/j": (kind, "ros2msg", definition.encode())}
    return write_mcap(path, messages, encoding="cdr", schemas=schemas)


def database(path: Path, messages: str, *more: str) -> Path:
    """A bag in SQLite whose table of messages is made by a statement, with one topic."""
    with closing(sqlite3.connect(path)) as db:
        columns = "id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT"
        db.execute(f"CREATE TABLE topics ({columns})")
        db.execute("INSERT INTO topics VALUES (1, '/j', 'sensor_msgs/msg/JointState', 'cdr')")
        db.execute(messages)
        for statement in more:
            db.execute(statement)
        db.commit()
    return path


def parquet(path: Path, **changed: object) -> Path:
    log = motion(7)
    columns: dict[str, object] = {"t": log["t"], "q": log["q"].tolist(), "dq": log["dq"].tolist()}
    write_table(pa.table(columns | changed), path)
    return path


def lists(first: object) -> list[object]:
    return [first, *motion(7)["q"].tolist()[1:]]


def npz(path: Path, **changed: object) -> Path:
    with path.open("wb") as file:
        np.savez(file, **(panda_py_log() | changed))
    return path


def table(path: Path, clock: Callable[[int], float], rows: int = ROWS) -> Path:
    log, times = motion(), [float(clock(k)) for k in range(rows)]
    names = ["t", *(f"{name}{j}" for name in ("q", "dq") for j in range(6))]
    lines = [",".join(names), *rows_of(np.array(times), log["q"][:rows], log["dq"][:rows])]
    path.write_text("\n".join(lines) + "\n")
    return path


def packed_text(path: Path) -> Path:
    path.write_bytes(zstandard.compress(b"t,q1\n" + b"0.1,0.2\n" * (17 << 20)))  # 136 MiB
    return path


def crowded_json(path: Path) -> Path:
    path.write_bytes(b'{"q": [' + b"[]," * (8 << 20) + b"[]]}")  # which would be .8 GB
    return path


def claiming_pickle(path: Path) -> Path:
    path.write_bytes(b"\x80\x02cnumpy\nndarray\n((I10000000000\nttR.")  # ndarray((10**9,))
    return path


def damaged_chunk(path: Path) -> Path:
    content = bytearray(bare_mcap(path).read_bytes())
    content[3000] ^= 1
    path.write_bytes(content)
    return path


def long_document(path: Path) -> Path:
    """A second message longer than any of joints is."""
    messages = [("/j", n, b'{"q": [' + b"1," * n + b"1]}") for n in (6, 5000)]
    return write_mcap(path, messages)


PLAIN = "id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB"


def computed_beside(path: Path) -> Path:
    """A column that is computed beside a plain table, which is never asked for."""
    more = "more BLOB GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL"
    insert = "INSERT INTO messages (topic_id, timestamp, data) VALUES (1, 0, x'0001')"
    return database(path, f"CREATE TABLE messages ({PLAIN}, {more})", insert)


def long_blob(path: Path) -> Path:
    """A message that claims about a million bytes: SQLite would make room for it first."""
    insert = "INSERT INTO messages VALUES (1, 1, 7, zeroblob(200000))"
    database(path, f"CREATE TABLE messages ({PLAIN})", insert)
    # A blob of n bytes has the number 2 n + 12, in groups of seven bits: 200 000 is 0x98 0xb5 0x0c.
    return patched(path, b"\x98\xb5\x0c", b"\xff\xff\x7c", behind=False)


def test_chunks_of_more_records_than_a_log_can_hold_are_refused(path, monkeypatch):
    """A record takes a microsecond or more: 100 MB of empty ones fit into 10 kB."""
    monkeypatch.setattr(container, "SPARE_PIECES", 500)
    monkeypatch.setattr(container, "PIECES_PER_BYTE", 0)
    for rows, words in ((1000, "more records than a log of this size"), (200, "no joint pos")):
        with pytest.raises(LogError, match=words):
            read(write_mcap(path, [("/j", 0, b"{}")] * rows))


def test_nothing_is_written_beside_a_log(tmp_path):
    path = rosbag1(tmp_path / "x")
    before = sorted(tmp_path.rglob("*"))
    read(path)
    assert sorted(tmp_path.rglob("*")) == before
    assert path.stat().st_nlink == 1


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: patched(rosbag1(path, compression="LZ4"), b"size=", b"\xff" * 4), TOO_MUCH),
        (packed_text, TOO_MUCH),
        (crowded_json, "a JSON document of 24 MiB, too many values to hold"),
        (claiming_pickle, "Pickles are opened only"),
        (damaged_chunk, "a chunk does not match its checksum; damaged"),
        (long_document, "message 2 of /j is damaged (nested or long"),
        (computed_beside, "does not fit the definition"),  # the message itself was reached
        (long_blob, "not a readable bag; it is damaged"),
        (lambda path: mcap_of_type(path, position=np.nan), "NaN in all 20 messages"),
        (lambda path: parquet(path, q=lists([])), "q holds no number in its first row"),
        (lambda path: parquet(path, dq=lists([])), "dq holds no number in its first row"),
        (lambda path: parquet(path, q=lists(None)), "q holds no number in its first row"),
        (lambda path: parquet(path, q=lists([1.0])), "lists of q are not all 1 long"),
        (lambda path: parquet(path, q=[[None] * 7] * ROWS), "column q holds null"),
        (lambda path: parquet(path, t=[[0.0, 1.0]] * ROWS), "the clock never moves"),
        (lambda path: parquet(path, t=[], q=[], dq=[]), "has no rows"),
        (lambda path: npz(path, time=np.zeros((ROWS, 3))), "the clock holds 3 numbers a row"),
        (lambda path: npz(path, time=np.zeros((ROWS, 4, 4))), "the clock holds 16 numbers"),
        (lambda path: npz(path, time=np.array(1.0)), "no clock"),
        (lambda path: npz(path, q=np.zeros((7, ROWS))), "dq has 7 columns, q has 120"),
        (lambda path: table(path, lambda _: 1.0), "clock never moves: all 120 samples"),
        (lambda path: table(path, lambda k: k // 40), "coarser than the samples: 117 of"),
        (lambda path: table(path, lambda k: k * 5e-324), "which no robot's log is"),
        (lambda path: table(path, lambda k: k * 1e300), "which no robot's log is"),
        (lambda path: table(path, lambda k: 1e10 + k / 64), "starts at 1e+10 s, which no clock"),
        (lambda path: table(path, lambda k: k % 100), "the clock restarts"),
    ],
)
def test_what_is_no_log_is_refused_by_what_is_wrong(path, make, words):
    with pytest.raises(VftError) as refusal:
        read(make(path))
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_name_of_many_digits_is_a_name(path):
    """A number was tried from each of its digits on, and one of 5000 digits is none of Python's."""
    text = table(path, lambda k: 0.008 * k).read_text()
    path.write_text(text.replace("dq5", "1" * 40_000 + "x").replace("dq4", "dq" + "4" * 5000))
    assert read(path).signals == ("q",)


def test_a_clock_may_be_a_list_of_one_number(path):
    clock = [[float(t)] for t in motion(7)["t"]]
    np.testing.assert_array_equal(read(parquet(path, t=clock)).t, motion(7)["t"])


def test_one_row_and_steps_down_to_a_tenth_of_a_microsecond_are_a_clock(path):
    assert read(table(path, float, rows=1)).samples == 1
    assert read(table(path, lambda k: k * 1.1e-7)).samples == ROWS


@pytest.mark.parametrize("compression", ["", "LZ4"])
def test_a_bag_cut_between_records_says_what_was_kept(path, compression):
    """All behind its second chunk and that one's index is gone."""
    content = rosbag1(path, compression=compression).read_bytes()
    records = list(bag_records(content[13:]))
    chunks = [k for k, (fields, _) in enumerate(records) if fields[b"op"] == b"\x05"]
    path.write_bytes(content[:13] + b"".join(bag_bytes(*r) for r in records[: chunks[2]]))
    recording = read(path)
    [cut] = [r for r in recording.source.remarks if r.level == "warning"]
    assert cut.code == "bag-cut"
    assert 0 < recording.samples < ROWS
    assert 2 * recording.samples - cut.values["kept"] in {-1, 0, 1}  # two topics of one rate


def test_an_mcap_without_its_middle_says_what_was_kept(tmp_path):
    counted = read(mcap_without_its_middle(tmp_path / "x", keep_summary=True))
    [cut] = [r for r in counted.source.remarks if r.level == "warning"]
    assert (cut.code, cut.values["counted"]) == ("messages-missing", 2 * ROWS)
    kept = cut.values["kept"]
    assert 0 < kept < 2 * ROWS
    placed = read(mcap_without_its_middle(tmp_path / "y", keep_summary=False))
    [cut] = [r for r in placed.source.remarks if r.level == "warning"]
    assert (cut.code, cut.values["kept"]) == ("bag-cut", kept)
    assert placed.samples == counted.samples < ROWS


def test_a_journal_beside_a_database_is_said(tmp_path):
    path = bare_db3(tmp_path / "x.db3")
    with closing(sqlite3.connect(path)) as db:
        db.execute("PRAGMA journal_mode = WAL")
        db.execute("INSERT INTO messages SELECT NULL, topic_id, timestamp, data FROM messages")
        db.commit()
        (tmp_path / "y.db3").write_bytes(path.read_bytes())
        (tmp_path / "y.db3-wal").write_bytes((tmp_path / "x.db3-wal").read_bytes())
    recording = read(tmp_path / "y.db3")
    assert recording.samples == ROWS
    assert [r.code for r in recording.source.remarks if r.level == "warning"] == ["journal-left"]


@pytest.mark.parametrize("make", [ur_csv, parquet, rosbag1, bare_db3, npz])
def test_a_name_that_is_not_utf8_is_no_hindrance(tmp_path, make):
    odd = make(tmp_path / "x").rename(tmp_path / os.fsdecode(b"bad\xff"))
    assert read(odd).samples == ROWS
