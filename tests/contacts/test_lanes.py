"""Kalman passes over lanes, against a dense Gaussian solve."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from vftcli.contacts.lanes import Lanes, nats, smoothed
from vftcli.signals.arrays import Array

BLOCKS, JOINTS = 40, 6


def lanes(count: int, gated: bool, seed: int) -> Lanes:
    """Lanes with random Jacobians and disturbances; gated ones open in the middle only."""
    rng = np.random.default_rng(seed)
    shape = (BLOCKS, count)
    decay = np.empty((*shape, 6 + JOINTS))
    added = np.empty_like(decay)
    decay[..., :6], added[..., :6] = 0.9, 19.0
    decay[..., 6:], added[..., 6:] = 0.97, 0.2
    if gated:
        closed = (np.arange(BLOCKS) < 12) | (np.arange(BLOCKS) >= 25)
        decay[closed, :, :6] = added[closed, :, :6] = 0.0
        decay[12, :, :6], added[12, :, :6] = 0.0, 100.0
    decay[0], added[0, :, 6:] = 0.0, 4.0
    return Lanes(
        d=rng.standard_normal((*shape, JOINTS)) * 5.0,
        jacobian=rng.standard_normal((*shape, 6, JOINTS)),
        white=rng.uniform(0.1, 1.0, (*shape, JOINTS)),
        decay=decay,
        added=added,
    )


def dense(lane: Lanes, number: int) -> tuple[Array, Array, float]:
    """Mean and covariance of the states given all blocks, and ln p(d), by one large solve."""
    size = 6 + JOINTS
    prior = np.zeros((BLOCKS * size, BLOCKS * size))
    variance = np.zeros(size)
    for k in range(BLOCKS):
        f = lane.decay[k, number]
        here = slice(k * size, (k + 1) * size)
        if k:
            before = slice((k - 1) * size, k * size)
            prior[here, : k * size] = f[:, None] * prior[before, : k * size]
            prior[: k * size, here] = prior[here, : k * size].T
        variance = f * f * variance + lane.added[k, number]
        prior[here, here] = np.diag(variance)
    H = np.zeros((BLOCKS * JOINTS, BLOCKS * size))
    for k in range(BLOCKS):
        rows = slice(k * JOINTS, (k + 1) * JOINTS)
        H[rows, k * size : k * size + 6] = lane.jacobian[k, number].T
        H[rows, k * size + 6 : (k + 1) * size] = np.eye(JOINTS)
    S = H @ prior @ H.T + np.diag(lane.white[:, number].ravel())
    gain = np.linalg.solve(S, H @ prior).T
    d = lane.d[:, number].ravel()
    likely = float(multivariate_normal(np.zeros(len(d)), S).logpdf(d))
    mean = (gain @ d).reshape(BLOCKS, size)
    return mean, prior - gain @ H @ prior, likely


@pytest.mark.parametrize("gated", [False, True])
def test_lanes_agree_with_a_dense_solve(gated: bool) -> None:
    made = lanes(3, gated, seed=4)
    mean, covariance = smoothed(made)
    likely = nats(made)
    for number in range(3):
        exact, P, logarithm = dense(made, number)
        # Rounding of a solve of 480 states.
        np.testing.assert_allclose(mean[:, number], exact, atol=1e-9 * np.abs(exact).max())
        for k in (0, 12, 20, BLOCKS - 1):
            block = P[k * 12 : (k + 1) * 12, k * 12 : (k + 1) * 12]
            np.testing.assert_allclose(covariance[k, number], block, atol=1e-9 * np.abs(P).max())
        constant = 0.5 * BLOCKS * JOINTS * np.log(2.0 * np.pi)
        np.testing.assert_allclose(likely[number] - constant, logarithm, rtol=1e-9)


def test_outside_the_gate_the_wrench_is_zero_with_certainty() -> None:
    mean, covariance = smoothed(lanes(2, True, seed=5))
    outside = (np.arange(BLOCKS) < 12) | (np.arange(BLOCKS) >= 25)
    assert np.all(mean[outside, :, :6] == 0.0)
    assert np.all(covariance[outside][:, :, :6, :6] == 0.0)
    assert np.all(np.linalg.norm(mean[~outside, :, :6], axis=-1) > 0.0)


@pytest.mark.statistical
def test_bands_hold_what_was_drawn_from_the_model() -> None:
    """200 drawn lanes: 95 % of the wrench's components within 1.96 standard deviations."""
    rng = np.random.default_rng(6)
    made = lanes(200, True, seed=6)
    x = np.zeros((200, 12))
    d, states = np.empty_like(made.d), np.empty((BLOCKS, 200, 12))
    for k in range(BLOCKS):
        x = made.decay[k] * x + np.sqrt(made.added[k]) * rng.standard_normal(x.shape)
        states[k] = x
        noise = np.sqrt(made.white[k]) * rng.standard_normal((200, JOINTS))
        d[k] = np.einsum("li,lij->lj", x[:, :6], made.jacobian[k]) + x[:, 6:] + noise
    mean, covariance = smoothed(made._replace(d=d))
    inside = slice(12, 25)
    sd = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))[inside, :, :6]
    held = np.abs(mean - states)[inside, :, :6] < 1.96 * sd
    # 200 lanes of 13 blocks that hang together: some 600 free numbers an axis, ±.02.
    assert np.all((held.mean(axis=(0, 1)) > 0.93) & (held.mean(axis=(0, 1)) < 0.97))
