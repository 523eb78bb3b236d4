"""Help on one screen: options in groups, commands by what one sets out to do, topics."""

import os
import re
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import pytest
import typer

from vftcli import cli
from vftcli.cli import COMMANDS, main, make_app
from vftcli.cli.commands import JOURNEYS
from vftcli.cli.help import GROUPS, topics, two_columns

Run = Callable[..., tuple[int, str, str]]

MOST_LINES = 45

PROGRAM = "import sys; sys.argv[0] = 'vftcli'; from vftcli.cli import launch; launch()"


@pytest.fixture(autouse=True)
def narrow(monkeypatch: pytest.MonkeyPatch) -> None:
    """A terminal of 80 columns."""
    monkeypatch.setenv("COLUMNS", "80")


def helped(run: Run, *words: str) -> str:
    code, out, err = run(*words)
    assert (code, err) == (0, "")
    return out


@pytest.mark.parametrize("command", COMMANDS)
def test_the_help_of_a_command_is_one_screen(command: str, run: Run) -> None:
    text = helped(run, command, "--help")
    assert len(text.splitlines()) <= MOST_LINES
    assert max(map(len, text.splitlines())) <= 80
    assert text == helped(run, command, "-h")
    assert COMMANDS[command].summary in " ".join(text.split())
    assert f"Example: vftcli {command}" in " ".join(text.split())


@pytest.mark.parametrize("command", COMMANDS)
def test_help_shows_every_option(command: str, run: Run) -> None:
    group: Any = typer.main.get_command(make_app())
    text = helped(run, command, "--help")
    for param in group.commands[command].params:
        for name in param.opts:
            if name.startswith("--") and not param.hidden:
                assert re.search(rf"(?<![\w-]){name}(?![\w-])", text), name


def test_options_stand_in_groups_in_their_order(run: Run) -> None:
    text = helped(run, "report", "--help")
    heads = [line.rstrip(":") for line in text.splitlines() if line.rstrip(":") in GROUPS]
    assert tuple(heads) == GROUPS
    wrench = text.partition("The wrench")[2].partition("What to write")[0]
    assert "--frame" in wrench


def test_the_commands_are_listed_by_what_one_sets_out_to_do(run: Run) -> None:
    text = helped(run, "--help")
    assert len(text.splitlines()) <= MOST_LINES
    for name, command in COMMANDS.items():
        # On one line, not cut.
        assert re.search(rf"^  {name} +{re.escape(command.summary)}$", text, re.MULTILINE)
    order = [text.index(head) for head in JOURNEYS]
    assert order == sorted(order)
    assert "--install-completion" in text


@pytest.mark.parametrize("topic", topics())
def test_a_topic_is_one_screen_and_its_options_exist(topic: str, run: Run) -> None:
    text = helped(run, "help", topic)
    assert len(text.splitlines()) <= MOST_LINES
    assert max(map(len, text.splitlines())) <= 100
    group: Any = typer.main.get_command(make_app())
    there = {name for c in group.commands.values() for p in c.params for name in p.opts}
    assert set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", text)) <= there


def test_help_lists_topics_and_explains_commands(run: Run) -> None:
    text = helped(run, "help")
    assert all(f"  {topic} " in text for topic in topics())
    assert helped(run, "help", "frames").startswith("FRAMES")
    assert "Usage: vftcli compare" in helped(run, "help", "compare")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("help", "colums"), "Did you mean columns?"),
        (("help", "weather"), "there is columns, reference, gains, frames, config, robots,"),
        (("reprot",), "No such command 'reprot'. Did you mean report?"),
        (("dance",), "No such command 'dance'."),
        (("report", "--freee", "x"), "No such option: --freee (Possible options: --free)"),
        (("report", "--zzz", "x"), "No such option: --zzz"),
        (("help", "formats", "headerles"), "Did you mean headerless?"),
    ],
)
def test_what_there_is_not_names_the_nearest_if_it_is_near(
    words: tuple[str, ...], said: str, run: Run
) -> None:
    code, _, err = run(*words)
    assert code in {1, 2}
    assert said in " ".join(err.split())
    assert ("Did you mean" in err or "Possible" in err) == ("Did you" in said or "Possib" in said)


def test_what_is_typed_is_left_of_what_it_means() -> None:
    rows = [("--a", "short"), ("--a-very-long-option-of-more-than NAME", "what it means")]
    assert list(two_columns(rows)) == [
        "  --a" + " " * 32 + "short",
        "  --a-very-long-option-of-more-than NAME",
        " " * 37 + "what it means",
    ]


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


@pytest.mark.parametrize(
    ("typed", "offered"),
    [("vftcli rep", {"report"}), ("vftcli report --fr", {"--free", "--frame"})],
)
def test_a_shell_completes_commands_and_options(typed: str, offered: set[str]) -> None:
    words = typed.split()
    asked = {
        "_VFTCLI_COMPLETE": "complete_bash",
        "COMP_WORDS": typed,
        "COMP_CWORD": str(len(words) - 1),
    }
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, **asked},
    )
    assert set(done.stdout.split()) >= offered


def test_only_the_command_that_is_asked_for_is_loaded(monkeypatch: pytest.MonkeyPatch) -> None:
    loaded = []
    monkeypatch.setattr(cli, "make_app", lambda load: lambda **_: loaded.append({*load}))
    for words in ("help report", "report log.csv", "./log.csv", ""):
        monkeypatch.setattr("sys.argv", ["vftcli", *words.split()])
        main()
    each = [some & {*COMMANDS} for some in loaded]
    assert each == [{"help", "report"}, {"report"}, {"contacts"}, set()]
