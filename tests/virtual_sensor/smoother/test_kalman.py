"""The filter and smoother against a dense Gaussian solve of all blocks at once."""

import numpy as np
import pytest

from vftcli.robots import load_robot
from vftcli.robots.kinematics import flange_jacobian
from vftcli.virtual_sensor.smoother.kalman import (
    Evolution,
    Measurement,
    Smoothed,
    filter_forward,
    likelihoods,
    smooth_backward,
)

BLOCKS = 40


def model(joints: int, seed: int, pinned: slice) -> tuple[Evolution, Measurement]:
    """Decays, variances and disturbances at random; the wrench certain in the pinned blocks."""
    rng = np.random.default_rng(seed)
    chain = load_robot("ur5" if joints == 6 else "panda").chain
    decay = rng.uniform(0.3, 0.999, (BLOCKS, 6 + joints))
    variance = rng.uniform(0.01, 1.0, (BLOCKS, 6 + joints)) * [
        *[400.0] * 3,
        *[4.0] * 3,
        *[2] * joints,
    ]
    decay[0] = 0.0
    decay[pinned, :6] = variance[pinned, :6] = 0.0
    if pinned.stop and pinned.stop < BLOCKS:
        decay[pinned.stop, :6] = 0.0
    known = rng.random(BLOCKS) > 0.15
    q = rng.uniform(-2.0, 2.0, (BLOCKS, joints))
    return Evolution(decay, variance), Measurement(
        d=5.0 * rng.standard_normal((BLOCKS, joints)),
        jacobian=flange_jacobian(chain, q),
        noise=rng.uniform(0.01, 0.5, joints),
        known=known,
    )


def dense(evolution: Evolution, measured: Measurement) -> tuple[Smoothed, float]:
    """Mean and covariance of every block, and ln p(d), from one joint normal distribution."""
    decay, variance = evolution
    size, joints = decay.shape[1], measured.d.shape[1]
    prior = np.zeros((BLOCKS, size, BLOCKS, size))
    for k in range(BLOCKS):
        before = np.diag(prior[k - 1, :, k - 1]) if k else np.zeros(size)
        own = decay[k] ** 2 * before + variance[k]
        for j in range(k, BLOCKS):
            prior[k, :, j] = prior[j, :, k] = np.diag(own * decay[k + 1 : j + 1].prod(axis=0))
    P = prior.reshape(BLOCKS * size, BLOCKS * size)
    seen = np.flatnonzero(measured.known)
    H = np.zeros((len(seen) * joints, BLOCKS * size))
    for row, k in enumerate(seen):
        rows = slice(row * joints, (row + 1) * joints)
        H[rows, k * size : k * size + 6] = measured.jacobian[k].T
        H[rows, k * size + 6 : (k + 1) * size] = np.eye(joints)
    S = H @ P @ H.T + np.diag(np.tile(measured.noise, len(seen)))
    gain = np.linalg.solve(S, H @ P).T
    d = measured.d[seen].ravel()
    covariance = (P - gain @ H @ P).reshape(BLOCKS, size, BLOCKS, size)
    blocks = np.arange(BLOCKS)
    nats = -0.5 * (d @ np.linalg.solve(S, d) + np.linalg.slogdet(S).logabsdet)
    return Smoothed((gain @ d).reshape(BLOCKS, size), covariance[blocks, :, blocks]), nats


@pytest.mark.parametrize("joints", [6, 7])
@pytest.mark.parametrize("pinned", [slice(0, 0), slice(0, 12), slice(15, 25)])
def test_it_is_the_dense_solve(joints: int, pinned: slice) -> None:
    evolution, measured = model(joints, 1, pinned)
    found = smooth_backward(evolution, filter_forward(evolution, measured))
    expected, _ = dense(evolution, measured)
    # 40 blocks of numbers up to 400, of which rounding leaves 1e-12
    np.testing.assert_allclose(found.mean, expected.mean, atol=1e-9)
    np.testing.assert_allclose(found.covariance, expected.covariance, atol=1e-9)


def test_what_is_pinned_is_zero_and_certain() -> None:
    evolution, measured = model(6, 2, slice(10, 30))
    found = smooth_backward(evolution, filter_forward(evolution, measured))
    assert not found.mean[10:30, :6].any()
    assert not found.covariance[10:30, :6].any()
    assert not found.covariance[10:30, :, :6].any()
    assert np.all(np.diagonal(found.covariance[:10, :6, :6], axis1=1, axis2=2) > 0.0)


def test_the_likelihoods_side_by_side_are_those_of_the_dense_solve() -> None:
    each = [model(6, seed, slice(0, 0))[0] for seed in (3, 4)]
    _, measured = model(6, 3, slice(0, 0))
    both = Evolution(*(np.stack(part, axis=1) for part in zip(*each, strict=True)))
    expected = [dense(evolution, measured)[1] for evolution in each]
    np.testing.assert_allclose(likelihoods(both, measured), expected, rtol=1e-10)


def test_a_log_of_which_nothing_is_known_leaves_the_prior() -> None:
    evolution, measured = model(6, 5, slice(0, 0))
    blind = measured._replace(known=np.zeros(BLOCKS, dtype=bool))
    forward = filter_forward(evolution, blind)
    found = smooth_backward(evolution, forward)
    np.testing.assert_allclose(found.mean, 0.0)
    np.testing.assert_allclose(found.covariance, forward.predicted, atol=1e-9)
    both = Evolution(evolution.decay[:, None], evolution.variance[:, None])
    np.testing.assert_array_equal(likelihoods(both, blind), [0.0])


@pytest.mark.slow
def test_the_truth_lies_in_the_band_of_a_model_that_is_right() -> None:
    """Drawn from the model itself, 200 times: 95 % bands hold .93 to .97 on every axis.

    8000 wrenches an axis that are correlated over some 10 blocks: ± .02 is three deviations.
    """
    rng = np.random.default_rng(6)
    evolution, measured = model(6, 6, slice(0, 0))
    decay, variance = evolution
    held, root = np.zeros(12), np.sqrt(measured.noise)
    for _ in range(200):
        x, states = np.zeros(12), []
        for k in range(BLOCKS):
            x = decay[k] * x + np.sqrt(variance[k]) * rng.standard_normal(12)
            states.append(x)
        truth = np.array(states)
        d = np.einsum("kij,ki->kj", measured.jacobian, truth[:, :6]) + truth[:, 6:]
        d += root * rng.standard_normal((BLOCKS, 6))
        found = smooth_backward(evolution, filter_forward(evolution, measured._replace(d=d)))
        sd = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
        held += np.mean(np.abs(found.mean - truth) <= 1.96 * sd, axis=0)
    share = held / 200
    assert np.all((share >= 0.93) & (share <= 0.97)), share
