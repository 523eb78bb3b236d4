"""Weighted robust least squares: planted numbers, honest spreads."""

import numpy as np
import pytest

from vftcli.signals.errors import IdentificationError
from vftcli.signals.estimation import (
    correlation_time,
    cross_validated,
    fit_column,
    inverse_of,
    left_out,
    robust_sd,
    solve,
)


def problem(seed, samples=2000):
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(samples, 4)) * [1.0, 10.0, 0.1, 1.0]
    x = np.array([3.0, -0.2, 5.0, 0.7])
    return rng, A, x, A @ x


@pytest.mark.parametrize("seed", range(3))
def test_planted_values_lie_within_their_spread(seed):
    rng, A, x, y = problem(seed)
    fit = fit_column(A, y + rng.normal(size=len(y)), np.ones(len(y)))
    # five standard deviations: one in a million
    assert np.all(np.abs(fit.values - x) < 5 * fit.sd)
    # white noise: sd = 1/(√N·scale) within the 3 % that 2000 samples allow, 20 % with Huber's loss
    np.testing.assert_allclose(fit.sd, 1 / np.sqrt(2000) / np.std(A, axis=0), rtol=0.2)


def test_outliers_hardly_count():
    rng, A, x, y = problem(5)
    spoilt = y + 0.1 * rng.normal(size=len(y))
    spoilt[100:200] += 50.0
    robust = fit_column(A, spoilt, np.ones(len(y)))
    plain = solve(A, spoilt)
    assert np.linalg.norm(robust.values - x) < 0.1 * np.linalg.norm(plain - x)
    assert np.all(robust.weights[100:200] < 0.05)


def test_samples_without_weight_do_not_count_at_all():
    _, A, x, y = problem(6)
    weights = np.ones(len(y))
    weights[:1000] = 0.0
    y = y.copy()
    y[:1000] = 1e6
    # exact equations: rounding only
    np.testing.assert_allclose(fit_column(A, y, weights).values, x, rtol=1e-6)


def test_what_no_column_tells_stays_zero_and_an_inverse_is_that_of_those_that_tell():
    """Columns a hundredfold apart, one of nothing: the plain inverse, and zeros."""
    _, A, _, y = problem(7)
    A = np.hstack([A, np.zeros((len(y), 1))])
    assert solve(A, y)[-1] == 0.0
    expected = np.zeros((5, 5))
    expected[:4, :4] = np.linalg.inv(A[:, :4].T @ A[:, :4])
    # condition number 1e4: rounding below 1e-11
    scale = np.sqrt(np.diag(expected)).max()
    np.testing.assert_allclose(inverse_of(A.T @ A), expected, atol=1e-9 * scale**2)


def test_too_few_samples_are_refused():
    with pytest.raises(IdentificationError, match="3 samples in motion for 4 unknowns"):
        fit_column(np.ones((3, 4)), np.ones(3), np.ones(3))


@pytest.mark.parametrize("rho", [0.0, 0.5, 0.9])
def test_correlation_time_of_an_autoregressive_series(rho):
    """AR(1): 1 + 2 Σ ρᵏ = (1 + ρ)/(1 − ρ)."""
    noise = np.random.default_rng(8).normal(size=200_000)
    series = np.empty_like(noise)
    series[0] = noise[0]
    for k in range(1, len(noise)):
        series[k] = rho * series[k - 1] + noise[k]
    # the sum ends at the first non-positive estimate: some per cent of truncation
    assert correlation_time(series) == pytest.approx((1 + rho) / (1 - rho), rel=0.1)


def refitted(A, y, weights, parts):
    """RMS of the rows of each part by a fit without them."""
    root, total, count = np.sqrt(weights), 0.0, 0.0
    for out in parts:
        keep = np.setdiff1d(np.arange(len(y)), out)
        x = np.linalg.lstsq(A[keep] * root[keep, None], y[keep] * root[keep], rcond=None)[0]
        total += np.sum(weights[out] * (y[out] - A[out] @ x) ** 2)
        count += weights[out].sum()
    return np.sqrt(total / count)


def test_cross_validation_equals_fitting_each_time_anew():
    """One log in fifths, beside one that tells nothing and is always kept."""
    rng, A, _, y = problem(9, 500)
    y = y + rng.normal(size=len(y))
    weights = rng.uniform(0.2, 1.0, len(y))
    parts = [np.arange(k, k + 80) for k in range(0, 400, 80)]
    expected = refitted(A, y, weights, parts)
    found = left_out([400, 100], [True, False])
    # normal equations square the condition number, here 1e2: rounding below 1e-11
    assert cross_validated(A, y, weights, found) == pytest.approx(expected, rel=1e-9)
    # sums of squares far below 1 count as they are
    small = cross_validated(A, 1e-6 * y, weights, found)
    assert small == pytest.approx(1e-6 * expected, rel=1e-9)


def test_the_robust_spread_of_normal_noise():
    # 100 000 samples: 0.4 % statistical
    sd = np.array([2.0, 0.5])
    noise = np.random.default_rng(1).normal(0, sd, (100_000, 2))
    np.testing.assert_allclose(robust_sd(noise), sd, rtol=0.02)
    np.testing.assert_array_equal(robust_sd(noise[:0]), [0.0, 0.0])


def test_of_several_logs_each_is_left_out_whole() -> None:
    """Three logs of 103, 57 and 40 rows, of which the last tells nothing; in either order."""
    rng = np.random.default_rng(5)
    A, y, weights = rng.standard_normal((200, 3)), rng.standard_normal(200), np.ones(200)
    expected = refitted(A, y, weights, [np.arange(103), np.arange(103, 160)])
    for lengths, rows in (([103, 57, 40], np.arange(200)),
                          ([57, 103, 40], np.r_[103:160, 0:103, 160:200])):  # fmt: skip
        parts = left_out(lengths, [True, True, False])
        assert cross_validated(A[rows], y[rows], weights, parts) == pytest.approx(
            expected, rel=1e-9
        )
