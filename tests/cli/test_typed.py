"""Options once: a choice's fields say how they are typed, commands are handed what was typed."""

import sys
from typing import Annotated, Any

import pytest
import typer
from typer.testing import CliRunner

from vftcli.admittance.choice import ControlChoice
from vftcli.batch.choice import WorkersChoice
from vftcli.bias.choice import RefinementChoice
from vftcli.cli.options import TableForm, command
from vftcli.doctor.examination import Examiner
from vftcli.free_motion.choice import FreeChoice
from vftcli.observers.choice import ObserverChoice
from vftcli.outputs import OutputChoice
from vftcli.pipeline import choice_of
from vftcli.readers.library import Library
from vftcli.readers.reader import ReadChoice
from vftcli.robots.choice import RobotChoice
from vftcli.signals.option import Asked, Choice, Option
from vftcli.wrench.choice import FIT, WrenchChoice

EVERY = (
    ReadChoice, RobotChoice, ObserverChoice, FreeChoice, RefinementChoice, WrenchChoice,
    OutputChoice, ControlChoice, WorkersChoice,
)  # fmt: skip


class SizeChoice(Choice):
    GROUP = "Sizes"

    word: Annotated[str, Option("--word", "W", "Which word.")]
    size: Annotated[int, Option("--size", "N", "How large.", least=1)] = 3
    loud: Annotated[bool, Option("-l/--loud", "", "Whether loud.")] = False
    each: Annotated[tuple[int, ...], Option("--each", "N", "Repeatable.", len, several=True)] = ()


def called(*words: str) -> tuple[int, dict[str, Any]]:
    """Run a command with choices; return its exit code and what it was handed."""
    seen: dict[str, Any] = {}

    @command(SizeChoice, TableForm)
    def work(
        name: Annotated[str, Option("", "NAME", "Who.")],
        asked: Asked,
        *,
        times: Annotated[int, Option("--times", "N", "How often.")] = 1,
        at: Annotated[float | None, Option("--at", "S", "When.")],
    ) -> None:
        """Do something."""
        seen.update(name=name, asked=asked, times=times, at=at)

    app = typer.Typer()
    app.command()(work)
    return CliRunner().invoke(app, words).exit_code, seen


def test_a_command_is_handed_what_was_typed() -> None:
    code, seen = called("me", "--size", "7", "-l", "--csv", "--times", "2", "--each", "a")
    assert code == 0
    asked = seen["asked"]
    own = {name: asked.words[name] for name in SizeChoice.options()}
    assert own == {"word": None, "size": 7, "loud": True, "each": ["a"]}
    choice = asked.but(word="w").of(SizeChoice)
    assert choice == SizeChoice(word="w", size=7, loud=True, each=1)
    assert asked.words["csv"]
    assert (seen["name"], seen["times"], seen["at"]) == ("me", 2, None)
    # What is not typed has its default, and limits hold.
    assert called("me")[1]["asked"].but(word="w").of(SizeChoice) == SizeChoice(word="w")
    assert called()[0] == 2  # the argument is missing
    assert called("me", "--size", "0")[0] == 2


def test_an_option_that_the_function_has_itself_is_asked_for_as_there() -> None:
    @command(SizeChoice)
    def work(word: Annotated[str, SizeChoice.option("word")], asked: Asked) -> None:
        """Do something."""
        assert asked.of(SizeChoice).word == word

    app = typer.Typer()
    app.command()(work)
    assert CliRunner().invoke(app, []).exit_code == 2
    assert CliRunner().invoke(app, ["--word", "w"]).exit_code == 0


@pytest.mark.parametrize("choice", EVERY)
def test_a_choice_of_nothing_typed_is_the_choice_s_default(choice: type[Choice]) -> None:
    """What is not given is decided by the room, not a second time by the command line."""
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
def test_figures_without_matplotlib_are_refused_before_anything_is_computed(
    refused, monkeypatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    error = refused("compare", "no.csv", "--reference", "zero", "--figures", "pdf", "-o", "out")
    assert "pip install 'vftcli[figures]'" in error
