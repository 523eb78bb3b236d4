"""Figures of merit: drags, peaks, returns and overshoot of motions that are known."""

import numpy as np
import pytest

from vftcli.admittance.motion import Drag, Phases, drags_of, overshoot, return_time

PERIOD = 0.1
T = np.arange(101) * PERIOD


def phases(*spans: tuple[int, int]) -> Phases:
    """A hundred periods in which y is dragged in the given ones."""
    dragged = np.zeros((100, 6), dtype=bool)
    for start, stop in spans:
        dragged[start:stop, 1] = True
    return Phases(dragged, np.zeros((100, 6)))


def test_a_drag_lasts_to_the_next_one_or_the_end() -> None:
    first, second = drags_of(phases((10, 30), (60, 70)), PERIOD)
    assert first == Drag(axis=1, number=1, begin=10, release=30, end=61)
    assert second == Drag(axis=1, number=2, begin=60, release=70, end=101)
    (drag,) = drags_of(phases((10, 30), (39, 50)), PERIOD)  # .9 s apart: one
    assert (drag.begin, drag.release) == (10, 50)
    assert len(drags_of(phases((10, 30), (40, 50)), PERIOD)) == 2  # 1 s apart


RELEASE = Drag(axis=0, number=1, begin=0, release=20, end=101)


def test_the_return_is_when_the_axis_stays_within_its_share() -> None:
    x = np.where(T <= 2.0, 1.0, np.exp(-(T - 2.0)))
    # e^{−t} = .1 at 2.303 s: the last sample outside is that of 2.3 s
    assert return_time(T, x, RELEASE, 0.1) == pytest.approx(2.3)
    x[50] = 0.2  # and once more outside, 3 s after the release
    assert return_time(T, x, RELEASE, 0.1) == pytest.approx(3.0)
    # What never returns has no return.
    assert return_time(T, np.ones(101), RELEASE, 0.1) is None
    assert return_time(T, np.zeros(101), RELEASE, 0.1) is None
    assert return_time(T, np.where(T > 5, np.inf, 1.0), RELEASE, 0.1) is None


def test_overshoot_is_to_the_other_side_and_a_share_of_the_release() -> None:
    x = np.where(T <= 2.0, 0.5, 0.0)
    x[30], x[40] = -0.1, 0.4
    assert overshoot(x, RELEASE) == pytest.approx(0.2)
    assert overshoot(-x, RELEASE) == pytest.approx(0.2)
    assert overshoot(np.abs(x), RELEASE) == 0.0
    assert overshoot(np.zeros(101), RELEASE) is None
