"""Topics of a bag on one clock: which leads, whose joints, what effort is, what is interpolated."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vftcli.readers.aliases import UR_NAMES
from vftcli.readers.reading import read
from vftcli.signals.errors import LogError
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import WrenchFrame

Message = dict[str, Any]


def write_joint_states(path: Path, messages: list[Message]) -> Path:
    """A ROS 1 bag of joint states; each dictionary holds a message's fields and its time."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC)
    types = store.types
    path.unlink(missing_ok=True)
    with Writer(path) as writer:
        connections: dict[str, Any] = {}
        for k, given in enumerate(messages):
            message = {"topic": "/joint_states", "stamp": True} | given
            topic, time = message["topic"], message["time"]
            stamp = time + message.get("ahead", 0) if message["stamp"] else 0
            sec, nanosec = divmod(stamp, 10**9)
            clock = types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
            frame = message.get("frame", "")
            header = types["std_msgs/msg/Header"](seq=k, stamp=clock, frame_id=frame)
            if "force" in message:
                kind = "geometry_msgs/msg/WrenchStamped"
                vector, body = (types[f"geometry_msgs/msg/{x}"] for x in ("Vector3", "Wrench"))
                wrench = body(force=vector(*message["force"]), torque=vector(0.0, 0.0, 0.0))
                typed = types[kind](header=header, wrench=wrench)
            else:
                kind = "sensor_msgs/msg/JointState"
                names = ("position", "velocity", "effort")
                fields = {name: np.array(message.get(name, []), dtype=float) for name in names}
                typed = types[kind](header=header, name=message["name"], **fields)
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            content = bytes(store.serialize_ros1(typed, kind)) + bytes(message.get("padding", 0))
            writer.write(connections[topic], time + 100, content)
    return path


ALPHABETICAL = sorted(UR_NAMES)
START = 1_700_000_000 * 10**9


def ur_message(k: int, **more: object) -> Message:
    position = [2.0, 1.0, 0.0, 3.0, 4.0, 5.0]
    base = {"time": START + k * 8_000_000, "name": ALPHABETICAL, "position": position}
    return base | {"velocity": [0.0] * 6, "effort": [0.2, 0.1, 0.0, 0.3, 0.4, 0.5]} | more


def arm_topic(
    name: str, count: int, joints: str = "abcdef", step: int = 8_000_000, **more: object
) -> list[Message]:
    """So many messages of one topic, every 8 ms, of joints of one letter each at 1, 2, … rad."""
    values = [1.0 + j for j in range(len(joints))]
    base = {"topic": name, "name": list(joints), "position": values} | more
    return [base | {"time": START + k * step} for k in range(count)]


def recorded(path: Path, *topics: list[Message], **how: Any) -> Recording:
    messages = sorted((m for topic in topics for m in topic), key=lambda message: message["time"])
    return read(write_joint_states(path, messages), **how)


UR_TOPIC = [ur_message(k) for k in range(20)]


def test_ur_joints_by_name_and_effort_as_current(path):
    recording = recorded(path, UR_TOPIC)
    assert recording.q[0].tolist() == [0, 1, 2, 3, 4, 5]
    assert recording.joint_names == UR_NAMES
    assert recording.torque is None
    np.testing.assert_allclose(recording.require("current")[0], 0.1 * np.arange(6), rtol=1e-12)
    assert any("motor current [A]" in repair for repair in recording.source.repairs)
    assert "header stamps" in recording.source.clock


@pytest.mark.parametrize(
    ("columns", "signal", "sign"),
    [("tau=effort", "torque", 1), ("-current=effort", "current", -1)],
)
def test_columns_say_what_effort_is(path, columns, signal, sign):
    recording = recorded(path, UR_TOPIC, columns=columns)
    expected = sign * 0.1 * np.arange(6)
    np.testing.assert_allclose(getattr(recording, signal)[0], expected, rtol=1e-12)
    assert len({"torque", "current"} & set(recording.signals)) == 1
    with pytest.raises(LogError, match="no field 'nonsense'; it has position"):
        read(path, columns="tau=nonsense")


