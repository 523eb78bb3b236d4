"""Joint names: their order along the arm, and the robot they settle."""

import random

import pytest

from vftcli.readers.aliases import UR_NAMES, kinematic_order, robot_of

FRANKA = [f"fr3_joint{j}" for j in range(1, 8)]


@pytest.mark.parametrize("prefix", ["", "left_"])
def test_ur_joints_are_found_in_any_order_and_among_others(prefix):
    names = [*(prefix + name for name in UR_NAMES), "gripper_finger"]
    random.Random(1).shuffle(names)
    ordered = [names[k] for k in kinematic_order(names)]
    assert ordered == [prefix + name for name in UR_NAMES]


def test_franka_joints_are_found_beside_the_fingers():
    names = ["fr3_finger_joint1", *reversed(FRANKA), "fr3_finger_joint2"]
    assert [names[k] for k in kinematic_order(names)] == FRANKA


def test_the_words_of_the_teach_pendant_and_numbers_are_ordered():
    words = ["elbow", "Wrist_3", "base", "wrist 1", "shoulder", "wrist_2"]
    found = [words[k] for k in kinematic_order(words)]
    assert found == ["base", "shoulder", "elbow", "wrist 1", "wrist_2", "Wrist_3"]
    assert kinematic_order(["joint_10", "joint_2", "joint_1"]) == (2, 1, 0)


@pytest.mark.parametrize("names", [["b", "a"], ["joint1", "joint1"], ["joint1", "hand"], []])
def test_names_that_tell_nothing_keep_the_files_order(names):
    assert kinematic_order(names) == tuple(range(len(names)))


def test_two_arms_of_one_make_are_not_one():
    assert kinematic_order(FRANKA + [f"left_{name}" for name in FRANKA]) == tuple(range(14))


@pytest.mark.parametrize(
    ("names", "robot"),
    [
        (FRANKA, "fr3"),
        ([f"panda_joint{j}" for j in range(1, 8)], "panda"),
        ([f"fer_joint{j}" for j in range(1, 8)], "panda"),
        ([*FRANKA, "panda_joint1"], None),
        (list(UR_NAMES), None),
    ],
)
def test_the_robot_that_names_settle(names, robot):
    assert robot_of(names) == robot
