"""Topics of a bag on one clock: which leads, whose joints, what effort is, what is interpolated."""

from pathlib import Path

import numpy as np
import pytest

from vftcli.readers.reading import read
from vftcli.signals.errors import LogError
from vftcli.signals.wrench import WrenchFrame


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
            stamp = time + int(message.get("ahead", 0)) if message["stamp"] else 0  # type: ignore[call-overload]
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
            content = bytes(store.serialize_ros1(typed, kind)) + bytes(message.get("padding", 0))  # type: ignore[call-overload]
            writer.write(connections[topic], time + 100, content)
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
    ("columns", "signal", "sign"),
    [("tau=effort", "torque", 1), ("-current=effort", "current", -1)],
)
def test_columns_say_what_effort_is(tmp_path: Path, columns: str, signal: str, sign: int) -> None:
    path = write_joint_states(tmp_path / "x", [ur_message(k) for k in range(20)])
    recording = read(path, columns=columns)
    np.testing.assert_allclose(
        getattr(recording, signal)[0], sign * 0.1 * np.arange(6), rtol=1e-12
    )
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


def test_bytes_behind_a_message_are_counted(tmp_path: Path) -> None:
    messages = [ur_message(k, padding=5 * (k == 9)) for k in range(20)]
    with pytest.raises(
        LogError, match=r"sensor_msgs/JointState \(5 bytes too many\)\. The bag is"
    ):
        read(write_joint_states(tmp_path / "x", messages))


def test_empty_and_nan_velocities_are_missing_signals(tmp_path: Path) -> None:
    messages = [ur_message(k, velocity=[], effort=[np.nan] * 6) for k in range(20)]
    recording = read(write_joint_states(tmp_path / "x", messages))
    assert recording.signals == ("q",)
    assert any("NaN in every message" in repair for repair in recording.source.repairs)


def test_receive_stamps_where_headers_are_unset(tmp_path: Path) -> None:
    messages = [ur_message(40 * k, stamp=False) for k in range(20)]
    recording = read(write_joint_states(tmp_path / "x", messages))
    np.testing.assert_allclose(recording.t, 0.32 * np.arange(20), atol=1e-9)
    assert recording.source.t0_ns == START + 100
    for message in messages:  # stamps that begin twice alike are set all the same
        message["stamp"] = True
    messages[1]["time"] = START
    clock = read(write_joint_states(tmp_path / "y", messages)).source.clock
    assert clock == "header stamps of /joint_states"
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
        messages.append(
            {"topic": "/wrench", "time": time, "force": (1.0, 0, -5.0), "frame": "ft"}
        )
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


def test_bags_without_joints_say_what_they_hold(tmp_path: Path) -> None:
    messages = [{"topic": "/wrench", "time": START + k, "force": (0.0, 0, 1)} for k in range(9)]
    with pytest.raises(LogError, match=r"no topic with joint positions among /wrench"):
        read(write_joint_states(tmp_path / "x", messages))
    more = [messages[0] | {"topic": f"/w{k:02}", "time": START + 50 + k} for k in range(15)]
    # Twelve topics are named.
    with pytest.raises(LogError, match=r", /w10 \(geometry_msgs/WrenchStamped\)\. Record a"):
        read(write_joint_states(tmp_path / "y", messages + more))


def arm_topic(
    name: str, count: int, joints: str = "abcdef", step: int = 8_000_000, **more: object
) -> list[dict[str, object]]:
    """So many messages of one topic, every 8 ms, of joints of one letter each at 1, 2, … rad."""
    values = [1.0 + j for j in range(len(joints))]
    base = {"topic": name, "name": list(joints), "position": values} | more
    return [base | {"time": START + k * step} for k in range(count)]


def in_time(*topics: list[dict[str, object]]) -> list[dict[str, object]]:
    return sorted((m for topic in topics for m in topic), key=lambda message: message["time"])


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
def test_the_topic_of_the_arm_leads(tmp_path: Path, topics, lead: str) -> None:
    """The measured one of most joints and messages; of one rate the one with efforts."""
    messages = in_time(*(arm_topic(name, count, **more) for name, count, more in topics))
    recording = read(write_joint_states(tmp_path / "x", messages))
    assert recording.source.clock.startswith(f"header stamps of {lead}")
    assert recording.samples == next(count for name, count, _ in topics if name == lead)


