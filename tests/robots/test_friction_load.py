"""Friction that grows with the load, and the Stribeck term."""

import numpy as np
import pytest

from vftcli.robots import JointFriction, load_robot
from vftcli.robots.friction import coulomb_viscous, friction_torque
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.errors import RobotError
from vftcli.signals.recording import Recording

LOADED = JointFriction(
    model="coulomb-viscous-load",
    parameters={"coulomb": 2.0, "viscous": 1.0, "load_coulomb": 0.1},
)
PLAIN = JointFriction(model="coulomb-viscous", parameters={"coulomb": 2.0, "viscous": 1.0})


def test_the_load_adds_to_the_coulomb_torque_whatever_its_sign():
    dq = np.array([[0.5, -0.5]])
    for load in (30.0, -30.0):
        torque = friction_torque((LOADED, LOADED), dq, np.full((1, 2), load))
        # 2 + 0.1·30 + 1·0.5; tanh(50) is 1 to rounding
        np.testing.assert_allclose(torque, [[5.5, -5.5]], rtol=1e-14)


def test_only_the_joints_with_the_model_feel_the_load():
    torque = friction_torque((LOADED, PLAIN), np.full((1, 2), 0.5), np.full((1, 2), 30.0))
    np.testing.assert_allclose(torque, [[5.5, 2.5]], rtol=1e-14)


def test_without_a_load_it_is_the_plain_model():
    dq = np.linspace(-1, 1, 7)[:, None]
    assert np.array_equal(friction_torque((LOADED,), dq), friction_torque((PLAIN,), dq))


def test_the_stribeck_term_fades():
    slow, fast = coulomb_viscous(
        np.array([0.05, 2.0]), 2.0, 0.0, smoothing=1e-3, stribeck=1.0, stribeck_velocity=0.05
    )
    # e⁻¹ at the Stribeck velocity, nothing far above it (analytic)
    assert slow == pytest.approx(2.0 + np.exp(-1.0), rel=1e-12)
    assert fast == pytest.approx(2.0, rel=1e-12)


def test_the_terms_use_the_gravity_torque_as_load():
    from dataclasses import replace

    robot = load_robot("ur5")
    rng = np.random.default_rng(0)
    q, dq, current = rng.uniform(-1, 1, (3, 20, 6))
    recording = Recording(t=0.008 * np.arange(20), q=q, dq=dq, current=current)
    rough = replace(robot, friction=(LOADED,) * 6)
    gravity = momentum_terms(robot.loaded_chain, q, dq).gravity
    expected = friction_torque(rough.friction, dq, gravity)
    smooth = dynamics_terms(recording, robot.without_friction())
    # differences of torques of 10²: rounding
    np.testing.assert_allclose(
        smooth.mu - dynamics_terms(recording, rough).mu, expected, atol=1e-12
    )
    literal = dynamics_terms(recording, rough, literal=True)
    # the paper's numeric method is good to 5e-6 N·m
    np.testing.assert_allclose(literal.mu, dynamics_terms(recording, rough).mu, atol=5e-5)


def test_a_file_needs_the_models_keys(tmp_path):
    from vftcli.robots import PROFILES

    text = PROFILES["ur10e"].read_text(encoding="utf-8")
    path = tmp_path / "arm.toml"
    model = 'model = "coulomb-logarithmic"'
    path.write_text(text.replace(model, 'model = "coulomb-viscous-load"', 1), encoding="utf-8")
    with pytest.raises(RobotError, match="viscous is missing"):
        load_robot(path)
    with_velocity = 'model = "coulomb-logarithmic"\nstribeck = 1.0\nstribeck_velocity = 0.0'
    path.write_text(text.replace(model, with_velocity, 1), encoding="utf-8")
    with pytest.raises(
        RobotError, match=r"stribeck_velocity is 0 rad/s; on a robot it lies within"
    ):
        load_robot(path)
