"""Logs and robots as users have them: each read as expected, and judged by one observer alike.

The samples stand beside the real logs; each is one simulated motion of a UR5, free up to 4 s.
"""

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from made_runs import analyse_log

from vftcli.doctor.causes import readings
from vftcli.doctor.windows import windows_of
from vftcli.observers import ObserverChoice
from vftcli.pipeline import AnalysisChoice
from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import Library, read
from vftcli.robots import RobotChoice, load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.run import paired
from vftcli.robots.terms import gravity_torque
from vftcli.signals.errors import ExaminationError, LogError
from vftcli.signals.recording import Recording

DEGREES = "t=t,q[deg]=q{i},dq[deg]=dq{i},-tau=tau{i}"

FORMATS = {
    ".hdf5": "hdf5", ".mat": "mat", ".feather": "arrow", ".arrows": "arrow", ".jsonl": "json",
    ".json": "json",
}  # fmt: skip
"""Ending of a container → what reads it."""

SIGNALS = ("q", "dq", "current", "torque", "tau_ext", "wrench")

REFUSED = {
    "aloha_episode_0.hdf5": "columns 0-5, right: columns 7-12",
    "robomimic_low_dim.hdf5": "has the layout of robomimic, which has no torque",
    "ur5.xlsx": "save the sheet as CSV",
    "ur5_degrees_turned.csv": r"looks like degrees.*q\[deg\]",
}
"""Sample → what is said where nothing says how it is to be read."""

SAID = {"ur5_v5_struct.mat": "signals-turned", "ros2_js_wrench": "joints-reordered"}
"""Sample → what is said of how it was read."""

DIGITS = {"ur5_sec_nsec.csv": 5e-7, "ur5_position_only.csv": 5e-7, "ur5_degrees_turned.csv": 1e-8,
          "ur5_degrees_turned.csv torque": 4e-6}  # fmt: skip
"""Sample, or a signal of it → the digits that it was written with, if fewer than nine."""