def test_one_of_two_arms_is_read_where_columns_name_it(tmp_path: Path) -> None:
    left, right = (arm_topic(f"/{side}", 20, side[:1] + "bcdef") for side in ("left", "right"))
    bag = write_joint_states(tmp_path / "x", in_time(left, right))
    with pytest.raises(
        LogError,
        match=r"two arms were recorded: /left, /right \(l, b… and r, b…\).*'q=/left.position'",
    ):
        read(bag)
    for side in ("left", "right"):
        recording = read(bag, columns=f"q=/{side}.position")
        assert recording.joint_names[0] == side[:1]


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
def test_another_topic_gives_the_velocities_of_the_leading_one_s_joints(
    tmp_path: Path, joints: str, given: str, found: list[int] | None
) -> None:
    """By their names, whatever their order and whatever other joints it has."""
    count = len(joints) or 6 + given.endswith("more")
    values = {name: [1.0 + j for j in range(count)] for name in given.split()}
    other = arm_topic("/other", 40, joints, 10_000_000, **{"position": []} | values)
    messages = in_time(arm_topic("/arm", 50), other)
    recording = read(write_joint_states(tmp_path / "x", messages))
    assert recording.q[0].tolist() == [1, 2, 3, 4, 5, 6]
    assert recording.signals == (("q",) if found is None else ("q", "dq"))
    if found is not None:
        # a weighted mean of two equal numbers
        np.testing.assert_allclose(recording.require("dq")[-1], found, rtol=1e-15)
    codes = {remark.code for remark in recording.source.remarks}
    assert codes == {"topics-left-out" if found is None else "signal-interpolated"}


def test_what_other_topics_command_is_no_measurement(tmp_path: Path) -> None:
    messages = in_time(arm_topic("/arm", 50), arm_topic("/arm/command", 50, velocity=[1.0] * 6))
    assert read(write_joint_states(tmp_path / "x", messages)).dq is None


@pytest.mark.parametrize(("lead", "other"), [(0, 0), (5, 5), (5, None), (None, 5), (None, None)])
def test_stamps_are_compared_with_stamps_of_one_clock(
    tmp_path: Path, lead: int | None, other: int | None
) -> None:
    """Headers that run 5 s ahead of the recorder, or are unset: what is of one instant meets."""
    messages = in_time(arm_topic("/arm", 50), arm_topic("/wrench", 200, step=2_000_000))
    for message in messages:
        ahead = lead if message["topic"] == "/arm" else other
        message["stamp"] = ahead is not None
        message["ahead"] = (ahead or 0) * 10**9
        if message["topic"] == "/wrench":
            message["force"] = ((message["time"] - START) * 1e-9, 0.0, 0.0)
    recording = read(write_joint_states(tmp_path / "x", messages))
    # stamps are whole nanoseconds
    np.testing.assert_allclose(
        recording.require("wrench")[:, 0], 0.008 * np.arange(50), atol=2e-9
    )


@pytest.mark.parametrize(
    ("first", "last", "kept"),
    [(0, 320, True), (0, 300, False), (76, 396, True), (84, 404, False)],
)
def test_a_wrench_is_held_where_it_misses_no_more_than_a_twentieth_of_the_motion(
    tmp_path: Path, first: int, last: int, kept: bool
) -> None:
    """Joints every 8 ms up to 392 ms, a wrench every 20 ms: 4 or 6 % lie more than 60 ms away."""
    messages = arm_topic("/arm", 50)
    for time in range(first, last + 1, 20):
        at = {"time": START + 10**6 * time, "force": (float(time), 0.0, 0.0)}
        messages.append({"topic": "/wrench"} | at)
    recording = read(write_joint_states(tmp_path / "x", in_time(messages)))
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
def test_the_sensor_s_fullest_topic_gives_the_wrench(
    tmp_path: Path, topics: dict[str, int], taken: str
) -> None:
    forces = [
        arm_topic(name, count, step=10_000_000, force=(float(count), 0.0, 0.0))
        for name, count in topics.items()
    ]
    recording = read(write_joint_states(tmp_path / "x", in_time(arm_topic("/arm", 50), *forces)))
    assert recording.require("wrench")[0, 0] == topics[taken]
    left = sorted(topics.keys() - {taken})
    found = [r.values["topics"] for r in recording.source.remarks if r.code == "topics-left-out"]
    assert found == ([tuple(left)] if left else [])


def test_topics_that_are_left_out_are_named_those_with_forces_first(tmp_path: Path) -> None:
    others = [arm_topic(f"/g{k}", 20, "uv") for k in range(6)] + [arm_topic("/z/force", 20, "uv")]
    messages = in_time(arm_topic("/arm", 20), *others)
    (left,) = read(write_joint_states(tmp_path / "x", messages)).source.remarks
    assert left.values["topics"] == ("/z/force", "/g0", "/g1", "/g2", "/g3", "/g4")


def test_messages_of_the_leading_topic_with_other_signals_are_left_out_and_said(
    tmp_path: Path,
) -> None:
    messages = arm_topic("/arm", 50, velocity=[0.5] * 6)
    for message in messages[10:14]:
        message["velocity"] = []
    recording = read(write_joint_states(tmp_path / "x", messages))
    assert recording.samples == 46
    (said,) = (r for r in recording.source.remarks if r.code == "messages-left-out")
    assert (said.values["messages"], said.values["signals"]) == (4, ("q",))
