"""Phases: thresholds per axis, hard and soft, hysteresis, unknown forces."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vftcli.admittance.law import Admittance
from vftcli.admittance.motion import phases


def parameters(mode: str = "hard", hysteresis: float = 0.0) -> Admittance:
    """Thresholds 4, 4, 15 N and 2 N·m, the Panda's."""
    return Admittance(
        mass=np.ones(6),
        damping=np.ones(6),
        stiffness=np.ones(6),
        alpha=np.ones(6),
        threshold=np.array([4.0, 4.0, 15.0, 2.0, 2.0, 2.0]),
        hysteresis=hysteresis,
        period=0.01,
        threshold_mode=mode,
    )


def column(*values: float) -> np.ndarray:
    """A force along x."""
    force = np.zeros((len(values), 6))
    force[:, 0] = values
    return force


def test_hard_passes_the_whole_force_and_soft_the_excess() -> None:
    force = column(3.0, 4.0, 5.0, -9.0, 1.0)
    hard, soft = phases(force, parameters()), phases(force, parameters("soft"))
    np.testing.assert_array_equal(hard.dragged[:, 0], [False, False, True, True, False])
    np.testing.assert_array_equal(hard.force[:, 0], [0, 0, 5, -9, 0])
    np.testing.assert_array_equal(soft.dragged, hard.dragged)
    np.testing.assert_array_equal(soft.force[:, 0], [0, 0, 1, -5, 0])


def test_as_printed_the_threshold_chooses_the_parameters_and_the_whole_force_enters() -> None:
    force = column(3.0, 4.0, 5.0, -9.0, 1.0)
    literal = phases(force, parameters("literal"))
    np.testing.assert_array_equal(literal.dragged, phases(force, parameters()).dragged)
    np.testing.assert_array_equal(literal.force, force)


def test_hysteresis_holds_on() -> None:
    force = column(3.5, 4.5, 3.5, 2.5, 1.9, 3.5, 4.5)
    held = phases(force, parameters(hysteresis=0.5)).dragged[:, 0]
    np.testing.assert_array_equal(held, [False, True, True, True, False, False, True])


def test_axes_are_apart() -> None:
    force = np.array([[5.0, 0.0, 14.0, 0.0, 2.5, 0.0]])
    np.testing.assert_array_equal(
        phases(force, parameters()).dragged, [[True, False, False, False, True, False]]
    )


def test_unknown_force_is_none() -> None:
    found = phases(column(np.nan, 5.0), parameters())
    np.testing.assert_array_equal(found.dragged[:, 0], [False, True])
    assert np.all(np.isfinite(found.force))


@given(arrays(float, (30, 6), elements=st.floats(-30, 30)), st.floats(0.0, 0.9))
def test_latch_is_the_plain_loop(force: np.ndarray, hysteresis: float) -> None:
    p = parameters(hysteresis=hysteresis)
    found = phases(force, p).dragged
    state = np.zeros(6, dtype=bool)
    for row, dragged in zip(np.abs(force), found, strict=True):
        state = (row > p.threshold) | (state & (row > p.threshold * (1.0 - hysteresis)))
        np.testing.assert_array_equal(dragged, state)
