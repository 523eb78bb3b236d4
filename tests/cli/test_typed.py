"""Options once: what is not typed is decided by the room, what is typed asks for its work."""

import sys
from typing import Any

import pytest

from vftcli.admittance import ControlChoice
from vftcli.batch import WorkersChoice
from vftcli.bias import RefinementChoice
from vftcli.doctor.examination import Examiner
from vftcli.free_motion import FreeChoice
from vftcli.observers import ObserverChoice
from vftcli.outputs import OutputChoice
from vftcli.pipeline import choice_of
from vftcli.readers.library import Library
from vftcli.readers.reader import ReadChoice
from vftcli.robots import RobotChoice
from vftcli.signals.option import Asked, Choice
from vftcli.wrench import FIT, WrenchChoice

EVERY = (
    ReadChoice, RobotChoice, ObserverChoice, FreeChoice, RefinementChoice, WrenchChoice,
    OutputChoice, ControlChoice, WorkersChoice,
)  # fmt: skip


@pytest.mark.parametrize("choice", EVERY)
def test_a_choice_of_nothing_typed_is_the_choice_s_default(choice: type[Choice]) -> None:
    assert choice.parsed() == choice()
    nothing = dict.fromkeys(choice.options())
    assert choice.parsed(**nothing) == choice()


@pytest.mark.parametrize(
    "typed",
    [
        {"wrench": True},
        {"frame": "base"},
        {"virtual-sensor.solver": "map"},
        {"virtual-sensor.tool": "0,0,0.1"},
        {"virtual-sensor.sensor": FIT},
        {"zero": ["1:2"]},
        {"virtual-sensor.torque-sd": "own"},
        {},
    ],
)
def test_any_option_of_it_asks_for_a_wrench(typed: dict[str, Any]) -> None:
    settings = {name: text for name, text in typed.items() if "." in name}
    words = {"zero": [], **{name: word for name, word in typed.items() if "." not in name}}
    asked = choice_of(Asked(words, settings, ""), Library(), Examiner())
    assert (asked.wrench is not None) == bool(typed)


@pytest.mark.usefixtures("here")
def test_figures_without_matplotlib_are_refused_before_the_log_is_read(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    error = refused("compare", "no.csv", "--reference", "zero", "--figures", "pdf", "-o", "out")
    assert "pip install 'vftcli[figures]'" in error
