"""Bags: every container and compression, bulk against typed decoding, topics, salvage."""

import bz2
import shutil
from collections.abc import Callable
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from seed_logs import (
    ROWS,
    bag_messages,
    bare_db3,
    bare_mcap,
    mcap_json,
    motion,
    rosbag1,
    rosbag2,
)

from vftcli.readers import read
from vftcli.readers.bags.container import ReadBudget, unpacked
from vftcli.signals.errors import LogError
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import WrenchFrame

STORAGES = [
    ("mcap", "", ""), ("sqlite3", "", ""), ("mcap", "FILE", "ZSTD"), ("sqlite3", "FILE", "ZSTD"),
    ("sqlite3", "MESSAGE", "ZSTD"), ("mcap", "STORAGE", "ZSTD"),
]  # fmt: skip


@pytest.mark.parametrize("name", ["lz4", "bz2", "zstd"])
def test_a_chunk_unpacks_to_the_size_that_it_claims_or_not_at_all(name: str) -> None:
    content, budget = bytes(range(100)), ReadBudget(Path("x"), 1000)
    pack = {"lz4": lz4.frame.compress, "bz2": bz2.compress, "zstd": zstandard.compress}[name]
    assert unpacked(budget, name, pack(content), 100) == content
    for claimed in (99, 101):
        with pytest.raises(LogError, match=f"does not unpack to {claimed} B"):
            unpacked(budget, name, pack(content), claimed)


def assert_is_the_motion(recording: Recording) -> None:
    log = motion(7, step=0.001)
    np.testing.assert_array_equal(recording.q, log["q"])
    np.testing.assert_array_equal(recording.dq, log["dq"])
    np.testing.assert_array_equal(recording.torque, log["tau"])
    np.testing.assert_array_equal(recording.tau_ext, 0.0 - log["tau_ext"])
    np.testing.assert_allclose(recording.t, 1e-3 * np.arange(ROWS), atol=1e-12)
    assert recording.robot_hint == "panda"
    assert recording.payload_mass == 0.5
    assert recording.source.t0 == pytest.approx(100)


@pytest.mark.parametrize("compression", ["", "LZ4", "BZ2"])
def test_ros1_bags(tmp_path: Path, compression: str) -> None:
    recording = read(rosbag1(tmp_path / "x", compression=compression))
    assert recording.source.format == "rosbag1"
    assert_is_the_motion(recording)
    assert "robot clock" in recording.source.clock


@pytest.mark.parametrize(("storage", "mode", "method"), STORAGES)
def test_ros2_bags(tmp_path: Path, storage: str, mode: str, method: str) -> None:
    folder = rosbag2(tmp_path / "x", storage=storage, mode=mode, method=method)
    recording = read(folder)
    assert recording.source.format == "rosbag2"
    assert_is_the_motion(recording)


def test_bare_files_and_folders_without_metadata(tmp_path: Path) -> None:
    assert_is_the_motion(read(bare_mcap(tmp_path / "x")))
    assert_is_the_motion(read(bare_db3(tmp_path / "y")))
    folder = rosbag2(tmp_path / "z")
    (folder / "metadata.yaml").unlink()
    assert_is_the_motion(read(folder))


def test_metadata_that_counts_other_messages_is_said(tmp_path: Path) -> None:
    folder = rosbag2(tmp_path / "x")
    text = (folder / "metadata.yaml").read_text()
    (folder / "metadata.yaml").write_text(
        text.replace("  message_count: 240", "  message_count: 9")
    )
    assert "metadata.yaml counts 9 messages, 240 were found" in read(folder).source.repairs
    (folder / "metadata.yaml").write_text(
        text.replace("  message_count: 240", "  message_count: 300")
    )
    [reported] = read(folder).source.warnings
    assert "kept 240 of the 300 messages that metadata.yaml counts" in reported


def test_metadata_cannot_choose_a_path(tmp_path: Path) -> None:
    folder = rosbag2(tmp_path / "x")
    text = (folder / "metadata.yaml").read_text()
    secret = tmp_path / "secret.mcap"
    secret.write_bytes(b"not to be opened")
    (folder / "metadata.yaml").write_text(text.replace("x.mcap", "../secret.mcap"))
    assert_is_the_motion(read(folder))


