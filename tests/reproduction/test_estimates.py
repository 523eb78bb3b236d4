"""What is read off the bearing's assembly: how the arm moves under it."""

from types import SimpleNamespace

import numpy as np
import pytest

from vftcli.reproduction.huang2025 import motion_under_knocks
from vftcli.reproduction.paper import CORRECTED


def test_an_arm_is_back_at_a_tenth_left_where_it_rests_and_moved_by_knocks() -> None:
    """Led .5 m along x until 2 s, back by a fifth of that a second; knocks of 4 and 3 mm later."""
    t = np.arange(0.0, 12.0, 0.01)
    x = np.zeros((len(t), 1, 6))
    x[:, 0, 0] = 0.5 * np.clip(np.minimum(t / 2.0, 1.0 - (t - 2.0) / 5.0), 0.006, 1.0)
    x[(t > 8.5) & (t < 9.0), 0, 1:3] = [0.004, 0.003]
    x[t > 9.5, 0, 2] = 0.7  # after the knocks
    rows = [
        {"controller": "variable", "axis": "x", "peak": 0.001, "release_s": 0.5},
        {"controller": "variable", "axis": "x", "peak": -0.5, "release_s": 2.0},
        {"controller": "variable", "axis": "y", "peak": 9.0, "release_s": 1.0},
        {"controller": "traditional", "axis": "x", "peak": 9.0, "release_s": 1.0},
    ]
    motion, law = SimpleNamespace(t=t, x=x), SimpleNamespace(kind="variable")
    found = SimpleNamespace(motion=motion, controllers=[law], rows=rows)
    given = motion_under_knocks(CORRECTED, found, (8.0, 9.4))
    values = {key: value for _, key, value in given}
    assert values["back/variable"] == pytest.approx(4.5, abs=0.011)  # a sample
    assert values["left/variable"] == pytest.approx(3.0)
    assert values["knocked/variable"] == pytest.approx(5.0)
