"""Joints driven through each other: speeds, torques, friction and rotors by hand, files refused."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.admittance.online import OnlineKalman
from vftcli.observers import KalmanObserver
from vftcli.robots import JointFriction, load_robot
from vftcli.robots.drive import drive_torque
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.running_friction import RunningFriction
from vftcli.robots.terms import dynamics_terms
from vftcli.robots.transmission import at_motors, joint_torque, motor_rows, motor_torque
from vftcli.robots.writing import robot_toml
from vftcli.signals.errors import ParameterError, RobotError
from vftcli.signals.recording import Recording

UR5 = load_robot("ur5")
T = np.eye(6)
T[5, 4] = 0.5
FRICTION = JointFriction(model="coulomb-viscous", parameters={"coulomb": 2.0, "viscous": 3.0})
COUPLED = replace(
    UR5, chain=replace(UR5.chain, transmission=T), friction=(JointFriction(),) * 5 + (FRICTION,)
)
RNG = np.random.default_rng(4)
Q, DQ = RNG.uniform(-1.0, 1.0, (2, 20, 6))


def test_motors_and_joints_have_the_same_power():
    torque = RNG.normal(size=(20, 6))
    at_the_motors = np.sum(motor_torque(T, torque) * at_motors(T, DQ), axis=1)
    # products of doubles: rounding
    np.testing.assert_allclose(at_the_motors, np.sum(torque * DQ, axis=1), atol=1e-12)
    np.testing.assert_allclose(joint_torque(T, motor_torque(T, torque)), torque, atol=1e-12)
    rows, x = RNG.normal(size=(20, 6, 3)), np.ones(3)
    np.testing.assert_allclose(motor_rows(T, rows) @ x, motor_torque(T, rows @ x), atol=1e-12)


def test_without_coupling_nothing_is_computed():
    assert at_motors(None, Q) is Q
    assert motor_torque(None, Q) is Q
    assert joint_torque(None, Q) is Q
    assert UR5.chain.rotor_coupling is None


def test_friction_of_motor_6_acts_on_joints_5_and_6():
    """By hand: θ̇₆ = q̇₆ + q̇₅/2, its friction on joint 6, half of it on joint 5."""
    torque = RunningFriction(COUPLED.friction, T).torque(Q, DQ)
    speed = DQ[:, 5] + 0.5 * DQ[:, 4]
    expected = 2.0 * np.tanh(speed / 0.01) + 3.0 * speed
    np.testing.assert_allclose(torque[:, 5], expected, atol=1e-12)
    np.testing.assert_allclose(torque[:, 4], 0.5 * expected, atol=1e-12)
    np.testing.assert_array_equal(torque[:, :4], 0.0)


def test_the_rotor_of_motor_6_belongs_to_the_momenta_of_both():
    """The kinetic energy J₆(q̇₆ + q̇₅/2)²/2, differentiated by hand."""
    more = momentum_terms(COUPLED.chain, Q, DQ).p - momentum_terms(UR5.chain, Q, DQ).p
    J = UR5.chain.rotor_inertia[5]
    np.testing.assert_allclose(more[:, 5], 0.5 * J * DQ[:, 4], atol=1e-12)
    np.testing.assert_allclose(more[:, 4], J * (0.5 * DQ[:, 5] + 0.25 * DQ[:, 4]), atol=1e-12)
    np.testing.assert_allclose(more[:, :4], 0.0, atol=1e-12)


def recording():
    t = 0.01 * np.arange(20)
    return Recording(t=t, q=Q, dq=DQ, current=RNG.normal(size=(20, 6)))


def test_currents_are_the_motors():
    log = recording()
    K = UR5.torque_constant
    torque = drive_torque(log, COUPLED)
    np.testing.assert_allclose(torque[:, 5], K[5] * log.current[:, 5])
    expected = K[4] * log.current[:, 4] + 0.5 * K[5] * log.current[:, 5]
    np.testing.assert_allclose(torque[:, 4], expected)


def test_the_terms_of_observers_are_those_of_the_papers_method():
    log = recording()
    fast, slow = dynamics_terms(log, COUPLED), dynamics_terms(log, COUPLED, literal=True)
    np.testing.assert_allclose(fast.p, slow.p, atol=1e-9)
    # the numeric derivative of (11)
    np.testing.assert_allclose(fast.mu, slow.mu, atol=1e-4)
    online = OnlineKalman(KalmanObserver(), COUPLED, 0.01, averaged=False)
    p, rest = online.terms(Q[3], DQ[3])
    np.testing.assert_allclose(p, fast.p[3], atol=1e-9)
    np.testing.assert_allclose(rest + drive_torque(log, COUPLED)[3], fast.mu[3], atol=1e-9)


def test_it_is_written_and_read(tmp_path):
    path = tmp_path / "coupled.toml"
    path.write_text(robot_toml(COUPLED), encoding="utf-8")
    np.testing.assert_array_equal(load_robot(path).chain.transmission, T)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[1.0]]", "must be 6 lists of 6 finite numbers"),
        ("3", "must be 6 lists of 6 finite numbers"),
        (str([[1.0] * 5] * 6), "has the row"),
        (str((2.0 * np.eye(6)).tolist()), "another diagonal than 1"),
        (str(np.ones((6, 6)).tolist()), "two motors turn alike"),
        (str((T + 200.0 * np.eye(6, k=1)).tolist()), "transmission"),
    ],
)
def test_what_is_no_transmission_is_refused_with_its_line(text, message, tmp_path):
    path = tmp_path / "coupled.toml"
    path.write_text(f"transmission = {text}\n{robot_toml(UR5)}", encoding="utf-8")
    with pytest.raises(RobotError, match=message) as error:
        load_robot(path)
    assert "line 1" in str(error.value)


def test_the_identity_is_no_coupling(tmp_path):
    path = tmp_path / "plain.toml"
    text = f"transmission = {np.eye(6).tolist()}\n{robot_toml(UR5)}"
    path.write_text(text, encoding="utf-8")
    assert load_robot(path).chain.transmission is None


def test_what_is_not_simulated_is_refused(tmp_path):
    from vftcli.simulation import simulate
    from vftcli.simulation.load import load_scenario

    path = tmp_path / "coupled.toml"
    path.write_text(robot_toml(COUPLED), encoding="utf-8")
    scenario = replace(load_scenario("ur5-circle"), robot=str(path))
    with pytest.raises(ParameterError, match="driven through each other"):
        simulate(scenario, seed=0)
