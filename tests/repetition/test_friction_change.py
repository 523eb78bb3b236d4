"""Friction that changed between two logs is told from contacts and from noise."""

from collections.abc import Callable

import numpy as np
import pytest

from vftcli.repetition.drive_run import DriveRun
from vftcli.repetition.friction_change import friction_change


@pytest.fixture
def swing(drive_of: Callable[..., DriveRun]) -> DriveRun:
    """Two joints swinging at 0.4 and 0.7 Hz for 20 s."""
    t = 0.008 * np.arange(2500)
    dq = np.sin(2.0 * np.pi * t[:, None] * np.array([0.4, 0.7]))
    return drive_of(t, np.zeros_like(dq), dq)


@pytest.mark.parametrize("seed", range(5))
def test_a_change_is_found(swing: DriveRun, seed: int) -> None:
    """0.4 N·m of friction under 0.3 N·m of noise: 2500 samples tell it to 0.006 N·m."""
    motion, rng = swing, np.random.default_rng(seed)
    tau = 0.4 * np.sign(motion.dq) * [1.0, 0.0] + 0.3 * rng.standard_normal(motion.dq.shape)
    found = friction_change(motion, tau, np.ones_like(tau, bool))
    assert found[0] == pytest.approx(0.4, abs=0.03)
    assert found[1] == 0.0


@pytest.mark.parametrize("seed", range(5))
def test_pushes_are_not_taken_for_it(swing: DriveRun, seed: int) -> None:
    """Pushes of 10 N·m, a second each, at random times and either way."""
    motion, rng = swing, np.random.default_rng(seed)
    tau = 0.3 * rng.standard_normal(motion.dq.shape)
    for start in rng.uniform(0.0, 19.0, 8):
        pushed = (motion.t >= start) & (motion.t < start + 1.0)
        tau[pushed] += 10.0 * rng.choice([-1, 1], 2)
    assert np.array_equal(friction_change(motion, tau, np.ones_like(tau, bool)), [0.0, 0.0])
