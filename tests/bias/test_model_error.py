"""The columns of a model's error: how wrong each may be, and the torque that they make."""

from dataclasses import replace

import numpy as np
import pytest
from known_errors import drawn_error, shortened, ur10e, wrong_run

from vftcli.bias import model_error
from vftcli.bias.model_error import (
    column_numbers,
    error_columns,
    expected_error,
    smooth_motion,
    usual_friction,
)
from vftcli.robots import load_robot
from vftcli.robots.robot import JointFriction
from vftcli.robots.terms import raw_disturbance


def test_an_arm_that_measures_behind_its_gears_has_no_rotors():
    panda = load_robot("panda")
    chain = replace(panda.chain, rotor_inertia=np.full(7, 0.2))
    assert not expected_error(replace(panda, chain=chain)).rotor.any()
    joint = replace(panda, chain=chain, torque_source="joint_torque")
    np.testing.assert_allclose(expected_error(joint).rotor, 0.04)


def test_the_usual_friction_is_what_the_keys_say():
    robot = ur10e()
    keys = {"coulomb": 7.0, "viscous": 9.0, "quadratic": -2.0, "offset": 0.3, "smoothing": 0.01}
    friction = (JointFriction(model="coulomb-viscous-quadratic", parameters=keys),) * 6
    found = usual_friction(replace(robot, friction=friction))
    # tanh(.05·π/.01) is 1 to 1e-13
    np.testing.assert_allclose([x[0] for x in found], [7.0, 9.0, -2.0], rtol=1e-9)
    sigmoid = {"amplitude": -0.5, "slope": 5.0, "shift": 0.1}
    bent = replace(robot, friction=(JointFriction(model="sigmoid", parameters=sigmoid),) * 6)
    np.testing.assert_allclose([x[0] for x in usual_friction(bent)], [0.35, 0.0, 0.0])
    for none in ((), (JointFriction(),) * 6):
        found = usual_friction(replace(robot, friction=none))
        assert not np.any(found)


def test_a_logarithm_s_slope_is_that_of_a_curve_through_it():
    robot = ur10e()
    found = usual_friction(robot)
    joint = robot.friction[0]
    assert found[0][0] == joint.parameters["coulomb"]
    speed = np.linspace(0.05, 1.0, 40) * robot.limits.qd_max[0]
    parameters = joint.parameters
    rise = parameters["logarithmic"] * np.log1p(speed / parameters["logarithmic_velocity"])
    fit = np.polyfit(speed, parameters["coulomb"] + rise, 2)
    # tanh(.1/.01) at the slowest speed is 1 to 4e-9
    np.testing.assert_allclose([found[1][0], found[2][0]], fit[1::-1], rtol=1e-6)


@pytest.mark.parametrize("name", ["ur10e", "panda"])
def test_the_columns_times_an_error_are_the_torque_of_it(name):
    """The rigid body's part two ways: by the regressor, and as inverse dynamics' difference."""
    robot = load_robot(name)
    run = wrong_run(robot, seconds=20.0)
    drawn = drawn_error(robot)
    error = drawn._replace(friction=np.zeros_like(drawn.friction))
    motion = smooth_motion(run)
    columns = error_columns(run, motion, expected_error(robot), 1)
    values, ones = error.values, expected_error(robot).values
    share = np.divide(values, ones, where=ones > 0.0, out=np.zeros_like(values))
    numbers = [column_numbers(j, robot.joints) for j in range(robot.joints)]
    dense = np.column_stack([c @ share[k] for c, k in zip(columns, numbers, strict=True)])
    # ṗ by central differences: ω²Ts²/6 of products of up to 1.8 Hz, .2 %, of 30 N·m at most
    np.testing.assert_allclose(error.torque(run, smooth_motion(run)), dense, atol=0.06)


def test_an_error_is_the_raw_disturbance_with_its_sign_turned():
    """d = τ_ext − A δx, for every kind of column, on an arm that is not touched."""
    robot = shortened(ur10e(), 3)
    error = drawn_error(robot)
    run = wrong_run(robot, error)
    d = raw_disturbance(run.terms)
    b = error.torque(run, smooth_motion(run))
    middle = 0.5 * (b[1:] + b[:-1])[50:-50]
    left = np.sqrt(np.mean((d[50:-50] + middle) ** 2, axis=0))
    # what is left is the sign's turn within a sample, some tenths of the dry friction's error of
    # 2 N·m in a sample of fifty
    assert np.all(left < 0.1 * np.sqrt(np.mean(middle**2, axis=0)))


def test_the_expected_errors_are_shares_of_the_robot_s_own_numbers():
    """Joint 2 of the UR10e by hand, from the specified shares."""
    robot = ur10e()
    found, chain = expected_error(robot), robot.chain
    m, c = chain.mass[1], chain.com[1]
    size = np.trace(chain.inertia[1]) + m * c @ c
    np.testing.assert_allclose(found.inertial[10], 0.05 * m)
    np.testing.assert_allclose(found.inertial[11:14], 0.01 * m + 0.05 * m * np.abs(c))
    tensor = 0.2 * size + 0.02 * m * np.linalg.norm(c) + 1e-4
    np.testing.assert_allclose(found.inertial[14:20], tensor)
    np.testing.assert_allclose(found.rotor, 0.2 * chain.rotor_inertia)
    np.testing.assert_allclose(found.drive, 0.02)
    friction = usual_friction(robot)
    np.testing.assert_allclose(found.friction[0], 0.2 * friction[0] + 0.05)
    np.testing.assert_allclose(found.friction[1], 0.7 * friction[0] + 0.05)
    np.testing.assert_allclose(found.friction[2], 0.03)
    np.testing.assert_allclose(found.friction[3], 0.4 * friction[1] + 0.1)
    np.testing.assert_allclose(found.friction[4], 0.4 * np.abs(friction[2]) + 0.05)
    np.testing.assert_allclose(found.offset, 0.15 * friction[0] + 0.02)


def test_chunks_make_no_difference(monkeypatch):
    robot = shortened(ur10e(), 3)
    run = wrong_run(robot, seconds=12.0)
    motion, expected = smooth_motion(run), expected_error(robot)
    whole = error_columns(run, motion, expected, 2)
    monkeypatch.setattr(model_error, "CHUNK", 37)
    for one, other in zip(error_columns(run, motion, expected, 2), whole, strict=True):
        # blocked sums of the same products: rounding alone
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)
