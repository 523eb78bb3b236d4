"""The virtual sensor of a loop: its wrench is the log's, and nothing where the pose tells none."""

import numpy as np
import pytest

from vftcli.admittance.closed_loop import OnlineKalman
from vftcli.observers import KalmanObserver
from vftcli.robots import load_robot
from vftcli.robots.friction import friction_torque
from vftcli.robots.kernels import momentum_terms
from vftcli.signals.external_torque import ExternalTorque
from vftcli.wrench.solvers import VirtualSensor

KFO = KalmanObserver(discretisation="fe", r_diag=0.5, q_p_diag=0.01, q_tau_diag=5000.0)


@pytest.mark.parametrize(
    ("name", "q"),
    [
        ("ur5", [0.3, -1.2, 1.4, -1.7, -1.5, 0.2]),
        ("panda", [0.3, -0.6, 0.2, -2.2, 0.1, 1.8, 0.5]),
    ],
)
def test_the_wrench_is_that_of_the_log(name: str, q: list[float]) -> None:
    robot = load_robot(name)
    sensor = OnlineKalman(KFO, robot, 0.001, averaged=False)
    sensor.tau = np.random.default_rng(1).normal(0.0, 10.0, robot.joints)
    torque = ExternalTorque(name="x", t=np.zeros(1), tau=sensor.tau[None])
    logged = VirtualSensor(frame="base").wrench(torque, np.array([q]), robot.chain)
    # two ways to the Jacobian, κ² of some 1e3 times rounding of 10 N·m
    np.testing.assert_allclose(sensor.wrench(np.array(q)), logged.values[0], atol=1e-10)


def test_a_singular_pose_reads_no_force() -> None:
    sensor = OnlineKalman(KFO, load_robot("ur5"), 0.001, averaged=False)
    sensor.tau = np.ones(6)
    np.testing.assert_array_equal(sensor.wrench(np.array([0, -1.0, 0, 0.3, 1.2, 0])), np.zeros(6))


def test_the_first_sample_starts_at_no_torque() -> None:
    robot = load_robot("ur5")
    sensor = OnlineKalman(KFO, robot, 0.001, averaged=True)
    q, dq = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2]), np.full(6, 0.1)
    np.testing.assert_array_equal(sensor.sample(q, dq, np.full(6, 50.0)), np.zeros(6))
    terms = momentum_terms(robot.loaded_chain, q[None], dq[None])
    np.testing.assert_allclose(sensor.p, terms.p[0], atol=1e-12)
    # its mean of 50 N·m over the step enters as it is
    mu = terms.coriolis_transpose_dq - terms.gravity
    mu -= friction_torque(robot.friction, dq[None], terms.gravity)
    np.testing.assert_allclose(sensor.mu, mu[0], atol=1e-9)
