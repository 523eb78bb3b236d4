"""Filter, likelihood and smoother against a dense solve; robust least squares."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from vftcli.signals import estimation
from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError

BLOCKS = 40


def models(count: int, joints: int, pinned: slice) -> estimation.LinearModel:
    """Models of a wrench and of one error a joint at random; the wrench certain where pinned."""
    rng = np.random.default_rng(1)
    shape = (BLOCKS, count)
    decay = rng.uniform(0.3, 0.999, (*shape, 6 + joints))
    added = rng.uniform(0.01, 1.0, decay.shape) * np.repeat([400.0, 4.0, 2.0], [3, 3, joints])
    decay[0] = 0.0
    decay[pinned, :, :6] = added[pinned, :, :6] = 0.0
    if pinned.stop and pinned.stop < BLOCKS:
        decay[pinned.stop, :, :6] = 0.0
    observation = np.zeros((*shape, 6 + joints, joints))
    observation[..., :6, :] = rng.standard_normal((*shape, 6, joints))
    observation[..., 6:, :] = np.eye(joints)
    observation[rng.random(shape) < 0.15] = 0.0
    d = 5.0 * rng.standard_normal((*shape, joints))
    white = rng.uniform(0.1, 1.0, (*shape, joints))
    return estimation.LinearModel(d, observation, white, decay, added)


def dense(model: estimation.LinearModel) -> tuple[Array, Array, float]:
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
def test_side_by_side_they_are_the_dense_solve(joints, pinned, monkeypatch):
    monkeypatch.setattr(estimation, "STRETCH", 16)
    made = models(3, joints, pinned)
    mean, covariance = estimation.smoothed(made)
    assert not mean[pinned, :, :6].any()  # zero and certain
    assert not covariance[pinned, :, :6].any()
    likely = estimation.log_likelihood(made) - 0.5 * made.d[:, 0].size * np.log(2.0 * np.pi)
    for lane in range(3):
        one = estimation.LinearModel(*(series[:, lane] for series in made))
        exact, P, logarithm = dense(one)
        # 40 blocks of numbers up to 400, of which rounding leaves 1e-12
        np.testing.assert_allclose(mean[:, lane], exact, atol=1e-9)
        np.testing.assert_allclose(covariance[:, lane], P, atol=1e-9)
        np.testing.assert_allclose(likely[lane], logarithm, rtol=1e-9)
        np.testing.assert_allclose(estimation.smoothed(one)[0], exact, atol=1e-9)


def test_a_spike_counts_with_its_own_variance() -> None:
    """One block of variance 4 + 1 reads 10: the square is 20, the gain 4/5 or a 40th of it."""
    four, one = np.full((1, 1), 4.0), np.ones((1, 1))
    block = estimation.LinearModel(10.0 * one, np.ones((1, 1, 1)), one, 0.0 * one, four)
    for limit, share in ((21.0, 1.0), (19.0, 1.0 / estimation.SPIKE)):
        found = next(estimation.filtered(block, np.full(1, limit)))
        assert found.square == pytest.approx(20.0)
        assert found.spread[0, 0] == pytest.approx(5.0)
        assert found.mean[0] == pytest.approx(share * 8.0)
        assert found.covariance[0, 0] == pytest.approx(4.0 - share * 3.2)


# Weighted robust least squares: planted numbers, honest spreads


def problem(seed, samples=2000):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(samples, 4)) * [1.0, 10.0, 0.1, 1.0]
    x = np.array([3.0, -0.2, 5.0, 0.7])
    return rng, A, x, A @ x


@pytest.mark.parametrize("seed", range(3))
def test_planted_values_lie_within_their_spread(seed):
    rng, A, x, y = problem(seed)
    fit = estimation.fit_column(A, y + rng.normal(size=len(y)), np.ones(len(y)))
    # five standard deviations: one in a million
    assert np.all(np.abs(fit.values - x) < 5 * fit.sd)
    # white noise: sd = 1/(√N·scale) within the 3 % that 2000 samples allow, 20 % with Huber's loss
    np.testing.assert_allclose(fit.sd, 1 / np.sqrt(2000) / np.std(A, axis=0), rtol=0.2)


def test_outliers_hardly_count():
    rng, A, x, y = problem(5)
    spoilt = y + 0.1 * rng.normal(size=len(y))
    spoilt[100:200] += 50.0
    robust = estimation.fit_column(A, spoilt, np.ones(len(y)))
    plain = estimation.solve(A, spoilt)
    assert np.linalg.norm(robust.values - x) < 0.1 * np.linalg.norm(plain - x)
    assert np.all(robust.weights[100:200] < 0.05)


def test_samples_without_weight_do_not_count_at_all():
    _, A, x, y = problem(6)
    weights = np.ones(len(y))
    weights[:1000] = 0.0
    y = y.copy()
    y[:1000] = 1e6
    # exact equations: rounding only
    np.testing.assert_allclose(estimation.fit_column(A, y, weights).values, x, rtol=1e-6)


def test_what_no_column_tells_stays_zero_and_an_inverse_is_that_of_those_that_tell():
    """Columns a hundredfold apart, one of nothing: the plain inverse, and zeros."""
    _, A, _, y = problem(7)
    A = np.hstack([A, np.zeros((len(y), 1))])
    assert estimation.solve(A, y)[-1] == 0.0
    expected = np.zeros((5, 5))
    expected[:4, :4] = np.linalg.inv(A[:, :4].T @ A[:, :4])
    # condition number 1e4: rounding below 1e-11
    scale = np.sqrt(np.diag(expected)).max()
    np.testing.assert_allclose(estimation.inverse_of(A.T @ A), expected, atol=1e-9 * scale**2)


def test_too_few_samples_are_refused():
    with pytest.raises(IdentificationError, match="3 samples in motion for 4 unknowns"):
        estimation.fit_column(np.ones((3, 4)), np.ones(3), np.ones(3))


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_correlation_time_of_an_autoregressive_series(rho):
    """AR(1): 1 + 2 Σ ρᵏ = (1 + ρ)/(1 − ρ)."""
    noise = np.random.default_rng(8).normal(size=200_000)
    series = np.empty_like(noise)
    series[0] = noise[0]
    for k in range(1, len(noise)):
        series[k] = rho * series[k - 1] + noise[k]
    # the sum ends at the first non-positive estimate: some per cent of truncation
    assert estimation.correlation_time(series) == pytest.approx((1 + rho) / (1 - rho), rel=0.1)


def refitted(A, y, weights, parts):
    """RMS of the rows of each part by a fit without them."""
    root, total, count = np.sqrt(weights), 0.0, 0.0
    for out in parts:
        keep = np.setdiff1d(np.arange(len(y)), out)
        x = np.linalg.lstsq(A[keep] * root[keep, None], y[keep] * root[keep], rcond=None)[0]
        total += np.sum(weights[out] * (y[out] - A[out] @ x) ** 2)
        count += weights[out].sum()
    return np.sqrt(total / count)


@pytest.mark.parametrize(
    ("lengths", "edges"),
    [
        ([400, 100], range(0, 401, 80)),  # one log in fifths
        ([303, 157, 40], (0, 303, 460)),  # of several each whole
        ([157, 303, 40], (0, 157, 460)),
    ],
)
def test_cross_validation_equals_fitting_each_time_anew(lengths, edges):
    """The last log tells nothing and is always kept."""
    rng, A, _, y = problem(9, 500)
    y = y + rng.normal(size=len(y))
    weights = rng.uniform(0.2, 1.0, len(y))
    expected = refitted(A, y, weights, [np.arange(*span) for span in pairwise(edges)])
    found = estimation.left_out(lengths, [True] * (len(lengths) - 1) + [False])
    # normal equations square the condition number, here 1e2: rounding below 1e-11
    assert estimation.cross_validated(A, y, weights, found) == pytest.approx(expected, rel=1e-9)
    # sums of squares far below 1 count as they are
    small = estimation.cross_validated(A, 1e-6 * y, weights, found)
    assert small == pytest.approx(1e-6 * expected, rel=1e-9)


def test_the_robust_spread_of_normal_noise():
    # 100 000 samples: 0.4 % statistical
    sd = np.array([2.0, 0.5])
    noise = np.random.default_rng(1).normal(0, sd, (100_000, 2))
    np.testing.assert_allclose(estimation.robust_sd(noise), sd, rtol=0.02)
    np.testing.assert_array_equal(estimation.robust_sd(noise[:0]), [0.0, 0.0])
