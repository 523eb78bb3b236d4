"""RobotChoice: the arm that is named, or the one the log settles."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_urdfs import two_armed, written

from vftcli.robots import RobotChoice
from vftcli.signals.errors import ParameterError, RobotError
from vftcli.signals.recording import Recording


def log(joints: int = 6, hint: str | None = None) -> Recording:
    return Recording(t=np.array([0.0, 0.1]), q=np.zeros((2, joints)), robot_hint=hint)


def test_the_named_arm_wins_over_the_log_s() -> None:
    assert RobotChoice(name="ur5").load(log(hint="ur10e")).name == "ur5"
    assert RobotChoice().load(log(hint="ur10e")).name == "ur10e"


def test_without_either_the_fitting_profiles_are_listed() -> None:
    """Of an arm that none fits all of them."""
    for joints, words in (
        (6, r"choose one with --robot: ur3, ur5, .*, m1013, or"),
        (7, "choose one with --robot: panda, fr3, iiwa7, iiwa14, gen3, xarm7, or"),
        (4, r"ur3, ur5, .*panda, .*m1013, or .* of 4 joints"),
    ):
        with pytest.raises(RobotError, match=words):
            RobotChoice().load(log(joints))


def test_friction_can_be_left_away() -> None:
    assert any(f.model != "none" for f in RobotChoice(name="ur5").load(log()).friction)
    without = RobotChoice.parsed(robot="ur5", settings={"model.friction": "none"}).load(log())
    assert all(f.model == "none" for f in without.friction)


def test_another_friction_is_refused_before_a_log_is_read() -> None:
    with pytest.raises(ParameterError, match=r"model\.friction=lugre; there is profile, none"):
        RobotChoice(friction="lugre")


def test_a_payload_that_the_file_has_not_is_refused() -> None:
    with pytest.raises(RobotError, match=r"no payload 'bucket'.*the robot file has franka_hand"):
        RobotChoice(name="panda", payload="bucket").load(log(7))


def test_the_tip_of_a_description_are_part_of_the_choice(tmp_path: Path) -> None:
    path = written(tmp_path, two_armed())
    choice = RobotChoice.parsed(robot=str(path), tip="left_tool0")
    assert choice.load(log(7)).chain.names[0] == "left_joint1"
    assert hash(choice) == hash(RobotChoice(name=str(path), tip="left_tool0"))


def test_the_payload_that_the_log_declares_is_mounted() -> None:
    reported = replace(log(6), payload_mass=1.2, payload_com=(0.0, 0.01, 0.1))
    payload = RobotChoice(name="ur5e", payload="log").load(reported).payload
    assert payload is not None
    assert (payload.mass, payload.com.tolist()) == (1.2, [0.0, 0.01, 0.1])
    with pytest.raises(RobotError, match="does not say which payload"):
        RobotChoice(name="ur5e", payload="log").load(log(6))
