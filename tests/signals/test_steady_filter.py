"""Products with Toeplitz blocks are the plain loop of a filter with constant coefficients."""

import numpy as np
import pytest

from vftcli.signals import steady_filter as module
from vftcli.signals.steady_filter import recursion, spans, steady_filter

RNG = np.random.default_rng(6)


def loop(F: np.ndarray, x: np.ndarray, start: np.ndarray) -> np.ndarray:
    y, state = np.empty_like(x), start
    for k in range(x.shape[1]):
        state = np.einsum("abj,bj->aj", F[:, :, k], state) + x[:, k]
        y[:, k] = state
    return y


@pytest.mark.parametrize("samples", [1, 31, 32, 33, 500])
@pytest.mark.parametrize("m", [1, 2])
def test_constant_coefficients_are_the_plain_loop(samples: int, m: int) -> None:
    n = 3
    F = RNG.standard_normal((n, m, m))
    # states that fade: spectral radius .95
    F *= 0.95 / np.abs(np.linalg.eigvals(F)).max(axis=-1)[:, None, None]
    F = np.moveaxis(F, 0, -1)
    g, wanted, state = RNG.standard_normal((3, m, n))
    d = RNG.standard_normal((samples, n))
    found, end = steady_filter(F, g, d, state, wanted)
    states = loop(F[:, :, None].repeat(samples, axis=2), g[:, None] * d, state)
    # sums of the same terms in another order
    np.testing.assert_allclose(found, np.sum(wanted[:, None] * states, axis=0), atol=1e-11)
    np.testing.assert_allclose(end, states[:, -1], atol=1e-11)


@pytest.mark.parametrize("samples", [1, 2, 35, 36, 37, 47, 48, 49, 63, 64, 65, 1296, 1297, 5003])
@pytest.mark.parametrize("m", [1, 2])
def test_agrees_with_a_plain_loop(samples: int, m: int) -> None:
    rng = np.random.default_rng(samples + m)
    F = rng.uniform(-0.6, 0.6, (m, m, samples, 3))
    x, start = rng.normal(size=(m, samples, 3)), rng.normal(size=(m, 3))
    # sums of the same terms in another order
    np.testing.assert_allclose(recursion(F, x, start), loop(F, x, start), atol=1e-12)


def test_pieces_carry_their_state(monkeypatch: pytest.MonkeyPatch) -> None:
    F, g = np.full((1, 1, 2), 0.999), np.ones((1, 2))
    d, start = RNG.standard_normal((3000, 2)), np.ones((1, 2))
    each = np.full((1, 1, 3000, 2), 0.999), d[None], start
    whole, end = steady_filter(F, g, d, start, g)
    states = recursion(*each)
    monkeypatch.setattr(module, "PIECE", 701)
    found, state = steady_filter(F, g, d, start, g)
    np.testing.assert_allclose(found, whole, atol=1e-10)
    np.testing.assert_allclose(state, end, atol=1e-10)
    np.testing.assert_allclose(recursion(*each), states, atol=1e-11)


def test_pieces_end_at_the_same_samples_wherever_a_block_begins() -> None:
    expected = [slice(1, 16384), slice(16384, 32768), slice(32768, 40000)]
    assert spans(40000, begins=True) == expected
    assert spans(40000, begins=False)[0] == slice(0, 16384)
    assert spans(1, begins=True) == []
