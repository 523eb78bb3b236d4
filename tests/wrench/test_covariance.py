"""The 95 % band where it must hold: a disturbance drawn from the Kalman filter's own model."""

import numpy as np
import pytest

from vftcli.observers import KalmanObserver
from vftcli.robots import load_robot
from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque
from vftcli.wrench.solvers import VirtualSensor

STEP = 0.008
POSE = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2])
R = np.array([0.5, 0.5, 0.5, 1.3, 1.3, 1.3])
Q_P = np.array([0.01, 0.01, 0.01, 0.02, 0.02, 0.02])
Q_TAU = np.full(6, 5000.0)
"""The paper's gains of the UR5, Sec. IV-A."""


def drawn(observer: KalmanObserver, samples: int, rng: np.random.Generator):
    """One run of the filter's own model: a random-walk torque, and its noisy momentum.

    x_{k+1} = A x_k + w with cov(w) = Q, y_k = p_k + v with var(v) = R of the discrete model; μ = 0.
    """
    model = observer.model(STEP, 6)
    x = np.zeros((2, 6))
    p, tau = np.empty((samples, 6)), np.empty((samples, 6))
    l11 = np.sqrt(model.q11)
    l21 = model.q12 / l11
    l22 = np.sqrt(model.q22 - l21**2)
    for k in range(samples):
        a, b = rng.standard_normal((2, 6))
        x = np.array([x[0] + model.a12 * x[1] + l11 * a, model.a22 * x[1] + l21 * a + l22 * b])
        p[k] = x[0] + np.sqrt(model.r) * rng.standard_normal(6)
        tau[k] = x[1]
    t = np.arange(samples) * STEP
    return DynamicsTerms(t=t, p=p, mu=np.zeros_like(p)), tau


SCHEMES = ["fe", pytest.param("zoh", marks=pytest.mark.statistical)]


@pytest.mark.slow
@pytest.mark.parametrize("scheme", SCHEMES)
def test_over_200_simulations_the_band_holds_the_truth_in_93_to_97_percent(scheme: str) -> None:
    """200 runs of 100 samples, correlated over about 25: 800 independent ones, ± 0.8 % each way."""
    first, last, runs = 150, 250, 200
    observer = KalmanObserver(discretisation=scheme, r_diag=R, q_p_diag=Q_P, q_tau_diag=Q_TAU)
    chain, sensor = load_robot("ur5").chain, VirtualSensor(frame="flange")
    held = np.zeros(6)
    for seed in range(runs):
        terms, tau = drawn(observer, last, np.random.default_rng(seed))
        q = np.tile(POSE, (last, 1))
        estimate = observer.estimate(terms)
        truth = ExternalTorque(name="truth", t=terms.t, tau=tau)
        own = {estimate.name: estimate.sd}
        reported, true = sensor.wrenches((estimate, truth), q, chain, own)
        inside = np.abs(reported.values - true.values) <= 1.96 * reported.sd
        held += inside[first:].mean(axis=0)
    share = held / runs
    assert np.all((share > 0.93) & (share < 0.97)), share
