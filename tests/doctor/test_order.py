"""Friction of one joint fitted to several torques at once: against least squares, and its signs."""

import numpy as np
import pytest

from vftcli.doctor.order import one_joint_rests


def test_rests_are_those_of_friction_that_takes_energy() -> None:
    rng = np.random.default_rng(2)
    speed = rng.uniform(-1, 1, 300)
    direction = np.sign(speed)
    sound = 2.0 * direction + 0.5 * speed
    coulomb, driving = 2.0 * direction, -sound
    noise = rng.normal(scale=0.1, size=300)
    target = np.column_stack([sound, coulomb, driving, sound + noise])
    found = one_joint_rests(target, direction, speed)
    assert found[0] == pytest.approx(0.0, abs=1e-9)
    assert found[1] == pytest.approx(0.0, abs=1e-9)
    # friction that drives is left where it is: all of it, of the quieter seven in ten
    quiet = np.sort(np.abs(sound))[: int(0.7 * 299) + 1]
    assert found[2] == pytest.approx(np.sqrt(np.mean(quiet**2)), rel=0.02)
    # unit noise cut at its 70th percentile has a deviation of .55
    assert found[3] == pytest.approx(0.055, rel=0.15)


def test_a_joint_that_rests_has_no_friction_to_fit() -> None:
    zeros = np.zeros(50)
    found = one_joint_rests(np.ones((50, 1)), zeros, zeros)
    assert found[0] == pytest.approx(1.0)
