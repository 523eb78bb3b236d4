"""Options once: a choice's fields say how they are typed, commands are handed what was typed."""

import sys
from dataclasses import dataclass
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from vftcli.admittance.choice import ControlChoice
from vftcli.batch.choice import WorkersChoice
from vftcli.bias.choice import RefinementChoice
from vftcli.cli.analysis import AnalysisOptions, LogOptions
from vftcli.cli.options import FORMS, Bundle, Needed, Typed, checked_form, command
from vftcli.evaluation.reference_choice import ReferenceChoice
from vftcli.free_motion.choice import FreeChoice
from vftcli.observers.choice import ObserverChoice
from vftcli.outputs import OutputChoice
from vftcli.readers.library import Library
from vftcli.readers.reader import ReadChoice
from vftcli.robots.choice import RobotChoice
from vftcli.signals.errors import PackageError, ParameterError
from vftcli.signals.option import Choice, Option
from vftcli.wrench.choice import FIT, WrenchChoice

EVERY = (
    ReadChoice, RobotChoice, ObserverChoice, FreeChoice, RefinementChoice, WrenchChoice,
    OutputChoice, ControlChoice, WorkersChoice,
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class SizeChoice(Choice):
    GROUP = "Sizes"

    word: Annotated[str, Option("--word", "W", "Which word.")]
    size: Annotated[int, Option("--size", "N", "How large.", least=1)] = 3
    loud: Annotated[bool, Option("-l/--loud", "", "Whether loud.")] = False
    each: Annotated[tuple[int, ...], Option("--each", "N", "Repeatable.", len, several=True)] = ()


class Outer(Bundle):
    sizes: Typed[SizeChoice]
    csv: Annotated[bool, Option("--csv", "", "A table.")]


def called(*words: str) -> tuple[int, dict[str, object]]:
    """Run a command with bundles; return its exit code and what it was handed."""
    seen: dict[str, object] = {}

    @command
    def work(
        name: Annotated[str, Option("", "NAME", "Who.")],
        outer: Outer,
        *,
        times: Annotated[int, Option("--times", "N", "How often.")] = 1,
        at: Annotated[float | None, Option("--at", "S", "When.")],
    ) -> None:
        """Do something."""
        seen.update(name=name, outer=outer, times=times, at=at)

    app = typer.Typer()
    app.command()(work)
    return CliRunner().invoke(app, words).exit_code, seen


def test_a_command_is_handed_what_was_typed() -> None:
    code, seen = called("me", "--size", "7", "-l", "--csv", "--times", "2", "--each", "a")
    assert code == 0
    assert seen["outer"].sizes.words == {"word": None, "size": 7, "loud": True, "each": ["a"]}
    choice = seen["outer"].sizes.choice(word="w")
    assert choice == SizeChoice(word="w", size=7, loud=True, each=1)
    assert (seen["outer"].csv, seen["name"], seen["times"], seen["at"]) == (True, "me", 2, None)


def test_what_is_not_typed_has_its_default_and_limits_hold() -> None:
    assert called("me")[1]["outer"].sizes.choice(word="w") == SizeChoice(word="w")
    assert called()[0] == 2  # the argument is missing
    assert called("me", "--size", "0")[0] == 2


def test_a_field_without_default_is_asked_for_where_the_choice_is_needed() -> None:
    @command
    def work(sizes: Needed[SizeChoice]) -> None:
        """Do something."""

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
        {"also_wrench": True},
        {"frame": "base"},
        {"virtual-sensor.solver": "map"},
        {"virtual-sensor.tool": "0,0,0.1"},
        {"virtual-sensor.sensor": FIT},
        {"zero": ["1:2"]},
        {"virtual-sensor.torque-sd": "own"},
        {},
    ],
)
def test_any_option_of_it_asks_for_a_wrench(typed: dict[str, object]) -> None:
    words = {"zero": [], **typed}
    also = bool(words.pop("also_wrench", False))
    nothing = {
        name: Typed(choice, {})
        for name, choice in (
            ("observers", ObserverChoice),
            ("free", FreeChoice),
            ("refinement", RefinementChoice),
        )
    }
    log = LogOptions(reading=Typed(ReadChoice, {}), robot=Typed(RobotChoice, {}))
    asked = AnalysisOptions(
        **nothing, log=log, also_wrench=also, wrench=Typed(WrenchChoice, words), anyway=False,
    ).choice(Library())  # fmt: skip
    assert (asked.wrench is not None) == bool(typed)


def test_a_reference_s_options_are_those_of_its_choice() -> None:
    made = ReferenceChoice.parsed(reference="zero", reference_columns="t,tau_ext:6")
    assert made == ReferenceChoice(name="zero", columns="t,tau_ext:6")


def test_a_form_of_figures_is_checked_before_anything_is_computed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    assert [checked_form(form) for form in FORMS] == list(FORMS)
    with pytest.raises(ParameterError, match="'gif' is not pdf, svg or png"):
        checked_form("gif")
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(PackageError, match=r"pip install 'vftcli\[figures\]'"):
        checked_form("pdf")
