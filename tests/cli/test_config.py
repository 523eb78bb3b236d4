"""Options kept in a file, and help on one screen."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
import typer
from example_logs import CIRCLE, FIXTURES

from vftcli import cli
from vftcli.cli import COMMANDS, config, main, make_app
from vftcli.cli.commands import JOURNEYS
from vftcli.cli.help import GROUPS, topics
from vftcli.observers.table import OBSERVERS
from vftcli.readers.reading import FORMATS
from vftcli.robots import PROFILES
from vftcli.signals.option import settings_by_name

# Options kept in a file do what the same options typed do, are said, and are checked alike.

KEPT = """
robot = "ur5"
observer = ["fdo", "gmo"]
interval = "0:4"
reference = "file:truth.csv"
[compare]
reference = "zero"
wrench = false
"""


def keep(folder: Path, text: str, name: str = config.NAME) -> Path:
    (folder / name).write_text(text, "utf-8")
    return folder / name


def test_kept_options_give_the_numbers_of_typed_ones(run, ran, here: Path) -> None:
    typed = ("--robot", "ur5", "--observer", "fdo", "--observer", "gmo", "--interval", "0:4")
    _, expected, _ = run("compare", CIRCLE, *typed, "--reference", "zero", "--json")
    keep(here, KEPT)
    out, err = ran("compare", CIRCLE, "--json", "--quiet")
    assert json.loads(out)["rows"] == json.loads(expected)["rows"]
    # Said even where little else is: a file nobody thinks of changes the results.
    assert err.splitlines()[0].startswith("note: vftcli.toml gives ")
    for option in ("--robot ur5", "--observer fdo --observer gmo", "--reference zero"):
        assert option in err


def test_what_is_typed_goes_before_what_is_kept(run, here: Path) -> None:
    keep(here, KEPT)
    _, out, err = run("compare", CIRCLE, "--observer", "gmo", "--json")
    assert {row["observer"] for row in json.loads(out)["rows"]} == {"gmo"}
    assert "--observer" not in err
    code, _, err = run("compare", CIRCLE, "--config", "none")
    assert (code, "note: " in err) == (2, False)
    assert "Missing option '--reference'" in err


def test_a_named_file_is_read_in_place_of_the_folder_s(run, here: Path) -> None:
    keep(here, "no TOML")
    keep(here, 'robot = "ur5"', "other.toml")
    code, _, err = run("inspect", CIRCLE, "--config", "other.toml")
    said = "note: other.toml gives --robot ur5 (--config none: without it)"
    assert (code, err.splitlines()[0]) == (0, said)


def test_the_command_line_of_run_json_needs_no_file(run, here: Path) -> None:
    keep(here, 'robot = "ur5"\nobserver = ["gmo"]\nwrench = false\n[contacts]\nlist = false\n')
    assert run("estimate", CIRCLE, "-o", "out")[0] == 0
    command = json.loads((here / "out/run.json").read_text("utf-8"))["command"]
    kept = "--observer gmo --robot ur5 --set contacts.list=no --config none"
    assert sorted(command.split()) == sorted(f"vftcli estimate {CIRCLE} -o out {kept}".split())
    (here / config.NAME).unlink()
    assert run(*command.split()[1:], "-o", "again")[0] == 0
    files = [here / folder / "estimates.parquet" for folder in ("out", "again")]
    assert files[0].read_bytes() == files[1].read_bytes()


@pytest.mark.slow
def test_kept_columns_are_not_those_of_estimates(run, here: Path) -> None:
    kept = 'robot = "ur5"\ncolumns = "-t,q:6"\nobserver = ["gmo"]\n[contacts]\nlist = false\n'
    keep(here, kept)
    code, _, err = run("estimate", CIRCLE, "-o", "out")
    assert (code, "--columns=-t,q:6" in err) == (1, True)
    assert run("estimate", CIRCLE, "-o", "out", "--config", "none", "--robot", "ur5")[0] == 0
    code, _, err = run("admit", here / "out/estimates.parquet")
    assert (code, "--columns" in err) == (0, False)


def test_logs_behind_two_dashes_stay_behind_them(run, here: Path) -> None:
    keep(here, 'robot = "ur5"\n')
    (here / "-log.csv").symlink_to(CIRCLE)
    code, out, err = run("inspect", "--json", "--", "-log.csv")
    assert (code, "note: vftcli.toml gives --robot ur5" in err) == (0, True)
    command = "vftcli inspect --json --robot ur5 --config none -- -log.csv"
    assert json.loads(out)["command"] == command


@pytest.mark.parametrize(("text", "said"), [
    ('robt = "ur5"', "is no option of a command that reads a log. Did you mean robot?"),
    ("dance = 1", "A key is an option without its dashes, as robot."),
    ('[compare]\nrobt = "ur5"', "'robt' is no option of compare. Did you mean robot?"),
    ("[compre]\nwrench = true", "compre.wrench is no setting here; vftcli help settings"),
    ("force = true", "force is not kept in a file; type --force"),
    ("robot = ", "not valid TOML"),
    ("robot = true", "robot = True is not a text or a number"),
    ('robot = ["ur5", "ur3"]', "is not a text or a number"),
    ("robot = {name = 'ur5'}", "robot.name is no setting"),
    ("[two-cycle]\nperiot = 4", "here; vftcli help settings lists all. Did you mean"),
    ("free = [[1, 2]]", "is not a text, a number or a list of them"),
    ('wrench = "yes"', "wrench = 'yes' is neither true nor false"),
    ('[two-cycle]\nperiod = "long"', "two-cycle.period=long is not a number"),
    ('[two-cycle]\nalignment = "odd"', "two-cycle.alignment=odd; there is auto"),
    ("two-cycle = 4", "'two-cycle' is no option of a command that reads a log"),
    ('robot = "mine.toml"', f"{Path('sub/mine.toml')}: no such robot file"),
])  # fmt: skip
def test_what_is_wrong_with_a_file_is_said_in_one_line(refused, here, text, said) -> None:
    (here / "sub").mkdir()
    file = keep(here / "sub", text, "kept.toml").relative_to(here)
    assert said in refused("report", CIRCLE, "-o", "out", "--config", file)
    assert not (here / "out").exists()


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("name", ["nowhere.toml", ".", os.devnull, str(CIRCLE)])
def test_what_is_no_such_file_is_refused(refused, name: str) -> None:
    assert f"{name}: " in refused("inspect", CIRCLE, "--config", name)


@pytest.mark.parametrize("content", [b"robot = '\xff'", "robot = 'ur5'".encode("utf-16")])
def test_a_file_in_another_encoding_is_refused_in_words(run, refused, here, content) -> None:
    (here / config.NAME).write_bytes(content)
    error = refused("inspect", CIRCLE)
    assert error.endswith("cannot be read as a file of options (not a text in UTF-8)")
    # Help needs no such file.
    assert run("inspect", "--help")[0] == 0
    assert run("help", "robots")[0] == 0


def test_files_are_named_from_the_folder_of_the_file(run, here: Path) -> None:
    (here / "sub").mkdir()
    (here / "sub/free.csv").write_bytes(CIRCLE.read_bytes())
    keep(here / "sub", 'robot = "ur5"\nfree = ["free.csv", "0.3:4"]\n')
    kept = ("--config", Path("sub") / config.NAME)
    code, _, err = run("contacts", CIRCLE, *kept)
    assert f"--free {Path('sub/free.csv')} --free 0.3:4" in err
    assert (code, "are one run" in err) == (1, True)
    # A log is no free run of itself.
    code, _, err = run("contacts", Path("sub/free.csv"), *kept)
    assert (code, "gives --robot ur5 --free 0.3:4 (" in err) == (0, True)


def test_the_file_is_an_input_that_nothing_writes_over(refused, here: Path) -> None:
    kept = keep(here, 'robot = "ur5"\n')
    error = refused("identify", CIRCLE, "--method", "gains", "-o", kept, "--force")
    assert "what this command reads" in error
    assert kept.read_text("utf-8") == 'robot = "ur5"\n'


def test_every_option_kept_otherwise_exists() -> None:
    every = config.every_command()
    settings = settings_by_name(config.choices_of(*every.values()))
    for command, keys in config.OTHERWISE.items():
        assert keys <= {*config.options_of(every[command]), *settings}


IDENTIFY = '[identify]\ncutoff = 5\nmethod = "guess"\n[two-cycle]\nperiod = 4\n'


@pytest.mark.parametrize(("kept", "words", "gives"), [
    ("anyway = true\ndetails = true\n[contacts]\nall = true\n", "contacts --interval 0:2",
     "--robot ur5 --all --anyway --details"),
    # `thresholds --reference` is of --check.
    ('reference = "two-cycle"\n', "thresholds --interval 0:1", "--robot ur5"),
    ('[thresholds]\nreference = "two-cycle"\n', "thresholds", "--robot ur5 --reference two-cycle"),
    # The group of a setting may be called as a command.
    (IDENTIFY, "identify",
     "--set identify.cutoff=5 --set two-cycle.period=4 --robot ur5 --method guess"),
    (IDENTIFY, "compare --reference zero --interval 0:1", "--set two-cycle.period=4 --robot ur5"),
])  # fmt: skip
def test_a_command_is_given_what_it_takes(run, here: Path, kept, words, gives) -> None:
    keep(here, f'robot = "ur5"\n{kept}')
    command, *more = words.split()
    note, *rest = run(command, CIRCLE, *more)[2].splitlines()
    given = note.partition(" gives ")[2].partition(" (")[0]
    assert given == gives
    assert any("--check" in line for line in rest) == ("thresholds]" in kept)


def test_a_typed_setting_goes_before_a_kept_one(run, here: Path) -> None:
    keep(here, 'robot = "ur5"\n[gmo]\ngain = [5, 5, 5, 5, 5, 5]\n[fdo]\nomega = 8\n')
    words = ("--observer", "gmo", "--observer", "fdo", "--reference", "zero", "--json")
    _, kept, err = run("compare", CIRCLE, *words, "--set", "gmo.gain=9")
    assert "gives --set fdo.omega=8 --robot ur5 (" in err
    typed = ("--set", "gmo.gain=9", "--set", "fdo.omega=8", "--robot", "ur5", "--config", "none")
    assert kept == run("compare", CIRCLE, *words, *typed)[1]


# Help on one screen: options in groups, commands by what one sets out to do, topics, lists.

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


@pytest.mark.parametrize(("words", "said"), [
    (("help", "colums"), "Did you mean columns?"),
    (("help", "weather"), "there is columns, reference, gains, frames, config, robots,"),
    (("help", "formats", "headerles"), "Did you mean headerless?"),
    (("help", "frames", "flange"), "a name follows robots or formats only"),
    (("reprot", "x.csv"), "No such command 'reprot'. Did you mean report?"),
    (("dance",), "No such command 'dance'."),
    (("report", "--freee", "x"), "No such option: --freee (Possible options: --free)"),
    (("report", "--zzz", "x"), "No such option: --zzz"),
])  # fmt: skip
def test_what_there_is_not_names_the_nearest_if_it_is_near(words, said, run):
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
    printed = subprocess.check_output([sys.executable, "-c", script], text=True)
    assert printed.splitlines()[-1] == "[]"


def test_only_the_command_that_is_asked_for_is_loaded(monkeypatch) -> None:
    loaded = []
    monkeypatch.setattr(cli, "make_app", lambda load: lambda **_: loaded.append({*load}))
    for words in ("help report", "report log.csv", "./log.csv", ""):
        monkeypatch.setattr("sys.argv", ["vftcli", *words.split()])
        main()
    each = [some & {*COMMANDS} for some in loaded]
    assert each == [{"help", "report"}, {"report"}, {"contacts"}, set()]


def test_a_missing_option_says_what_it_takes(run) -> None:
    code, _, err = run("compare", FIXTURES / "ur5_circle.csv")
    assert code == 2
    assert "Usage: vftcli compare [OPTIONS] LOG...\n" in err
    assert "  Compare with two-cycle, sensor, vendor, zero, file.\n" in err
