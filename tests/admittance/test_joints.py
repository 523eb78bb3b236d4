"""Inverse kinematics: reached where it can be, refused where it cannot."""

import numpy as np
import pytest

from vftcli.admittance.joints import follow, largest_speed, try_pose
from vftcli.robots import load_robot
from vftcli.robots.robot import FlangeSolver

UR5 = load_robot("ur5")
START = np.array([0.0, -1.35, 1.9, -2.1208, -1.5708, 0.0])


def test_a_pose_beyond_the_arm_is_not_reached() -> None:
    solver = FlangeSolver(UR5)
    rotation, translation = solver.pose(START)
    beyond = translation + np.array([3.0, 0, 0])
    assert not solver.reach(rotation, beyond, START)[1]
    q, good = try_pose(solver, rotation, np.array([np.nan, 0, 0]), START, START)
    assert not good
    np.testing.assert_array_equal(q, START)


def test_the_arm_waits_where_it_cannot_follow() -> None:
    x = np.zeros((30, 1, 6))
    x[10:20, 0, 0] = 3.0  # out of reach for ten rows
    x[20:, 0, 1] = 0.01
    path = follow(UR5, START, x, 0.008)
    np.testing.assert_array_equal(
        path.reached[:, 0], np.r_[[True] * 10, [False] * 10, [True] * 10]
    )
    np.testing.assert_array_equal(path.q[10:20, 0], np.tile(path.q[9, 0], (10, 1)))
    assert not np.allclose(path.q[25, 0], START)


def test_speed_is_a_share_of_the_limit_between_reached_samples() -> None:
    q = np.zeros((4, 2, 6))
    q[1:, 0, 2] = 0.02
    q[2:, 0, 4] = 5.0  # a leap to a pose that is not reached
    reached = np.array([[True, True], [True, True], [False, True], [False, True]])
    share = largest_speed(UR5, q, reached, 0.01)
    assert share[0] == pytest.approx(0.02 / 0.01 / UR5.limits.qd_max[2])
    assert share[1] == 0.0
    assert np.isnan(largest_speed(UR5, q, np.zeros((4, 2), dtype=bool), 0.01)).all()
