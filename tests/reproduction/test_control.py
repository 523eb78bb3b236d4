"""What is read off a controller: releases as the law alone gives them, and where the arm turns."""

from types import SimpleNamespace

import numpy as np
import pytest

from vftcli.reproduction.control import ALPHAS, released, turn_after
from vftcli.reproduction.paper import CORRECTED


def test_releases_of_the_ur5_are_those_of_the_law() -> None:
    """docs/admittance.md: 0.3 m at rest, ξ .51 and 1; two decimals are what it prints."""
    values = released("ur5", 0, 0.3, ALPHAS, 0).values
    found = [values[f"return_2_s/{a:g}"] for a in ALPHAS]
    assert [x[CORRECTED] for x in found] == pytest.approx([4.66, 3.53, 2.80, 2.31], abs=5e-3)
    assert [x["ξ = 1"] for x in found] == pytest.approx([3.14, 2.30, 1.74, 1.35], abs=6e-3)
    assert values["return_2_s/traditional"][CORRECTED] == pytest.approx(4.84, abs=5e-3)
    assert values["overshoot/traditional"][CORRECTED] == pytest.approx(15.0, abs=0.5)
    assert values["threshold/rx"][CORRECTED] == 6.0


def test_the_turn_is_where_the_velocity_changes_its_sign() -> None:
    """A deviation of −cos(t − 1): the arm goes on outward for 1 s after the release at 1 s."""
    t = np.arange(0.0, 4.0, 0.01)
    x, v = -np.cos(t - 2.0), np.sin(t - 2.0)
    motion = SimpleNamespace(
        t=t, x=np.stack([x] * 6, axis=1)[:, None], v=np.stack([v] * 6, axis=1)[:, None]
    )
    turned = turn_after(SimpleNamespace(motion=motion), 0, {"axis": "y", "release_s": 1.0})
    assert turned == pytest.approx(1.0, abs=0.01)  # a sample