def test_bulk_and_typed_decoding_agree(tmp_path: Path) -> None:
    """Every number of 240 messages against rosbags' typed decoder."""
    from rosbags.highlevel import AnyReader

    path = rosbag1(tmp_path / "x.bag")
    recording = read(path)
    with AnyReader([path]) as reader:
        typed = [
            reader.deserialize(raw, connection.msgtype)
            for connection, _, raw in reader.messages()
            if connection.topic == "/franka_states"
        ]
    np.testing.assert_array_equal(recording.q, [m.q for m in typed])
    np.testing.assert_array_equal(recording.target_dq, [m.dq_d for m in typed])
    np.testing.assert_array_equal(recording.wrench, [m.O_F_ext_hat_K for m in typed])


def write_joint_states(path: Path, messages: list[dict[str, object]]) -> Path:
    """A ROS 1 bag of joint states; each dictionary holds a message's fields and its time."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    with Writer(path) as writer:
        connections: dict[str, object] = {}
        for k, given in enumerate(messages):
            message = {"topic": "/joint_states", "stamp": True} | given
            time = int(message["time"])  # type: ignore[call-overload]
            stamp = time if message["stamp"] else 0
            header = types["std_msgs/msg/Header"](
                seq=k,
                stamp=types["builtin_interfaces/msg/Time"](
                    sec=stamp // 10**9, nanosec=stamp % 10**9
                ),
                frame_id=message.get("frame", ""),
            )
            topic = str(message["topic"])
            if "force" in message:
                kind = "geometry_msgs/msg/WrenchStamped"
                vector = types["geometry_msgs/msg/Vector3"]
                body = types["geometry_msgs/msg/Wrench"](
                    force=vector(*message["force"]), torque=vector(0.0, 0.0, 0.0)
                )
                typed = types[kind](header=header, wrench=body)
            else:
                kind = "sensor_msgs/msg/JointState"
                typed = types[kind](
                    header=header,
                    name=message["name"],
                    position=np.array(message.get("position", []), dtype=float),
                    velocity=np.array(message.get("velocity", []), dtype=float),
                    effort=np.array(message.get("effort", []), dtype=float),
                )
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], time + 100, store.serialize_ros1(typed, kind))
    return path


ALPHABETICAL = ["elbow_joint", "shoulder_lift_joint", "shoulder_pan_joint", "wrist_1_joint",
                "wrist_2_joint", "wrist_3_joint"]  # fmt: skip
START = 1_700_000_000 * 10**9


def ur_message(k: int, **more: object) -> dict[str, object]:
    position = [2.0, 1.0, 0.0, 3.0, 4.0, 5.0]
    base = {"time": START + k * 8_000_000, "name": ALPHABETICAL, "position": position}
    return base | {"velocity": [0.0] * 6, "effort": [0.2, 0.1, 0.0, 0.3, 0.4, 0.5]} | more


def test_ur_joints_by_name_and_effort_as_current(tmp_path: Path) -> None:
    recording = read(write_joint_states(tmp_path / "x", [ur_message(k) for k in range(20)]))
    assert recording.q[0].tolist() == [0, 1, 2, 3, 4, 5]
    assert recording.joint_names[:2] == ("shoulder_pan_joint", "shoulder_lift_joint")
    assert recording.torque is None
    assert recording.current is not None
    np.testing.assert_allclose(recording.current[0], 0.1 * np.arange(6), rtol=1e-12)
    assert any("motor current [A]" in repair for repair in recording.source.repairs)
    assert "header stamps" in recording.source.clock


@pytest.mark.parametrize(
    ("columns", "signal", "sign"), [("tau=effort", "torque", 1), ("-current=effort", "current", -1)]
)
def test_columns_say_what_effort_is(tmp_path: Path, columns: str, signal: str, sign: int) -> None:
    path = write_joint_states(tmp_path / "x", [ur_message(k) for k in range(20)])
    recording = read(path, columns=columns)
    np.testing.assert_allclose(getattr(recording, signal)[0], sign * 0.1 * np.arange(6), rtol=1e-12)
    assert len({"torque", "current"} & set(recording.signals)) == 1
    with pytest.raises(LogError, match="no field 'nonsense'; it has position"):
        read(path, columns="tau=nonsense")


def test_merged_topics_with_a_gripper_and_changing_order(tmp_path: Path) -> None:
    """Messages of one topic in two orders, with fingers, and gripper-only ones in between."""
    arm = [f"panda_joint{j}" for j in range(1, 8)]
    messages = []
    for k in range(40):
        time = START + k * 1_000_000
        values = [float(j) + 0.001 * k for j in range(7)]
        if k % 2:
            messages.append({"time": time, "name": arm[::-1], "position": values[::-1]})
        else:
            fingers = ["panda_finger_joint1", "panda_finger_joint2"]
            messages.append({"time": time, "name": fingers + arm, "position": [9, 9, *values]})
    messages = [m | {"velocity": m["position"], "effort": m["position"]} for m in messages]
    messages += [{"time": START + 10**9 + k, "name": ["f"], "position": [1.0]} for k in range(5)]
    recording = read(write_joint_states(tmp_path / "x", messages))
    expected = np.arange(7.0) + 0.001 * np.arange(40)[:, None]
    np.testing.assert_allclose(recording.q, expected, rtol=1e-15)
    assert recording.robot_hint == "panda"


def test_empty_and_nan_velocities_are_missing_signals(tmp_path: Path) -> None:
    messages = [ur_message(k, velocity=[], effort=[np.nan] * 6) for k in range(20)]
    recording = read(write_joint_states(tmp_path / "x", messages))
    assert recording.signals == ("q",)
    assert any("NaN in every message" in repair for repair in recording.source.repairs)


def test_receive_stamps_where_headers_are_unset(tmp_path: Path) -> None:
    messages = [ur_message(k, stamp=False) for k in range(20)]
    recording = read(write_joint_states(tmp_path / "x", messages))
    np.testing.assert_allclose(recording.t, 0.008 * np.arange(20), atol=1e-9)
    assert "receive stamps" in recording.source.clock


def test_a_wrench_of_another_rate_is_interpolated(tmp_path: Path) -> None:
    messages = [ur_message(k) for k in range(50)]
    for k in range(400):
        time = START + k * 1_000_000 + 300_000
        force = (0.001 * (time - START) * 1e-6, 0.0, -5.0)
        messages.append({"topic": "/wrench", "time": time, "force": force, "frame": "tool0"})
    messages.sort(key=lambda message: message["time"])
    recording = read(write_joint_states(tmp_path / "x", messages))
    assert recording.wrench is not None
    inner = slice(1, -1)  # the ends are held
    np.testing.assert_allclose(
        recording.wrench[inner, 0], 0.001 * 8 * np.arange(50)[inner], atol=1e-9
    )
    assert recording.wrench_frame == WrenchFrame("tool0", "tool0")
    assert any("interpolated wrench of /wrench (1000 Hz)" in r for r in recording.source.repairs)


def test_columns_state_the_frame_and_sign_of_a_bags_wrench(tmp_path: Path) -> None:
    """What a refused frame asks for, "--columns wrench[base]=…", without a field's name."""
    messages = [ur_message(k) for k in range(50)]
    for k in range(50):
        time = START + k * 8_000_000
        messages.append({"topic": "/wrench", "time": time, "force": (1.0, 0, -5.0), "frame": "ft"})
    messages.sort(key=lambda message: message["time"])
    bag = write_joint_states(tmp_path / "x", messages)
    plain = read(bag).wrench
    stated = read(bag, columns="wrench[base@tool,by-robot]")
    assert stated.wrench_frame == WrenchFrame("base", "tool", "by-robot")
    np.testing.assert_array_equal(stated.wrench, plain)
    turned = read(bag, columns="-wrench[sensor],-dq")
    assert turned.wrench_frame == WrenchFrame("sensor", "sensor")
    np.testing.assert_array_equal(turned.wrench, -plain)
    without = write_joint_states(tmp_path / "y", [ur_message(k) for k in range(20)])
    with pytest.raises(LogError, match="no topic has one"):
        read(without, columns="wrench[base]")


