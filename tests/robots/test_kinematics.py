"""Batched kinematics against Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import PROFILES, load_robot
from vftcli.robots.kinematics import flange_jacobian, link_poses


@pytest.mark.parametrize("name", PROFILES)
def test_poses_and_jacobian_agree_with_pinocchio(name: str) -> None:
    robot = load_robot(name)
    q = np.random.default_rng(0).uniform(-3, 3, (40, robot.joints))
    poses, jacobian = link_poses(robot.chain, q), flange_jacobian(robot.chain, q)
    model, data = robot.model, robot.model.createData()
    flange = model.getFrameId("flange")
    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    for k in range(len(q)):
        J = pin.computeFrameJacobian(model, data, q[k], flange, frame)
        pin.framesForwardKinematics(model, data, q[k])
        # the same products in another order: rounding of numbers of order 1
        np.testing.assert_allclose(jacobian[k], J, atol=1e-13)
        np.testing.assert_allclose(poses.rotation[k, -1], data.oMf[flange].rotation, atol=1e-13)
        np.testing.assert_allclose(
            poses.translation[k, -1], data.oMf[flange].translation, atol=1e-13
        )
        for j in range(robot.joints):
            np.testing.assert_allclose(
                poses.translation[k, j], data.oMi[j + 1].translation, atol=1e-13
            )


def test_power_is_the_same_in_joint_and_flange_space() -> None:
    """q̇ᵀ(Jᵀf) = (J q̇)ᵀf for any wrench."""
    robot = load_robot("panda")
    rng = np.random.default_rng(1)
    q, dq = rng.uniform(-2, 2, (2, 30, 7))
    wrench = rng.normal(0, 10, (30, 6))
    J = flange_jacobian(robot.chain, q)
    joint = np.einsum("ti,ti->t", dq, np.einsum("tij,ti->tj", J, wrench))
    flange = np.einsum("ti,ti->t", np.einsum("tij,tj->ti", J, dq), wrench)
    np.testing.assert_allclose(joint, flange, atol=1e-12)  # rounding of sums of order 100
