"""The mean disturbance: the external torque itself, smoothed without delay, on any clock."""

import numpy as np
import pytest

from vftcli.signals.external_torque import DynamicsTerms
from vftcli.wrench.sensing import HALF, mean_disturbance


def terms_of(t: np.ndarray, tau: np.ndarray, mu: np.ndarray) -> DynamicsTerms:
    """Terms whose momentum gains μ + τ by the trapezoid, so that τ is what they leave. (T, 1)"""
    gained = 0.5 * ((mu + tau)[1:] + (mu + tau)[:-1]) * np.diff(t)[:, None]
    return DynamicsTerms(t=t, p=np.concatenate([[[0.3]], 0.3 + np.cumsum(gained, axis=0)]), mu=mu)


def uneven(samples: int = 600) -> np.ndarray:
    return np.cumsum(np.random.default_rng(1).uniform(0.002, 0.02, samples))


def test_a_constant_torque_is_itself_on_an_uneven_clock() -> None:
    t = uneven()
    mu = np.sin(3.0 * t)[:, None]
    found = mean_disturbance(terms_of(t, np.full((600, 1), 2.5), mu))
    np.testing.assert_allclose(found.tau, 2.5, atol=1e-10)  # rounding of sums of some 10 N·m·s


def test_a_ramp_keeps_its_place_and_a_step_is_spread_over_the_window() -> None:
    t = np.arange(0.0, 4.0, 0.001)
    inner = (t > HALF) & (t < t[-1] - HALF)
    ramp = mean_disturbance(terms_of(t, t[:, None], np.zeros((len(t), 1))))
    np.testing.assert_allclose(ramp.tau[inner, 0], t[inner], atol=1e-9)
    step = (t >= 2.0).astype(float)[:, None]
    found = mean_disturbance(terms_of(t, step, np.zeros((len(t), 1)))).tau[:, 0]
    expected = np.clip((t - 2.0 + HALF) / (2 * HALF), 0.0, 1.0)
    # the trapezoid puts the step half a sample early, 1 ms of 100
    np.testing.assert_allclose(found, expected, atol=0.01)


def test_noise_of_the_velocity_is_averaged_out() -> None:
    """2 mrad/s on 1.5 kg·m²: the difference of two samples 0.1 s apart leaves √2·3e-3/0.1 N·m."""
    t = np.arange(0.0, 60.0, 0.002)
    p = 1.5 * 2e-3 * np.random.default_rng(2).standard_normal((len(t), 1))
    found = mean_disturbance(DynamicsTerms(t=t, p=p, mu=np.zeros_like(p)))
    # interpolation between neighbours takes a little more off
    assert np.std(found.tau) == pytest.approx(np.sqrt(2) * 3e-3 / (2 * HALF), rel=0.2)


def test_two_samples_tell_the_mean_between_them_and_one_nothing() -> None:
    t = np.array([0.0, 0.02])
    found = mean_disturbance(terms_of(t, np.array([[1.0], [3.0]]), np.array([[5.0], [-2.0]])))
    np.testing.assert_allclose(found.tau, 2.0, rtol=1e-12)
    one = DynamicsTerms(t=np.zeros(1), p=np.ones((1, 6)), mu=np.ones((1, 6)))
    np.testing.assert_array_equal(mean_disturbance(one).tau, np.zeros((1, 6)))