def test_a_converted_log_of_an_earlier_version_reads_without_a_frame(tmp_path: Path) -> None:
    """Its frame_id is a sentence, which was refused as the user's mistake."""
    more = {"topic": "/vftcli/wrench", "force": (1.0, 0.0, 0.0)}
    more["frame"] = "base axes, moment about the flange point"
    messages = [ur_message(k) for k in range(20)]
    messages += [{**more, "time": message["time"]} for message in messages]
    messages.sort(key=lambda message: message["time"])
    recording = read(write_joint_states(tmp_path / "x", messages))
    assert recording.wrench is not None
    assert recording.wrench_frame is None


def test_a_topic_that_is_taken_is_not_reported_as_left_out(tmp_path: Path) -> None:
    """Whatever its name: one with a hyphen was not found again in the sentence on its taking."""
    messages = [ur_message(k) for k in range(50)]
    for k in range(400):
        force = {"time": START + k * 1_000_000, "force": (0.0, 0.0, 1.0)}
        messages += [{"topic": "/ft-sensor/wrench", **force}]
    messages.sort(key=lambda message: message["time"])
    codes = {r.code for r in read(write_joint_states(tmp_path / "x", messages)).source.remarks}
    assert "signal-interpolated" in codes
    assert "topics-left-out" not in codes


