"""`vftcli help`: the list of topics, what there is, and every setting, on narrow screens."""

from collections.abc import Callable
from pathlib import Path

import pytest
import typer

from vftcli.cli import COMMANDS, make_app
from vftcli.cli.help import topics
from vftcli.observers.table import OBSERVERS
from vftcli.readers.reading import FORMATS
from vftcli.robots import PROFILES

Run = Callable[..., tuple[int, str, str]]

FIXTURES = Path(__file__).parents[2] / "fixtures"
WIDEST = 80


@pytest.fixture(autouse=True)
def narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal of 80 columns."""
    monkeypatch.setenv("COLUMNS", str(WIDEST))


def helped(run: Run, *words: object) -> str:
    code, out, err = run("help", *words)
    assert (code, err) == (0, "")
    return out


def test_help_alone_lists_topics_lists_and_commands(run: Run) -> None:
    text = helped(run)
    there = {line.split()[0] for line in text.splitlines() if line.startswith("  ")}
    lists = {"robots", "observers", "formats", "settings"}
    assert there == {*topics(), *lists, *COMMANDS}
    assert max(map(len, text.splitlines())) <= WIDEST


@pytest.mark.parametrize("topic", [*topics(), "observers", "formats", "settings"])
def test_topics_are_no_commands_and_fit_the_screen(run: Run, topic: str) -> None:
    assert topic not in COMMANDS
    assert max(map(len, helped(run, topic).splitlines())) <= WIDEST


def test_what_there_is_is_listed_with_the_sources_of_one(run: Run) -> None:
    assert all(f" {name} " in helped(run, "observers") for name in OBSERVERS)
    assert all(f"{name} " in helped(run, "formats") for name in FORMATS)
    assert all(f"{name} " in helped(run, "robots") for name in PROFILES)
    assert "source huang2025: " in helped(run, "robots", "ur5")


def test_a_description_is_shown_up_to_its_tip(run: Run) -> None:
    whole = helped(run, "robots", FIXTURES / "arm.urdf")
    joints = [line.split()[0] for line in whole.splitlines()[3:] if line][:3]
    part = helped(run, "robots", FIXTURES / "arm.urdf", "--tip", joints[1])
    assert ": 2 joints" in part.splitlines()[0]


def test_every_setting_of_a_command_is_listed_once(run: Run) -> None:
    text = helped(run, "settings")
    commands = vars(typer.main.get_command(make_app()))["commands"].values()
    choices = {kind for command in commands for kind in vars(command.callback)["choices"]}
    options = {o.name for kind in choices for *_, o in kind.options().values() if o.is_setting}
    dotted = [name for name in options if "." in name]
    assert len(dotted) > 20
    listed = [line.split()[0] for line in text.splitlines() if line[:2] == "  " != line[2:4]]
    assert sorted(listed) == sorted([*dotted, "OBSERVER.NUMBER", "AXIS.NUMBER"])
    assert "(S)" in text.partition("two-cycle.period")[2].partition("virtual-sensor")[0]
    assert "default yes" in text.partition("contacts.list")[2].partition("log.derive")[0]


def test_a_name_follows_only_what_has_names(run: Run) -> None:
    code, out, err = run("help", "frames", "flange")
    assert (code, out) == (1, "")
    assert err == "error: help frames flange: a name follows robots or formats only\n"
