"""`vftcli inspect`: the log doctor, and a log's options in a file."""

import math
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vftcli.cli import options as opt
from vftcli.cli.config import NAME
from vftcli.cli.console import LeftOut, echo, echo_top, say, say_json, say_robots
from vftcli.readers.reader import ReadChoice
from vftcli.robots import RobotChoice
from vftcli.signals.option import Asked, Option
from vftcli.signals.parsing import counted

if TYPE_CHECKING:
    from vftcli.proposal import ProposedOption


@opt.command(*opt.OF_LOG, opt.Talk)
def inspect_log(
    logs: opt.Logs,
    asked: Asked,
    output: Annotated[
        Path | None, opt.OUT._replace(help="Write here; the options that this log needs.")
    ],
    strict: Annotated[
        bool, Option("--strict", "", "Exit with 1 if anything looks wrong, for CI.")
    ],
    json: opt.Json,
    force: opt.Force,
) -> None:
    """Show what a log holds and what is wrong with it.

    With -o vftcli.toml it writes robot, columns and reference, each with its reason, for the
    commands in that folder. Further LOGs become free motion if nothing touches the arm.

    Example: vftcli inspect fixtures/ur5_circle.csv
    """
    from vftcli.doctor import Examiner, examine
    from vftcli.outputs.examination import examination_record, examinations_text
    from vftcli.outputs.files import check_file
    from vftcli.outputs.run_record import log_entry
    from vftcli.outputs.screen import MOST_LINES
    from vftcli.readers.reading import Library
    from vftcli.signals.errors import VftError

    if output is not None:
        check_file(output, force)
    choice = replace(asked.of(ReadChoice), examining=True)
    chosen, examiner = asked.of(RobotChoice), Examiner()
    library, examinations = Library(logs), []
    left_out = LeftOut(library, logs)
    for log in logs:
        try:
            recording, arm = library.open(log, choice), None
            if chosen.name or choice.effort == "auto":
                arm = examiner.robot(recording, chosen)
                recording = examiner.read_as(recording, arm, choice)
            examinations.append(examine(recording, arm))
        except VftError as error:
            left_out.add(log, error)
    if not examinations:
        left_out.end(0)
    say_robots(examiner.robots)
    if not json:
        most = math.inf if asked.words["details"] else MOST_LINES
        echo_top(examinations_text(examinations, most))
    written = {} if output is None else write_options(output, logs, asked, force=force)
    if json:
        entries = [log_entry(one.recording, examination_record(one)) for one in examinations]
        say_json(entries, [remark for one in examinations for remark in one.remarks], **written)
    warnings = sum(len(examination.warnings) for examination in examinations)
    if strict and warnings:
        echo(f"{counted(warnings, 'warning')} (--strict)", err=True)
        raise typer.Exit(1)
    left_out.end(len(examinations))


def write_options(
    output: Path, logs: Sequence[Path], asked: Asked, *, force: bool
) -> dict[str, Any]:
    """Write the options for logs, and return them for machines."""
    from vftcli.outputs.files import write_text
    from vftcli.proposal import config_text, propose
    from vftcli.readers.reading import Library

    words = {word: asked.words.get(word) for kind in opt.OF_LOG for word in kind.options()}
    words |= asked.settings
    given = {name.replace("_", "-"): value for name, value in words.items() if value is not None}
    choice = opt.choice_for(asked, Library(logs), on_screen=True)
    proposed = [from_folder(output.parent, option) for option in propose(logs, choice, given)]
    write_text(output, config_text(proposed), force)
    settled = {option.key: option.value for option in proposed if option.key and option.holds}
    for option in proposed:
        if not option.key:
            say(f"note: {option.why}")
    how = (
        "unasked by commands run beside it" if output.name == NAME else f"with --config {output}"
    )
    say(f"wrote {output}: {', '.join(settled) or 'nothing that is settled'}; read {how}")
    if "robot" not in settled:
        say("which arm it is remains open: name it with --robot, or in the file")
    notes = [option.why for option in proposed]
    return {"output": str(output), "options": settled, "notes": notes}


def from_folder(folder: Path, option: "ProposedOption") -> "ProposedOption":
    """An option with its files named from a folder on."""

    def named(word: str) -> str:
        there = option.key in {"robot", "free"} and Path(word).exists()
        return Path(os.path.relpath(word, folder)).as_posix() if there else word

    value = option.value
    return option._replace(
        value=named(value) if isinstance(value, str) else list(map(named, value))
    )
