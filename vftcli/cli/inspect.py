"""`vftcli inspect`: the log doctor."""

from typing import Annotated

import typer

from vftcli.cli import options as opt
from vftcli.cli.analysis import LogOptions
from vftcli.cli.progress import echo
from vftcli.signals.option import Option


@opt.command
def inspect_log(
    log: opt.Log,
    logged: LogOptions,
    _talk: opt.TalkOptions,
    strict: Annotated[bool, Option("--strict", "", "Exit with 1 if there is any warning, for CI.")],
    json: opt.Json,
) -> None:
    """Examine a log: format, signals, clock, and what looks wrong.

    Example: vftcli inspect fixtures/ur5_circle.csv
    """
    from vftcli.cli.console import say_json, say_robots
    from vftcli.doctor import Examiner, examine
    from vftcli.outputs.examination import examination_record, examination_text
    from vftcli.readers import read_first_recording

    choice = logged.reading.choice()
    recording = read_first_recording(log, choice)
    recording = choice.within(choice.taken(recording))
    chosen = logged.robot.choice()
    examiner, arm = Examiner(), None
    if chosen.name or choice.effort == "auto":
        arm = examiner.robot(recording, chosen)
        recording = examiner.taken(recording, arm, choice)
    say_robots(examiner.robots)
    examination = examine(recording, arm)
    if json:
        say_json(examination_record(examination))
    else:
        echo(examination_text(examination))
    warnings = len(examination.warnings)
    if strict and warnings:
        echo(f"{warnings} warning{'s' if warnings > 1 else ''} (--strict)", err=True)
        raise typer.Exit(1)
