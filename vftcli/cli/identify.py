"""`vftcli identify`: logs become a robot."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from vftcli.cli import options as opt
from vftcli.cli.analysis import LogOptions
from vftcli.cli.progress import echo
from vftcli.repetition.choice import FreeChoice
from vftcli.signals.option import WRITE, Option
from vftcli.signals.parsing import interval

if TYPE_CHECKING:
    from vftcli.identification import Task
    from vftcli.readers.reader import ReadChoice
    from vftcli.signals.recording import Recording


class TaskOptions(opt.Bundle):
    """What is identified, and how."""

    method: Annotated[
        str | None,
        Option(
            "--method",
            "METHOD",
            "friction, base, targets or auto. Default: auto, friction but base where the robot's "
            "links are wrong; none with --find-payload.",
        ),
    ]
    find_payload: Annotated[
        bool,
        Option(
            "--find-payload",
            "",
            "Find a load on the flange: two LOGs of one motion, --free, poses, or motion.",
        ),
    ]
    fit_constants: Annotated[
        bool, Option("--fit-constants", "", "Friction method: drive constants K too.")
    ]
    cutoff: Annotated[float, Option("--cutoff", "HZ", "Cutoff of the zero-phase filter.")] = 8.0

    def task(self, name: str, friction: bool = True) -> "Task":
        """What shall be identified, for a robot of this name whose joints rub or not."""
        from vftcli.identification import Processing, Task

        usual = "friction" if self.fit_constants else "auto"
        return Task(
            method=self.method or (None if self.find_payload else usual),
            friction=friction,
            name=name,
            find_payload=self.find_payload,
            fit_constants=self.fit_constants,
            processing=Processing(cutoff=self.cutoff),
        )


def logs_without_load(free: list[str] | None, find_payload: bool) -> tuple[Path, ...]:
    """The logs of the same motion without the load that is sought, one at most."""
    from vftcli.signals.errors import ParameterError

    chosen = FreeChoice.parsed(free=free)
    if chosen.spans or len(chosen.logs) > 1:
        raise ParameterError(
            "a load is found from one pair of logs: give --free the log without it, once"
        )
    if chosen.logs and not find_payload:
        raise ParameterError(
            "--free is the motion without the load that --find-payload seeks; free motion to "
            "identify the arm from is given as LOG"
        )
    return chosen.logs


@opt.command
def identify_robot(
    logs: opt.Logs,
    output: Annotated[Path, Option("-o/--output", "FILE.toml", "The new robot file.", group=WRITE)],
    logged: LogOptions,
    asked: TaskOptions,
    validate: Annotated[
        list[Path] | None,
        Option("--validate", "LOG", "Score on this log too. Repeatable."),
    ],
    span: Annotated[
        tuple[float, float] | None,
        Option(
            "--validate-interval", "A:B", "Use only this span of the --validate logs.", interval
        ),
    ],
    free: Annotated[list[str] | None, FreeChoice.option("free", reads=None)],
    made: opt.MadeOptions,
    anyway: opt.Anyway,
    _talk: opt.TalkOptions,
    show: opt.Open,
) -> None:
    """Make a robot file from logs: friction, inertias, payload.

    Writes FILE.toml for --robot, and FILE.html and FILE.run.json beside it. With --find-payload
    a LOG may be a dataset, of which every episode counts.

    Example: vftcli identify free.csv --robot ur5 --method friction -o my_robot.toml
    """
    from vftcli.cli.console import (
        command_line,
        detail,
        health_of,
        open_made,
        say,
        say_recording,
        say_robots,
    )
    from vftcli.identification import identify
    from vftcli.outputs.files import OutputFolder
    from vftcli.outputs.identification import (
        beside,
        files_beside,
        tables_text,
        write_identification,
    )
    from vftcli.readers.library import Library

    task = asked.task(output.stem, friction=logged.robot.words["friction"] != "none")
    form = made.figures
    OutputFolder(output.parent, made.force, files_beside(output, form)).check()
    choice, chosen = logged.reading.choice(), logged.robot.choice()
    # An episode is one of LOG's; the others are logs of their own.
    held_out_choice = replace(choice.whole, interval=span)
    unloaded_choice = replace(choice.whole, interval=choice.interval)
    validated, without_load = validate or [], logs_without_load(free, asked.find_payload)
    library = Library([*logs, *validated, *without_load])
    # That the profile is not the arm's is what this command is there to change; but the friction
    # method keeps the profile's links, and the default begins with it.
    keeps = task.method in {"friction", "auto"}
    examiner = health_of(library, anyway=anyway, fitting=keeps)
    profile = examiner.robot(next(library.open_each(logs, choice)), chosen)

    def opened(
        paths: list[Path] | tuple[Path, ...], how: "ReadChoice", *, whole: bool = False
    ) -> list["Recording"]:
        each = library.open_each(paths, how, whole=whole)
        return [examiner.taken(log, profile, how) for log in each]

    train = opened(logs, choice, whole=asked.find_payload)
    held_out, unloaded = opened(validated, held_out_choice), opened(without_load, unloaded_choice)
    for recording in (*train, *held_out, *unloaded):
        say_recording(recording)
        examiner.examine(recording, profile)
    found = identify(train, profile, task, held_out, unloaded[0] if unloaded else None)
    record = write_identification(
        output, found, examiner.examinations, command_line(), made.force, form
    )
    say_robots(examiner.robots)
    for remark in found.remarks:
        detail(f"note: {remark}")
    say(f"wrote {', '.join(map(str, beside(output).values()))}")
    echo(record.rstrip("\n") if made.json else tables_text(found))
    if show:
        open_made(output.with_suffix(".html"))
