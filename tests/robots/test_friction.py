"""Friction models at the points where their value is plain."""

import numpy as np
import pytest

from vftcli.robots import JointFriction
from vftcli.robots.friction import (
    coulomb_viscous,
    dry_friction,
    dry_torque,
    friction_torque,
    sigmoid,
)
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


@pytest.mark.parametrize("smoothing", [0.001, 0.01, 0.2])
def test_dry_friction_is_half_the_step_whatever_smooths_it(smoothing: float) -> None:
    """Taken at some low speed it was .46 of a sign smoothed over 0.1 rad/s, and viscous in part."""
    values = {"coulomb": 4.0, "viscous": 30.0, "smoothing": smoothing, "offset": 1.0}
    robot = (JointFriction(model="coulomb-viscous-offset", parameters=values),)
    fast = 20.0 * smoothing  # tanh(20) is 1 to the last digit
    there, back = (friction_torque(robot, np.array([[v]]))[0, 0] for v in (fast, -fast))
    step = 0.5 * (there - back) - values["viscous"] * fast
    np.testing.assert_allclose(dry_friction(robot, 1), [step], rtol=1e-12)


def test_dry_friction_of_every_model() -> None:
    stribeck = {"coulomb": 3.0, "viscous": 1.0, "stribeck": 2.0, "stribeck_velocity": 0.1}
    robot = (
        JointFriction(model="coulomb-viscous-stribeck", parameters=stribeck),
        JointFriction(model="sigmoid", parameters={"amplitude": -1.5, "slope": 10.0, "shift": 0.1}),
        JointFriction(),
    )
    # at breakaway; a sigmoid's two saturations lie its amplitude apart
    np.testing.assert_array_equal(dry_friction(robot, 3), [5.0, 0.75, 0.0])
    ends = sigmoid(np.array([-50.0, 50.0]), -1.5, 10.0, 0.1)
    np.testing.assert_allclose(0.5 * abs(ends[1] - ends[0]), 0.75)
    np.testing.assert_array_equal(dry_friction((), 4), np.zeros(4))


def test_dry_friction_grows_with_the_load_either_way() -> None:
    values = {"coulomb": 3.0, "load_coulomb": 0.1}
    np.testing.assert_allclose(dry_torque(values, np.array([-20.0, 0.0, 20.0])), [5.0, 3.0, 5.0])
