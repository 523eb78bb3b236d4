"""What is typed: options mean the same in every command, former words, first words."""

import json
import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import typer
from example_logs import CIRCLE, TAPS

import vftcli as vft
from vftcli.admittance import ControlChoice
from vftcli.batch import WorkersChoice
from vftcli.bias import RefinementChoice
from vftcli.cli import COMMANDS, make_app
from vftcli.cli.commands import former, with_command
from vftcli.doctor.examination import Examiner
from vftcli.free_motion import FreeChoice
from vftcli.observers import ObserverChoice
from vftcli.outputs import OutputChoice
from vftcli.pipeline import choice_of
from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import Library
from vftcli.robots import RobotChoice
from vftcli.signals.option import Asked, Choice, settings_by_name
from vftcli.wrench import FIT, WrenchChoice

# An option means and takes the same in every command that has it.

ROOT = Path(__file__).parents[2]
READING = {
    "estimate": ("-o", "out"), "compare": ("--reference", "zero"), "report": ("-o", "out"),
    "identify": ("-o", "robot.toml", "--method", "payload"), "convert": ("-o", "log.parquet"),
    "admit": (), "inspect": (), "thresholds": (), "contacts": (),
}  # fmt: skip
"""Command that reads a log → what else it has to be given."""
WRITING = "simulate admit identify convert inspect compare annotate batch reproduce benchmark"
OWN = {
    ("simulate", "--set"), ("identify", "--gains"),
    *((command, "--output") for command in WRITING.split()),
    *((command, "--csv") for command in ("report", "estimate", "compare", "contacts", "batch")),
}  # fmt: skip
"""Options that are a command's own: --set of a scenario, the goal of --method gains, what is
written where, and --csv, which the contract makes a file of `estimate` and a table of the others.
"""
BAD = {
    "--interval": ("8:4", "is not A:B with A < B"),
    "log.format": ("excel", "known formats"),
    "--columns": ("nonsense", "--columns"),
    "--episode": ("last", "is neither a number, as in 0, nor all"),
    "--arm": ("middle", "there is left, right"),
    "log.effort": ("volts", "there is auto, current, torque, torque-without-gravity"),
    "--robot": ("ur9", "no robot 'ur9'"),
    "model.friction": ("some", "there is profile, none, model"),
    "--tip": ("tool0", "--tip is for a URDF, xacro or MJCF; ur5 is a robot file"),
    "--payload": ("bucket", "no payload 'bucket'"),
    "--observer": ("kalman", "no observer 'kalman'; there is best, fdo, gmo"),
    "recording.detail": ("many", "there is full, levels, none"),
    "--gains": ("nowhere.toml", "nowhere.toml"),
    "--free": ("nowhere.csv", "nowhere.csv"),
    "two-cycle.free-cycles": ("first", "is no list of cycle numbers"),
    "two-cycle.period": ("-3", "is not a positive time in seconds"),
    "two-cycle.alignment": ("odd", "there is auto, commanded, period, phase, model"),
    "two-cycle.low-pass": ("-3", "is not a positive cutoff in Hz, none or auto"),
    "bias.method": ("all", "there is auto, whole-log, none"),
    "--frame": ("world", "world"),
    "virtual-sensor.solver": ("qr", "there is smoother, pinv, map"),
    "virtual-sensor.tool": ("1,2", "virtual-sensor.tool"),
    "virtual-sensor.sensor": ("hand", "virtual-sensor.sensor"),
    "--zero": ("nowhere", "is neither A:B with A < B, in seconds, nor start; name a log"),
    "virtual-sensor.torque-sd": ("some", "virtual-sensor.torque-sd"),
    "log.derive": ("tau", "there is dq, none"),
    "--reference": ("magic", "no reference 'magic'; there is zero, vendor, two-cycle, sensor"),
    "--figures": ("gif", "--figures gif; there is pdf, svg, png"),
    "--config": ("nowhere.toml", "--config nowhere.toml: no such file"),
}
"""Shared option or setting → a value it does not take, and what the one line on it says."""


def parameters(command: str) -> dict[str, Any]:
    """Name as it is typed → what typer knows of it; of a setting, the setting."""
    group: Any = typer.main.get_command(make_app())
    found = group.commands[command]
    settings = settings_by_name(vars(found.callback)["choices"])
    return {p.opts[-1]: p for p in found.params} | settings


