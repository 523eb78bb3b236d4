"""Blocks of a log with a drawn model error, and the noise that they are drawn from."""

import numpy as np

from vftcli.robots.friction import CREEP_SHARE, PUSHED_SHARE
from vftcli.robots.terms import Blocks
from vftcli.signals.arrays import Array, Mask
from vftcli.wrench.model_error import TorqueNoise

B = 0.024


def blocks(d: Array, velocity: Array, known: Mask | None = None) -> Blocks:
    """Blocks of `B` seconds."""
    t = B * (np.arange(len(d)) + 0.5)
    known = np.ones(len(d), dtype=bool) if known is None else known
    return Blocks(t, np.full(len(d), B), d, np.zeros_like(d), velocity, known)


def noise(joints: int = 1, *, seen: bool = True) -> TorqueNoise:
    """White noise of .1 N·m, an error of .5 N·m over .4 s, dry friction of 10 N·m."""
    values = {"white": 0.01, "variance": 0.25, "time": 0.4, "dry": 10.0}
    values |= {"at_rest": (CREEP_SHARE * 10.0) ** 2, "pushed": (PUSHED_SHARE * 10.0) ** 2}
    each = {key: np.full(joints, value) for key, value in values.items()}
    return TorqueNoise(**each, seen=np.full(joints, seen), free_seconds=4.0)


def drawn(count: int, rng: np.random.Generator) -> Array:
    """Model error and white noise of `noise`, drawn."""
    f = np.exp(-B / 0.4)
    b = np.empty(count)
    b[0] = 0.5 * rng.standard_normal()
    for k in range(1, count):
        b[k] = f * b[k - 1] + 0.5 * np.sqrt(1.0 - f * f) * rng.standard_normal()
    return (b + 0.1 * rng.standard_normal(count))[:, None]
