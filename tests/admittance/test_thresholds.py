"""Phases: thresholds per axis, hard and soft, hysteresis, unknown forces."""

from dataclasses import replace

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vftcli.admittance.law import Admittance, from_table
from vftcli.admittance.motion import phases
from vftcli.robots import load_robot


def parameters(mode: str = "hard", hysteresis: float = 0.0) -> Admittance:
    """Thresholds 4, 4, 15 N and 2 N·m, the Panda's."""
    profile = from_table(load_robot("panda").admittance, "panda", {})
    return replace(profile, threshold_mode=mode, hysteresis=hysteresis)


def column(*values: float) -> np.ndarray:
    """A force along x."""
    force = np.zeros((len(values), 6))
    force[:, 0] = values
    return force


def test_hard_passes_the_whole_force_soft_the_excess_and_literal_every_force() -> None:
    """As printed the threshold chooses the parameters alone; an unknown force is none."""
    force = column(3.0, 4.0, 5.0, -9.0, np.nan)
    hard, soft, literal = (phases(force, parameters(m)) for m in ("hard", "soft", "literal"))
    np.testing.assert_array_equal(hard.dragged[:, 0], [False, False, True, True, False])
    np.testing.assert_array_equal(hard.force[:, 0], [0, 0, 5, -9, 0])
    np.testing.assert_array_equal(soft.dragged, hard.dragged)
    np.testing.assert_array_equal(soft.force[:, 0], [0, 0, 1, -5, 0])
    np.testing.assert_array_equal(literal.dragged, hard.dragged)
    np.testing.assert_array_equal(literal.force, np.nan_to_num(force))


@given(arrays(float, (30, 6), elements=st.floats(-30, 30)), st.floats(0.0, 0.9))
def test_latch_is_the_plain_loop(force: np.ndarray, hysteresis: float) -> None:
    p = parameters(hysteresis=hysteresis)
    found = phases(force, p).dragged
    state = np.zeros(6, dtype=bool)
    for row, dragged in zip(np.abs(force), found, strict=True):
        state = (row > p.threshold) | (state & (row > p.threshold * (1.0 - hysteresis)))
        np.testing.assert_array_equal(dragged, state)
