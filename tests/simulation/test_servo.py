"""The position controller against Pinocchio and the linear loop it makes."""

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import load_robot
from vftcli.robots.friction import friction_torque
from vftcli.signals.errors import ParameterError
from vftcli.simulation.arm import Servo, rigid_torque
from vftcli.simulation.scenario import ServoSpec
from vftcli.simulation.trajectories import Reference

ROBOT = load_robot("ur5")
RNG = np.random.default_rng(0)
STATES = Reference(*RNG.uniform(-0.5, 0.5, (3, 4, 6)))


def test_feed_forward_is_inverse_dynamics_and_friction():
    data = ROBOT.model.createData()
    forward = Servo(ServoSpec(), ROBOT, 1e-3).feed_forward(STATES)
    rigid = [pin.rnea(ROBOT.model, data, *row) for row in zip(*STATES, strict=True)]
    np.testing.assert_allclose(rigid_torque(ROBOT.model, STATES), rigid, atol=1e-12)
    friction = friction_torque(ROBOT.friction, STATES.dq)
    np.testing.assert_allclose(forward, rigid + friction, atol=1e-12)


def test_without_feed_forward_gravity_alone_is_compensated():
    servo = Servo(ServoSpec(feed_forward=False), ROBOT, 1e-3)
    data = ROBOT.model.createData()
    forward = servo.feed_forward(STATES)
    for row, q in zip(forward, STATES.q, strict=True):
        gravity = pin.computeGeneralizedGravity(ROBOT.model, data, q)
        np.testing.assert_allclose(row, gravity, atol=1e-12)


@pytest.mark.parametrize(("stiffness", "omega"), [("stiff", 90.0), ("soft", 28.0), (40.0, 40.0)])
def test_every_mode_has_the_loops_frequency_and_damping(stiffness, omega):
    servo = Servo(ServoSpec(stiffness=stiffness, damping=0.7, torque_limits=False), ROBOT, 1e-3)
    q, error, rate = STATES.q[0], 1e-3 * RNG.standard_normal(6), 1e-2 * RNG.standard_normal(6)
    tau = servo.torque(np.zeros(6), q + error, rate, q, np.zeros(6))
    M = pin.crba(ROBOT.model, ROBOT.model.createData(), q)
    M = np.triu(M) + np.triu(M, 1).T
    # computed torque: M⁻¹τ = ω² e + 2ζω ė
    np.testing.assert_allclose(
        np.linalg.solve(M, tau), omega**2 * error + 2 * 0.7 * omega * rate, rtol=1e-9
    )


def test_torque_and_positions_stay_inside_the_limits():
    servo = Servo(ServoSpec(), ROBOT, 1e-3)
    tau = servo.torque(np.zeros(6), np.full(6, 3.0), np.zeros(6), np.zeros(6), np.zeros(6))
    assert np.all(np.abs(tau) <= ROBOT.limits.tau_max)
    assert np.any(np.abs(tau) == ROBOT.limits.tau_max)
    free = Servo(ServoSpec(torque_limits=False), ROBOT, 1e-3)
    assert np.all(np.isinf(free.limit))
    np.testing.assert_array_equal(
        [servo.q_min, servo.q_max], [ROBOT.limits.q_min, ROBOT.limits.q_max]
    )


@pytest.mark.parametrize(
    ("spec", "step", "words"),
    [
        (ServoSpec(stiffness="hard"), 1e-3, "there is stiff, soft"),
        (ServoSpec(stiffness=0.0), 1e-3, "must be positive"),
        (ServoSpec(damping=-0.1), 1e-3, "must be positive and damping not negative"),
        (
            ServoSpec(stiffness=401.0),
            1e-3,
            "chatters at a step of 0.001 s; it can be at most 400",
        ),
    ],
)
def test_impossible_loops_are_refused(spec, step, words):
    with pytest.raises(ParameterError, match=words):
        Servo(spec, ROBOT, step)
    Servo(ServoSpec(stiffness=399.0), ROBOT, 1e-3)