def test_a_wrench_that_does_not_cover_the_motion_is_left_out(tmp_path: Path) -> None:
    messages = [ur_message(k) for k in range(200)]
    for k in range(20):
        time = START + k * 1_000_000
        messages.append({"topic": "/wrench", "time": time, "force": (0.0, 0.0, 1.0)})
    recording = read(write_joint_states(tmp_path / "x", messages))
    assert recording.wrench is None
    assert any("does not cover" in warning for warning in recording.source.warnings)


def test_a_wrench_that_ends_within_three_of_its_steps_is_held(tmp_path: Path) -> None:
    """Joints every 8 ms up to 392 ms; a wrench every 20 ms up to 340 ms, 2.6 steps earlier."""
    messages = [ur_message(k) for k in range(50)]
    for k in range(18):
        time = START + k * 20_000_000
        messages.append({"topic": "/wrench", "time": time, "force": (float(k), 0.0, 0.0)})
    messages.sort(key=lambda message: message["time"])
    recording = read(write_joint_states(tmp_path / "x", messages))
    assert recording.wrench is not None
    np.testing.assert_allclose(recording.wrench[-7:, 0], 17.0, atol=1e-9)


def test_two_arms_are_refused(tmp_path: Path) -> None:
    messages = []
    for side in ("left", "right"):
        names = [f"{side}_{name}" for name in ALPHABETICAL]
        messages += [ur_message(k, name=names, topic=f"/{side}/joint_states") for k in range(20)]
    with pytest.raises(LogError, match="two arms were recorded"):
        read(write_joint_states(tmp_path / "x", messages))


def test_bags_without_joints_say_what_they_hold(tmp_path: Path) -> None:
    messages = [{"topic": "/wrench", "time": START + k, "force": (0.0, 0, 1)} for k in range(9)]
    with pytest.raises(LogError, match=r"no topic with joint positions among /wrench"):
        read(write_joint_states(tmp_path / "x", messages))


@pytest.mark.parametrize(("make", "code"), [(rosbag1, "chunks-missing"), (bare_mcap, "chunks-cut")])
def test_cut_files_are_read_up_to_their_last_whole_chunk(
    tmp_path: Path, make: Callable[[Path], Path], code: str
) -> None:
    path = make(tmp_path / "x")
    content = path.read_bytes()
    lengths = []
    for share in (0.9, 0.6, 0.4):
        path.write_bytes(content[: int(share * len(content))])
        recording = read(path)
        lengths.append(recording.samples)
        [cut] = [r for r in recording.source.remarks if r.level == "warning"]
        assert cut.code == code
        # Two topics of one rate, of which the second may have lost its last message.
        assert 2 * recording.samples - cut.values["kept"] in {0, 1}
        np.testing.assert_array_equal(recording.q, motion(7)["q"][: recording.samples])
    assert ROWS > lengths[0] > lengths[1] > lengths[2] > 1
    path.write_bytes(content[:2000])
    with pytest.raises(LogError, match="no messages in any whole chunk"):
        read(path)


def test_unclosed_ros1_bags_are_read(tmp_path: Path) -> None:
    path = rosbag1(tmp_path / "x")
    content = bytearray(path.read_bytes())
    place = content.index(b"index_pos=") + 10
    content[place : place + 8] = bytes(8)
    path.write_bytes(content)
    recording = read(path)
    assert_is_the_motion(recording)
    assert any("did not close the file" in reported for reported in recording.source.warnings)


