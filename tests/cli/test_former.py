"""Words of the release before do what they did, each with a note that says today's words."""

import json
from pathlib import Path
from typing import Any

import pytest
import typer

from vftcli.cli import make_app
from vftcli.cli.commands import former, with_command

LOG = Path(__file__).parents[2] / "fixtures" / "ur5_taps_ur_rtde.csv"
TABLE = former()
SHORT = ("--robot", "ur5", "--interval", "4:6", "--json", "-q")


pytestmark = pytest.mark.usefixtures("here")


@pytest.fixture(scope="module")
def commands() -> dict[str, Any]:
    """Name → command."""
    return vars(typer.main.get_command(make_app()))["commands"]


@pytest.mark.parametrize("word", TABLE["options"])
def test_what_a_former_option_is_now_exists(word: str, commands) -> None:
    option, _, value = TABLE["options"][word].partition(" ")
    each = commands.values()
    if option.startswith("--"):
        assert option in {"--help", *(name for c in each for p in c.params for name in p.opts)}
    if option == "--set":
        setting = value.partition("=")[0]
        assert any(kind.takes(setting) for c in each for kind in vars(c.callback)["choices"])


@pytest.mark.parametrize("name", TABLE["commands"])
def test_what_a_former_command_is_now_exists(name: str, commands) -> None:
    now = TABLE["commands"][name].split()
    assert now[0] in commands
    options = {option for param in commands[now[0]].params for option in param.opts}
    assert {word for word in now if word.startswith("-")} <= options


@pytest.mark.parametrize(
    ("words", "now"),
    [
        ("init a.csv", "inspect -o vftcli.toml a.csv"),
        ("init a.csv -o b.toml", "inspect a.csv -o b.toml"),
        ("init --output=b.toml a.csv", "inspect --output=b.toml a.csv"),
        ("tune a.csv -o b.toml", "identify --method gains a.csv -o b.toml"),
    ],
)
def test_a_former_command_is_called_with_its_words(words: str, now: str) -> None:
    assert with_command(words.split()) == now.split()


def test_no_former_word_is_a_word_of_today(commands) -> None:
    assert not {*TABLE["commands"], *TABLE["gone"]} & {*commands}
    for name in (*(f"--{word}" for word in TABLE["options"]), *TABLE["gone"]):
        assert not [n for n, c in commands.items() for p in c.params if name in p.opts], name


def test_a_former_option_does_what_its_setting_does(run) -> None:
    typed = ("--set", "log.effort=current", "--set", "model.friction=none")
    code, expected, _ = run("contacts", LOG, *SHORT, *typed)
    assert (code, expected == run("contacts", LOG, *SHORT)[1]) == (0, False)
    code, out, err = run(LOG, *SHORT, "--effort", "current", "--friction=none")
    assert (code, out) == (0, expected)
    assert err.splitlines() == [
        "note: --effort is now --set log.effort=…",
        "note: --friction is now --set model.friction=…",
    ]


def test_the_command_line_of_run_json_has_today_s_words(run, here: Path) -> None:
    words = ("--interval", "0:2", "--observer", "gmo", "--robot", "ur5", "-o", "out")
    code, _, err = run("estimate", LOG, *words, "--no-contacts", "--match", "bandwidth=2")
    assert (code, err.count(" is now ")) == (0, 2)
    command = json.loads((here / "out/run.json").read_text("utf-8"))["command"]
    assert command.endswith(" --set contacts.list=no --gains bandwidth=2")


def test_a_former_command_is_run_as_what_it_is_now(run) -> None:
    code, out, err = run("robots", "ur5")
    assert (code, err) == (0, "note: robots is now help robots\n")
    assert out == run("help", "robots", "ur5")[1]


def test_the_arguments_of_a_xacro_go_to_the_robot(run, here: Path) -> None:
    for package in ("xacro", "xacrodoc"):
        pytest.importorskip(package, reason="the extra vftcli[xacro] is not installed")
    text = (LOG.parent / "arm.urdf").read_text("utf-8")
    text = text.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ', 1)
    head, _, tail = text.partition('<mass value="')
    text = f'{head}<mass value="$(arg heavy){tail[tail.index(chr(34)) :]}'
    (here / "arm.xacro").write_text(text, "utf-8")
    now = run("inspect", LOG, "--robot", "arm.xacro heavy:=4")
    then = run("inspect", LOG, "--robot", "arm.xacro", "--robot-arg", "heavy=4")
    assert "heavy" not in now[2]
    assert then[:2] == now[:2]
    assert then[2] == "note: --robot-arg is now --robot 'FILE …'\n" + now[2]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("open", "out"), "open is gone; open DIR/index.html in a browser, or DIR/recording.rrd"),
        (("batch", LOG, "--limit", "3"), "--limit is gone; leave it out"),
        (("report", LOG, "--low-pass"), "--low-pass is now --set two-cycle.low-pass=…; give a"),
        (("inspect", LOG, "--robot-arg", "heavy=4"), "'FILE heavy:=4'; give --robot"),
        (("contacts", "--", "--low-pass"), "error: --low-pass: "),  # behind two dashes: a log
    ],
)
def test_what_is_gone_is_one_line(refused, words: tuple[object, ...], said: str) -> None:
    assert said in refused(*words)


def test_former_keys_of_a_file_of_options_are_read(run, here: Path) -> None:
    code, expected, _ = run("contacts", LOG, *SHORT, "--set", "model.friction=none")
    (here / "vftcli.toml").write_text('friction = "none"\nno-contacts = false\n', "utf-8")
    code, out, err = run("contacts", LOG, *SHORT)
    assert code == 0
    assert json.loads(out)["logs"] == json.loads(expected)["logs"]
    assert err.splitlines()[:2] == [
        "note: vftcli.toml: friction is now --set model.friction=…",
        "note: vftcli.toml: no-contacts is now --set contacts.list=no",
    ]
    (here / "vftcli.toml").write_text("[batch]\nlimit = 3\n", "utf-8")
    assert run("contacts", LOG)[2] == "error: --limit is gone; leave it out\n"
