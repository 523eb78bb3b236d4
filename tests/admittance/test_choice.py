"""ControlChoice and the start of a release: what a replay is run with."""

import numpy as np
import pytest

from vftcli.admittance import ControlChoice, released_robot
from vftcli.robots import RobotChoice, load_robot
from vftcli.signals.errors import ParameterError, RobotError

UR5 = load_robot("ur5")


def test_controllers_are_those_of_the_words():
    words = {"controller": "variable", "xi": "0.8", "threshold_mode": "soft"}
    settings = {f"admittance.{name}": value for name, value in words.items()}
    found = ControlChoice.parsed(alpha="1,1.6", settings=settings).controllers(UR5)
    assert [c.alpha[0] for c in found] == [1.0, 1.6]
    np.testing.assert_array_equal(found[0].parameters.xi, np.full(6, 0.8))
    assert found[0].parameters.threshold_mode == "soft"
    assert len(ControlChoice.parsed().controllers(UR5)) == 2  # both kinds where none is named


def test_as_printed_the_whole_force_enters_unless_a_mode_is_named():
    def mode(*assignments: str) -> str:
        choice = ControlChoice(assignments=assignments, as_printed=True)
        return choice.controllers(UR5)[0].parameters.threshold_mode

    assert mode() == "literal"
    assert mode("admittance.threshold_mode=hard") == mode("threshold_mode=hard") == "hard"
    assert ControlChoice.parsed().controllers(UR5)[0].parameters.threshold_mode == "hard"


def test_a_release_starts_where_it_is_set_or_where_the_file_says():
    named = ControlChoice.parsed(settings={"admittance.start": "0,1,2,3,4,5"})
    np.testing.assert_array_equal(named.start_pose(UR5), [0, 1, 2, 3, 4, 5])
    np.testing.assert_array_equal(ControlChoice().start_pose(UR5), UR5.admittance["start"])


def test_a_slip_is_refused_before_a_log_is_read():
    with pytest.raises(ParameterError, match="--alpha 'one' is not a list of numbers"):
        ControlChoice.parsed(alpha="one")
    with pytest.raises(ParameterError, match="there is traditional, variable"):
        ControlChoice.parsed(settings={"admittance.controller": "fuzzy"})


def test_a_release_needs_an_arm():
    with pytest.raises(RobotError, match="a release needs an arm"):
        released_robot(RobotChoice())
    assert released_robot(RobotChoice(name="panda")).name == "panda"
