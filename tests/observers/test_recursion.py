"""The block recursion is the plain loop in another order."""

import numpy as np
import pytest

from vftcli.observers import recursion as module
from vftcli.observers.recursion import recursion


def loop(F: np.ndarray, x: np.ndarray, start: np.ndarray) -> np.ndarray:
    y, state = np.empty_like(x), start
    for k in range(x.shape[1]):
        state = np.einsum("abj,bj->aj", F[:, :, k], state) + x[:, k]
        y[:, k] = state
    return y


@pytest.mark.parametrize("samples", [1, 2, 63, 64, 65, 1000, 5003])
@pytest.mark.parametrize("m", [1, 2])
def test_agrees_with_a_plain_loop(samples: int, m: int) -> None:
    rng = np.random.default_rng(samples + m)
    F = rng.uniform(-0.6, 0.6, (m, m, samples, 3))
    x, start = rng.normal(size=(m, samples, 3)), rng.normal(size=(m, 3))
    # sums of the same terms in another order
    np.testing.assert_allclose(recursion(F, x, start), loop(F, x, start), atol=1e-12)


def test_pieces_carry_their_state(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    F, x = np.full((1, 1, 3000, 2), 0.999), rng.normal(size=(1, 3000, 2))
    whole = recursion(F, x, np.ones((1, 2)))
    monkeypatch.setattr(module, "PIECE", 701)
    np.testing.assert_allclose(recursion(F, x, np.ones((1, 2))), whole, atol=1e-11)
