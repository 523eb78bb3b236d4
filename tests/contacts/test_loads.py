"""Contacts that are a load."""

from dataclasses import replace

import numpy as np
import pytest
from contact_rows import contact

from vftcli.contacts.listing import is_load
from vftcli.signals.recording import Recording


def log() -> Recording:
    """An arm that moves from 2 s to 20 s, but for a rest from 8 s to 10.5 s."""
    t = 0.01 * np.arange(2000)
    moves = (t > 2.0) & ((t < 8.0) | (t > 10.5))
    dq = np.where(moves, 0.3, 0.0)[:, None]
    return Recording(t=t, q=np.cumsum(dq, axis=0) * 0.01, dq=dq, torque=np.zeros_like(dq))


DOWN, UP = np.array([0.0, 0.0, -27.0]), np.array([0.0, 0.0, 27.0])


def aside(degrees: float) -> np.ndarray:
    """A force of the size of `DOWN`, so far from it."""
    angle = np.radians(degrees)
    return 27.0 * np.array([np.sin(angle), 0.0, -np.cos(angle)])


@pytest.mark.parametrize(
    ("spans", "forces", "expected"),
    [
        ([], [], False),
        ([(3.0, 19.0)], [DOWN], True),  # 16 of 18 s of motion
        ([(3.0, 9.0), (10.0, 19.0)], [DOWN, 0.8 * DOWN], True),
        ([(3.0, 9.0), (10.0, 19.0)], [DOWN, UP], False),  # pushes from two sides
        # Half of the time since the first motion, 8.995 s.
        ([(4.0, 7.0), (11.0, 16.9)], [DOWN, DOWN], False),
        ([(4.0, 7.0), (11.0, 17.1)], [DOWN, DOWN], True),
        # Two forces an angle apart add up to its half's cosine: .96, .94.
        ([(3.0, 8.0), (12.0, 17.0)], [DOWN, aside(32.0)], True),
        ([(3.0, 8.0), (12.0, 17.0)], [DOWN, aside(40.0)], False),
        # Each counts by how long it lasts: 9.8 of 10.2, 9.2 of 10.8.
        ([(3.0, 13.0), (18.0, 18.2)], [DOWN, UP], True),
        ([(3.0, 13.0), (18.0, 18.8)], [DOWN, UP], False),
        # It neither begins nor ends while the arm rests for a second on either side,
        ([(9.02, 19.0)], [DOWN], False),
        ([(8.98, 19.0)], [DOWN], True),
        ([(9.48, 19.0)], [DOWN], False),
        ([(9.52, 19.0)], [DOWN], True),
        ([(1.2, 8.98), (11.0, 19.0)], [DOWN, DOWN], True),
        ([(2.0, 9.1)], [DOWN], False),
        # but within a second of an end of the log.
        ([(0.98, 19.0)], [DOWN], True),
    ],
)
def test_a_load_is_one_force_for_most_of_the_motion(spans, forces, expected):
    rows = tuple(
        replace(contact(), start=start, stop=stop, mean_force=force)
        for (start, stop), force in zip(spans, forces, strict=True)
    )
    assert is_load(log(), rows) is expected


@pytest.mark.parametrize(("start", "is_one"), [(0.98, True), (1.02, False)])
def test_a_push_may_begin_with_the_log(start, is_one):
    """The arm rests until 4 s."""
    t = 0.01 * np.arange(2000)
    dq = np.where(t > 4.0, 0.3, 0.0)[:, None]
    still = Recording(t=t, q=0.0 * dq, dq=dq, torque=np.zeros_like(dq))
    row = replace(contact(), start=start, stop=19.5, mean_force=DOWN)
    assert is_load(still, (row,)) is is_one
