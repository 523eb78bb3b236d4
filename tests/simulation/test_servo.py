"""The position controller against Pinocchio and the linear loop it makes."""

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import load_robot
from vftcli.robots.friction import friction_torque
from vftcli.signals.errors import ParameterError
from vftcli.simulation.arm import Servo
from vftcli.simulation.scenario import ServoSpec
from vftcli.simulation.trajectories import Reference

ROBOT = load_robot("ur5")
RNG = np.random.default_rng(0)
STATES = Reference(*RNG.uniform(-0.5, 0.5, (3, 4, 6)))


def test_feed_forward_is_inverse_dynamics_and_friction_or_gravity_alone():
    data = ROBOT.model.createData()
    friction = friction_torque(ROBOT.friction, STATES.dq)
    whole, bare = (Servo(ServoSpec(feed_forward=on), ROBOT, 1e-3) for on in (True, False))
    rigid = [pin.rnea(ROBOT.model, data, *row).copy() for row in zip(*STATES, strict=True)]
    np.testing.assert_allclose(whole.feed_forward(STATES), rigid + friction, atol=1e-12)
    gravity = [pin.computeGeneralizedGravity(ROBOT.model, data, q).copy() for q in STATES.q]
    np.testing.assert_allclose(bare.feed_forward(STATES), gravity, atol=1e-12)


@pytest.mark.parametrize(("stiffness", "omega"), [("stiff", 90.0), ("soft", 28.0), (40.0, 40.0)])
def test_every_mode_has_the_loops_frequency_and_damping(stiffness, omega):
    servo = Servo(ServoSpec(stiffness=stiffness, damping=0.7, torque_limits=False), ROBOT, 1e-3)
    q, error, rate = STATES.q[0], 1e-3 * RNG.standard_normal(6), 1e-2 * RNG.standard_normal(6)
    tau = servo.torque(np.zeros(6), q + error, rate, q, np.zeros(6))
    M = pin.crba(ROBOT.model, ROBOT.model.createData(), q)
    M = np.triu(M) + np.triu(M, 1).T
    # computed torque: M⁻¹τ = ω² e + 2ζω ė
    expected = omega**2 * error + 2 * 0.7 * omega * rate
    np.testing.assert_allclose(np.linalg.solve(M, tau), expected, rtol=1e-9)


def test_torque_stays_inside_the_limits():
    servo = Servo(ServoSpec(), ROBOT, 1e-3)
    tau = servo.torque(np.zeros(6), np.full(6, 3.0), np.zeros(6), np.zeros(6), np.zeros(6))
    assert np.all(np.abs(tau) <= ROBOT.limits.tau_max)
    assert np.any(np.abs(tau) == ROBOT.limits.tau_max)
    free = Servo(ServoSpec(torque_limits=False), ROBOT, 1e-3)
    assert np.all(np.isinf(free.limit))


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        (ServoSpec(stiffness="hard"), "there is stiff, soft"),
        (ServoSpec(stiffness=0.0), "must be positive"),
        (ServoSpec(damping=-0.1), "must be positive and damping not negative"),
        (ServoSpec(stiffness=401.0), "chatters at a step of 0.001 s; it can be at most 400"),
    ],
)
def test_impossible_loops_are_refused(spec, words):
    with pytest.raises(ParameterError, match=words):
        Servo(spec, ROBOT, 1e-3)
    Servo(ServoSpec(stiffness=399.0), ROBOT, 1e-3)
