"""Bags: every container and compression, salvage."""

import bz2
import shutil
import sqlite3
import struct
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import seed_logs
import zstandard
from message_mutants import bag_bytes, bag_records

from vftcli.readers.bags.container import ReadBudget, unpacked
from vftcli.readers.reading import read
from vftcli.signals.errors import LogError
from vftcli.signals.recording import Recording

BAGS = {
    "rosbag1": (seed_logs.rosbag1, {}),
    "rosbag1 lz4": (seed_logs.rosbag1, {"compression": "LZ4"}),
    "rosbag1 bz2": (seed_logs.rosbag1, {"compression": "BZ2"}),
    "rosbag2 mcap": (seed_logs.rosbag2, {"storage": "mcap"}),
    "rosbag2 sqlite3": (seed_logs.rosbag2, {"storage": "sqlite3"}),
    "rosbag2 mcap file": (seed_logs.rosbag2, {"storage": "mcap", "mode": "FILE"}),
    "rosbag2 mcap storage": (seed_logs.rosbag2, {"storage": "mcap", "mode": "STORAGE"}),
    "rosbag2 sqlite3 file": (seed_logs.rosbag2, {"storage": "sqlite3", "mode": "FILE"}),
    "rosbag2 sqlite3 message": (seed_logs.rosbag2, {"storage": "sqlite3", "mode": "MESSAGE"}),
    "mcap": (seed_logs.bare_mcap, {}),
    "db3": (seed_logs.bare_db3, {}),
}
"""Format, storage and compression → how a bag is made."""


@pytest.mark.parametrize("name", ["lz4", "bz2", "zstd"])
def test_a_chunk_unpacks_to_the_size_that_it_claims_or_not_at_all(name):
    content, budget = bytes(range(100)), ReadBudget(Path("x"), 1000)
    pack = {"lz4": lz4.frame.compress, "bz2": bz2.compress, "zstd": zstandard.compress}[name]
    assert unpacked(budget, name, pack(content), 100) == content
    for claimed in (99, 101):
        with pytest.raises(LogError, match=f"does not unpack to {claimed} B"):
            unpacked(budget, name, pack(content), claimed)


def assert_is_the_motion(recording: Recording) -> None:
    log = seed_logs.motion(7, step=0.001)
    np.testing.assert_array_equal(recording.q, log["q"])
    np.testing.assert_array_equal(recording.dq, log["dq"])
    np.testing.assert_array_equal(recording.target_dq, log["dq"])
    np.testing.assert_array_equal(recording.torque, log["tau"])
    np.testing.assert_array_equal(recording.tau_ext, 0.0 - log["tau_ext"])
    assert not recording.require("wrench").any()
    np.testing.assert_allclose(recording.t, 1e-3 * np.arange(seed_logs.ROWS), atol=1e-12)
    assert recording.robot_hint == "panda"
    assert recording.payload_mass == 0.5
    assert recording.source.t0 == pytest.approx(100)


@pytest.mark.parametrize("name", BAGS)
def test_every_kind_of_bag_holds_the_motion(path, name):
    make, how = BAGS[name]
    recording = read(make(path, **how))
    assert_is_the_motion(recording)
    if how:
        assert recording.source.format == name.split()[0]
    assert "robot clock" in recording.source.clock


def test_metadata_is_not_needed_and_cannot_choose_a_path(tmp_path):
    metadata = seed_logs.rosbag2(tmp_path / "x") / "metadata.yaml"
    text = metadata.read_text()
    (tmp_path / "secret.mcap").write_bytes(b"not to be opened")
    metadata.write_text(text.replace("x.mcap", "../secret.mcap"))
    assert_is_the_motion(read(tmp_path / "x"))
    metadata.write_text(text.replace("  message_count: 240", "  message_count: 300"))
    [reported] = read(tmp_path / "x").source.warnings
    assert "read 240 of the 300 messages that metadata.yaml counts" in reported
    metadata.unlink()
    assert_is_the_motion(read(tmp_path / "x"))
    shutil.move(next((tmp_path / "x").glob("*.mcap")), tmp_path / "x" / "x.txt")
    with pytest.raises(LogError, match="not recognised"):
        read(tmp_path / "x")


@pytest.mark.parametrize("make", [seed_logs.rosbag1, seed_logs.bare_mcap])
def test_cut_files_are_read_up_to_their_last_whole_chunk(path, make):
    make(path)
    content = path.read_bytes()
    lengths = []
    for share in (0.9, 0.6, 0.4):
        path.write_bytes(content[: int(share * len(content))])
        recording = read(path)
        lengths.append(recording.samples)
        [cut] = [r for r in recording.source.remarks if r.level == "warning"]
        assert cut.code == "bag-cut"
        # Two topics of one rate, of which the second may have lost its last message.
        assert 2 * recording.samples - cut.values["kept"] in {0, 1}
        np.testing.assert_array_equal(recording.q, seed_logs.motion(7)["q"][: recording.samples])
    assert seed_logs.ROWS > lengths[0] > lengths[1] > lengths[2] > 1
    path.write_bytes(content[:2000])
    with pytest.raises(LogError, match="no messages in any whole chunk"):
        read(path)


