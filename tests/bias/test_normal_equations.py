"""The normal equations against dense matrices, and the choice of loads against all of them."""

from dataclasses import replace

import numpy as np
import pytest
from known_errors import best_by_hand, dense, drawn_error, fit_rows, shortened, ur10e, wrong_run

JOINTS, STRIDE = 4, 10


def push(t, _q):
    """A torque that rises along the log. (T, n) [N·m]"""
    return 0.4 * t[:, None] * np.ones(JOINTS)


@pytest.fixture(scope="module")
def rows():
    robot = shortened(ur10e(), JOINTS)
    return fit_rows(wrong_run(robot, drawn_error(robot), push, seconds=26.0, noise=0.5), STRIDE)


@pytest.fixture(scope="module")
def weight(rows):
    """Of every row, differing. Seed 4."""
    return np.random.default_rng(4).uniform(0.01, 2.0, rows.d.shape)


@pytest.mark.parametrize("scale", [0.1, 1.0])
def test_the_solution_is_that_of_the_dense_matrix(rows, weight, scale):
    """The group of loads is the one with the least objective and twice its columns."""
    found, P = rows.solution(rows.sums(weight)[0], scale), rows.unknowns
    expected = best_by_hand(dense(rows), rows.d, weight, scale, rows)
    assert P + len(found.loads) == len(expected)
    # condition numbers of up to 1e8 leave seven digits
    np.testing.assert_allclose(found.model, expected[:P], atol=1e-6)
    np.testing.assert_allclose(found.loads, expected[P:], atol=1e-6)


def test_the_spread_is_that_of_the_inverse(rows, weight):
    """diag(A N⁻¹ Aᵀ) with the loads' columns in N."""
    P, found = rows.unknowns, rows.solution(rows.sums(weight)[0], 0.3)
    used = len(found.loads)
    assert used > 0
    A = dense(rows)[:, :, : P + used]
    flat = A.reshape(-1, A.shape[-1])
    prior = np.concatenate([np.full(P, 0.3), np.ones(used)]) ** -2.0
    N = flat.T @ (flat * weight.ravel()[:, None]) + np.diag(prior)
    covariance = np.linalg.inv(N)[:P, :P]
    expected = np.sqrt(np.einsum("tnp,pq,tnq->tn", A[:, :, :P], covariance, A[:, :, :P]))
    np.testing.assert_allclose(rows.spread(found.covariance), expected, rtol=1e-6)


def test_no_load_is_believed_where_there_is_none(rows):
    """Noise of a tenth of the scale gains less than two a column."""
    quiet = replace(rows, d=np.random.default_rng(8).normal(0.0, 0.1, rows.d.shape))
    assert len(quiet.solution(quiet.sums(np.ones(rows.d.shape))[0]).loads) == 0
