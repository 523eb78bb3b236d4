"""Rotations under the law: large turns without a jump, axes kept."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vftcli.admittance.law import Admittance, from_table, variable
from vftcli.admittance.motion import (
    Drag,
    Phases,
    drags_of,
    overshoot,
    phases,
    release,
    return_time,
    run,
)
from vftcli.robots import load_robot

UR5 = from_table(load_robot("ur5").admittance, "ur5", {})
"""A soft rotation that a small moment can turn far."""


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.6, -0.5, 0.62), (-1.0, 0.2, 0.1)])
def test_large_rotations_have_no_jump(axis):
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


def test_equal_axes_turn_about_the_start_s_own_axis():
    """With equal parameters a release stays on its axis, so it is the scalar law along it."""
    unit = np.array([0.48, -0.6, 0.64])
    wide = replace(UR5, speed_limit=np.inf, alpha=np.ones(6), speed_scale=1e9)
    slanted = release([variable(wide)], np.concatenate([np.zeros(3), 0.3 * unit]), 4.0)
    straight = release([variable(wide)], np.array([0, 0, 0, 0.3, 0, 0.0]), 4.0)
    along = slanted.x[:, 0, 3:] @ unit
    np.testing.assert_allclose(along, straight.x[:, 0, 3], atol=1e-12)  # 500 steps of ulp


def test_an_axis_recovers_whatever_drags_another():
    """Damping and swelling are each axis's own."""
    law = [variable(replace(UR5, xi=np.ones(6)))]  # damped more than a drag
    start, shape = np.array([0.0, 0.2, 0.0, 0.0, 0.0, 0.0]), (250, 6)
    force, dragged = np.zeros(shape), np.zeros(shape, bool)
    force[:, 0], dragged[:, 0] = 30.0, True
    both = run(law, force, dragged, start)
    alone = release(law, start, 250 * UR5.period)
    assert both.x[-1, 0, 0] > 0.1
    np.testing.assert_array_equal(both.x[:, 0, 1], alone.x[:, 0, 1])


def panda(mode: str = "hard", hysteresis: float = 0.0) -> Admittance:
    """Thresholds 4, 4, 15 N and 2 N·m, the Panda's."""
    profile = from_table(load_robot("panda").admittance, "panda", {})
    return replace(profile, threshold_mode=mode, hysteresis=hysteresis)


def column(*values: float) -> np.ndarray:
    force = np.zeros((len(values), 6))
    force[:, 0] = values
    return force


def test_hard_passes_the_whole_force_soft_the_excess_and_literal_every_force():
    """As printed the threshold chooses the panda alone; an unknown force is none."""
    force = column(3.0, 4.0, 5.0, -9.0, np.nan)
    hard, soft, literal = (phases(force, panda(m)) for m in ("hard", "soft", "literal"))
    np.testing.assert_array_equal(hard.dragged[:, 0], [False, False, True, True, False])
    np.testing.assert_array_equal(hard.force[:, 0], [0, 0, 5, -9, 0])
    np.testing.assert_array_equal(soft.dragged, hard.dragged)
    np.testing.assert_array_equal(soft.force[:, 0], [0, 0, 1, -5, 0])
    np.testing.assert_array_equal(literal.dragged, hard.dragged)
    np.testing.assert_array_equal(literal.force, np.nan_to_num(force))


@given(arrays(float, (30, 6), elements=st.floats(-30, 30)), st.floats(0.0, 0.9))
def test_latch_is_the_plain_loop(force, hysteresis):
    p = panda(hysteresis=hysteresis)
    found = phases(force, p).dragged
    state = np.zeros(6, dtype=bool)
    for row, dragged in zip(np.abs(force), found, strict=True):
        state = (row > p.threshold) | (state & (row > p.threshold * (1.0 - hysteresis)))
        np.testing.assert_array_equal(dragged, state)


PERIOD = 0.1
T = np.arange(101) * PERIOD


def dragged_in(*spans: tuple[int, int]) -> Phases:
    """A hundred periods in which y is dragged in the given ones."""
    dragged = np.zeros((100, 6), dtype=bool)
    for start, stop in spans:
        dragged[start:stop, 1] = True
    return Phases(dragged, np.zeros((100, 6)))


def test_a_drag_lasts_to_the_next_one_or_the_end():
    first, second = drags_of(dragged_in((10, 30), (60, 70)), PERIOD)
    assert first == Drag(axis=1, number=1, begin=10, release=30, end=61)
    assert second == Drag(axis=1, number=2, begin=60, release=70, end=101)
    (drag,) = drags_of(dragged_in((10, 30), (39, 50)), PERIOD)  # .9 s apart: one
    assert (drag.begin, drag.release) == (10, 50)
    assert len(drags_of(dragged_in((10, 30), (40, 50)), PERIOD)) == 2  # 1 s apart


RELEASE = Drag(axis=0, number=1, begin=0, release=20, end=101)


def test_the_return_is_when_the_axis_stays_within_its_share():
    x = np.where(T <= 2.0, 1.0, np.exp(-(T - 2.0)))
    # e^{−t} = .1 at 2.303 s: the last sample outside is that of 2.3 s
    assert return_time(T, x, RELEASE, 0.1) == pytest.approx(2.3)
    x[50] = 0.2  # and once more outside, 3 s after the release
    assert return_time(T, x, RELEASE, 0.1) == pytest.approx(3.0)
    # What never returns has no return.
    assert return_time(T, np.ones(101), RELEASE, 0.1) is None
    assert return_time(T, np.zeros(101), RELEASE, 0.1) is None
    assert return_time(T, np.where(T > 5, np.inf, 1.0), RELEASE, 0.1) is None


def test_overshoot_is_to_the_other_side_and_a_share_of_the_release():
    x = np.where(T <= 2.0, 0.5, 0.0)
    x[30], x[40] = -0.1, 0.4
    assert overshoot(x, RELEASE) == pytest.approx(0.2)
    assert overshoot(-x, RELEASE) == pytest.approx(0.2)
    assert overshoot(np.abs(x), RELEASE) == 0.0
    assert overshoot(np.zeros(101), RELEASE) is None
    x[10] = 10.0  # shares of what is left at the release say nothing
    assert overshoot(x, RELEASE) is return_time(T, x, RELEASE, 0.1) is None
