"""Hostile files: bombs, claims beyond what a file holds, and what broke a reader before."""

import gzip
import os
import resource
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hostile_logs import (
    EMPTY_ARRAY,
    JOINT_STATE,
    TYPE_BOMB,
    bag_cut_at_record,
    computed,
    database,
    lists,
    mcap_of_type,
    mcap_without_its_middle,
    npz,
    parquet,
    parquet_of_zeros,
    pickled_itself,
    pickled_laughs,
    pickled_texts,
    pickled_with_byte_order,
    table,
    viewed,
)
from reading_child import read_apart
from seed_logs import ROWS, bare_db3, bare_mcap, motion, rosbag1, ur_csv, write_mcap

from vftcli.readers.bags import container
from vftcli.readers.reading import read
from vftcli.signals.errors import LogError, VftError


def peak_mib() -> float:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


@pytest.mark.slow
@pytest.mark.parametrize("pack", [gzip.compress, zstandard.compress])
def test_decompression_bombs_are_bounded(tmp_path: Path, pack: Callable[[bytes], bytes]) -> None:
    bomb = b"t,q1\n" + b"0.1,0.2\n" * (64 << 20)  # half a gibibyte, shrinks a thousandfold
    (tmp_path / "x").write_bytes(pack(bomb))
    del bomb
    before = peak_mib()
    with pytest.raises(LogError, match="unpacks to more than 128 MiB"):
        read(tmp_path / "x")
    assert peak_mib() - before < 1024


def test_a_chunk_that_claims_too_much_is_refused(tmp_path: Path) -> None:
    path = rosbag1(tmp_path / "x", compression="LZ4")
    content = bytearray(path.read_bytes())
    place = content.index(b"size=") + 5
    content[place : place + 4] = struct.pack("<I", 2**32 - 1)
    path.write_bytes(content)
    with pytest.raises(LogError, match="unpacks to more than 128 MiB"):
        read(path)


def test_chunks_of_more_records_than_a_log_can_hold_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A record takes a microsecond or more: 100 MB of empty ones fit into 10 kB."""
    monkeypatch.setattr(container, "SPARE_PIECES", 500)
    monkeypatch.setattr(container, "PIECES_PER_BYTE", 0)
    for rows, words in ((1000, "more records than a log of this size"), (200, "no joint pos")):
        with pytest.raises(LogError, match=words):
            read(write_mcap(tmp_path / "x", [("/j", 0, b"{}")] * rows))


def test_damaged_chunks_do_not_pass_their_checksum(tmp_path: Path) -> None:
    path = bare_mcap(tmp_path / "x")
    content = bytearray(path.read_bytes())
    content[3000] ^= 1
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"damaged|checksum"):
        read(path)


def test_nothing_is_written_beside_a_log(tmp_path: Path) -> None:
    path = rosbag1(tmp_path / "x")
    before = sorted(tmp_path.rglob("*"))
    read(path)
    assert sorted(tmp_path.rglob("*")) == before
    assert path.stat().st_nlink == 1


MEMORY_MIB = 500.0
"""What any file may take."""

BOMBS: dict[str, tuple[Callable[[Path], Path], str]] = {
    "empty-array": (lambda path: mcap_of_type(path, EMPTY_ARRAY), "more parts than bytes"),
    "type-bomb": (lambda path: mcap_of_type(path, TYPE_BOMB), "more parts than bytes"),
    "long-definition": (
        lambda path: mcap_of_type(path, "float64 a\n" * 7000),
        "a definition of more than 64 KiB",
    ),
    "zeroblob": (computed("zeroblob(900000000)"), "no stored column data"),
    "view": (viewed, "without plain tables of a ROS 2 bag"),
    "laughs": (pickled_laughs, "more numbers than a file of its size"),
    "texts": (pickled_texts, "more numbers than a file of its size"),
    "itself": (pickled_itself, "a list that holds itself"),
    "zeros": (parquet_of_zeros, "unpacks to more than 128 MiB"),
}
"""Name → a file that once filled the memory or never ended, and what is said of it."""


@pytest.mark.slow
def test_bombs_are_refused_in_one_line_and_little_memory(tmp_path: Path) -> None:
    paths = [make(tmp_path / name) for name, (make, _) in BOMBS.items()]
    found = read_apart(paths)
    for name, (_, words) in BOMBS.items():
        reading = found[name]
        assert (reading.samples, words in reading.said) == (-1, True), (name, reading)
        assert "\n" not in reading.said
        assert reading.peak_mib < MEMORY_MIB, name


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda path: mcap_of_type(path, JOINT_STATE, position=np.nan), "NaN in all 20 messages"),
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
        (
            lambda path: table(path, lambda k: k // 40),
            "clock is coarser than the samples: 117 of",
        ),
        (lambda path: table(path, lambda k: k * 5e-324), "which no robot's log is"),
        (lambda path: table(path, lambda k: k * 1e300), "which no robot's log is"),
        (lambda path: table(path, lambda k: 1e10 + k / 64), "starts at 1e+10 s, which no clock"),
        (lambda path: table(path, lambda k: k % 100), "the clock starts anew"),
    ],
)
def test_tables_that_are_no_log_are_refused_by_what_is_wrong(
    tmp_path: Path, make: Callable[[Path], Path], words: str
) -> None:
    with pytest.raises(VftError) as refusal:
        read(make(tmp_path / "x"))
    assert words in str(refusal.value)
    assert "\n" not in str(refusal.value)


def test_a_name_of_many_digits_is_a_name(tmp_path: Path) -> None:
    """A number was tried from each of its digits on, and one of 5000 digits is none of Python's."""
    path = table(tmp_path / "x", lambda k: 0.008 * k)
    head, _, rows = path.read_text().partition("\n")
    path.write_text(head.replace("dq5", "1" * 40_000 + "x").replace("dq4", "dq" + "4" * 5000))
    with path.open("a") as file:
        file.write("\n" + rows)
    assert read(path).signals == ("q",)


