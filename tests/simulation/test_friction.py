"""The true friction against the profile's curve and its own derivative."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.robots import JointFriction, load_robot
from vftcli.robots.friction import friction_torque
from vftcli.signals.errors import ParameterError
from vftcli.simulation.plant import true_friction
from vftcli.simulation.scenario import FrictionSpec


def test_the_stribeck_peak_fades_over_its_velocity():
    robot = load_robot("ur5")
    spec = FrictionSpec(stribeck=0.3, stribeck_velocity=0.05)
    friction = true_friction(robot, spec)
    coulomb = true_friction(robot, FrictionSpec()).coulomb
    np.testing.assert_allclose(friction.dry(np.zeros(6)), 1.3 * coulomb)
    np.testing.assert_allclose(friction.dry(np.full(6, 0.05)), (1 + 0.3 / np.e) * coulomb)
    np.testing.assert_allclose(friction.dry(np.full(6, -0.5)), coulomb, rtol=1e-12)


def test_a_joint_that_gives_has_dry_friction_that_fades_and_one_that_does_not_sticks():
    """Of alternate joints; the slope against central differences."""
    friction = true_friction(load_robot("ur5"), FrictionSpec(presliding=0.6))
    friction = replace(friction, presliding=friction.presliding * [1, 0, 1, 0, 1, 0])
    dry, dq, h = friction.dry(np.zeros(6)), np.linspace(-0.004, 0.006, 6), 1e-7
    torque, slope, sticking = friction.creep(dq, dry)
    np.testing.assert_array_equal(sticking, dry * [0, 1, 0, 1, 0, 1])
    np.testing.assert_allclose(torque, (dry - sticking) * np.tanh(dq / 0.003), rtol=1e-12)
    difference = (friction.creep(dq + h, dry)[0] - friction.creep(dq - h, dry)[0]) / (2 * h)
    np.testing.assert_allclose(slope, difference, atol=1e-4)


def test_a_share_of_the_sigmoid_can_stick():
    robot = load_robot("panda")
    whole, part = (true_friction(robot, FrictionSpec(sticking=s)) for s in (0.0, 0.4))
    np.testing.assert_allclose(part.amplitude, 0.6 * whole.amplitude)
    np.testing.assert_allclose(part.coulomb, whole.coulomb + 0.2 * whole.amplitude)
    assert "amplitude" in whole.present


def test_warmth_changes_all_but_the_offset():
    friction = true_friction(load_robot("ur10e"), FrictionSpec(presliding=0.5))
    friction = replace(friction, offset=np.full(6, 0.3))
    factor = np.linspace(0.7, 1.2, 6)
    warm, dq = friction.times(factor, factor), np.linspace(-1.0, 1.5, 6)
    np.testing.assert_allclose(warm.smooth(dq)[0] - 0.3, factor * (friction.smooth(dq)[0] - 0.3))
    np.testing.assert_allclose(warm.dry(dq, 9.0 * dq), factor * friction.dry(dq, 9.0 * dq))
    np.testing.assert_allclose(warm.presliding, factor * friction.presliding)
    np.testing.assert_array_equal(warm.offset, friction.offset)


def joint(model: str, **values: float) -> JointFriction:
    return JointFriction(model=model, parameters=values)


GIVING = {"load_coulomb": 0.1, "presliding": 0.5, "presliding_length": 1e-3}
SPEEDS, TORQUES = (0.01, 0.5, 1.5, 3.2), (5.73, 9.32, 13.58, 18.72)
LINE = JointFriction(model="points", parameters=GIVING, speeds=SPEEDS, torques=TORQUES)
SHORT = JointFriction(model="points", speeds=(0.1, 1.0), torques=(1.0, 3.0))
FLAT = joint("coulomb-logarithmic", coulomb=2.0, logarithmic=3.0, logarithmic_velocity=1.2)
SQUARE = joint("coulomb-viscous-quadratic", coulomb=2.0, viscous=1.0, quadratic=0.5)
MADE = replace(load_robot("ur5"), friction=(LINE, SHORT, FLAT, SQUARE, LINE, JointFriction()))


@pytest.mark.parametrize("robot", [MADE, load_robot("ur5"), load_robot("panda")])
def test_a_sliding_joint_rubs_as_the_model_says_and_its_slope_is_the_derivative(robot):
    """The plant's friction by velocity and load, bends included, against the model's function."""
    friction = true_friction(robot, FrictionSpec())
    load = np.resize([-30.0, 20.0, 5.0, 0.0, 1.0, 2.0], robot.joints)
    for speed in (-4.0, -1.0, -0.3, -0.05, 0.05, 0.3, 1.0, 4.0):
        # five times the smoothing: tanh is 1 to 1e-4 of the Coulomb torque
        dq = np.full(robot.joints, speed)
        torque = friction.smooth(dq)[0] + np.sign(speed) * friction.dry(dq, load)
        model = friction_torque(robot.friction, dq[None], load[None])[0]
        np.testing.assert_allclose(torque, model, rtol=2e-4)
        h = 1e-6
        rise = (friction.smooth(dq + h)[0] - friction.smooth(dq - h)[0]) / (2 * h)
        # where it falls, as a quadratic below zero may, the slope used is zero; differences of
        # 20 N·m over 2e-6 rad/s: rounding
        np.testing.assert_allclose(friction.smooth(dq)[1], np.maximum(rise, 0.0), atol=2e-8)


def test_presliding_is_the_models_and_a_share_of_the_coulomb_torque():
    found = true_friction(MADE, FrictionSpec()).presliding
    np.testing.assert_array_equal(found, [0.5, 0, 0, 0, 0.5, 0])
    robot = load_robot("ur10e")
    whole, part = (true_friction(robot, FrictionSpec(presliding=s)) for s in (0.0, 0.6))
    np.testing.assert_allclose(part.presliding, 0.6 * whole.coulomb)
    np.testing.assert_allclose(part.coulomb + part.presliding, whole.coulomb)
    np.testing.assert_array_equal(part.presliding_length, 3e-4)


def test_a_frictionless_arm_has_none():
    friction = true_friction(load_robot("panda"), FrictionSpec(enabled=False))
    torque, slope = friction.smooth(np.ones(7))
    assert not np.any([torque, slope, friction.dry(np.ones(7))])
    assert "amplitude" not in friction.present


def test_an_arm_without_friction_figures_has_those_stated():
    robot = load_robot("xarm6")
    stated = FrictionSpec(coulomb=(3.0,) * 6, viscous=(1.0, 2.0, 3.0, 0.0, 0.0, 0.0))
    friction = true_friction(robot, stated)
    np.testing.assert_array_equal(friction.dry(np.ones(6)), 3.0)
    np.testing.assert_array_equal(friction.smooth(np.ones(6))[0], stated.viscous)
    assert not np.any(true_friction(robot, FrictionSpec()).dry(np.ones(6)))
    for wrong in ((1.0,), (-1.0,) * 6, (1e9,) * 6):
        with pytest.raises(ParameterError, match="one number a joint, 6 of them"):
            true_friction(robot, FrictionSpec(coulomb=wrong))
    with pytest.raises(ParameterError, match="'ur5' has some"):
        true_friction(load_robot("ur5"), stated)
