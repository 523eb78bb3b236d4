"""Friction keys of a robot file: points, presliding and temperature law, read and written."""

from pathlib import Path

import pytest

from vftcli.robots import PROFILES, load_robot
from vftcli.robots.writing import robot_toml
from vftcli.signals.errors import RobotError

POINTS = """model = "points"
speeds = [0.01, 0.5, 1.5, 3.2]
torques = [5.73, 9.32, 13.58, 18.72]
load_coulomb = 0.067
smoothing = 0.003
offset = -0.2
presliding = 2.0
presliding_length = 3e-4
temperature = [3.637679, -0.011074, 1.362321, -0.085741]
temperature_at = 44.6
"""


def arm_with(friction: str, folder: Path) -> Path:
    """The Panda, its first joint's friction replaced."""
    head, _, rest = PROFILES["panda"].read_text(encoding="utf-8").partition("[joints.friction]\n")
    _, _, others = rest.partition("\n\n")
    path = folder / "arm.toml"
    path.write_text(f"{head}[joints.friction]\n{friction}\n{others}", encoding="utf-8")
    return path


def test_they_are_read_and_written_back(tmp_path: Path) -> None:
    robot = load_robot(arm_with(POINTS, tmp_path))
    joint = robot.friction[0]
    assert joint.model == "points"
    assert joint.speeds == (0.01, 0.5, 1.5, 3.2)
    assert joint.torques == (5.73, 9.32, 13.58, 18.72)
    assert joint.temperature == (3.637679, -0.011074, 1.362321, -0.085741)
    assert joint.temperature_at == 44.6
    assert joint.parameters == {
        "load_coulomb": 0.067,
        "smoothing": 0.003,
        "offset": -0.2,
        "presliding": 2.0,
        "presliding_length": 3e-4,
    }
    again = tmp_path / "again.toml"
    again.write_text(robot_toml(robot), encoding="utf-8")
    assert load_robot(again).friction == robot.friction


def test_presliding_and_temperature_stand_beside_any_model(tmp_path: Path) -> None:
    more = "".join(POINTS.partition("presliding")[1:])
    sigmoid = 'model = "sigmoid"\namplitude = 1.0\nslope = 5.0\nshift = 0.1\n'
    joint = load_robot(arm_with(sigmoid + more, tmp_path)).friction[0]
    assert (joint.parameters["presliding"], joint.temperature_at) == (2.0, 44.6)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("presliding = 2.0", "presliding = -2.0", r"presliding is -2 N·m; on a robot it lies"),
        ("presliding_length = 3e-4", "presliding_length = 0.0", "presliding_length is 0 rad; on a"),
        ("presliding_length = 3e-4", "presliding_length = 3.0", "presliding_length is 3 rad; on a"),
        ("presliding_length = 3e-4\n", "", "presliding_length is missing; presliding needs it"),
        ("presliding = 2.0\n", "", "presliding is missing; presliding_length needs it"),
        ("temperature_at = 44.6\n", "", "temperature_at is missing; temperature needs it"),
        ("temperature_at = 44.6", "temperature_at = 308", "temperature_at is 308 °C; on a robot"),
        ("3.637679", "-3.637679", "line .*temperature makes friction"),
        ("-0.085741]", "-0.085741, 1.0]", "temperature is .*; it must be 4 finite numbers"),
        ("speeds = [0.01, 0.5, 1.5, 3.2]\n", "", "speeds is missing; it must be a list of at"),
        ("0.01, 0.5, 1.5, 3.2", "0.01", r"speeds is \[0.01\]; it must be a list of at least 2"),
        ("0.01, 0.5, 1.5, 3.2", "0.01, 0.5, 0.5, 3.2", "speeds is .*; each lies above the one"),
        ("0.01, 0.5, 1.5, 3.2", "0.0, 0.5, 1.5, 3.2", "speeds is 0 rad/s; on a robot it lies"),
        ("0.01, 0.5, 1.5, 3.2", "0.01, 0.5, 1.5", "there are 4 torques for 3 speeds"),
        ("5.73, 9.32", "nan, 9.32", "torques is .*; it must be a list of at least 2 finite"),
        ("5.73, 9.32", "1e9, 9.32", r"torques is 1e\+09 N·m; on a robot it lies"),
    ],
)
def test_what_no_joint_has_is_refused(old: str, new: str, words: str, tmp_path: Path) -> None:
    assert old in POINTS
    with pytest.raises(RobotError, match=words):
        load_robot(arm_with(POINTS.replace(old, new), tmp_path))
