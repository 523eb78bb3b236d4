"""On simulated logs with seeded mismatch: the numbers the issue requires."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.identification import Task
from vftcli.identification.fitting import identify
from vftcli.identification.links import is_physical
from vftcli.identification.training import prepare
from vftcli.robots import load_robot
from vftcli.robots.friction import friction_torque
from vftcli.robots.kernels import chain_parameters
from vftcli.robots.robot import Robot
from vftcli.robots.terms import gravity_torque
from vftcli.signals.arrays import root_mean_squares
from vftcli.simulation import load_scenario, simulate
from vftcli.simulation import prepare as build

STICKS = "friction.presliding=0"  # The numbers are required of joints that stick.
MISMATCH = [
    STICKS, "mismatch.mass=0.05", "mismatch.com=0.01", "mismatch.rotor_inertia=0.1",
    "mismatch.friction=0.15", "mismatch.torque_constant=0.02", "friction.stribeck=0.15",
    "friction.stribeck_velocity=0.03",
]  # fmt: skip
SEED = 1


@pytest.fixture(scope="module")
def train():
    return simulate(load_scenario("free-excitation", [STICKS]), SEED).recording


@pytest.fixture(scope="module")
def truth() -> Robot:
    arm, _ = build(load_scenario("free-excitation", [STICKS]), SEED)
    profile, true = load_robot("ur5"), arm.true
    friction = []
    for j, joint in enumerate(profile.friction):
        rises = np.cumsum(true.friction.bend_slopes[:, j]) * np.diff(joint.speeds)
        coulomb = float(true.friction.coulomb[j])
        parameters = {
            "load_coulomb": float(true.friction.load_coulomb[j]),
            "stribeck": true.friction.stribeck * coulomb,
            "stribeck_velocity": true.friction.stribeck_velocity,
            "smoothing": 0.003,
        }
        torques = tuple(coulomb + np.concatenate([[0.0], np.cumsum(rises)]))
        friction.append(replace(joint, parameters=parameters, torques=torques))
    constant = profile.torque_constant * true.gain
    return replace(profile, chain=true.chain, friction=tuple(friction), torque_constant=constant)


def rubbing(robot, speeds, load):
    """Friction against motion, half the step between both ways. (m, n) [N·m]

    The offset is left out: it also stands for errors of the links' gravity.
    """
    v = speeds[:, None] * np.ones(6)
    there, back = (friction_torque(robot.friction, x, load + 0 * v) for x in (v, -v))
    return 0.5 * (there - back)


@pytest.mark.slow
def test_friction_rotor_and_constants_come_back_within_five_per_cent(train, truth):
    found = identify([train], load_robot("ur5"), Task(method="friction", constants=True)).robot
    np.testing.assert_allclose(found.torque_constant, truth.torque_constant, rtol=0.05)
    np.testing.assert_allclose(found.chain.rotor_inertia, truth.chain.rotor_inertia, rtol=0.05)
    speeds = np.linspace(0.2, 1.0, 9)
    load = np.mean(np.abs(gravity_torque(truth, train.q)), axis=0)
    expected = rubbing(truth, speeds, load)
    np.testing.assert_allclose(rubbing(found, speeds, load), expected, rtol=0.05)


@pytest.mark.slow
def test_another_trajectory_is_predicted_to_the_noise_floor(train, truth):
    other = simulate(load_scenario("ur5-circle", [*MISMATCH, "contacts=[]"]), SEED).recording
    found = identify([train], load_robot("ur5"), Task(method="base"), [other])
    trace = next(t for t in found.traces if t.role == "held-out")
    motion = prepare(other, truth)
    floor = root_mean_squares(motion.tau - motion.with_robot(truth).predicted)
    # the floor is what the true arm itself leaves: current noise and stiction at reversals
    assert root_mean_squares(trace.residual).mean() <= 1.1 * floor.mean()
    assert is_physical(chain_parameters(found.robot.chain))
    assert np.all(found.robot.chain.rotor_inertia > 0)


@pytest.mark.slow
@pytest.mark.parametrize(("settings", "most"), [([], 2.0), (MISMATCH, 1.25)])
def test_rounds_of_one_motion_are_reported_and_hardly_spoil_the_profile(train, settings, most):
    """Five rounds of one circle predict each other whatever the links are.

    On the arm that gives before it slides most parameters are open: 12.8 N·m elsewhere with the
    weakest pull, 1.33 with a table's, .84 with the profile. On one that sticks 5.0 with a pull of
    .01, .79 with what is chosen, .70 with the profile.
    """
    rounds = simulate(load_scenario("ur5-circle", [*settings, "contacts=[]"]), SEED).recording
    found = identify([rounds], load_robot("ur5"), Task(method="base"), [train])
    (count,) = [r for r in found.remarks if r.code == "undetermined-base-parameters"]
    assert count.level == "caution"
    elsewhere = next(t for t in found.traces if t.role == "held-out")
    assert np.mean(elsewhere.rms) <= most * np.mean(elsewhere.before)
