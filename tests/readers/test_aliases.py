"""Columns found by their names: joints in them and their order along the arm, clocks."""

import random
from pathlib import Path

import numpy as np
import pytest

from vftcli.readers.aliases import ALIASES, CLOCKS, UR_NAMES, kinematic_order, robot_of
from vftcli.readers.columns import SIGNALS
from vftcli.readers.reading import read
from vftcli.signals.errors import LogError

FRANKA = [f"fr3_joint{j}" for j in range(1, 8)]
ROWS = 30
CLOCK: dict[str, object] = {"t": np.arange(ROWS) * 0.01}


def write(path: Path, columns: dict[str, object]) -> Path:
    """A CSV of columns; one number fills a column."""
    filled = [np.broadcast_to(np.asarray(value), ROWS).tolist() for value in columns.values()]
    lines = [",".join(columns), *(",".join(map(str, row)) for row in zip(*filled, strict=True))]
    path.write_text("\n".join(lines) + "\n", "utf-8")
    return path


@pytest.mark.parametrize("header", ["Joint {j} {signal} [{unit}]", "{signal}_{j} ({unit})"])
@pytest.mark.parametrize("columns", [None, "q=position", "q[deg]=position"])
def test_a_unit_behind_a_name_holds(path, header, columns):
    """A list that a researcher made by hand has its units in the header."""
    units = {"position": "deg", "velocity": "deg/s", "current": "mA"}
    table = {"Time [ms]": 10 * np.arange(ROWS)} | {
        header.format(j=j, signal=signal, unit=unit): 90.0 + j
        for signal, unit in units.items()
        for j in range(1, 7)
    }
    log = read(write(path, table), columns=columns)
    given = 90.0 + np.arange(1, 7)
    np.testing.assert_allclose(log.t[:2], [0.0, 0.01], rtol=1e-12)
    np.testing.assert_allclose(log.q[0], np.deg2rad(given), rtol=1e-12)
    np.testing.assert_allclose(log.dq[0], np.deg2rad(given), rtol=1e-12)
    np.testing.assert_allclose(log.current[0], 1e-3 * given, rtol=1e-12)


def test_one_signal_in_two_units_is_refused(path):
    table = CLOCK | {f"q{j} [{'deg' if j == 3 else 'rad'}]": 0.1 * j for j in range(1, 7)}
    with pytest.raises(LogError, match="several units"):
        read(write(path, table))


@pytest.mark.parametrize(
    "pattern", ["{signal}_{joint}", "{joint}_{signal}", "{joint}.{signal}", "{signal}/{joint}"]
)
@pytest.mark.parametrize(
    ("word", "effort"), [("effort", "current"), ("eff", "current"), ("tau", "torque")]
)
def test_a_joints_name_beside_the_signals_gives_its_place(path, pattern, word, effort):
    """UR's drivers publish currents as effort; what is called torque is one."""
    columns = dict(CLOCK)
    for k, signal in enumerate(("pos", "vel", word)):
        for joint in reversed(UR_NAMES):
            columns[pattern.format(signal=signal, joint=joint)] = k + 0.1 * UR_NAMES.index(joint)
    log = read(write(path, columns))
    assert log.joint_names == UR_NAMES
    assert log.signals == ("q", "dq", effort)
    for k, signal in enumerate(("q", "dq", effort)):
        np.testing.assert_allclose(log.require(signal)[0], k + 0.1 * np.arange(6))


def test_plotjuggler_names_the_topic_then_the_joint(path):
    columns = {f"/joint_states/{joint}/position": 0.1 * k for k, joint in enumerate(UR_NAMES)}
    log = read(write(path, {"__time": CLOCK["t"]} | dict(reversed(columns.items()))))
    assert log.joint_names == UR_NAMES
    np.testing.assert_allclose(log.q[0], 0.1 * np.arange(6))


@pytest.mark.parametrize("pattern", ["{signal}_{k}", "{signal}_joint{k}", "joint{k}_{signal}"])
def test_numbered_joints_are_ordered_by_number(path, pattern):
    columns = dict(CLOCK)
    for signal in ("pos", "vel", "eff"):
        columns |= {pattern.format(signal=signal, k=k): 0.1 * k for k in (3, 1, 2)}
    log = read(write(path, columns))
    np.testing.assert_allclose(log.q[0], [0.1, 0.2, 0.3])
    assert log.signals == ("q", "dq", "torque")


def test_a_pose_has_no_joints(path):
    columns = {f"{signal}_{axis}": 0.5 for signal in ("pos", "vel") for axis in "xyz"}
    with pytest.raises(LogError, match="no joint positions"):
        read(write(path, CLOCK | columns))


