"""Friction models at the points where their value is plain."""

import numpy as np
import pytest

from vftcli.robots import JointFriction
from vftcli.robots.friction import coulomb_viscous, friction_torque, sigmoid
from vftcli.signals.errors import ParameterError


def test_coulomb_viscous_at_speed_is_the_sum_of_its_parts() -> None:
    # tanh(0.5/0.01) is 1 to the last bit
    torque = coulomb_viscous(np.array([0.5, -0.5]), 6.3, 14.2, -4.5, 0.2)
    np.testing.assert_allclose(
        torque, [0.2 + 6.3 + 7.1 - 1.125, 0.2 - 6.3 - 7.1 + 1.125], rtol=1e-14
    )


def test_coulomb_is_smoothed_through_zero() -> None:
    assert coulomb_viscous(np.array([0.0]), 6.3, 14.2)[0] == 0.0
    np.testing.assert_allclose(
        coulomb_viscous(np.array([0.01]), 6.3, 0.0), 6.3 * np.tanh(1.0), rtol=1e-15
    )


def test_sigmoid_is_zero_at_rest_and_spans_its_amplitude() -> None:
    assert sigmoid(np.array([0.0]), 0.5, 5.0, 0.04)[0] == 0.0
    span = sigmoid(np.array([1e3]), 0.5, 5.0, 0.04) - sigmoid(np.array([-1e3]), 0.5, 5.0, 0.04)
    np.testing.assert_allclose(span, 0.5, rtol=1e-12)  # the tails of the exponential are gone


def test_joints_of_different_models_are_kept_apart() -> None:
    friction = (
        JointFriction(model="coulomb-viscous", parameters={"coulomb": 2.0, "viscous": 1.0}),
        JointFriction(),
        JointFriction(model="sigmoid", parameters={"amplitude": 1.0, "slope": 9.0, "shift": 0.0}),
    )
    dq = np.array([[1.0, 1.0, 1.0], [-1.0, -1.0, -1.0]])
    torque = friction_torque(friction, dq)
    np.testing.assert_allclose(torque[:, 0], [3.0, -3.0], rtol=1e-14)
    assert not np.any(torque[:, 1])
    np.testing.assert_allclose(torque[:, 2], sigmoid(dq[:, 2], 1.0, 9.0, 0.0))


def test_an_unknown_model_is_named() -> None:
    with pytest.raises(ParameterError, match="no friction model 'sticky'; there is"):
        friction_torque((JointFriction(model="sticky", parameters={"x": 1.0}),), np.ones((2, 1)))