def changed_index(path: Path, entry: Callable[[bytes], bytes]) -> Path:
    """A closed ROS 1 bag whose records behind each chunk, its index, are changed."""
    content = path.read_bytes()
    place, out = len(b"#ROSBAG V2.0\n"), [content[:13]]
    while place < len(content):
        head = place + 4 + int.from_bytes(content[place : place + 4], "little")
        end = head + 4 + int.from_bytes(content[head : head + 4], "little")
        record = content[place:end]
        out.append(entry(record) if b"op=\x04" in record[:60] else record)
        place = end
    path.write_bytes(b"".join(out))
    return path


def test_a_bag_without_the_index_of_its_chunks_is_read(tmp_path: Path) -> None:
    """A recorder that stopped between a chunk and its index."""
    assert_is_the_motion(read(changed_index(rosbag1(tmp_path / "x"), lambda _: b"")))


@pytest.mark.parametrize("by", [1, 100, 2**31])
def test_an_index_that_points_elsewhere_is_damage(tmp_path: Path, by: int) -> None:
    def moved(record: bytes) -> bytes:
        place = int.from_bytes(record[-4:], "little") + by
        return record[:-4] + place.to_bytes(4, "little")

    with pytest.raises(LogError, match="damaged"):
        read(changed_index(rosbag1(tmp_path / "x"), moved))


def test_messages_that_an_index_leaves_out_are_damage(tmp_path: Path) -> None:
    def shortened(record: bytes) -> bytes:
        size = int.from_bytes(record[51:55], "little") - 12
        return record[:51] + size.to_bytes(4, "little") + record[55:-12]

    with pytest.raises(LogError, match="a chunk and its index count differently"):
        read(changed_index(rosbag1(tmp_path / "x"), shortened))


def test_databases_without_definitions_know_the_usual_types(tmp_path: Path) -> None:
    import sqlite3

    path = bare_db3(tmp_path / "x")
    with sqlite3.connect(path) as db:
        db.execute("DROP TABLE message_definitions")
    with pytest.raises(LogError, match="no definition of franka_msgs/FrankaState"):
        read(path)  # only the current FrankaRobotState is known
    with sqlite3.connect(path) as db:
        db.execute("DELETE FROM messages WHERE topic_id = 1")
        db.execute("DELETE FROM topics WHERE id = 1")
    db.close()
    recording = read(path)
    np.testing.assert_array_equal(recording.q, motion(7)["q"])


def test_json_documents(tmp_path: Path) -> None:
    recording = read(mcap_json(tmp_path / "x"))
    np.testing.assert_array_equal(recording.q, motion()["q"])
    np.testing.assert_array_equal(recording.torque, motion()["tau"])
    assert recording.source.t0_ns == 10**9


def foxglove_joint_states(k: int) -> bytes:
    """A foxglove.JointStates message, written by hand from its published field numbers."""
    import struct

    def field(number: int, content: bytes) -> bytes:
        return bytes([number << 3 | 2, len(content)]) + content

    out = field(1, bytes([0x08, 100, 0x10]) + varint(k * 1_000_000))
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


def test_foxglove_joint_states(tmp_path: Path) -> None:
    from mcap.writer import Writer

    with (tmp_path / "x").open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="test")
        schema = writer.register_schema("foxglove.JointStates", "protobuf", b"")
        channel = writer.register_channel("/joints", "protobuf", schema)
        for k in range(30):
            writer.add_message(channel, k, foxglove_joint_states(k), k, k)
        writer.finish()
    recording = read(tmp_path / "x")
    np.testing.assert_allclose(recording.q[5], [1.05, 2.05, 3.05], rtol=1e-15)
    assert recording.torque is not None
    assert recording.torque[0].tolist() == [-1, -2, -3]
    assert recording.joint_names == ("joint1", "joint2", "joint3")
    assert recording.source.t0 == 100


def test_folders_that_are_no_bags(tmp_path: Path) -> None:
    folder = rosbag2(tmp_path / "x")
    shutil.move(next(folder.glob("*.mcap")), folder / "x.txt")
    with pytest.raises(LogError, match="not recognised"):
        read(folder)


def test_typestore_of_the_seeds_has_both_types() -> None:
    _, messages = bag_messages(ros1=True)
    assert {kind for _, kind, _, _ in messages} == {
        "franka_msgs/msg/FrankaState",
        "sensor_msgs/msg/JointState",
    }