def test_merged_topics_with_a_gripper_and_changing_order(path):
    """Messages of one topic in two orders, with fingers, and gripper-only ones in between."""
    arm = [f"panda_joint{j}" for j in range(1, 8)]
    fingers, messages = ["panda_finger_joint1", "panda_finger_joint2"], []
    for k in range(40):
        values = [float(j) + 0.001 * k for j in range(7)]
        names, values = (arm[::-1], values[::-1]) if k % 2 else (fingers + arm, [9, 9, *values])
        message = dict.fromkeys(("position", "velocity", "effort"), values)
        messages.append(message | {"time": START + k * 1_000_000, "name": names})
    messages += [{"time": START + 10**9 + k, "name": ["f"], "position": [1.0]} for k in range(5)]
    recording = recorded(path, messages)
    expected = np.arange(7.0) + 0.001 * np.arange(40)[:, None]
    np.testing.assert_allclose(recording.q, expected, rtol=1e-15)
    assert recording.robot_hint == "panda"


def test_bytes_behind_a_message_are_counted(path):
    words = r"sensor_msgs/JointState \(5 bytes too many\)\. The bag is"
    with pytest.raises(LogError, match=words):
        recorded(path, [ur_message(k, padding=5 * (k == 9)) for k in range(20)])


def test_empty_and_nan_velocities_are_missing_signals(path):
    messages = [ur_message(k, velocity=[], effort=[np.nan] * 6) for k in range(20)]
    recording = recorded(path, messages)
    assert recording.signals == ("q",)
    assert any("NaN in every message" in repair for repair in recording.source.repairs)


def test_receive_stamps_where_headers_are_unset(path):
    messages = [ur_message(40 * k, stamp=False) for k in range(20)]
    recording = recorded(path, messages)
    np.testing.assert_allclose(recording.t, 0.32 * np.arange(20), atol=1e-9)
    assert recording.source.t0_ns == START + 100
    assert "receive stamps" in recording.source.clock
    for message in messages:  # stamps that begin twice alike are set all the same
        message["stamp"] = True
    messages[1]["time"] = START
    assert recorded(path, messages).source.clock == "header stamps of /joint_states"


def test_a_wrench_of_another_rate_is_interpolated(path):
    wrench = arm_topic("/wrench", 400, step=1_000_000, frame="tool0")
    for k, message in enumerate(wrench):
        message["time"] += 300_000
        message["force"] = (0.001 * (k + 0.3), 0.0, -5.0)
    recording = recorded(path, arm_topic("/arm", 50), wrench)
    inner = slice(1, -1)  # the ends are held
    expected = 0.001 * 8 * np.arange(50)[inner]
    np.testing.assert_allclose(recording.require("wrench")[inner, 0], expected, atol=1e-9)
    assert recording.wrench_frame == WrenchFrame("tool0", "tool0")
    assert any("interpolated wrench of /wrench (1000 Hz)" in r for r in recording.source.repairs)


def test_columns_state_the_frame_and_sign_of_a_bags_wrench(path):
    """What a refused frame asks for, "--columns wrench[base]=…", without a field's name."""
    wrench = arm_topic("/wrench", 20, force=(1.0, 0, -5.0), frame="ft")
    plain = recorded(path, UR_TOPIC, wrench).require("wrench")
    stated = read(path, columns="wrench[base@tool,by-robot]")
    assert stated.wrench_frame == WrenchFrame("base", "tool", "by-robot")
    np.testing.assert_array_equal(stated.wrench, plain)
    turned = read(path, columns="-wrench[sensor],-dq")
    assert turned.wrench_frame == WrenchFrame("sensor", "sensor")
    np.testing.assert_array_equal(turned.wrench, -plain)
    with pytest.raises(LogError, match="no topic has one"):
        recorded(path, UR_TOPIC, columns="wrench[base]")


def test_a_converted_log_of_an_earlier_version_reads_without_a_frame(path):
    """Its frame_id is a sentence, which was refused as the user's mistake."""
    sentence = "base axes, moment about the flange point"
    wrench = arm_topic("/vftcli/wrench", 20, force=(1.0, 0.0, 0.0), frame=sentence)
    recording = recorded(path, UR_TOPIC, wrench)
    assert (recording.wrench is None, recording.wrench_frame) == (False, None)


