"""Logs in the layouts that users have: each read as expected, and judged by one observer alike.

The samples stand beside the real logs; each is one simulated motion of a UR5, free up to 4 s.
"""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vftcli.observers.choice import ObserverChoice
from vftcli.pipeline import AnalysisChoice, analyse_log
from vftcli.readers import read
from vftcli.readers.library import Library
from vftcli.readers.reader import ReadChoice
from vftcli.robots.choice import RobotChoice
from vftcli.signals.errors import ExaminationError, LogError

DEGREES = "t=t,q[deg]=q{i},dq[deg]=dq{i},-tau=tau{i}"
COLUMNS = {"ur5_degrees_turned.csv": DEGREES}
"""Sample → what its text for --columns has to be."""

READ = (
    "ros2_js_wrench",
    "ros2_ur_effort_torque",
    "ros2_ur_effort_full_torque",
    "bagpy_joint_states.csv",
    "rostopic_echo_p.csv",
    "ros2_topic_echo.csv",
    "ur5_sec_nsec.csv",
    "ur5_position_only.csv",
    "ur5_degrees_turned.csv",
)


@pytest.fixture(scope="module")
def expected(samples: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((samples / "reach" / "expected.json").read_text("utf-8"))
    return found


@pytest.mark.parametrize("name", READ)
def test_every_layout_has_its_joints_count_and_ends(
    samples: Path, expected: dict[str, Any], name: str
) -> None:
    log, entry = read(samples / "reach" / name, columns=COLUMNS.get(name)), expected[name]
    assert log.joints == entry["joints"]
    assert log.samples == entry["samples"]
    assert 1 / log.median_step == pytest.approx(entry["rate_hz"], rel=1e-3)
    np.testing.assert_allclose([log.t[0], log.t[-1]], entry["t"], atol=2e-9)
    told = {key: entry[key] for key in ("q", "dq", "current", "torque", "wrench") if key in entry}
    effort = told.pop("torque", entry.get("effort"))
    if effort is not None:
        # UR's names say current; that it is not, the model finds.
        told["current" if log.current is not None else "torque"] = effort
    if "effort" in entry:
        told["current"] = entry["effort"]
    for signal, ends in told.items():
        values = log.require(signal)
        # The digits that the files were written with.
        rough = 4e-6 if signal in {"torque", "current"} and name in COLUMNS else 1e-8
        fine = rough if name in COLUMNS else 2e-9
        fine = 5e-7 if name in {"ur5_sec_nsec.csv", "ur5_position_only.csv"} else fine
        np.testing.assert_allclose(values[0], ends["first"], atol=fine, err_msg=signal)
        np.testing.assert_allclose(values[-1], ends["last"], atol=fine, err_msg=signal)


def test_joints_of_a_bag_beside_a_gripper_are_named(
    samples: Path, expected: dict[str, Any]
) -> None:
    entry = expected["arm_with_gripper_bag"]
    log = read(samples / "reach" / "arm_with_gripper_bag")
    assert list(log.joint_names) == entry["file_order"]


def free_torque(path: Path, robot: str | Path = "ur5", until: float = 3.9, **how: Any) -> float:
    """Mean of the joints' rms by the momentum observer in free motion from .5 s on. [N·m]"""
    choice = AnalysisChoice(
        read=ReadChoice(**how),
        robot=RobotChoice(name=str(robot)),
        observers=ObserverChoice(names=("gmo",)),
    )
    analysis = analyse_log(path, choice)
    inside = (analysis.recording.t >= 0.5) & (analysis.recording.t <= until)
    tau = analysis.estimates[0].tau[inside]
    return float(np.sqrt(np.mean(tau**2, axis=0)).mean())


@pytest.mark.parametrize(
    ("name", "until", "how"),
    [
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
    ],
)
def test_every_layout_gives_the_same_estimate(
    samples: Path, name: str, until: float, how: dict[str, str]
) -> None:
    reach = samples / "reach"
    found = free_torque(reach / name, until=until, **how)
    # Derived velocities may cost .08 N·m; all else is the same numbers in other clothes.
    allowed = 0.08 if "position_only" in name else 0.03
    assert abs(found - free_torque(reach / "ros2_js_wrench", until=until)) < allowed


def test_an_arm_is_laid_on_its_log_by_name(samples: Path) -> None:
    reach = samples / "reach"
    # By position 19.3 N·m are left.
    robot = reach / "arm_with_gripper.urdf"
    assert free_torque(reach / "arm_with_gripper_bag", robot) < 0.6


@pytest.mark.parametrize(
    ("name", "columns", "words"),
    [
        ("ros2_ur_effort_torque", None, "torque-without-gravity.*--effort torque-without-gravity"),
        ("ros2_ur_effort_full_torque", None, "current-as-torque.*--effort torque"),
        ("ur5_degrees_turned.csv", DEGREES.replace("-tau", "tau"), "effort-sign.*-tau"),
        ("ur5_degrees_turned.csv", "q[deg]=q{i},-tau=tau{i}", "velocity-unit.*deg/s"),
    ],
)
def test_what_is_not_what_it_is_called_is_refused_with_its_remedy(
    samples: Path, name: str, columns: str | None, words: str
) -> None:
    with pytest.raises(ExaminationError, match=words):
        free_torque(samples / "reach" / name, columns=columns)


def test_degrees_are_refused_with_their_remedy(samples: Path) -> None:
    with pytest.raises(LogError, match=r"looks like degrees.*q\[deg\]"):
        read(samples / "reach" / "ur5_degrees_turned.csv")


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


@pytest.mark.statistical
@pytest.mark.parametrize("name", LOGS)
def test_an_effort_is_told_from_four_others_on_real_logs(logs: Path, name: str) -> None:
    """Each is explained best as what it is; what explains it less than 1.5 × better is said."""
    from vftcli.doctor.effort import readings
    from vftcli.doctor.windows import windows_of
    from vftcli.identification.processing import gravity_torque
    from vftcli.robots import load_robot

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
            told = [
                reading
                for reading in readings(tried, robot, windows)
                # Currents without gravity are none of the five.
                if reading.code != "current-without-gravity"
            ]
            assert min(told, key=lambda reading: reading.case.misfit).code == code


def test_derived_velocities_are_said_and_near_the_logged(samples: Path) -> None:
    reach, library = samples / "reach", Library()
    log = library.open(reach / "ur5_position_only.csv", ReadChoice())
    assert log.source.derived == ("dq",)
    truth = read(reach / "ur5_sec_nsec.csv").require("dq")
    # .0015 rad/s rms of .45 were measured; noise of 5e-5 rad behind a filter of 12 Hz.
    assert np.sqrt(np.mean((log.require("dq") - truth) ** 2)) < 0.003
    assert library.open(reach / "ur5_position_only.csv", ReadChoice(derive="none")).dq is None
