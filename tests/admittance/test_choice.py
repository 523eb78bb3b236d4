"""ControlChoice and the start of a release: what a replay is run with."""

from typing import Any

import numpy as np
import pytest

from vftcli.admittance.choice import (
    ControlChoice,
    released_robot,
)
from vftcli.robots import load_robot
from vftcli.robots.choice import RobotChoice
from vftcli.signals.errors import ParameterError, RobotError

UR5 = load_robot("ur5")


def test_one_variable_controller_an_alpha() -> None:
    choice = ControlChoice.parsed(alpha="1,1.6", settings={"admittance.controller": "variable"})
    found = choice.controllers(UR5)
    assert [c.alpha[0] for c in found] == [1.0, 1.6]


def test_both_kinds_where_none_is_named() -> None:
    choice = ControlChoice.parsed()
    assert len(choice.controllers(UR5)) == 2


def test_xi_and_threshold_mode_are_settings() -> None:
    parameters = (
        ControlChoice.parsed(
            settings={"admittance.xi": "0.8", "admittance.threshold_mode": "soft"}
        )
        .controllers(UR5)[0]
        .parameters
    )
    np.testing.assert_array_equal(parameters.xi, np.full(6, 0.8))
    assert parameters.threshold_mode == "soft"


def test_as_printed_the_whole_force_enters_unless_a_mode_is_named() -> None:
    def mode(*assignments: str) -> str:
        choice = ControlChoice(assignments=assignments, as_printed=True)
        return choice.controllers(UR5)[0].parameters.threshold_mode

    assert mode() == "literal"
    assert mode("admittance.threshold_mode=hard") == mode("threshold_mode=hard") == "hard"
    assert ControlChoice.parsed().controllers(UR5)[0].parameters.threshold_mode == "hard"


def test_a_release_starts_where_it_is_set_or_where_the_file_says() -> None:
    named = ControlChoice.parsed(settings={"admittance.start": "0,1,2,3,4,5"})
    np.testing.assert_array_equal(named.start_pose(UR5), [0, 1, 2, 3, 4, 5])
    np.testing.assert_array_equal(ControlChoice().start_pose(UR5), UR5.admittance["start"])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"alpha": "one"}, "--alpha 'one' is not a list of numbers"),
        (
            {"settings": {"admittance.controller": "fuzzy"}},
            "no controller 'fuzzy'; there is traditional, variable",
        ),
    ],
)
def test_a_slip_is_refused_before_a_log_is_read(words: dict[str, Any], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        ControlChoice.parsed(**words)


def test_a_release_needs_an_arm() -> None:
    with pytest.raises(RobotError, match="a release needs an arm"):
        released_robot(RobotChoice())
    assert released_robot(RobotChoice(name="panda")).name == "panda"
