"""Flange poses and the way back, limits and starts."""

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import load_robot
from vftcli.robots.robot import FlangeSolver
from vftcli.signals.errors import ParameterError
from vftcli.simulation import load_scenario
from vftcli.simulation.trajectories import HOMES, check_limits, check_start, follow


def test_the_usual_poses_are_those_of_the_paper_and_of_franka():
    """The start of the circle, and Franka's: 0, −π/4, 0, −3π/4, 0, π/2, π/4 to four digits."""
    np.testing.assert_array_equal(HOMES[6], load_scenario("ur5-circle").trajectory.start)
    ready = np.pi * np.array([0, -1, 0, -3, 0, 2, 1]) / 4.0
    np.testing.assert_allclose(HOMES[7], ready, atol=5e-5)


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_a_pose_nearby_is_reached(name):
    robot = load_robot(name)
    home = np.array(HOMES[robot.joints])
    # the flange looks down, to the four digits of the angles
    solver = FlangeSolver(robot, 1e-10)
    down = solver.pose(home).rotation[:, 2]
    np.testing.assert_allclose(down, [0.0, 0.0, -1.0], atol=2e-4)
    goal = solver.pose(home + 0.1)
    found, good = solver.reach(*goal, home)
    assert good
    pose = solver.pose(found)
    # the iteration stops at an error twist of 1e-10
    np.testing.assert_allclose(pose.translation, goal.translation, atol=1e-9)
    np.testing.assert_allclose(pose.rotation, goal.rotation, atol=1e-9)
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, found)
    frame = data.oMf[robot.model.getFrameId("flange")]
    np.testing.assert_allclose(frame.translation, goal.translation, atol=1e-9)


def test_a_pose_out_of_reach_is_refused():
    robot = load_robot("ur5")
    home = np.array(HOMES[6])
    offsets = np.array([np.zeros(3), [2.0, 0.0, 0.0]])  # a UR5 reaches 0.85 m
    with pytest.raises(ParameterError, match=r"a line: the flange .* \(point 2 of 2\)"):
        follow(robot, home, offsets, "a line")


def test_a_path_is_followed_without_changing_branch():
    robot = load_robot("ur5")
    home = np.array(HOMES[6])
    offsets = np.outer(np.arange(10), [0.0, 0.01, 0.0])
    path = follow(robot, home, offsets, "a line")
    np.testing.assert_allclose(path[0], home, atol=1e-9)
    assert np.max(np.abs(np.diff(path, axis=0))) < 0.05  # 1 cm at half a metre, and a wrist
    pose = FlangeSolver(robot).pose
    points = pose(home).translation + offsets
    np.testing.assert_allclose(pose(path[-1]).translation, points[-1])


def test_limits_are_held_joint_by_joint():
    robot = load_robot("panda")
    q = np.tile(check_start(robot, ()), (2, 1))
    still = np.zeros_like(q)
    check_limits(robot, q, still, "a rest")
    over, fast = q.copy(), still.copy()
    over[1, 3] = robot.limits.q_max[3] + 0.01
    fast[0, 5] = -robot.limits.qd_max[5] - 0.01
    with pytest.raises(ParameterError, match=r"joint 4 of 'panda' would move over"):
        check_limits(robot, over, still, "a move")
    with pytest.raises(ParameterError, match=r"joint 6 of 'panda' would move at"):
        check_limits(robot, q, fast, "a move")


def test_starts_have_as_many_angles_as_joints():
    robot = load_robot("ur5")
    np.testing.assert_array_equal(check_start(robot, ()), HOMES[6])
    with pytest.raises(ParameterError, match="has 2 angles; robot 'ur5' has 6"):
        check_start(robot, (0.0, 1.0))
