"""What tests of observers and spectra share."""

from collections.abc import Callable

import numpy as np
import pytest

from vftcli.observers import MomentumObserver
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.remarks import Remark


@pytest.fixture
def terms_of() -> Callable[..., DynamicsTerms]:
    """Makes the terms of a body whose momentum integrates a torque, plus white torque noise."""
    return momentum_of


def momentum_of(t: np.ndarray, external: np.ndarray, noise: float = 0.0) -> DynamicsTerms:
    """A body whose momentum integrates a torque that is linear between samples, plus white noise.

    Seed 3.
    """
    dt = np.diff(t, prepend=t[0])[:, None]
    middle = 0.5 * (external + np.vstack([external[:1], external[:-1]]))
    white = np.random.default_rng(3).normal(0.0, noise, external.shape)
    p = np.cumsum(dt * (middle + white), axis=0)
    return DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))


@pytest.fixture
def wandering() -> Callable[..., DynamicsTerms]:
    """Makes the terms of a momentum that wanders, on a clock of 8 ms that may jitter."""
    return random_walk


def random_walk(
    samples: int = 1500, jitter: float = 0.0, seed: int = 0, joints: int = 6
) -> DynamicsTerms:
    """A momentum that walks at random by 0.1 kg·m²/s a sample, and μ of 5 N·m, both white."""
    rng = np.random.default_rng(seed)
    steps = 0.008 * (1 + jitter * rng.uniform(-1, 1, samples - 1))
    t = np.concatenate([[0.0], np.cumsum(steps)])
    p = 2.0 + np.cumsum(rng.normal(0, 0.1, (samples, joints)), axis=0)
    return DynamicsTerms(t=t, p=p, mu=rng.normal(0, 5, (samples, joints)))


@pytest.fixture
def in_blocks() -> Callable[..., tuple[np.ndarray, tuple[Remark, ...]]]:
    """Runs an observer over a log block by block."""
    return run_in_blocks


def run_in_blocks(
    observer: MomentumObserver, log: DynamicsTerms, size: int
) -> tuple[np.ndarray, tuple[Remark, ...]]:
    """τ̂ over a log cut into blocks of `size` samples, and the remarks of the last block."""
    state, before, tau = None, None, []
    for first in range(0, log.samples, size):
        span = slice(first, first + size)
        block = DynamicsTerms(
            t=log.t[span],
            p=log.p[span],
            mu=log.mu[span],
            log_clock=log.clock,
            before=before,
        )
        estimate, state = observer.run(block, state)
        before = block.last
        tau.append(estimate.tau)
    return np.concatenate(tau), estimate.remarks
