"""JointState and WrenchStamped as JSON documents in an MCAP: the rules of every other bag."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from seed_logs import mcap_json, motion, write_mcap

from vftcli.readers.aliases import UR_NAMES
from vftcli.readers.reading import read

ROWS, START = 25, 1_750_000_000_000_000_001
ALPHABETICAL = sorted(UR_NAMES)
Q = 0.1 * np.arange(6) + 0.01 * np.arange(ROWS)[:, None]
"""Positions, base to tip. (25, 6) [rad]"""


def stamp(k: int) -> dict[str, Any]:
    whole = START + k * 8_000_000
    return {"sec": whole // 10**9, "nanosec": whole % 10**9}


def joint_state(k: int) -> dict[str, Any]:
    values = Q[k, [UR_NAMES.index(name) for name in ALPHABETICAL]]
    return {
        "header": {"stamp": stamp(k), "frame_id": ""}, "name": ALPHABETICAL,
        "position": values.tolist(), "velocity": (1 + values).tolist(),
        "effort": (2 + values).tolist(),
    }  # fmt: skip


def wrench(k: int) -> dict[str, Any]:
    axes = dict(zip("xyz", (1.0 + k, 2.0, 3.0), strict=True))
    return {
        "header": {"stamp": stamp(k), "frame_id": "tool0"},
        "wrench": {"force": axes, "torque": {axis: -value for axis, value in axes.items()}},
    }


def mcap(path: Path, **topics: Any) -> Path:
    """An MCAP whose topics hold JSON documents: what a function makes of the sample's number."""
    return write_mcap(path, (
        (f"/{name}", START + k * 8_000_000, json.dumps(make(k)).encode())
        for k in range(ROWS) for name, make in topics.items()
    ))  # fmt: skip


def test_effort_names_and_wrench_are_taken_as_from_ros_messages(path):
    log = read(mcap(path, joint_states=joint_state, ft=wrench))
    assert log.joint_names == UR_NAMES
    np.testing.assert_array_equal(log.q, Q)
    np.testing.assert_array_equal(log.require("current"), 2 + Q)
    assert log.torque is None
    expected = [[1 + k, 2, 3, -1 - k, -2, -3] for k in range(ROWS)]
    np.testing.assert_array_equal(log.require("wrench"), expected)
    assert str(log.wrench_frame).startswith("tool0 axes at tool0")
    assert log.source.t0_ns == START
    stated = read(path, columns="tau=effort")
    np.testing.assert_array_equal(stated.require("torque"), 2 + Q)
    assert stated.current is None


def test_plain_documents(path):
    log = read(mcap_json(path))
    np.testing.assert_array_equal(log.q, motion()["q"])
    np.testing.assert_array_equal(log.torque, motion()["tau"])
    assert log.source.t0_ns == 10**9


@pytest.mark.parametrize("state", [joint_state, lambda k: {"q": Q[k].tolist()}])
def test_a_wrench_that_is_not_taken_is_named(path, state):
    path = mcap(path, joints=state, wrench_of_hand=lambda k: {"force": [k, 0.0, 0.0]})
    (left,) = [r for r in read(path).source.remarks if r.code == "topics-left-out"]
    assert left.values["topics"] == ("/wrench_of_hand",)


@pytest.mark.parametrize(
    ("own", "clock"),
    [
        ({"sec": 1, "nanosec": 5}, "header stamps"),
        ({"sec": 8_999_999_999, "nanosec": 5}, "header stamps"),
        ({"sec": 9_000_000_000, "nanosec": 5}, "log time of the recorder"),
        ({"sec": 1, "nanosec": 10**10}, "log time of the recorder"),
        ({"sec": 1.5, "nanosec": 5}, "log time of the recorder"),
    ],
)
def test_a_stamp_is_whole_seconds_and_nanoseconds_of_some_centuries(path, own, clock):
    def stamped(k: int) -> dict[str, Any]:
        later = own | {"nanosec": own["nanosec"] + 8_000_000 * k}
        return joint_state(k) | {"header": {"stamp": later, "frame_id": ""}}

    log = read(mcap(path, joint_states=stamped))
    assert log.source.clock.startswith(clock)
    np.testing.assert_allclose(log.t, 0.008 * np.arange(ROWS), atol=1e-9)
