"""The figures that the list of deviations quotes are the code's own."""

import numpy as np
import pytest

from vftcli.admittance.deviations_from_paper import DIFFERENCES
from vftcli.admittance.law import variable
from vftcli.admittance.parameters import from_table
from vftcli.admittance.stability import judge
from vftcli.robots import load_robot

SAID = dict(DIFFERENCES)


def parameters(name: str):
    return from_table(load_robot(name).admittance, name, {})


@pytest.mark.parametrize(
    ("name", "figures"), [("ur5", ("0.510", "0.671")), ("panda", ("2.74", "1.06"))]
)
def test_damping_ratios(name: str, figures: tuple[str, str]) -> None:
    ratio = parameters(name).damping_ratio
    for value, figure in zip((ratio[0], ratio[3]), figures, strict=True):
        assert figure in SAID["ξ is stated."]
        assert value == pytest.approx(float(figure), abs=0.5 * 10.0 ** -len(figure.split(".")[1]))


def test_the_escape_bound_of_the_ur5s_rotation() -> None:
    assert "18°" in SAID["Rotation has a speed limit."]
    bound = judge(variable(parameters("ur5"))).escape[3]
    assert np.degrees(bound) == pytest.approx(18.0, abs=0.5)