def typed(name: str, value: str) -> tuple[str, ...]:
    # A negative number would be taken for an option if it stood alone.
    return (f"{name}={value}",) if name.startswith("-") else ("--set", f"{name}={value}")


@pytest.mark.slow
@pytest.mark.parametrize("option", BAD)
def test_the_same_bad_value_is_refused_with_the_same_line(option: str, refused, here) -> None:
    value, words = BAD[option]
    lines = {}
    for command, needed in READING.items():
        there = parameters(command)
        if option not in there or (command, option) in OWN:
            continue
        robot = ("--robot", "ur5") if "--robot" in there and option != "--robot" else ()
        lines[command] = refused(command, CIRCLE, *robot, *needed, *typed(option, value))
    assert words in next(iter(lines.values()))
    assert len(set(lines.values())) == 1, lines
    assert not any(here.iterdir())  # nothing half written


def test_every_shared_option_is_tried() -> None:
    """A new option of several commands needs its bad value here, or is one that takes all."""
    takes_all = {"--output", "--help", "--json", "--force", "--causal", "--wrench", "--as-printed",
                 "--details", "--set", "--reference-columns", "--anyway", "--mcap", "--open",
                 "--quiet", "--latex", "--check", "contacts.list"}  # fmt: skip
    each = ((command, name) for command in READING for name in parameters(command))
    count = Counter(name for command, name in each if (command, name) not in OWN)
    shared = {name for name, times in count.items() if times > 1 and re.search(r"^--|\.", name)}
    assert shared - takes_all <= set(BAD)


def test_a_shared_option_reads_alike_in_every_command() -> None:
    seen: dict[str, dict[str, list[str]]] = {}
    for command in COMMANDS:
        for name, p in parameters(command).items():
            if name.startswith("--") and (command, name) not in OWN:
                text = str((p.help, p.metavar, p.opts, p.is_flag))
                seen.setdefault(name, {}).setdefault(text, []).append(command)
    assert not {name: texts for name, texts in seen.items() if len(texts) > 1}


@pytest.mark.parametrize("command", READING)
def test_a_command_takes_all_that_can_be_asked_of_a_log_and_of_an_estimate(command: str) -> None:
    asked = {"log.format", "--columns", "--interval", "--json", "--details", "--quiet"}
    if command in {"estimate", "compare", "report", "admit"}:
        asked |= {*BAD, "--causal", "--wrench", "--as-printed"}
        asked -= {
            "--reference",
            "--figures",
            "recording.detail",
        }  # what is compared, shown, written
    assert set(parameters(command)) >= asked


OF_OTHER_TOOLS = {"--binary", "--storage", "--help", "--all-extras", "--dist", "--nthreads",
                  "--protocol", "--tls-ca-file",
                  "--tls-cert", "--tls-key", "--rounds"}  # fmt: skip
"""Options in documents that are those of pip, ros2 bag, Dask, our benchmark, or of all programs."""


def test_documents_name_every_option_and_no_other() -> None:
    files = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    # Options that are gone, and those of the developers' tools.
    others = {"changelog.md", "contributing.md"}
    text = "\n".join(f.read_text("utf-8") for f in files if f.name not in others)
    named = set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", text)) - OF_OTHER_TOOLS
    there = {name for c in COMMANDS for name in parameters(c) if name.startswith("--")}
    of_help = {"--version", "--install-completion"}
    assert named - of_help == there


# Options once: what is not typed is decided by the room, what is typed asks for its work.


@pytest.mark.parametrize("choice", [
    ReadChoice, RobotChoice, ObserverChoice, FreeChoice, RefinementChoice, WrenchChoice,
    OutputChoice, ControlChoice, WorkersChoice,
])  # fmt: skip
def test_a_choice_of_nothing_typed_is_the_choice_s_default(choice: type[Choice]) -> None:
    assert choice.parsed() == choice()
    nothing = dict.fromkeys(choice.options())
    assert choice.parsed(**nothing) == choice()


