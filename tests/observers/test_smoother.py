"""The smoother against a dense Rauch–Tung–Striebel textbook implementation, and its symmetries."""

from typing import Any

import numpy as np
import pytest
from made_terms import dense_filter, random_walk

from vftcli.observers import KalmanObserver
from vftcli.observers.smoother import KalmanSmoother
from vftcli.signals.external_torque import DynamicsTerms

R, Q_P, Q_TAU = np.array([0.5, 1.3]), np.array([0.01, 0.02]), np.array([5000.0, 5000.0])
STEP = 0.008
WIDE = 1e9  # [(N·m·s)², (N·m)²]


def smoother(scheme: str = "fe", convention: str = "density", **more: object) -> KalmanSmoother:
    own = {"r_diag": R, "q_p_diag": Q_P, "q_tau_diag": Q_TAU, "noise_convention": convention}
    return KalmanSmoother(filter=KalmanObserver(discretisation=scheme, **own, **more))


def dense_rts(steps: list[Any]) -> tuple[np.ndarray, np.ndarray]:
    """Backward smoother with full 2n-state matrices, as in any textbook, on a dense filter."""
    xs, Ps = steps[-1][1]
    n = len(xs) // 2
    tau, sd = [xs[n:]], [np.sqrt(np.diag(Ps)[n:])]
    for k in range(len(steps) - 2, -1, -1):
        (x, P), (x_next, P_next, A) = steps[k][1], steps[k + 1][0]
        G = P @ A.T @ np.linalg.inv(P_next)
        xs, Ps = x + G @ (xs - x_next), P + G @ (Ps - P_next) @ G.T
        tau.append(xs[n:])
        sd.append(np.sqrt(np.diag(Ps)[n:]))
    return np.array(tau[::-1]), np.array(sd[::-1])


@pytest.mark.parametrize("convention", ["density", "discrete", "literal"])
@pytest.mark.parametrize("scheme", ["fe", "zoh"])
@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_agrees_with_a_dense_textbook_smoother(scheme, convention, jitter):
    log = random_walk(700, jitter, joints=2)
    smooth = smoother(scheme, convention)
    # The first state may be anything: `WIDE` is its variance.
    estimate, (tau, sd) = smooth.estimate(log), dense_rts(dense_filter(smooth.filter, log, WIDE))
    # the dense one rounds at `WIDE`, 1e-7 (N·m)² beside variances of .001 to 1000
    np.testing.assert_allclose(estimate.tau, tau, atol=2e-6, rtol=0)
    np.testing.assert_allclose(estimate.sd, sd, rtol=5e-4)
    # Its rounding fades from the first sample on: far from there it is that of the recursion.
    far = slice(350, None)
    np.testing.assert_allclose(estimate.tau[far], tau[far], atol=1e-10, rtol=0)
    np.testing.assert_allclose(estimate.sd[far], sd[far], rtol=1e-9)


@pytest.mark.parametrize("scheme", ["fe", "zoh"])
@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_a_constant_torque_is_known_from_the_first_sample_to_the_last(scheme, jitter):
    """Whatever was there before the log: 3 and 50 N·m at sample 0, none of it wandered."""
    rng = np.random.default_rng(4)
    t = STEP * (np.arange(1000) + jitter * rng.uniform(-0.5, 0.5, 1000))
    truth = np.array([3.0, 50.0])
    p = (t - t[0])[:, None] * truth
    estimate = smoother(scheme).estimate(DynamicsTerms(t=t, p=p, mu=np.zeros_like(p)))
    # no noise, no error: rounding of p, some 100 N·m·s, over the time constant of .1 s
    np.testing.assert_allclose(estimate.tau, np.tile(truth, (1000, 1)), atol=1e-9, rtol=0)
    noisy = p + np.sqrt(R / STEP) * rng.standard_normal(p.shape)
    estimate = smoother(scheme).estimate(DynamicsTerms(t=t, p=noisy, mu=np.zeros_like(p)))
    assert np.all(np.abs(estimate.tau[0] - truth) < 1.96 * estimate.sd[0])


def test_frequency_response_is_that_of_the_two_sided_filter():
    samples, f = 8000, 1.5
    t = np.arange(samples) * 0.001
    w = 2 * np.pi * f
    p = -np.cos(w * t)[:, None] / w * np.ones(2)
    smooth = smoother("zoh")
    answer = smooth.estimate(DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))).tau[2000:6000]
    basis = np.column_stack([np.sin(w * t[2000:6000]), np.cos(w * t[2000:6000])])
    sine, cosine = np.linalg.lstsq(basis, answer, rcond=None)[0]
    response = smooth.frequency_response(np.array([f]), 0.001, 2)[0]
    # the formula is that of the continuous filter: (ω_n Ts)² = 1e-4 at 1 kHz
    np.testing.assert_allclose(sine, response.real, atol=1e-4)
    np.testing.assert_allclose(cosine, 0.0, atol=1e-4)


def test_the_bandwidth_is_that_of_the_formula():
    tuning = smoother().tuning(STEP, 2)
    # −3 dB of |H_KFO|² at .802 ω_n for ζ = .707
    np.testing.assert_allclose(2 * np.pi * tuning.bandwidth / tuning.omega_n, 0.802, atol=1e-3)
    assert not np.any(tuning.delay)


def test_a_gap_of_days_parts_a_log_into_two():
    """Nothing is known across it: each part is what a log of its own gives, but near the gap."""
    rng = np.random.default_rng(3)
    t = STEP * np.arange(2000)
    t[200:] += 1e6
    p, mu = np.cumsum(rng.standard_normal((2000, 2)), axis=0) * STEP, np.zeros((2000, 2))
    whole = smoother().estimate(DynamicsTerms(t=t, p=p, mu=mu))
    late = smoother().estimate(DynamicsTerms(t=t[200:], p=p[200:], mu=mu[200:]))
    assert np.all(np.isfinite(whole.tau))
    assert np.all(np.isfinite(whole.sd))
    # forgotten at 7 rad/s in 13 s; stamps at 1e6 s are rounded by 1e-10 s, 1e-8 of a step
    np.testing.assert_allclose(whole.tau[1800:], late.tau[1600:], atol=1e-9)


@pytest.mark.parametrize("samples", [0, 1, 2])
@pytest.mark.parametrize("scheme", ["fe", "zoh"])
def test_a_part_of_a_log_may_be_a_sample_or_none(samples, scheme):
    """As between two gaps, or of an episode without rows; one sample alone shows no torque."""
    p = np.arange(samples * 2.0).reshape(samples, 2)
    log = DynamicsTerms(t=STEP * np.arange(samples), p=p, mu=np.zeros_like(p))
    estimate = smoother(scheme).estimate(log)
    assert estimate.tau.shape == (samples, 2)
    assert np.isfinite(estimate.tau).all()
    np.testing.assert_array_equal(estimate.tau[: samples == 1], 0.0)
