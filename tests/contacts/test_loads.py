"""Contacts that are a load."""

from dataclasses import replace

import numpy as np
import pytest
from contact_rows import contact

from vftcli.contacts.listing import is_load
from vftcli.signals.recording import Recording


def log() -> Recording:
    """An arm that moves from 2 s to 20 s."""
    t = 0.01 * np.arange(2000)
    dq = np.where(t > 2.0, 0.3, 0.0)[:, None]
    return Recording(t=t, q=np.cumsum(dq, axis=0) * 0.01, dq=dq, torque=np.zeros_like(dq))


DOWN, UP = np.array([0.0, 0.0, -27.0]), np.array([0.0, 0.0, 27.0])


@pytest.mark.parametrize(
    ("spans", "forces", "expected"),
    [
        ([(3.0, 19.0)], [DOWN], True),  # 16 of 18 s of motion
        ([(3.0, 9.0), (10.0, 19.0)], [DOWN, 0.8 * DOWN], True),
        ([(3.0, 9.0), (10.0, 19.0)], [DOWN, UP], False),  # pushes from two sides
        ([(3.0, 6.0), (10.0, 14.0)], [DOWN, DOWN], False),  # 7 of 18 s
    ],
)
def test_a_load_is_one_force_for_most_of_the_motion(
    spans: list[tuple[float, float]], forces: list[np.ndarray], expected: bool
) -> None:
    rows = tuple(
        replace(contact(), start=start, stop=stop, mean_force=force)
        for (start, stop), force in zip(spans, forces, strict=True)
    )
    assert is_load(log(), rows) is expected
