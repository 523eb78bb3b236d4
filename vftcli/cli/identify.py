"""`vftcli identify`: logs become a robot, or the gains of its observers."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from vftcli.bias import RefinementChoice
from vftcli.cli import options as opt
from vftcli.cli.console import (
    detail,
    echo_data,
    echo_top,
    health_of,
    open_made,
    say,
    say_json,
    say_recording,
    say_robots,
)
from vftcli.free_motion import FreeChoice
from vftcli.identification import Task
from vftcli.observers import GoalChoice
from vftcli.signals.errors import ParameterError
from vftcli.signals.option import Anyway, Asked


def check_uses(task: Task, free: FreeChoice, logs: list[Path], others: dict[str, object]) -> None:
    """Refuse options that the method does not use."""
    for name, given in others.items():
        if given and (name == "--gains") != (task.method == "gains"):
            raise ParameterError(
                f"--method {task.method} makes no use of {name}; leave it out"
                if task.method
                else f"{name} is an option of --method gains"
            )
    if task.method == "gains":
        if len(logs) > 1:
            raise ParameterError("--method gains takes one LOG; name free motion by --free")
    elif free.logs and task.method != "payload":
        raise ParameterError(
            "--free is the motion without the load that --method payload seeks; free motion to "
            "identify the arm from is given as LOG"
        )
    elif free.spans or len(free.logs) > 1:
        raise ParameterError(
            "a load is found from one pair of logs: give --free the log without it, once"
        )


def file_for(robot: str) -> Path:
    """The default file in this folder for a robot's results."""
    return Path("my_" + re.sub(r"[^\w.-]", "_", robot) + ".toml")


@opt.command(*opt.OF_LOG, Task, GoalChoice, FreeChoice, RefinementChoice, Anyway, opt.Talk)
def identify_robot(
    logs: opt.Logs,
    output: Annotated[
        Path | None, opt.OUT._replace(help="Write here; default: my_ROBOT.toml in this folder.")
    ],
    asked: Asked,
    check: opt.Check,
    figures: opt.Figures,
    json: opt.Json,
    force: opt.Force,
    show: opt.Open,
) -> None:
    """Make a robot file: friction, inertia, payload, gains.

    Default method: friction, or base where the robot's links are wrong. Writes a page and
    run.json beside the file. For a payload a LOG may be a dataset with all its episodes.
    For gains, --gains states the goal.

    Example: vftcli identify free.csv --robot ur5 --method friction -o my_robot.toml
    """
    from vftcli.answering import identified
    from vftcli.outputs.files import OutputFolder
    from vftcli.outputs.identification import (
        LEGEND,
        files_beside,
        tables_text,
        write_identification,
    )
    from vftcli.readers.reading import Library

    task, free = asked.of(Task), asked.of(FreeChoice)
    gains = asked.words["gains"]
    others = {"--check": check, "--open": show, "--figures": figures, "--gains": gains}
    check_uses(task, free, logs, others)
    if task.method == "gains":
        find_gains(logs[0], output, asked)
        return
    library = Library([*logs, *(check or ()), *free.logs])
    examiner = health_of(library, anyway=asked.anyway, fitting=task.keeps_links)
    choice = replace(opt.choice_for(asked, library), examiner=examiner)
    profile = examiner.robot(next(library.open_each(logs, choice.read)), choice.robot)
    output = output or file_for(profile.name)
    OutputFolder(output.parent, force, files_beside(output, figures)).check()
    found = identified(logs, check or (), choice, replace(task, name=output.stem), say_recording)
    record = write_identification(
        output, found, examiner.examinations, asked.line, force, figures
    )
    say_robots(examiner.robots)
    for remark in found.remarks:
        (detail if remark.level == "fact" else say)(f"note: {remark}")
    made_files = map(output.with_name, files_beside(output, None))
    say(f"wrote {', '.join(map(str, made_files))}; use it with --robot {output}")
    if json:
        echo_data(record)
    else:
        echo_top(tables_text(found))
        say(LEGEND)
    if show:
        open_made(output.with_suffix(".html"))


def find_gains(log: Path, output: Path | None, asked: Asked) -> None:
    """Write the gains for a goal, by the log's spectra."""
    from vftcli.answering import TUNED, gains_of
    from vftcli.outputs.examination import health_record, overridden_lines
    from vftcli.outputs.files import check_file, write_text
    from vftcli.outputs.grid import terminal
    from vftcli.outputs.grids import tuned_grid
    from vftcli.readers.reading import Library
    from vftcli.robots.robot_file import lines_of

    choice, goal = opt.choice_for(asked, Library([log]), observers=TUNED), asked.of(GoalChoice)
    force = asked.words["force"]
    if output is None:
        recording = choice.library.open(log, choice.read)
        output = file_for(choice.examiner.robot(recording, choice.robot).name)
    check_file(output, force)
    found = gains_of(log, choice, goal)
    notes, health = list(map(str, found.remarks)), found.examinations
    said = asked.line, f"goal: {goal.gains}", f"robot: {found.run.robot.name}"
    heading = [*overridden_lines(health), *said, *notes]
    gains = {"observers": {line.section: dict(line.gains) for line in found.tuned}}
    text = "".join([*(f"# {line}\n" for line in heading), *lines_of(gains)])
    write_text(output, text, force)
    if asked.words["json"]:
        rows = [line._asdict() for line in found.tuned]
        about = {"goal": goal.gains, "examination": health_record(health), "observers": rows}
        say_json([found.run.recording], found.remarks, **about)
        return
    say_recording(found.run.recording)
    for note in (*found.run.robot.remarks, *notes):
        detail(f"note: {note}")
    echo_top(terminal(tuned_grid(found.tuned, found.goal.threshold is not None)))
    say(f"wrote {output}: use it with --gains {output}")