def test_bags_without_joints_say_what_they_hold(path):
    wrench = arm_topic("/wrench", 9, force=(0.0, 0, 1))
    with pytest.raises(LogError, match=r"no topic with joint positions among /wrench"):
        recorded(path, wrench)
    more = [arm_topic(f"/w{k:02}", 1, force=(0.0, 0, 1)) for k in range(15)]
    # Twelve topics are named.
    with pytest.raises(LogError, match=r", /w10 \(geometry_msgs/WrenchStamped\)\. Record a"):
        recorded(path, wrench, *more)


@pytest.mark.parametrize(
    ("topics", "lead"),
    [
        ([("/arm", 50, {}), ("/arm_desired", 90, {})], "/arm"),
        ([("/arm", 50, {}), ("/gripper", 90, {"joints": "uv"})], "/arm"),
        ([("/a", 50, {}), ("/b", 45, {"effort": [1.0] * 6})], "/b"),  # 9 in 10 are one rate
        ([("/a", 50, {}), ("/b", 44, {"effort": [1.0] * 6})], "/a"),
        ([("/a", 48, {}), ("/b", 50, {})], "/b"),
        ([("/a", 50, {}), ("/other", 44, {"joints": "uvwxyz"})], "/a"),
        ([("/a", 50, {}), ("/track", 48, {"joints": "uvwxyzt"})], "/a"),
        ([("/a", 2, {}), ("/b", 1, {"effort": [1.0] * 6})], "/a"),
        ([("/pair", 5, {"joints": "uv"})], "/pair"),
    ],
)
def test_the_topic_of_the_arm_leads(path, topics, lead):
    """The measured one of most joints and messages; of one rate the one with efforts."""
    made = (arm_topic(name, count, **more) for name, count, more in topics)
    recording = recorded(path, *made)
    assert recording.source.clock.startswith(f"header stamps of {lead}")
    assert recording.samples == next(count for name, count, _ in topics if name == lead)


def test_one_of_two_arms_is_read_where_columns_name_it(path):
    left, right = (arm_topic(f"/{side}", 20, side[:1] + "bcdef") for side in ("left", "right"))
    words = r"two arms were recorded: /left, /right \(l, b… and r, b…\).*'q=/left.position'"
    with pytest.raises(LogError, match=words):
        recorded(path, left, right)
    for side in ("left", "right"):
        assert read(path, columns=f"q=/{side}.position").joint_names[0] == side[:1]


@pytest.mark.parametrize(
    ("joints", "given", "found"),
    [
        ("abcdef", "position velocity", [1, 2, 3, 4, 5, 6]),
        ("fedcba", "position velocity", [6, 5, 4, 3, 2, 1]),
        ("abcdefg", "position velocity", [1, 2, 3, 4, 5, 6]),
        ("gabcdef", "position velocity", [2, 3, 4, 5, 6, 7]),
        ("gabcdef", "velocity effort", [2, 3, 4, 5, 6, 7]),
        ("abcde", "position velocity", None),
        ("uvwxyz", "position velocity", None),
        ("uvwxyzt", "position velocity", None),
        ("", "position velocity", [1, 2, 3, 4, 5, 6]),  # no joints by name: by their number
        ("", "position velocity more", None),
        ("abcdef", "velocity", None),
    ],
)
def test_another_topic_gives_velocities_of_the_leading_one_s_joints(path, joints, given, found):
    """By their names, whatever their order and whatever other joints it has."""
    count = len(joints) or 6 + given.endswith("more")
    values = {name: [1.0 + j for j in range(count)] for name in given.split()}
    other = arm_topic("/other", 40, joints, 10_000_000, **{"position": []} | values)
    recording = recorded(path, arm_topic("/arm", 50), other)
    assert recording.q[0].tolist() == [1, 2, 3, 4, 5, 6]
    assert recording.signals == (("q",) if found is None else ("q", "dq"))
    if found is not None:
        # a weighted mean of two equal numbers
        np.testing.assert_allclose(recording.require("dq")[-1], found, rtol=1e-15)
    codes = {remark.code for remark in recording.source.remarks}
    assert codes == {"topics-left-out" if found is None else "signal-interpolated"}


