"""Rotations under the law: large turns without a jump, axes kept."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.admittance.law import from_table, variable
from vftcli.admittance.motion import release, run
from vftcli.robots import load_robot

UR5 = from_table(load_robot("ur5").admittance, "ur5", {})
"""A soft rotation that a small moment can turn far."""


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.6, -0.5, 0.62), (-1.0, 0.2, 0.1)])
def test_large_rotations_have_no_jump(axis: tuple[float, float, float]) -> None:
    """Dragged through 3 rad and past π, and let go: no step exceeds what the speed limit allows."""
    unit = np.array(axis) / np.linalg.norm(axis)
    force = np.zeros((1500, 6))
    force[:700, 3:] = 2.2 * unit  # settles at 4.4 rad, beyond π
    dragged = np.zeros_like(force, dtype=bool)
    dragged[:700, 3:] = True
    motion = run([variable(UR5)], force, dragged)
    angle = np.linalg.norm(motion.x[:, 0, 3:], axis=1)
    assert angle.max() > 3.5
    steps = np.linalg.norm(np.diff(motion.x[:, 0, 3:], axis=0), axis=1)
    # |ω| ≤ √3 rad/s for the three limits together; a turned axis lengthens log by angle/2/tan(…)
    assert steps.max() < 3.0 * np.sqrt(3.0) * 0.008
    assert angle[-1] < 0.05


def test_three_radians_return() -> None:
    x = np.concatenate([np.zeros(3), 3.0 * np.array([0.48, -0.6, 0.64])])
    motion = release([variable(UR5)], x, 12.0)
    assert np.linalg.norm(motion.x[-1, 0, 3:]) < 1e-3
    assert np.linalg.norm(np.diff(motion.x[:, 0, 3:], axis=0), axis=1).max() < 0.05


def test_equal_axes_turn_about_the_start_s_own_axis() -> None:
    """With equal parameters a release stays on its axis, so it is the scalar law along it."""
    unit = np.array([0.48, -0.6, 0.64])
    wide = replace(UR5, speed_limit=np.inf, alpha=np.ones(6), speed_scale=1e9)
    slanted = release([variable(wide)], np.concatenate([np.zeros(3), 0.3 * unit]), 4.0)
    straight = release([variable(wide)], np.array([0, 0, 0, 0.3, 0, 0.0]), 4.0)
    along = slanted.x[:, 0, 3:] @ unit
    np.testing.assert_allclose(along, straight.x[:, 0, 3], atol=1e-12)  # 500 steps of ulp
