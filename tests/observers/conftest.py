"""What tests of observers and spectra share."""

from collections.abc import Callable

import numpy as np
import pytest

from vftcli.robots.terms import DynamicsTerms


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
