"""The batched regressor against Pinocchio's, and what is built on it."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import PROFILES, Robot, load_robot
from vftcli.robots.kernels import (
    chain_parameters,
    load_regressor,
    torque_regressor,
    with_parameters,
)


def tilted(robot: Robot, gravity: Sequence[float]) -> Robot:
    """The robot on a base whose gravity vector, in base axes, is `gravity`. [m/s²]"""
    return replace(robot, chain=replace(robot.chain, gravity=np.array(gravity)))


def states(joints, seed, count=40):
    return np.random.default_rng(seed).uniform(-2.5, 2.5, (3, count, joints))


@pytest.mark.parametrize("name", ["ur5", "ur10e", "panda", "fr3"])
def test_equals_pinocchios_regressor(name):
    robot = load_robot(name)
    q, dq, ddq = states(robot.joints, 1)
    model, data = robot.model, robot.model.createData()
    expected = [
        pin.computeJointTorqueRegressor(model, data, *state).copy()
        for state in zip(q, dq, ddq, strict=True)
    ]
    # both are sums of some hundred products of numbers of order 10: rounding at 1e-13
    np.testing.assert_allclose(torque_regressor(robot.chain, q, dq, ddq), expected, atol=1e-12)


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_times_parameters_is_inverse_dynamics_without_rotors(name):
    robot = load_robot(name)
    q, dq, ddq = states(robot.joints, 2)
    model, data = robot.model, robot.model.createData()
    torque = [pin.rnea(model, data, *state).copy() for state in zip(q, dq, ddq, strict=True)]
    rigid = torque_regressor(robot.chain, q, dq, ddq) @ chain_parameters(robot.chain)
    # Pinocchio's rnea includes the rotors' armature
    np.testing.assert_allclose(rigid + robot.chain.rotor_inertia * ddq, torque, atol=1e-11)


def test_a_tilted_base_turns_gravity():
    robot = tilted(load_robot("ur5"), [4.0, -3.0, -8.0])
    q, zero = states(6, 3)[0], np.zeros((40, 6))
    model, data = robot.model, robot.model.createData()
    expected = [pin.computeGeneralizedGravity(model, data, x).copy() for x in q]
    gravity = torque_regressor(robot.chain, q, zero, zero) @ chain_parameters(robot.chain)
    np.testing.assert_allclose(gravity, expected, atol=1e-12)


@pytest.mark.parametrize("name", ["ur10e", "panda"])
def test_parameters_make_the_chain_again(name):
    chain = load_robot(name).chain
    again = with_parameters(chain, chain_parameters(chain))
    for key in ("mass", "com", "inertia", "rotor_inertia"):
        # moving a tensor to the origin and back loses digits of m·c², here below 10 kg·m²
        np.testing.assert_allclose(getattr(again, key), getattr(chain, key), atol=1e-14)


@pytest.mark.parametrize("name", PROFILES)
def test_a_load_on_the_flange_weighs_as_pinocchio_s_last_body(name):
    """The last link's columns for mass and first moment, moved from the flange; on a tilted base,
    so that all three components of gravity count."""
    robot = tilted(load_robot(name), [4.0, -3.0, -8.0])
    chain = robot.chain
    model, data = robot.model, robot.model.createData()
    q, zero = states(robot.joints, 4)[0], np.zeros(robot.joints)
    rng = np.random.default_rng(5)
    mass, com = 3.0, rng.uniform(-0.2, 0.2, 3)
    moved = chain.flange_rotation @ com + chain.flange_translation
    link = np.array([mass, *(mass * moved)])
    expected = [
        # what the drives bear, as a torque from outside
        -pin.computeJointTorqueRegressor(model, data, x, zero, zero)[:, -10:-6] @ link
        for x in q
    ]
    found = load_regressor(chain, q) @ np.array([mass, *(mass * com)])
    # sums of some hundred products of numbers of order 10
    np.testing.assert_allclose(found, expected, atol=1e-12)