@pytest.fixture(scope="module")
def expected(samples: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((samples / "reach" / "expected.json").read_text("utf-8"))
    return found


def as_expected(
    path: Path, reported: dict[str, Any]
) -> Iterator[tuple[Recording, dict[str, Any]]]:
    """A sample as it has to be read, and what its entry tells of that; each arm and episode."""
    if "arms" in reported:
        for side in ("left", "right"):
            yield read(path, arm=side), reported | reported[side]
    elif "joints" in reported and isinstance(reported["joints"], list):
        log = read(path)
        assert list(log.joint_names) == reported["file_order"]
        laid = paired(log, load_robot(path.parent / reported["robot"]))
        assert "joints-left-out" in {remark.code for remark in laid.source.remarks}
        yield laid, reported
    else:
        yield read(path, columns=reported.get("right_columns")), reported


def check_log(name: str, log: Recording, reported: dict[str, Any]) -> None:
    """Check the joints, the count, the clock, the signals, and their first and last values."""
    joints = reported["joints"]
    joints = joints if isinstance(joints, int) else len(joints)
    assert (log.joints, log.samples) == (joints, reported["samples"]), name
    assert 1 / log.median_step == pytest.approx(reported["rate_hz"], rel=1e-3), name
    np.testing.assert_allclose(log.t[[0, -1]], reported["t"], atol=2e-9, err_msg=name)
    assert log.source.format == FORMATS.get(Path(name).suffix, log.source.format)
    for signal in (key for key in (*SIGNALS, "effort") if key in reported):
        # Names of UR say current, and so does what a driver calls effort: what it is the model
        # finds.
        called = signal
        if signal == "effort" or (signal == "torque" and log.torque is None):
            called = "current"
        values = log.require(called)[[0, -1]]
        if "arms" in reported and signal == "effort":
            values = 1e3 * values  # read as mA
        digits = DIGITS.get(f"{name} {signal}", DIGITS.get(name, 2e-9))
        ends = [reported[signal]["first"], reported[signal]["last"]]
        np.testing.assert_allclose(values, ends, 1e-12, digits, err_msg=f"{name} {signal}")


def check_robot(path: Path, reported: dict[str, Any]) -> None:
    """Check a robot's joints and flange, its masses, and its torques to 1e-6 N·m."""
    robot = load_robot(path)
    arm = next(r.values for r in robot.remarks if "flange" in r.values)
    assert arm["flange"] == reported["flange"]
    if (motion := reported.get("inverse_dynamics")) is not None:
        pin = pytest.importorskip("pinocchio", reason="an MJCF is read by pin, which is missing")
        model = robot.chain.to_pinocchio()
        moving = (np.array(motion[key]) for key in ("q", "v", "a"))
        torque = pin.rnea(model, model.createData(), *moving)
        np.testing.assert_allclose(torque, motion["N·m"], atol=1e-6)
        return
    assert list(robot.chain.names) == reported["joints"]
    assert sorted(arm["locked"]) == sorted(reported["locked"])
    np.testing.assert_allclose(robot.chain.mass, reported["link_masses"], rtol=1e-12)
    q = np.array([reported["gravity_torque"]["q"]])
    gravity = momentum_terms(robot.chain, q, np.zeros((1, 6))).gravity[0]
    np.testing.assert_allclose(gravity, reported["gravity_torque"]["N·m"], atol=1e-6)


@pytest.mark.slow
def test_every_entry_is_read_as_expected_or_refused_as_stated(samples, expected):
    pytest.importorskip("h5py", reason="h5py, the extra hdf5, is not installed")
    for name, reported in expected.items():
        path = samples / "reach" / name
        if (words := REFUSED.get(name)) is not None:
            with pytest.raises(LogError, match=words):
                read(path)
        if path.suffix in {".urdf", ".xml"}:
            check_robot(path, reported)
        elif path.suffix != ".xlsx" and not name.startswith("robomimic"):
            for log, of_log in as_expected(path, reported):
                check_log(name, log, of_log)
        if (code := SAID.get(name)) is not None:
            assert code in {remark.code for remark in read(path).source.remarks}, name


def free_torque(path: Path, robot: str | Path = "ur5", until: float = 3.9, **how: Any) -> float:
    """Mean of the joints' rms by the momentum observer in free motion from .5 s on. [N·m]"""
    arm, observers = RobotChoice(name=str(robot)), ObserverChoice(names=("gmo",))
    choice = AnalysisChoice(read=ReadChoice(**how), robot=arm, observers=observers)
    analysis = analyse_log(path, choice)
    inside = (analysis.recording.t >= 0.5) & (analysis.recording.t <= until)
    tau = analysis.estimates[0].tau[inside]
    return float(np.sqrt(np.mean(tau**2, axis=0)).mean())


@pytest.mark.slow
@pytest.mark.parametrize(("name", "until", "how"), [
    ("ros2_ur_effort_torque", 3.9, {"effort": "auto"}),
    ("ros2_ur_effort_torque", 3.9, {"columns": "tau+g=effort"}),
    ("ros2_ur_effort_full_torque", 3.9, {"effort": "auto"}),
    ("ros2_ur_effort_full_torque", 3.9, {"columns": "tau=effort"}),
    ("bagpy_joint_states.csv", 3.19, {}),
    ("rostopic_echo_p.csv", 3.19, {}),
    ("ros2_topic_echo.csv", 3.19, {}),
    ("ur5_sec_nsec.csv", 3.9, {}),
    ("ur5_degrees_turned.csv", 3.9, {"columns": DEGREES}),
    ("ur5_position_only.csv", 3.9, {}),
])  # fmt: skip
def test_every_layout_gives_the_same_estimate(samples, name, until, how):
    reach = samples / "reach"
    found = free_torque(reach / name, until=until, **how)
    # Derived velocities may cost .08 N·m; all else is the same numbers in other clothes.
    allowed = 0.08 if "position_only" in name else 0.03
    assert abs(found - free_torque(reach / "ros2_js_wrench", until=until)) < allowed


def test_an_arm_is_laid_on_its_log_by_name(samples: Path) -> None:
    reach = samples / "reach"
    # By position 19.3 N·m are left.
    assert free_torque(reach / "arm_with_gripper_bag", reach / "arm_with_gripper.urdf") < 0.6


@pytest.mark.slow
@pytest.mark.parametrize(("name", "columns", "words"), [
    ("ros2_ur_effort_torque", None, "torque-without-gravity.*--set log.effort=torque-with"),
    ("ros2_ur_effort_full_torque", None, "current-as-torque.*--set log.effort=torque"),
    ("ur5_degrees_turned.csv", DEGREES.replace("-tau", "tau"), "effort-sign.*-tau"),
    ("ur5_degrees_turned.csv", "q[deg]=q{i},-tau=tau{i}", "velocity-unit.*deg/s"),
])  # fmt: skip
def test_what_is_not_what_it_is_called_is_refused_with_its_remedy(samples, name, columns, words):
    with pytest.raises(ExaminationError, match=words):
        free_torque(samples / "reach" / name, columns=columns)


UR10E = "t,q:6,dq:6,current:6"
HARMONIC = ("10harm", "12harm", "12harm_40s", "14harm")
LOGS = {
    **{f"ur10e/free_{name}.csv{'.gz' * (name in {'10harm', '12harm_40s'})}": f"{UR10E},_:12"
       for name in HARMONIC},
    **{f"ur10e/free_repeat_{k}.csv": f"{UR10E},_:12" for k in "abc"},
    "ur10e/load_14harm.csv": f"{UR10E},_:12",
    "ur10e/jointwise_2.csv": f"{UR10E},_:12",
    "ur10_link4/link4.csv.gz": f"{UR10E},_:6",
}  # fmt: skip
"""Every real log of a UR10e in which gravity varies by 24 N·m or more → its columns."""

READINGS = {
    "current": ("", "current-as-torque", "torque-without-gravity", "current-as-turned-torque",
                "effort-sign"),
    "torque": ("torque-as-current", "", "torque-without-gravity", "effort-sign",
               "torque-as-turned-current"),
}  # fmt: skip
"""What an effort is called → what is found where it is K⁻¹τ, τ, τ − g, −τ and −K⁻¹τ."""


@pytest.mark.slow
@pytest.mark.parametrize("name", LOGS)
def test_an_effort_is_distinct_from_four_others_on_real_logs(logs: Path, name: str) -> None:
    """Each is explained best as what it is; what explains it less than 1.5 × better is said."""
    robot = load_robot("ur10e")
    log = read(logs / name, columns=LOGS[name])
    current, load = log.require("current"), gravity_torque(robot, log.q)
    torque = current * robot.torque_constant
    plain, windows = replace(log, current=None), windows_of(log, robot)
    assert np.ptp(load, axis=0).max() >= 24
    for called, codes in READINGS.items():
        for effort, code in zip((current, torque, torque - load, -torque, -current), codes,
                                strict=True):  # fmt: skip
            tried = replace(plain, **{called: effort})
            found = readings(replace(windows, recording=tried))
            # Currents without gravity are none of the five.
            five = [reading for reading in found if reading.code != "current-without-gravity"]
            assert min(five, key=lambda reading: reading.case.misfit).code == code


def test_derived_velocities_are_said_and_near_the_logged(samples: Path) -> None:
    reach, library = samples / "reach", Library()
    log = library.open(reach / "ur5_position_only.csv", ReadChoice())
    assert log.source.derived == ("dq",)
    truth = read(reach / "ur5_sec_nsec.csv").require("dq")
    # .0015 rad/s rms of .45 were measured; noise of 5e-5 rad behind a filter of 12 Hz.
    assert np.sqrt(np.mean((log.require("dq") - truth) ** 2)) < 0.003
    assert library.open(reach / "ur5_position_only.csv", ReadChoice(derive="none")).dq is None
