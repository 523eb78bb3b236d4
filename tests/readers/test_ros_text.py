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

FIELDS = ("position", "velocity", "effort")
Q = 0.1 * np.arange(6) + 0.01 * np.arange(ROWS)[:, None]
"""Positions, base to tip. (40, 6) [rad]"""


def rows(names: Sequence[str]) -> list[list[float]]:
    """Positions, velocities 1 + q and efforts 2 + q of each row, in the order of some names."""
    base = [*UR_NAMES, "finger"]
    q = np.hstack([Q, np.full((ROWS, 1), 9.0)])[:, [base.index(name) for name in names]]
    return np.hstack([q, 1 + q, 2 + q]).tolist()


def numbered(names: Sequence[str], sep: str, *fields: str) -> str:
    return ",".join(f"{field}{sep}{k}" for field in fields for k in range(len(names)))


def written(path: Path, *lines: list[object] | str) -> Path:
    texts = (line if isinstance(line, str) else ",".join(map(str, line)) for line in lines)
    path.write_text("\n".join(texts) + "\n", "utf-8")
    return path


def bagpy(path: Path, names: Sequence[str] = ALPHABETICAL) -> Path:
    """As bagpy's message_by_topic writes it: the recorder's Time 0.3 ms behind, and uneven."""
    head = "Time,header.seq,header.stamp.secs,header.stamp.nsecs,header.frame_id,name,"
    lines: list[list[object]] = []
    for k, row in enumerate(rows(names)):
        stamp, time = START + k * STEP, (START + k * STEP) * 1e-9 + 3e-4 * (k % 2)
        lines.append([time, k, stamp // 10**9, stamp % 10**9, "", f'"{[*names]}"', *row])
    return written(path, head + numbered(names, "_", *FIELDS), *lines)


def rostopic(path: Path, names: Sequence[str] = ALPHABETICAL) -> Path:
    """As rostopic echo -p prints it."""
    head = "%time,field.header.seq,field.header.stamp,field.header.frame_id,"
    lines: list[list[object]] = []
    for k, row in enumerate(rows(names)):
        stamp = START + k * STEP
        lines.append([stamp + 300_000 * (k % 2), k, stamp, "", *names, *row])
    fields = (f"field.{field}" for field in ("name", *FIELDS))
    return written(path, head + numbered(names, "", *fields), *lines)


def ros2_echo(path: Path, names: Sequence[str] = ALPHABETICAL) -> Path:
    """As ros2 topic echo --csv prints it: no header."""
    stamps = (START + k * STEP for k in range(ROWS))
    heads = ([stamp // 10**9, stamp % 10**9, "base_link", *names] for stamp in stamps)
    return written(path, *([*head, *row] for head, row in zip(heads, rows(names), strict=True)))


WRITERS = {"bagpy": bagpy, "rostopic": rostopic, "ros2-echo": ros2_echo}


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("gripper", [(), ("finger",)])
def test_the_names_give_the_order_and_the_header_the_clock(name, gripper, path):
    """A gripper beside UR's joints is set aside."""
    WRITERS[name](path, (*gripper, *ALPHABETICAL))
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
    stated = read(path, columns="tau=effort")
    assert stated.current is None
    np.testing.assert_allclose(stated.require("torque"), 2 + Q, atol=1e-15)
    np.testing.assert_allclose(stated.q, Q, atol=1e-15)


@pytest.mark.parametrize("name", WRITERS)
def test_rows_of_other_joints_are_refused(name, path):
    WRITERS[name](path)
    *lines, last = path.read_text("utf-8").splitlines()
    written(path, *lines, last.replace("elbow_joint", "other"))
    with pytest.raises(LogError, match="rows name different joints"):
        read(path)


def test_a_list_of_names_that_is_none_is_refused(path):
    bagpy(path)
    path.write_text(path.read_text("utf-8").replace("['elbow_joint'", "[elbow"), "utf-8")
    with pytest.raises(LogError, match="holds no list of joints"):
        read(path)
