"""What bagpy, rostopic and ros2 topic echo print of JointState topics: names, clock, effort."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from vftcli.readers.aliases import UR_NAMES
from vftcli.readers.reading import read, recognise
from vftcli.signals.errors import LogError

START = 1_750_000_000_123_456_789
ROWS, STEP = 40, 8_000_000
ALPHABETICAL = sorted(UR_NAMES)
"""The order in which the ROS 1 driver publishes: the elbow first."""

Q = 0.1 * np.arange(6) + 0.01 * np.arange(ROWS)[:, None]
"""Positions, base to tip. (40, 6) [rad]"""


def rows(names: Sequence[str]) -> list[list[float]]:
    """Positions, velocities 1 + q and efforts 2 + q of each row, in the order of some names."""
    base = [*UR_NAMES, "finger"]
    q = np.hstack([Q, np.full((ROWS, 1), 9.0)])[:, [base.index(name) for name in names]]
    return np.hstack([q, 1 + q, 2 + q]).tolist()


def numbered(name: str, names: Sequence[str], sep: str) -> str:
    return ",".join(f"{name}{sep}{k}" for k in range(len(names)))


def bagpy(path: Path, names: Sequence[str] = ALPHABETICAL) -> Path:
    """As bagpy's message_by_topic writes it: the recorder's Time 0.3 ms behind, and uneven."""
    fields = [numbered(field, names, "_") for field in ("position", "velocity", "effort")]
    lines = [
        "Time,header.seq,header.stamp.secs,header.stamp.nsecs,header.frame_id,name,"
        + ",".join(fields)
    ]
    for k, row in enumerate(rows(names)):
        stamp = START + k * STEP
        listed = "[" + ", ".join(f"'{name}'" for name in names) + "]"
        cells = [
            stamp * 1e-9 + 3e-4 * (k % 2),
            k,
            stamp // 10**9,
            stamp % 10**9,
            "",
            f'"{listed}"',
        ]
        lines.append(",".join(map(str, [*cells, *row])))
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


def rostopic(path: Path, names: Sequence[str] = ALPHABETICAL) -> Path:
    """As rostopic echo -p prints it."""
    fields = [
        numbered(f"field.{field}", names, "")
        for field in ("name", "position", "velocity", "effort")
    ]
    lines = [
        "%time,field.header.seq,field.header.stamp,field.header.frame_id," + ",".join(fields)
    ]
    for k, row in enumerate(rows(names)):
        stamp = START + k * STEP
        lines.append(",".join(map(str, [stamp + 300_000 * (k % 2), k, stamp, "", *names, *row])))
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


def ros2_echo(path: Path, names: Sequence[str] = ALPHABETICAL) -> Path:
    """As ros2 topic echo --csv prints it: no header."""
    lines = []
    for k, row in enumerate(rows(names)):
        stamp = START + k * STEP
        lines.append(
            ",".join(map(str, [stamp // 10**9, stamp % 10**9, "base_link", *names, *row]))
        )
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


WRITERS = {"bagpy": bagpy, "rostopic": rostopic, "ros2-echo": ros2_echo}


@pytest.mark.parametrize("name", WRITERS)
def test_the_names_give_the_order_and_the_header_the_clock(name: str, tmp_path: Path) -> None:
    path = WRITERS[name](tmp_path / "log")
    assert recognise(path).name == name
    log = read(path)
    assert log.joint_names == UR_NAMES
    assert log.source.t0_ns == START
    # Whole nanoseconds: no stamp is rounded.
    np.testing.assert_array_equal(log.t, np.arange(ROWS) * STEP * 1e-9)
    np.testing.assert_allclose(log.q, Q, atol=1e-15)
    np.testing.assert_allclose(log.require("dq"), 1 + Q, atol=1e-15)
    np.testing.assert_allclose(log.require("current"), 2 + Q, atol=1e-15)
    assert log.torque is None
    assert "effort-is-current" in {remark.code for remark in log.source.remarks}


@pytest.mark.parametrize("name", WRITERS)
def test_an_effort_that_is_said_to_be_torque_is_torque(name: str, tmp_path: Path) -> None:
    path = WRITERS[name](tmp_path / "log")
    log = read(path, columns="tau=effort")
    assert log.current is None
    np.testing.assert_allclose(log.require("torque"), 2 + Q, atol=1e-15)
    np.testing.assert_allclose(log.q, Q, atol=1e-15)


@pytest.mark.parametrize("name", WRITERS)
def test_a_gripper_beside_urs_joints_is_set_aside(name: str, tmp_path: Path) -> None:
    log = read(WRITERS[name](tmp_path / "log", ("finger", *ALPHABETICAL)))
    assert log.joint_names == UR_NAMES
    np.testing.assert_allclose(log.q, Q, atol=1e-15)


@pytest.mark.parametrize("name", WRITERS)
def test_rows_of_other_joints_are_refused(name: str, tmp_path: Path) -> None:
    path = WRITERS[name](tmp_path / "log")
    *lines, last = path.read_text("utf-8").splitlines()
    path.write_text("\n".join([*lines, last.replace("elbow_joint", "other")]) + "\n", "utf-8")
    with pytest.raises(LogError, match="rows name different joints"):
        read(path)


def test_a_list_of_names_that_is_none_is_refused(tmp_path: Path) -> None:
    path = bagpy(tmp_path / "log")
    path.write_text(path.read_text("utf-8").replace("['elbow_joint'", "[elbow"), "utf-8")
    with pytest.raises(LogError, match="holds no list of joints"):
        read(path)