@pytest.mark.parametrize("typed", [
    {"wrench": True}, {"frame": "base"}, {"zero": ["1:2"]}, {"virtual-sensor.solver": "map"},
    {"virtual-sensor.tool": "0,0,0.1"}, {"virtual-sensor.sensor": FIT},
    {"virtual-sensor.torque-sd": "own"}, {},
])  # fmt: skip
def test_any_option_of_it_asks_for_a_wrench(typed: dict[str, Any]) -> None:
    settings = {name: text for name, text in typed.items() if "." in name}
    words = {name: word for name, word in typed.items() if "." not in name}
    asked = choice_of(Asked({"zero": []} | words, settings, ""), Library(), Examiner())
    assert (asked.wrench is not None) == bool(typed)


@pytest.mark.usefixtures("here")
def test_figures_without_matplotlib_are_refused_before_the_log_is_read(refused, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    error = refused("compare", "no.csv", "--reference", "zero", "--figures", "pdf", "-o", "out")
    assert "pip install 'vftcli[figures]'" in error


# Without a command the words are of `contacts`: a log or options may come first.


@pytest.mark.parametrize("words", [(TAPS, "--robot", "ur5"), ("--robot", "ur5", TAPS)])
def test_a_log_alone_is_asked_what_touched_the_arm(run, words: tuple[object, ...]) -> None:
    asked = ("--interval", "0:3", "--csv", "-q")
    expected = run("contacts", *words, *asked)
    assert expected[0] == 0
    assert run(*words, *asked) == expected


@pytest.mark.parametrize("name", ["nowhere.csv", "no/where", "-"])
def test_a_word_that_looks_as_a_path_is_a_log(refused, name: str) -> None:
    assert refused(name).startswith(f"error: {name}: ")


def test_a_file_of_the_folder_is_a_log_and_a_command_goes_before_it(run, here: Path) -> None:
    for name in ("push", "report"):
        (here / name).write_text("no log\n")
    assert run("push")[2].startswith("error: push: ")
    assert "Missing argument" in run("report")[2]
    assert run("./report")[2].startswith("error: report: ")


@pytest.mark.usefixtures("here")
def test_an_arm_that_is_not_settled_is_asked_for(run) -> None:
    """Behind what the log holds, on one line, with the two that fit best."""
    log = vft.read(TAPS)
    held = np.column_stack([log.t, log.q, log.require("dq"), log.require("current")])
    # A longer path would leave no room for the format beside it.
    np.savetxt("push.csv", held, delimiter=",")
    words = ("push.csv", "--columns", "t,q:6,dq:6,current:6")
    code, out, err = run(*words)
    assert code == 1
    assert out.startswith("push.csv: headerless\n  joints    6\n")
    said = r"error: Which arm\? Best fits: ur5 .*%\), .*%\)\. Add --robot ur5\n"
    assert re.fullmatch(said, err)
    assert run(*words, "--json") == (code, "", err)
    Path("vftcli.toml").write_text("json = true\n")
    assert run(*words)[1] == ""


# Words of the release before do what they did, each with a note that says today's words.

TABLE = former()
SHORT = ("--robot", "ur5", "--interval", "4:6", "--json", "-q")
pytestmark = pytest.mark.usefixtures("here")


@pytest.fixture(scope="module")
def commands() -> dict[str, Any]:
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


@pytest.mark.parametrize(("words", "now"), [
    ("init a.csv", "inspect -o vftcli.toml a.csv"),
    ("init a.csv -o b.toml", "inspect a.csv -o b.toml"),
    ("init --output=b.toml a.csv", "inspect --output=b.toml a.csv"),
    ("tune a.csv -o b.toml", "identify --method gains a.csv -o b.toml"),
])  # fmt: skip
def test_a_former_command_is_called_with_its_words(words: str, now: str) -> None:
    assert with_command(words.split()) == now.split()


def test_no_former_word_is_a_word_of_today(commands) -> None:
    assert not {*TABLE["commands"], *TABLE["gone"]} & {*commands}
    for name in (*(f"--{word}" for word in TABLE["options"]), *TABLE["gone"]):
        assert not [n for n, c in commands.items() for p in c.params if name in p.opts], name


def test_a_former_option_does_what_its_setting_does(run) -> None:
    typed = ("--set", "log.effort=current", "--set", "model.friction=none")
    code, expected, _ = run("contacts", TAPS, *SHORT, *typed)
    assert (code, expected == run("contacts", TAPS, *SHORT)[1]) == (0, False)
    code, out, err = run(TAPS, *SHORT, "--effort", "current", "--friction=none")
    assert (code, out) == (0, expected)
    now = {"effort": "log.effort", "friction": "model.friction"}
    assert err.splitlines() == [f"note: --{then} is now --set {x}=…" for then, x in now.items()]
    said = run("admit", "--closed-loop=x.toml")[2]
    assert "note: --closed-loop is now the argument x.toml" in said


def test_the_command_line_of_run_json_has_today_s_words(run, here: Path) -> None:
    words = ("--interval", "0:2", "--observer", "gmo", "--robot", "ur5", "-o", "out")
    code, _, err = run("estimate", TAPS, *words, "--no-contacts", "--match", "bandwidth=2")
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
    text = (TAPS.parent / "arm.urdf").read_text("utf-8")
    text = text.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ', 1)
    head, _, tail = text.partition('<mass value="')
    text = f'{head}<mass value="$(arg heavy){tail[tail.index(chr(34)) :]}'
    (here / "arm.xacro").write_text(text, "utf-8")
    now = run("inspect", TAPS, "--robot", "arm.xacro heavy:=4")
    then = run("inspect", TAPS, "--robot", "arm.xacro", "--robot-arg", "heavy=4")
    assert "heavy" not in now[2]
    assert then[:2] == now[:2]
    assert then[2] == "note: --robot-arg is now --robot 'FILE …'\n" + now[2]


def test_former_keys_of_a_file_of_options_are_read(run, here: Path) -> None:
    code, expected, _ = run("contacts", TAPS, *SHORT, "--set", "model.friction=none")
    (here / "vftcli.toml").write_text('friction = "none"\nno-contacts = false\n', "utf-8")
    code, out, err = run("contacts", TAPS, *SHORT)
    assert code == 0
    assert json.loads(out)["logs"] == json.loads(expected)["logs"]
    assert err.splitlines()[:2] == [
        "note: vftcli.toml: friction is now --set model.friction=…",
        "note: vftcli.toml: no-contacts is now --set contacts.list=no",
    ]
    (here / "vftcli.toml").write_text("[batch]\nlimit = 3\n", "utf-8")
    assert run("contacts", TAPS)[2] == "error: --limit is gone; leave it out\n"


# What a shell is offered behind the words that were typed.

PROGRAM = "import sys; sys.argv[0] = 'vftcli'; from vftcli.cli import launch; launch()"
LOG = str(CIRCLE)


@pytest.mark.parametrize(("words", "values"), [
    (("rep",), {"report", "reproduce"}),
    (("report", "--fr"), {"--free", "--frame"}),
    (("contacts", "--robot", "ur1"), {"ur10", "ur10e", "ur16e"}),
    ((LOG, "--robot", "ur10"), {"ur10", "ur10e"}),
    (("--robot", "ur5", LOG, "--arm", "l"), {"left"}),
    (("report", "--observer", "kfo-"), {"kfo-auto", "kfo-fe", "kfo-rts", "kfo-zoh"}),
    (("compare", "--reference", "ze"), {"zero"}),
    (("report", "--gains", "p"), {"paper"}),
    (("report", "--frame", "f"), {"flange"}),
    (("report", "--figures", "s"), {"svg"}),
    (("batch", "--do", "co"), {"compare", "contacts"}),
    (("simulate", "--as", "lib"), {"libfranka"}),
    (("report", "--set", "two-cycle.l"), {"two-cycle.low-pass="}),
    (("report", "--set", "gmo."), {"gmo.gain="}),
    (("admit", "--set", "rz.thr"), {"rz.threshold="}),
    (("contacts", "--set", "bench"), set()),
    (("help", "fr"), {"frames"}),
    (("help", "co"), {"columns", "config", "contacts", "compare", "convert"}),
    (("report", "--robot", "my_"), set()),  # the shell offers files
])  # fmt: skip
def test_values_are_offered(words: tuple[str, ...], values: set[str]) -> None:
    typed = " ".join(("vftcli", *words))
    asked = {
        "_VFTCLI_COMPLETE": "complete_bash",
        "COMP_WORDS": typed,
        "COMP_CWORD": f"{len(words)}",
    }
    shell = {"capture_output": True, "text": True, "env": {**os.environ, **asked}}
    done = subprocess.run([sys.executable, "-c", PROGRAM], check=False, **shell)
    assert (set(done.stdout.split()), done.stderr) == (values, "")