def test_a_document_longer_than_any_message_of_joints_is_refused(tmp_path: Path) -> None:
    messages = [("/j", n, b'{"q": [' + b"1," * n + b"1]}") for n in (6, 5000)]
    with pytest.raises(LogError, match=r"message 2 of /j is damaged \(nested or long"):
        read(write_mcap(tmp_path / "x", messages))


def test_a_clock_may_be_a_list_of_one_number(tmp_path: Path) -> None:
    clock = [[float(t)] for t in motion(7)["t"]]
    np.testing.assert_array_equal(read(parquet(tmp_path / "x", t=clock)).t, motion(7)["t"])


def test_one_row_and_steps_down_to_a_tenth_of_a_microsecond_are_a_clock(tmp_path: Path) -> None:
    assert read(table(tmp_path / "x", float, rows=1)).samples == 1
    assert read(table(tmp_path / "x", lambda k: k * 1.1e-7)).samples == ROWS


@pytest.mark.parametrize("compression", ["", "LZ4"])
def test_a_bag_cut_between_records_says_what_was_kept(tmp_path: Path, compression: str) -> None:
    recording = read(bag_cut_at_record(tmp_path / "x", compression))
    [cut] = [r for r in recording.source.remarks if r.level == "warning"]
    assert cut.code == "bag-cut"
    assert 0 < recording.samples < ROWS
    assert 2 * recording.samples - cut.values["kept"] in {-1, 0, 1}  # two topics of one rate


def test_an_mcap_without_its_middle_says_what_was_kept(tmp_path: Path) -> None:
    counted = read(mcap_without_its_middle(tmp_path / "x", keep_summary=True))
    [cut] = [r for r in counted.source.remarks if r.level == "warning"]
    assert (cut.code, cut.values["counted"]) == ("messages-missing", 2 * ROWS)
    kept = cut.values["kept"]
    assert 0 < kept < 2 * ROWS
    placed = read(mcap_without_its_middle(tmp_path / "y", keep_summary=False))
    [cut] = [r for r in placed.source.remarks if r.level == "warning"]
    assert (cut.code, cut.values["kept"]) == ("bag-cut", kept)
    assert placed.samples == counted.samples < ROWS


COLUMNS = "id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB"


def test_no_function_of_a_database_runs(tmp_path: Path) -> None:
    """Also where the table is plain: an index on an expression is never computed for a query."""
    path = database(
        tmp_path / "x",
        f"CREATE TABLE messages ({COLUMNS}, "
        "more BLOB GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL)",
        "INSERT INTO messages (topic_id, timestamp, data) VALUES (1, 0, x'0001')",
    )
    with pytest.raises(LogError, match="does not fit the definition"):
        read(path)  # the message itself was reached, and it is none


def test_a_message_longer_than_its_file_is_damage(tmp_path: Path) -> None:
    """A row that claims a length of 2³¹ or so: SQLite would make room for it first."""
    path = database(
        tmp_path / "x",
        f"CREATE TABLE messages ({COLUMNS})",
        "INSERT INTO messages VALUES (1, 1, 7, zeroblob(200000))",
    )
    content = bytearray(path.read_bytes())
    # A blob of n bytes has the number 2 n + 12, in groups of seven bits: 200 000 is 0x98 0xb5 0x0c.
    place = content.index(bytes([0x98, 0xB5, 0x0C]))
    content[place : place + 3] = bytes([0xFF, 0xFF, 0x7C])  # about a million bytes
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"damaged|not a readable"):
        read(path)


def test_a_journal_beside_a_database_is_said(tmp_path: Path) -> None:
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


def test_pickled_arrays_keep_their_byte_order(tmp_path: Path) -> None:
    recording = read(pickled_with_byte_order(tmp_path / "x"))
    np.testing.assert_array_equal(recording.q, motion(7)["q"])
    np.testing.assert_array_equal(recording.torque, motion(7)["tau"])


@pytest.mark.parametrize("make", [ur_csv, parquet, rosbag1, bare_db3, npz])
def test_a_name_that_is_not_utf8_is_no_hindrance(
    tmp_path: Path, make: Callable[[Path], Path]
) -> None:
    plain = make(tmp_path / "x")
    odd = tmp_path / os.fsdecode(b"bad\xff")
    plain.rename(odd)
    assert read(odd).samples == ROWS


FOUND_READ = {
    "cut_at_record.bag": 59, "cut_at_record_lz4.bag": 19, "cut_middle.mcap": 64, "one-row.csv": 1,
    "pk_bigendian.pkl": 400, "pk_bigendian_round.pkl": 400,
}  # fmt: skip
"""Samples of the files that were found by fuzzing and are read: all others are refused."""


@pytest.mark.slow
def test_files_that_were_found_by_fuzzing(logs: Path) -> None:
    folder = logs.parent / "hostile"
    if not folder.is_dir():
        pytest.skip("the folder of hostile files is not beside VFT_LOGS")
    others = {".toml", ".urdf", ".md"}  # robot files, and what the folder says of itself
    found = read_apart(sorted(p for p in folder.iterdir() if p.suffix not in others))
    for name, reading in found.items():
        assert reading.samples == FOUND_READ.get(name, -1), (name, reading)
        assert "\n" not in reading.said
        assert reading.peak_mib < MEMORY_MIB, name
    assert "claims more memory than the file holds" in found["memory.db3"].said
