"""Filter, likelihood and smoother against a dense Gaussian solve of all blocks at once."""

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from vftcli.signals import estimation as module
from vftcli.signals.arrays import Array
from vftcli.signals.estimation import (
    SPIKE,
    LinearModel,
    beside_errors,
    filtered,
    log_likelihood,
    smoothed,
)

BLOCKS = 40


def models(count: int, seed: int, joints: int = 6, pinned: slice = slice(0)) -> LinearModel:
    """Models of a wrench and of one error a joint at random; the wrench certain where pinned."""
    rng = np.random.default_rng(seed)
    shape = (BLOCKS, count)
    decay = rng.uniform(0.3, 0.999, (*shape, 6 + joints))
    added = rng.uniform(0.01, 1.0, decay.shape) * np.repeat([400.0, 4.0, 2.0], [3, 3, joints])
    decay[0] = 0.0
    decay[pinned, :, :6] = added[pinned, :, :6] = 0.0
    if pinned.stop and pinned.stop < BLOCKS:
        decay[pinned.stop, :, :6] = 0.0
    observation = beside_errors(rng.standard_normal((*shape, 6, joints)))
    observation[rng.random(shape) < 0.15] = 0.0
    return LinearModel(
        d=5.0 * rng.standard_normal((*shape, joints)),
        observation=observation,
        white=rng.uniform(0.1, 1.0, (*shape, joints)),
        decay=decay,
        added=added,
    )


def dense(model: LinearModel) -> tuple[Array, Array, float]:
    """Mean and covariance of every block, and ln p(d), from one joint normal distribution."""
    (blocks, size), n = model.decay.shape, model.d.shape[-1]
    prior = np.zeros((blocks, size, blocks, size))
    own = np.zeros(size)
    for k in range(blocks):
        own = model.decay[k] ** 2 * own + model.added[k]
        for j in range(k, blocks):
            kept = np.diag(own * model.decay[k + 1 : j + 1].prod(axis=0))
            prior[k, :, j] = prior[j, :, k] = kept
    P = prior.reshape(blocks * size, blocks * size)
    H = np.zeros((blocks, n, blocks, size))
    H[np.arange(blocks), :, np.arange(blocks)] = model.observation.swapaxes(1, 2)
    H = H.reshape(blocks * n, blocks * size)
    S = H @ P @ H.T + np.diag(model.white.ravel())
    gain, d = np.linalg.solve(S, H @ P).T, model.d.ravel()
    covariance = (P - gain @ H @ P).reshape(blocks, size, blocks, size)
    each = np.arange(blocks)
    likely = float(multivariate_normal(np.zeros(len(d)), S).logpdf(d))
    return (gain @ d).reshape(blocks, size), covariance[each, :, each], likely


@pytest.mark.parametrize("joints", [6, 7])
@pytest.mark.parametrize("pinned", [slice(0), slice(0, 12), slice(15, 25)])
def test_side_by_side_they_are_the_dense_solve(
    joints: int, pinned: slice, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "STRETCH", 16)
    made = models(3, 1, joints, pinned)
    mean, covariance = smoothed(made)
    assert not mean[pinned, :, :6].any()  # zero and certain
    assert not covariance[pinned, :, :6].any()
    likely = log_likelihood(made) - 0.5 * made.d[:, 0].size * np.log(2.0 * np.pi)
    for lane in range(3):
        one = LinearModel(*(series[:, lane] for series in made))
        exact, P, logarithm = dense(one)
        # 40 blocks of numbers up to 400, of which rounding leaves 1e-12
        np.testing.assert_allclose(mean[:, lane], exact, atol=1e-9)
        np.testing.assert_allclose(covariance[:, lane], P, atol=1e-9)
        np.testing.assert_allclose(likely[lane], logarithm, rtol=1e-9)
        np.testing.assert_allclose(smoothed(one)[0], exact, atol=1e-9)


def test_a_spike_counts_with_its_own_variance() -> None:
    """One block of variance 4 + 1 reads 10: the square is 20, the gain 4/5 or a 40th of it."""
    four, one = np.full((1, 1), 4.0), np.ones((1, 1))
    block = LinearModel(10.0 * one, np.ones((1, 1, 1)), one, 0.0 * one, four)
    for limit, share in ((21.0, 1.0), (19.0, 1.0 / SPIKE)):
        found = next(filtered(block, np.full(1, limit)))
        assert found.square == pytest.approx(20.0)
        assert found.spread[0, 0] == pytest.approx(5.0)
        assert found.mean[0] == pytest.approx(share * 8.0)
        assert found.covariance[0, 0] == pytest.approx(4.0 - share * 3.2)
