"""Products with Toeplitz blocks are the plain loop of a filter with constant coefficients."""

import numpy as np
import pytest

from vftcli.signals import steady_filter as module
from vftcli.signals.steady_filter import steady_filter

RNG = np.random.default_rng(6)


def stable(m: int, n: int) -> np.ndarray:
    """Transitions whose states fade: spectral radius below .95. (m, m, n)"""
    F = RNG.standard_normal((n, m, m))
    radius = np.abs(np.linalg.eigvals(F)).max(axis=-1)[:, None, None]
    return np.moveaxis(0.95 * F / radius, 0, -1)


@pytest.mark.parametrize("samples", [1, 31, 32, 33, 500])
@pytest.mark.parametrize("m", [1, 2])
def test_it_is_the_plain_loop(samples: int, m: int) -> None:
    n = 3
    F, g, wanted = stable(m, n), RNG.standard_normal((m, n)), RNG.standard_normal((m, n))
    d, state = RNG.standard_normal((samples, n)), RNG.standard_normal((m, n))
    found, end = steady_filter(F, g, d, state, wanted)
    for k in range(samples):
        state = np.einsum("abj,bj->aj", F, state) + g * d[k]
        # sums of the same terms in another order
        np.testing.assert_allclose(found[k], np.sum(wanted * state, axis=0), atol=1e-11)
    np.testing.assert_allclose(end, state, atol=1e-11)


def test_pieces_carry_their_state(monkeypatch: pytest.MonkeyPatch) -> None:
    F, g = np.full((1, 1, 2), 0.999), np.ones((1, 2))
    d, start = RNG.standard_normal((3000, 2)), np.ones((1, 2))
    whole, end = steady_filter(F, g, d, start, g)
    monkeypatch.setattr(module, "PIECE", 701)
    found, state = steady_filter(F, g, d, start, g)
    np.testing.assert_allclose(found, whole, atol=1e-10)
    np.testing.assert_allclose(state, end, atol=1e-10)
