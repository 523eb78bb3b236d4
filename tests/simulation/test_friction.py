"""The true friction against the profile's curve and its own derivative."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.robots import load_robot
from vftcli.robots.friction import friction_torque
from vftcli.simulation.friction import true_friction
from vftcli.simulation.scenario import FrictionSpec


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_a_sliding_joint_rubs_as_the_profile_says(name):
    robot = load_robot(name)
    friction = true_friction(robot, FrictionSpec())
    for speed in (-1.5, -0.4, 0.4, 1.5):  # far above the smoothing: tanh is 1 to 1e-30
        dq = np.full(robot.joints, speed)
        torque = friction.smooth(dq)[0] + np.sign(speed) * friction.dry(dq)
        np.testing.assert_allclose(
            torque, friction_torque(robot.friction, dq[None])[0], rtol=1e-12, atol=1e-12
        )


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_the_slope_is_the_derivative(name):
    robot = load_robot(name)
    friction = true_friction(robot, FrictionSpec())
    dq, h = np.linspace(-0.3, 0.4, robot.joints), 1e-6
    difference = (friction.smooth(dq + h)[0] - friction.smooth(dq - h)[0]) / (2 * h)
    # where it falls, as a quadratic below zero may, the slope used is zero
    np.testing.assert_allclose(friction.smooth(dq)[1], np.maximum(difference, 0.0), atol=1e-7)


def test_the_stribeck_peak_fades_over_its_velocity():
    robot = load_robot("ur5")
    spec = FrictionSpec(stribeck=0.3, stribeck_velocity=0.05)
    friction = true_friction(robot, spec)
    coulomb = true_friction(robot, FrictionSpec()).coulomb
    np.testing.assert_allclose(friction.dry(np.zeros(6)), 1.3 * coulomb)
    np.testing.assert_allclose(friction.dry(np.full(6, 0.05)), (1 + 0.3 / np.e) * coulomb)
    np.testing.assert_allclose(friction.dry(np.full(6, -0.5)), coulomb, rtol=1e-12)


def test_a_share_of_the_sigmoid_can_stick():
    robot = load_robot("panda")
    whole, part = (true_friction(robot, FrictionSpec(sticking=s)) for s in (0.0, 0.4))
    np.testing.assert_allclose(part.amplitude, 0.6 * whole.amplitude)
    np.testing.assert_allclose(part.coulomb, whole.coulomb + 0.2 * whole.amplitude)
    assert whole.has_sigmoid


def test_warmth_thins_the_rise_alone():
    friction = true_friction(load_robot("ur5"), FrictionSpec())
    warm = replace(friction, viscous=np.ones(6)).with_viscous_factor(0.7)
    np.testing.assert_allclose(warm.viscous, np.full(6, 0.7))
    np.testing.assert_allclose(warm.logarithmic, 0.7 * friction.logarithmic)
    assert friction.logarithmic.all()
    np.testing.assert_array_equal(warm.coulomb, friction.coulomb)


def test_a_frictionless_arm_has_none():
    friction = true_friction(load_robot("panda"), FrictionSpec(enabled=False))
    torque, slope = friction.smooth(np.ones(7))
    assert not np.any([torque, slope, friction.dry(np.ones(7))])
    assert not friction.has_sigmoid