def test_what_other_topics_command_is_no_measurement(path):
    command = arm_topic("/arm/command", 50, velocity=[1.0] * 6)
    assert recorded(path, arm_topic("/arm", 50), command).dq is None


@pytest.mark.parametrize(("lead", "other"), [(0, 0), (5, 5), (5, None), (None, 5), (None, None)])
def test_stamps_are_compared_with_stamps_of_one_clock(path, lead, other):
    """Headers that run 5 s ahead of the recorder, or are unset: what is of one instant meets."""

    def stamped(ahead: int | None) -> Message:
        return {"stamp": ahead is not None, "ahead": (ahead or 0) * 10**9}

    arm = arm_topic("/arm", 50, **stamped(lead))
    wrench = arm_topic("/wrench", 200, step=2_000_000, **stamped(other))
    for k, message in enumerate(wrench):
        message["force"] = (0.002 * k, 0.0, 0.0)
    found = recorded(path, arm, wrench).require("wrench")[:, 0]
    # stamps are whole nanoseconds
    np.testing.assert_allclose(found, 0.008 * np.arange(50), atol=2e-9)


@pytest.mark.parametrize(
    ("first", "last", "kept"),
    [(0, 320, True), (0, 300, False), (76, 396, True), (84, 404, False)],
)
def test_a_wrench_is_held_where_it_misses_a_twentieth_of_the_motion(path, first, last, kept):
    """Joints every 8 ms up to 392 ms, a wrench every 20 ms: 4 or 6 % lie more than 60 ms away."""
    wrench = [
        {"topic": "/wrench", "time": START + 10**6 * time, "force": (float(time), 0.0, 0.0)}
        for time in range(first, last + 1, 20)
    ]
    recording = recorded(path, arm_topic("/arm", 50), wrench)
    codes = {remark.code for remark in recording.source.remarks}
    assert ("topic-too-short" in codes) != kept
    if not kept:
        assert recording.wrench is None
        return
    expected = np.clip(8 * np.arange(50), first, last)  # [ms]
    np.testing.assert_allclose(recording.require("wrench")[:, 0], expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("topics", "taken"),
    [
        ({"/ft_a": 40, "/ft-b/wrench": 50}, "/ft-b/wrench"),  # a hyphen was no letter of a name
        ({"/ft_b": 50, "/ft_a": 40}, "/ft_b"),
        ({"/franka/F_ext": 50, "/ft": 40}, "/ft"),
        ({"/franka/F_ext": 50}, "/franka/F_ext"),
    ],
)
def test_the_sensor_s_fullest_topic_gives_the_wrench(path, topics, taken):
    slow = {"step": 10_000_000}
    forces = [arm_topic(name, n, force=(float(n), 0, 0), **slow) for name, n in topics.items()]
    recording = recorded(path, arm_topic("/arm", 50), *forces)
    assert recording.require("wrench")[0, 0] == topics[taken]
    left = sorted(topics.keys() - {taken})
    found = [r.values["topics"] for r in recording.source.remarks if r.code == "topics-left-out"]
    assert found == ([tuple(left)] if left else [])


def test_topics_that_are_left_out_are_named_those_with_forces_first(path):
    others = [arm_topic(name, 20, "uv") for name in (*(f"/g{k}" for k in range(6)), "/z/force")]
    (left,) = recorded(path, arm_topic("/arm", 20), *others).source.remarks
    assert left.values["topics"] == ("/z/force", "/g0", "/g1", "/g2", "/g3", "/g4")


def test_messages_of_the_leading_topic_with_other_signals_are_left_out(path):
    messages = arm_topic("/arm", 50, velocity=[0.5] * 6)
    for message in messages[10:14]:
        message["velocity"] = []
    recording = recorded(path, messages)
    assert recording.samples == 46
    (said,) = [r for r in recording.source.remarks if r.code == "messages-left-out"]
    assert (said.values["messages"], said.values["signals"]) == (4, ("q",))