@pytest.mark.parametrize(
    ("place", "sec", "nsec"),
    [("", "sec", "nsec"), ("", "secs", "nsecs"), ("", "sec", "nanosec"),
     ("header.stamp.", "sec", "nanosec"), ("/joint_states/header/stamp/", "sec", "nanosec")],
)  # fmt: skip
def test_seconds_and_nanoseconds_are_one_clock(path, place, sec, nsec):
    sec, nsec = place + sec, place + nsec
    stamps = 1_750_000_000_999_999_999 + np.arange(ROWS) * 8_000_001
    columns = {sec: stamps // 10**9, nsec: stamps % 10**9, "q1": 0.1, "q2": 0.2}
    log = read(write(path, columns))
    assert log.source.t0_ns == stamps[0]
    np.testing.assert_array_equal(log.t, (stamps - stamps[0]) * 1e-9)
    stated = read(path, columns=f"t={sec}|{nsec},q=q{{i}}")
    np.testing.assert_array_equal(stated.t, log.t)


def test_a_messages_stamp_goes_before_the_recorders_time(path):
    stamps = np.arange(ROWS) * 8_000_000
    columns = {"Time": np.arange(ROWS) * 0.0081, "q1": np.linspace(0, 1, ROWS)}
    columns |= {"header.stamp.secs": stamps // 10**9, "header.stamp.nsecs": stamps % 10**9}
    np.testing.assert_array_equal(read(write(path, columns)).t, stamps * 1e-9)


@pytest.mark.parametrize("nanoseconds", [0.5, 2e9, -1.0])
def test_a_pair_that_is_none_is_refused(path, nanoseconds):
    columns = {"sec": np.arange(ROWS), "nsec": nanoseconds, "q1": np.linspace(0, 1, ROWS)}
    with pytest.raises(LogError, match="no whole seconds and the nanoseconds"):
        read(write(path, columns))


def test_a_rate_alone_leaves_the_signals_to_their_names(path):
    columns = {"q1": np.linspace(0, 1, ROWS), "dq1": 0.5, "current1": 2.0}
    log = read(write(path, columns), columns="t@125Hz,current[mA]")
    assert log.signals == ("q", "dq", "current")
    assert log.median_step == pytest.approx(0.008)
    assert log.require("current")[0, 0] == pytest.approx(2e-3)


def test_what_a_text_leaves_out_is_found_where_one_group_fits(path):
    columns = {"time": CLOCK["t"], "arm_1": 0.1, "dq_1": 0.2, "tau_1": 0.3, "tau_ext_1": 0.4}
    log = read(write(path, columns), columns="q=arm_{i}")
    # A vendor's estimate may have either sign: it is not taken unasked.
    assert log.signals == ("q", "dq", "torque")
    assert [r.code for r in log.source.remarks].count("signal-by-name") == 2
    # Of two efforts neither is.
    write(path, {**columns, "current_1": 0.5})
    assert read(path, columns="q=arm_{i}").signals == ("q", "dq")
    stated = read(path, columns="q=arm_{i},tau=tau_{i}")
    assert stated.signals == ("q", "dq", "torque")


@pytest.mark.parametrize(
    ("arm", "others"),
    [
        (UR_NAMES, ["gripper_finger"]),
        ([f"left_{name}" for name in UR_NAMES], ["gripper_finger"]),
        (FRANKA, ["fr3_finger_joint1", "fr3_finger_joint2"]),
        (["base", "shoulder", "elbow", "wrist 1", "wrist_2", "Wrist_3"], []),
        (["joint_1", "joint_2", "joint_10"], []),
    ],
)
def test_an_arms_joints_are_found_in_any_order_and_among_others(arm, others):
    names = [*arm, *others]
    random.Random(1).shuffle(names)
    assert [names[k] for k in kinematic_order(names)] == list(arm)


@pytest.mark.parametrize(
    "names",
    [["b", "a"], ["joint1", "joint1"], ["joint1", "hand"], [],
     [*FRANKA, *(f"left_{name}" for name in FRANKA)]],
)  # fmt: skip
def test_names_that_tell_nothing_keep_the_files_order(names):
    assert kinematic_order(names) == tuple(range(len(names)))


def test_the_robot_that_names_settle():
    for arm, robot in {"fr3": "fr3", "panda": "panda", "fer": "panda"}.items():
        assert robot_of([f"{arm}_joint{j}" for j in range(1, 8)]) == robot
    assert robot_of([*FRANKA, "panda_joint1"]) is robot_of(UR_NAMES) is None


@pytest.mark.parametrize("field", ALIASES)
def test_the_document_has_every_alias_and_every_name_of_the_clock(field):
    text = (Path(__file__).parents[2] / "docs" / "formats.md").read_text("utf-8")
    rows = {line.split("`")[1]: line for line in text.splitlines() if line.startswith("| `")}
    signal = next(name for name, target in SIGNALS.items() if target == field)
    assert all(f"`{alias}`" in rows[signal] for alias in ALIASES[field])
    assert all(f"`{name}`" in text for name in CLOCKS)
