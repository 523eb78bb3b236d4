"""ROS messages as JSON in an MCAP: joints, efforts and wrenches by the rules of the binary ones."""

import json
from pathlib import Path

import numpy as np
import pytest
from seed_logs import ROWS, motion

from vftcli.readers import read
from vftcli.readers.joints import UR_NAMES
from vftcli.signals.wrench import WrenchFrame

START = 10**18
"""Stamp of the first message. [ns]"""


def stamp_of(time: int) -> dict[str, int]:
    return {"sec": time // 10**9, "nanosec": time % 10**9}


def messages(path: Path, names: tuple[str, ...], shift: float = 0.0) -> Path:
    """Joint states, a wrench every second sample that grows with time, and an odometry."""
    from mcap.writer import Writer

    log, axes = motion(), "xyz"
    with path.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="test")
        topics = ("/joint_states", "/ft/wrench", "/odom")
        channels = [writer.register_channel(topic, "json", 0) for topic in topics]
        for k in range(ROWS):
            time = START + round(log["t"][k] * 1e9)
            joints = {
                "header": {"stamp": stamp_of(time), "frame_id": ""}, "name": names[::-1],
                "position": log["q"][k][::-1].tolist(), "velocity": log["dq"][k][::-1].tolist(),
                "effort": log["tau"][k][::-1].tolist(),
            }  # fmt: skip
            parts = {"force": dict.fromkeys(axes, log["t"][k]), "torque": dict.fromkeys(axes, -1.0)}
            later = time + round(shift * 1e9)
            wrench = {"header": {"stamp": stamp_of(later), "frame_id": "tool0"}, "wrench": parts}
            held = [joints, wrench if k % 2 == 0 else None, {"pose": {"x": 1.0}}]
            for channel, document in zip(channels, held, strict=True):
                if document is not None:
                    writer.add_message(channel, time, json.dumps(document).encode(), time, k)
        writer.finish()
    return path


def test_a_wrench_is_kept_in_its_frame_and_the_rest_is_named(tmp_path: Path) -> None:
    recording = read(messages(tmp_path / "x", tuple(f"joint_{j}" for j in range(6))))
    np.testing.assert_array_equal(recording.torque, motion()["tau"])
    # Every second sample lies between two of the wrench, which is a straight line but at its end.
    force = recording.wrench[:-1, :3]
    np.testing.assert_allclose(force, np.repeat(recording.t[:-1, None], 3, axis=1), atol=1e-9)
    assert recording.wrench_frame == WrenchFrame("tool0", "tool0")
    told = {remark.code: remark.values for remark in recording.source.remarks}
    assert told["signal-interpolated"]["topic"] == "/ft/wrench"
    assert told["topics-left-out"]["topics"] == ("/odom",)


def test_the_effort_of_ur_joints_is_current_here_too(tmp_path: Path) -> None:
    recording = read(messages(tmp_path / "x", UR_NAMES))
    np.testing.assert_array_equal(recording.current, motion()["tau"])
    assert recording.torque is None
    assert recording.joint_names == UR_NAMES
    assert "effort-is-current" in {remark.code for remark in recording.source.remarks}


@pytest.mark.parametrize("shift", [0.2, -0.2])
def test_a_wrench_of_another_time_is_left_out_and_said(shift: float, tmp_path: Path) -> None:
    recording = read(messages(tmp_path / "x", UR_NAMES, shift=shift))
    assert recording.wrench is None
    assert "topic-too-short" in {remark.code for remark in recording.source.remarks}
