"""An option means and takes the same in every command that has it."""

import re
from pathlib import Path
from typing import Any

import pytest
import typer

from vftcli.cli import COMMANDS, make_app
from vftcli.signals.option import settings_by_name

ROOT = Path(__file__).parents[2]
FIXTURE = ROOT / "fixtures" / "ur5_circle.csv"

READING = {
    "estimate": ("-o", "out"),
    "compare": ("--reference", "zero"),
    "report": ("-o", "out"),
    "admit": (),
    "identify": ("-o", "robot.toml", "--method", "payload"),
    "inspect": (),
    "thresholds": (),
    "convert": ("-o", "log.parquet"),
    "contacts": (),
}
"""Command that reads a log → what else it has to be given."""

OWN = {("simulate", "--set"), ("identify", "--gains"), ("simulate", "--output"),
       ("admit", "--output"), ("identify", "--output"), ("convert", "--output"),
       ("inspect", "--output"), ("compare", "--output"),
       ("annotate", "--output"), ("batch", "--output"), ("reproduce", "--output"),
       ("benchmark", "--output"),
       ("estimate", "--csv"), ("compare", "--csv"), ("contacts", "--csv")}  # fmt: skip
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
    "recording.detail": ("many", "many is none of full, levels and none"),
    "--gains": ("nowhere.toml", "nowhere.toml"),
    "--free": ("nowhere.csv", "nowhere.csv"),
    "two-cycle.free-cycles": ("first", "is no list of cycle numbers"),
    "two-cycle.period": ("-3", "is not a positive time in seconds"),
    "two-cycle.alignment": ("odd", "no alignment 'odd'"),
    "two-cycle.low-pass": ("-3", "is not a positive cutoff in Hz, none or auto"),
    "bias.method": ("all", "there is auto, whole-log, none"),
    "--frame": ("world", "world"),
    "virtual-sensor.solver": ("qr", "no solver 'qr'"),
    "virtual-sensor.tool": ("1,2", "virtual-sensor.tool"),
    "virtual-sensor.sensor": ("hand", "virtual-sensor.sensor"),
    "--zero": ("nowhere", "is neither A:B with A < B, in seconds, nor start; name a log"),
    "virtual-sensor.torque-sd": ("some", "virtual-sensor.torque-sd"),
    "log.derive": ("tau", "log.derive 'tau'"),
    "--reference": ("magic", "no reference 'magic'"),
    "--figures": ("gif", "--figures 'gif' is not pdf, svg or png"),
    "--config": ("nowhere.toml", "--config nowhere.toml: no such file"),
}
"""Shared option or setting → a value it does not take, and what the one line on it says."""


def parameters(command: str) -> dict[str, Any]:
    """Name as it is typed → what typer knows of it; of a setting, the setting."""
    group: Any = typer.main.get_command(make_app())
    found = group.commands[command]
    return {p.opts[-1]: p for p in found.params} | settings_by_name(
        vars(found.callback)["choices"]
    )


def typed(name: str, value: str) -> tuple[str, ...]:
    """The words for a value of an option or a setting."""
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
        lines[command] = refused(command, FIXTURE, *robot, *needed, *typed(option, value))
    assert words in next(iter(lines.values()))
    assert len(set(lines.values())) == 1, lines
    assert not any(here.iterdir())  # nothing half written


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("command", ["estimate", "compare", "report", "admit"])
def test_a_bad_number_of_an_observer_is_refused(command: str, refused) -> None:
    words = ("--robot", "ur5", *READING[command], "--set", "gmo.gain=much")
    assert "is not a number or a list" in refused(command, FIXTURE, *words)


def test_every_shared_option_is_tried() -> None:
    """A new option of several commands needs its bad value here, or is one that takes all."""
    takes_all = {"--output", "--help", "--json", "--force", "--causal", "--wrench", "--as-printed",
                 "--details", "--set", "--reference-columns", "--anyway", "--mcap", "--open",
                 "--quiet", "--latex", "--check", "contacts.list"}  # fmt: skip
    count: dict[str, int] = {}
    for command in READING:
        for name in parameters(command):
            shown = name.startswith("--") or "." in name
            if shown and (command, name) not in OWN:
                count[name] = count.get(name, 0) + 1
    shared = {name for name, times in count.items() if times > 1}
    assert shared - takes_all <= set(BAD)


def test_a_shared_option_reads_alike_in_every_command() -> None:
    seen: dict[str, dict[str, tuple[object, ...]]] = {}
    for command in COMMANDS:
        for name, p in parameters(command).items():
            if name.startswith("--") and (command, name) not in OWN:
                text = (p.help, p.metavar, p.opts, p.is_flag)
                seen.setdefault(name, {})[command] = text
    differing = {
        name: texts for name, texts in seen.items() if len(set(map(str, texts.values()))) > 1
    }
    assert not differing


@pytest.mark.parametrize("command", READING)
def test_a_command_that_reads_a_log_reads_it_as_all_do(command: str) -> None:
    common = {"log.format", "--columns", "--interval", "--json", "--details", "--quiet"}
    assert set(parameters(command)) >= common


@pytest.mark.parametrize("command", ["estimate", "compare", "report", "admit"])
def test_a_command_that_estimates_takes_all_that_can_be_asked(command: str) -> None:
    whole = {*BAD, "--causal", "--wrench", "--as-printed"}
    whole -= {"--reference", "--figures", "recording.detail"}  # what is compared, shown, written
    assert set(parameters(command)) >= whole


OF_OTHER_TOOLS = {"--binary", "--storage", "--help", "--all-extras", "--dist", "--nthreads",
                  "--protocol", "--tls-ca-file",
                  "--tls-cert", "--tls-key", "--rounds"}  # fmt: skip
"""Options in documents that are those of pip, ros2 bag, Dask, our benchmark, or of all programs."""


def test_documents_name_every_option_and_no_other() -> None:
    files = [ROOT / "README.md", *(ROOT / "docs").glob("*.md")]
    # The one names options that are gone, the other those of the developers' tools.
    others = {"changelog.md", "contributing.md"}
    text = "\n".join(f.read_text("utf-8") for f in files if f.name not in others)
    named = set(re.findall(r"(?<![\w-])--[a-z][a-z-]+", text)) - OF_OTHER_TOOLS
    there = {name for c in COMMANDS for name in parameters(c) if name.startswith("--")}
    of_help = {"--version", "--install-completion"}
    assert named - of_help == there