def changed_index(path: Path, change: Callable[[bytes], bytes] | None) -> Path:
    """A closed ROS 1 bag whose records behind each chunk, its index, are changed or gone."""
    content, out = seed_logs.rosbag1(path).read_bytes(), []
    for fields, body in bag_records(content[13:]):
        if fields[b"op"] != b"\x04":
            out.append(bag_bytes(fields, body))
        elif change is not None:
            out.append(bag_bytes(fields, change(body)))
    path.write_bytes(content[:13] + b"".join(out))
    return path


def test_a_bag_without_the_index_of_its_chunks_is_read(tmp_path):
    """A recorder that stopped between a chunk and its index, and never closed the bag."""
    path = changed_index(tmp_path / "x", None)
    assert_is_the_motion(read(path))
    path = seed_logs.patched(seed_logs.rosbag1(tmp_path / "y"), b"index_pos=", bytes(8))
    recording = read(path)
    assert_is_the_motion(recording)
    assert any("was never closed" in reported for reported in recording.source.warnings)


def test_a_bag_cut_within_the_index_of_a_chunk_is_read(path):
    """Behind each chunk is a record of index a topic; the last one is gone."""
    content = seed_logs.rosbag1(path).read_bytes()
    records = list(bag_records(content[13:]))
    places = [k for k, (fields, _) in enumerate(records) if fields[b"op"] == b"\x04"]
    path.write_bytes(content[:13] + b"".join(bag_bytes(*r) for r in records[: places[3]]))
    recording = read(path)
    np.testing.assert_array_equal(recording.q, seed_logs.motion(7)["q"][: recording.samples])
    assert [r.code for r in recording.source.remarks if r.level == "warning"] == ["bag-cut"]


def moved(by: int) -> Callable[[bytes], bytes]:
    return lambda b: b[:-4] + (int.from_bytes(b[-4:], "little") + by).to_bytes(4, "little")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        *((moved(by), "damaged") for by in (1, 100, 2**31)),
        (lambda body: body[:-12], "a chunk and its index count differently"),
    ],
)
def test_an_index_that_points_elsewhere_or_leaves_out_is_damage(path, change, words):
    with pytest.raises(LogError, match=words):
        read(changed_index(path, change))


def test_databases_without_definitions_know_the_usual_types(path):
    seed_logs.bare_db3(path)
    with closing(sqlite3.connect(path)) as db, db:
        db.execute("DROP TABLE message_definitions")
    with pytest.raises(LogError, match="no definition of franka_msgs/FrankaState"):
        read(path)  # only the current FrankaRobotState is known
    with closing(sqlite3.connect(path)) as db, db:
        db.execute("DELETE FROM messages WHERE topic_id = 1")
        db.execute("DELETE FROM topics WHERE id = 1")
    np.testing.assert_array_equal(read(path).q, seed_logs.motion(7)["q"])


def test_a_definition_is_read_once_for_all_topics_of_its_type(path):
    """More definitions than the file has bytes, if each topic came with its own."""
    seed_logs.bare_db3(path)
    with closing(sqlite3.connect(path)) as db, db:
        first = db.execute("SELECT * FROM topics WHERE id = 1").fetchone()
        rows = [(k, f"{first[1]}_{k}", *first[2:]) for k in range(10, 1010)]
        db.executemany(f"INSERT INTO topics VALUES ({', '.join('?' * len(first))})", rows)
    assert_is_the_motion(read(path))


def foxglove_joint_states(k: int) -> bytes:
    """A foxglove.JointStates message, written by hand from its published field numbers."""

    def field(number: int, content: bytes) -> bytes:
        return bytes([number << 3 | 2, len(content)]) + content

    # From .99 s on; as protobuf 3 has it, a number that is zero is left out.
    stamp = divmod(990_000_000 + k * 1_000_000, 10**9)
    parts = [bytes([0x08 * n]) + varint(v) for n, v in enumerate(stamp, start=1) if v]
    out = field(1, b"".join(parts))
    for j in (2, 1, 3):
        joint = field(1, f"joint{j}".encode())
        joint += b"\x11" + struct.pack("<d", j + 0.01 * k) + b"\x29" + struct.pack("<d", -j)
        out += field(2, joint)
    return out


def varint(value: int) -> bytes:
    out = b""
    while value > 127:
        out += bytes([value & 127 | 128])
        value >>= 7
    return out + bytes([value])


def test_foxglove_joint_states(path):
    messages = (("/joints", k, foxglove_joint_states(k)) for k in range(30))
    schemas = {"/joints": ("foxglove.JointStates", "protobuf", b"")}
    path = seed_logs.write_mcap(path, messages, encoding="protobuf", schemas=schemas)
    recording = read(path)
    np.testing.assert_allclose(recording.q[5], [1.05, 2.05, 3.05], rtol=1e-15)
    assert recording.require("torque")[0].tolist() == [-1, -2, -3]
    assert recording.joint_names == ("joint1", "joint2", "joint3")
    assert recording.source.t0_ns == 990_000_000
    np.testing.assert_allclose(recording.t, 1e-3 * np.arange(30), atol=1e-15)
