"""Help on one screen: options in groups, commands by what one sets out to do, topics, lists."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer

from vftcli import cli
from vftcli.cli import COMMANDS, main, make_app
from vftcli.cli.commands import JOURNEYS
from vftcli.cli.help import GROUPS, topics
from vftcli.observers.table import OBSERVERS
from vftcli.readers.reading import FORMATS
from vftcli.robots import PROFILES

FIXTURES = Path(__file__).parents[2] / "fixtures"
MOST_LINES, WIDEST = 45, 80
LISTS = ("robots", "observers", "formats", "settings")


@pytest.fixture
def helped(run, monkeypatch):
    """What the program prints on a terminal of 80 columns."""
    monkeypatch.setenv("COLUMNS", str(WIDEST))

    def call(*words: object) -> str:
        code, out, err = run(*words)
        assert (code, err) == (0, "")
        return out

    return call


def commands() -> dict[str, Any]:
    """Name → command."""
    return vars(typer.main.get_command(make_app()))["commands"]


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_a_command_is_one_screen_and_shows_every_option(command: str, helped) -> None:
    text = helped(command, "--help")
    assert len(text.splitlines()) <= MOST_LINES
    assert max(map(len, text.splitlines())) <= WIDEST
    assert text == helped(command, "-h")
    assert COMMANDS[command].summary in " ".join(text.split())
    assert f"Example: vftcli {command}" in " ".join(text.split())
    params = commands()[command].params
    names = [name for p in params for name in p.opts if name.startswith("--") and not p.hidden]
    assert [name for name in names if not re.search(rf"(?<![\w-]){name}(?![\w-])", text)] == []


def test_options_stand_in_groups_in_their_order(helped) -> None:
    text = helped("report", "--help")
    heads = [line.rstrip(":") for line in text.splitlines() if line.rstrip(":") in GROUPS]
    assert tuple(heads) == GROUPS
    wrench = text.partition("The wrench")[2].partition("What to write")[0]
    assert "--frame" in wrench


def test_the_commands_are_listed_by_what_one_sets_out_to_do(helped) -> None:
    text = helped("--help")
    assert len(text.splitlines()) <= MOST_LINES
    for name, command in COMMANDS.items():
        # On one line, not cut.
        assert re.search(rf"^  {name} +{re.escape(command.summary)}$", text, re.MULTILINE)
    order = [text.index(head) for head in JOURNEYS]
    assert order == sorted(order)
    assert "--install-completion" in text


@pytest.mark.parametrize("topic", topics())
def test_a_topic_is_one_screen_and_its_options_exist(topic: str, helped) -> None:
    assert topic not in COMMANDS
    text = helped("help", topic)
    assert len(text.splitlines()) <= MOST_LINES
    assert max(map(len, text.splitlines())) <= WIDEST
    there = {name for c in commands().values() for p in c.params for name in p.opts}
    assert set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", text)) <= there


def test_help_lists_topics_lists_and_commands_and_explains_each(helped) -> None:
    text = helped("help")
    there = {line.split()[0] for line in text.splitlines() if line.startswith("  ")}
    assert there == {*topics(), *LISTS, *COMMANDS}
    for shown in (text, *(helped("help", name) for name in LISTS[1:])):
        assert max(map(len, shown.splitlines())) <= WIDEST
    assert helped("help", "frames").startswith("FRAMES")
    assert "Usage: vftcli compare" in helped("help", "compare")


def test_what_there_is_is_listed_with_the_sources_of_one(helped) -> None:
    for name, known in (("observers", OBSERVERS), ("formats", FORMATS), ("robots", PROFILES)):
        text = helped("help", name)
        assert [each for each in known if f"{each} " not in text] == []
    assert "source huang2025: " in helped("help", "robots", "ur5")
    assert "record:" in helped("help", "formats", "mcap")


def test_a_description_is_shown_up_to_its_tip(helped) -> None:
    whole = helped("help", "robots", FIXTURES / "arm.urdf")
    joints = [line.split()[0] for line in whole.splitlines()[3:] if line][:3]
    part = helped("help", "robots", FIXTURES / "arm.urdf", "--tip", joints[1])
    assert ": 2 joints" in part.splitlines()[0]


def test_every_setting_of_a_command_is_listed_once(helped) -> None:
    text = helped("help", "settings")
    choices = {kind for c in commands().values() for kind in vars(c.callback)["choices"]}
    options = {o.name for kind in choices for *_, o in kind.options().values() if o.is_setting}
    dotted = [name for name in options if "." in name]
    assert len(dotted) > 20
    listed = [line.split()[0] for line in text.splitlines() if line[:2] == "  " != line[2:4]]
    assert sorted(listed) == sorted([*dotted, "OBSERVER.NUMBER", "AXIS.NUMBER"])
    assert "(S)" in text.partition("two-cycle.period")[2].partition("virtual-sensor")[0]
    assert "default yes" in text.partition("contacts.list")[2].partition("log.derive")[0]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("help", "colums"), "Did you mean columns?"),
        (("help", "weather"), "there is columns, reference, gains, frames, config, robots,"),
        (("help", "formats", "headerles"), "Did you mean headerless?"),
        (("help", "frames", "flange"), "a name follows robots or formats only"),
        (("reprot", "x.csv"), "No such command 'reprot'. Did you mean report?"),
        (("dance",), "No such command 'dance'."),
        (("report", "--freee", "x"), "No such option: --freee (Possible options: --free)"),
        (("report", "--zzz", "x"), "No such option: --zzz"),
    ],
)
def test_what_there_is_not_names_the_nearest_if_it_is_near(
    words: tuple[str, ...], said: str, run
) -> None:
    code, out, err = run(*words)
    assert (code, out) == (1 if words[0] == "help" else 2, "")
    assert said in " ".join(err.split())
    assert ("Did you mean" in err or "Possible" in err) == ("Did you" in said or "Possib" in said)


def test_help_loads_nothing_heavy() -> None:
    script = (
        "import sys\nsys.argv = ['vftcli', 'report', '--help']\n"
        "from vftcli.cli import main\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'scipy', 'polars', 'pinocchio', 'rerun', 'rich'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    done = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines()[-1] == "[]"


def test_only_the_command_that_is_asked_for_is_loaded(monkeypatch) -> None:
    loaded = []
    monkeypatch.setattr(cli, "make_app", lambda load: lambda **_: loaded.append({*load}))
    for words in ("help report", "report log.csv", "./log.csv", ""):
        monkeypatch.setattr("sys.argv", ["vftcli", *words.split()])
        main()
    each = [some & {*COMMANDS} for some in loaded]
    assert each == [{"help", "report"}, {"report"}, {"contacts"}, set()]
