"""Friction shapes: one term each of the friction law, filtered like the torque."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.identification.shapes import BENDS, Shape, bent, term_values
from vftcli.robots import load_robot
from vftcli.robots.friction import RunningFriction, friction_torque
from vftcli.robots.profile import robot_toml

PANDA = load_robot("panda")

DQ = np.linspace(-1.0, 1.0, 41)
LOAD = np.linspace(0.0, 8.0, 41)


@pytest.mark.parametrize(
    ("terms", "model"),
    [
        (("coulomb", "viscous"), "coulomb-viscous"),
        (("coulomb", "viscous", "offset"), "coulomb-viscous-offset"),
        (("coulomb", "viscous", "offset", "quadratic"), "coulomb-viscous-quadratic"),
        (("coulomb", "viscous", "quadratic", "load_coulomb"), "coulomb-viscous-load"),
        (("coulomb", "viscous", "stribeck", "load_coulomb"), "coulomb-viscous-stribeck"),
        (("coulomb", "logarithmic", "offset"), "coulomb-logarithmic"),
        (("coulomb", "logarithmic", "stribeck", "load_coulomb"), "coulomb-logarithmic"),
    ],
)
def test_columns_times_coefficients_are_the_robot_files_friction(terms, model):
    shape = Shape(terms, 0.03, 0.1, 0.2)
    assert shape.model == model
    values = 1.0 + 0.25 * np.arange(len(terms))
    columns = np.stack([term_values(term, shape, DQ, LOAD) for term in terms], axis=1)
    friction = shape.friction(values)
    torque = friction_torque([friction], DQ[:, None], LOAD[:, None])[:, 0]
    np.testing.assert_allclose(columns @ values, torque, atol=1e-12)


def test_columns_are_filtered_and_each_shape_has_its_own(prepared):
    t = np.arange(0, 4, 0.01)
    dq = 0.5 * np.sin(2 * np.pi * 0.5 * t)[:, None] * [1.0, -1.0]
    log = prepared(t, dq=dq, load=np.ones((len(t), 2)))
    smooth = Shape((), 0.01)
    for term, other in (
        ("coulomb", Shape((), 0.1)),
        ("logarithmic", smooth._replace(logarithmic_velocity=0.1)),
    ):
        assert not np.array_equal(log.column(term, 0, smooth), log.column(term, 0, other))
    both = log.friction(0, Shape(("coulomb", "viscous"), 0.01))
    # tanh of a strided column rounds otherwise on some processors, by its last digit.
    expected = log.filtered(np.hstack([np.tanh(dq[:, :1] / 0.01), dq[:, :1]]))
    np.testing.assert_allclose(both, expected, rtol=0, atol=1e-15)
    assert log.friction(0, Shape(())).shape == (len(t), 0)


def test_points_and_presliding_are_the_robot_files_friction(prepared):
    """All columns of a bent line with presliding, times coefficients, against the robot's own."""
    t = np.arange(0, 20, 0.01)
    q = 0.8 * np.sin(2 * np.pi * 0.1 * t)[:, None]
    dq = np.gradient(q, t, axis=0)
    line = bent(float(np.abs(dq).max()))
    assert line.terms == ("point1", "point2")
    terms = (*line.terms, "offset", "presliding")
    shape = line._replace(terms=terms, smoothing=0.003, presliding_length=1e-3)
    values = np.array([3.0, 5.0, 0.4, 2.0])
    friction = shape.friction(values)
    assert (friction.model, friction.speeds) == ("points", BENDS[:2])
    assert friction.torques == (3.0, 5.0)
    assert friction.parameters["presliding_length"] == 1e-3
    warmth = np.linspace(1.2, 0.9, len(t))[:, None]
    log = prepared(t, q=q, dq=dq, warmth=warmth)
    expected = RunningFriction((friction,)).torque(q, dq)[:, 0]
    # all but the offset follows the temperature
    expected = log.filtered(((expected - 0.4) * warmth[:, 0] + 0.4)[:, None])[:, 0]
    np.testing.assert_allclose(log.friction(0, shape) @ values, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("speed", "points"), [(0.1, 0), (0.16, 2), (0.79, 2), (0.81, 3), (2.1, 4)]
)
def test_a_point_is_reported_by_a_motion_that_goes_a_third_of_the_way_to_it(speed, points):
    """.01 + .3·.49 = .157, .5 + .3·1 = .8 and 1.5 + .3·1.7 = 2.01 rad/s."""
    shape = bent(speed)
    assert (0 if shape is None else len(shape.speeds)) == points


TERMS = ("coulomb", "viscous", "quadratic", "offset", "load_coulomb", "stribeck", "presliding")


@pytest.mark.parametrize("mask", range(1, 2 ** len(TERMS)))
def test_whatever_was_fitted_is_a_friction_that_a_robot_file_may_have(mask, tmp_path):
    """A joint without any rise was once written without `viscous`, which no robot file may lack."""
    terms = tuple(term for k, term in enumerate(TERMS) if mask >> k & 1)
    fitted = Shape(terms, presliding_length=3e-4).friction(np.full(len(terms), 0.5))
    robot = replace(PANDA, friction=(fitted,) * PANDA.joints)
    path = tmp_path / "arm.toml"
    path.write_text(robot_toml(robot), encoding="utf-8")
    read = load_robot(path).friction[0]
    assert read.model == fitted.model
    assert dict(read.parameters) == dict(fitted.parameters)
