"""Least squares over windows: planted coefficients, contact set aside, friction that only takes."""

import numpy as np
import pytest

from vftcli.doctor.windows import Terms, solve, terms
from vftcli.signals.arrays import Array


def planted(values: Array, windows: int = 200, joints: int = 3) -> tuple[Array, Array]:
    """A torque of known coefficients, and its columns."""
    rng = np.random.default_rng(7)
    columns = rng.normal(size=(windows, joints, len(values)))
    return columns @ values, columns


def test_coefficients_come_back_and_noise_gives_their_deviation() -> None:
    values = np.array([2.0, -1.0])
    target, columns = planted(values)
    found = solve(target, terms(columns))
    np.testing.assert_allclose(found.values, values, atol=1e-9)
    assert found.size < 1e-9
    noise = np.random.default_rng(1).normal(size=target.shape)
    found = solve(target + noise, terms(columns))
    # 600 rows of unit noise: 1/√600 = .04; of it four deviations
    np.testing.assert_allclose(found.values, values, atol=0.17)
    assert np.all((found.sd > 0.01) & (found.sd < 0.08))


def test_a_contact_in_a_quarter_of_the_windows_is_set_aside() -> None:
    values = np.array([2.0, -1.0])
    target, columns = planted(values)
    target[:50] += 30.0
    found = solve(target, terms(columns))
    np.testing.assert_allclose(found.values, values, atol=1e-9)
    assert not found.kept[:50].any()
    # Without noise all that is left over is rounding, in which windows tie.
    noise = np.random.default_rng(2).normal(scale=1e-6, size=target.shape)
    kept = solve(target + noise, terms(columns)).kept
    assert not kept[:50].any()
    assert kept.sum() == 140  # seven in ten


def test_what_must_be_positive_is_left_out_where_it_is_not() -> None:
    target, columns = planted(np.array([2.0, -1.0]))
    found = solve(target, terms(columns, positive=True))
    assert found.values[1] == 0.0
    assert found.values[0] > 0
    both = terms(columns[:, :, :1], positive=True).beside(terms(columns[:, :, 1:]))
    np.testing.assert_allclose(solve(target, both).values, [2.0, -1.0], atol=1e-9)


def test_a_column_that_nothing_shows_stays_at_its_prior() -> None:
    target, columns = planted(np.array([2.0]))
    twice = np.concatenate([columns, 1e-3 * columns, 0 * columns], axis=2)
    prior = np.array([np.inf, 1.0, 1.0])
    found = solve(target, Terms(twice, np.zeros(3, dtype=bool), prior))
    assert found.values[0] == pytest.approx(2.0, abs=1e-3)
    assert abs(found.values[1]) < 0.1
    assert found.values[2] == 0.0


def test_no_terms_leave_everything_over() -> None:
    target = np.ones((10, 2))
    found = solve(target, terms(np.empty((10, 2, 0))))
    assert found.size == 1.0
    np.testing.assert_array_equal(found.by_joint, [1.0, 1.0])
