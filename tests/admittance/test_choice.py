"""ControlChoice and the start of a release: what a replay is run with."""

from pathlib import Path

import numpy as np
import pytest

from vftcli.admittance.choice import (
    ControlChoice,
    released_robot,
    split_settings,
    start_pose,
)
from vftcli.robots import load_robot
from vftcli.robots.choice import RobotChoice
from vftcli.signals.errors import ParameterError, RobotError

UR5 = load_robot("ur5")


def test_one_variable_controller_an_alpha() -> None:
    choice = ControlChoice.parsed(alpha="1,1.6", controller=["variable"])
    found = choice.controllers(choice.parameters(UR5))
    assert [c.alpha[0] for c in found] == [1.0, 1.6]


def test_both_kinds_where_none_is_named() -> None:
    choice = ControlChoice.parsed()
    assert len(choice.controllers(choice.parameters(UR5))) == 2


def test_xi_and_threshold_mode_are_settings() -> None:
    parameters = ControlChoice.parsed(xi="0.8", threshold_mode="soft").parameters(UR5)
    assert parameters.xi is not None
    np.testing.assert_array_equal(parameters.xi, np.full(6, 0.8))
    assert parameters.threshold_mode == "soft"


def test_as_printed_the_whole_force_enters_unless_a_mode_is_named() -> None:
    def mode(*assignments: str, **words: str) -> str:
        choice = ControlChoice(assignments=assignments, as_printed=True, **words)
        return choice.parameters(UR5).threshold_mode

    assert mode() == "literal"
    assert mode(threshold_mode="hard") == mode("threshold_mode=hard") == "hard"
    assert ControlChoice.parsed().parameters(UR5).threshold_mode == "hard"


def test_xi_from_the_drag_phase_is_the_default() -> None:
    from_damping = ControlChoice.parsed(xi="from-B").parameters(UR5)
    np.testing.assert_array_equal(
        from_damping.damping_ratio, ControlChoice.parsed().parameters(UR5).damping_ratio
    )


def test_settings_go_before_a_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(
        "[admittance]\nperiod = 0.004\n"
        "[admittance.position]\nmass = 2\ndamping = 20\nstiffness = 50\nalpha = 1\nthreshold = 3\n"
        "[admittance.rotation]\nmass = 1\ndamping = 9\nstiffness = 20\nalpha = 1\nthreshold = 1\n",
        encoding="utf-8",
    )
    choice = ControlChoice(file=file, assignments=("x.mass=5",))
    parameters = choice.parameters(UR5)
    assert parameters.period == 0.004
    np.testing.assert_array_equal(parameters.mass, [5, 2, 2, 1, 1, 1])


def test_settings_of_observers_are_told_from_the_admittance_s() -> None:
    words = ["gmo.gain=3", "x.mass=2", "xi=1", "kfo.decay=0"]
    assert split_settings(words) == (["x.mass=2", "xi=1"], ["gmo.gain=3", "kfo.decay=0"])


def test_a_release_starts_where_it_is_told_or_where_the_file_says() -> None:
    np.testing.assert_array_equal(start_pose(UR5, "0,1,2,3,4,5"), [0, 1, 2, 3, 4, 5])
    np.testing.assert_array_equal(start_pose(UR5, None), UR5.admittance["start"])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"alpha": "one"}, "--alpha 'one' is not a list of numbers"),
        ({"controller": ["fuzzy"]}, "no controller 'fuzzy'; there is traditional, variable"),
    ],
)
def test_a_slip_is_refused_before_a_log_is_read(words: dict[str, object], message: str) -> None:
    with pytest.raises(ParameterError, match=message):
        ControlChoice.parsed(**words)


def test_a_release_needs_an_arm() -> None:
    with pytest.raises(RobotError, match="a release needs an arm"):
        released_robot(RobotChoice())
    assert released_robot(RobotChoice(name="panda")).name == "panda"
