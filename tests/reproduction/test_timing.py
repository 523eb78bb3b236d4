"""Table II: every part is there, and the paper's way computes what the observers do."""

import numpy as np
import pytest

from vftcli.observers import KalmanObserver, MomentumObserver
from vftcli.reproduction import timing
from vftcli.reproduction.paper import AS_PRINTED, CORRECTED
from vftcli.reproduction.timing import (
    circle,
    dense_kalman_loop,
    first_order_loops,
    held_matrices,
    taylor_exponential,
)
from vftcli.robots import load_robot
from vftcli.robots.terms import dynamics_terms

UR5 = load_robot("ur5")
LOG = circle(UR5, 400)
TERMS = dynamics_terms(LOG, UR5)
STEP = LOG.median_step


def test_every_observer_has_its_time_with_the_dynamics_in_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(timing, "SCRIPT_SAMPLES", 50)
    monkeypatch.setattr(timing, "SAMPLES", 400)
    monkeypatch.setattr(timing, "ROUNDS", 1)
    values = timing.computing_time(0).values
    for variant in (AS_PRINTED, CORRECTED):
        seconds = {name: values[f"seconds/{name}"][variant] for name in timing.PAPER}
        assert all(value > 0.0 for value in seconds.values())
        assert values["zoh/fdo"][variant] == seconds["kfo-zoh"] / seconds["fdo"]
        assert values["cost/gmo"][variant] == pytest.approx(1e6 * seconds["gmo"] / 400)


def test_the_first_order_loop_is_the_momentum_observer() -> None:
    fdo, gmo = first_order_loops(TERMS.p, TERMS.mu, STEP, rate=10.0)
    expected = MomentumObserver(gain=10.0).estimate(TERMS).tau[-1]
    # The same recursion in another order of sums; torques are some tens of N·m.
    np.testing.assert_allclose(gmo, expected, atol=1e-9)
    np.testing.assert_allclose(fdo, expected, atol=1e-9)  # with K = ω they are one filter


@pytest.mark.parametrize("rebuild", [False, True])
def test_the_dense_loop_is_the_steady_kalman_observer(rebuild: bool) -> None:
    kalman = KalmanObserver(discretisation="zoh", r_diag=0.5, q_p_diag=0.01, q_tau_diag=5000.0)
    found = dense_kalman_loop(TERMS.p, TERMS.mu, STEP, kalman, rebuild=rebuild)
    expected = kalman.estimate(TERMS).tau[-1]
    # Started at the steady covariance the two agree to the Riccati equation's accuracy.
    np.testing.assert_allclose(found[6:], expected, rtol=1e-6, atol=1e-6)


def test_the_series_is_the_exponential() -> None:
    from scipy.linalg import expm

    A = 0.05 * np.random.default_rng(0).normal(size=(4, 4))
    # The first term left out is ‖A‖⁶/6! with ‖A‖ of about 0.2.
    np.testing.assert_allclose(taylor_exponential(A), expm(A), atol=1e-6)


def test_the_held_matrices_are_those_of_an_integrator_pair() -> None:
    h, q_p, q_tau = 0.008, np.array([0.01]), np.array([5000.0])
    A, B, Q = held_matrices(h, q_p, q_tau)
    np.testing.assert_allclose(A, [[1, h], [0, 1]], atol=1e-15)
    np.testing.assert_allclose(B, [[h], [0]], atol=1e-15)
    exact = [
        [q_p[0] * h + q_tau[0] * h**3 / 3, q_tau[0] * h**2 / 2],
        [q_tau[0] * h**2 / 2, q_tau[0] * h],
    ]
    np.testing.assert_allclose(Q, exact, rtol=1e-12)
