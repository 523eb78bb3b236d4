"""`vftcli tune`: gains from the log itself, for a stated goal."""

from pathlib import Path
from typing import Annotated

import typer

from vftcli.cli import options as opt
from vftcli.cli.analysis import LogOptions
from vftcli.refinement.choice import RefinementChoice
from vftcli.repetition.choice import FreeChoice
from vftcli.signals.option import WRITE, Option


@opt.command
def tune_gains(
    *,
    log: opt.Log,
    output: Annotated[Path, Option("-o/--output", "FILE.toml", "The gains file.", group=WRITE)],
    logged: LogOptions,
    free: opt.Typed[FreeChoice],
    bias: opt.Typed[RefinementChoice],
    made: opt.MadeOptions,
    anyway: opt.Anyway,
    _talk: opt.TalkOptions,
    goal: Annotated[
        str,
        Option(
            "--goal", "rmse|delay=S|bandwidth=HZ|false-alarms=PER_HOUR", "What the gains are for."
        ),
    ] = "rmse",
    threshold: Annotated[
        str | None,
        Option(
            "--threshold", "NUMBER(S)", "Torque that raises an alarm [N·m], one or one a joint."
        ),
    ],
) -> None:
    """Find gains on a log for a stated goal, for --gains.

    The spectra of the log's free and loaded part tell how much error every gain makes.

    Example: vftcli tune fixtures/ur5_circle.csv --robot ur5 -o gains.toml
    """
    from vftcli.cli.console import command_line, detail, say, say_json, say_recording
    from vftcli.observers.choice import LOG_GAINS, ObserverChoice
    from vftcli.observers.tuning import bounds_reached, parse_goal, tune_all
    from vftcli.outputs.examination import health_record, overridden_lines
    from vftcli.outputs.files import check_file
    from vftcli.outputs.grid import terminal
    from vftcli.outputs.listings import tuned_grid
    from vftcli.outputs.log.figures import write_tuned
    from vftcli.outputs.log.run_record import jsonable
    from vftcli.pipeline import examine, model, prepared, read
    from vftcli.readers.library import Library
    from vftcli.robots.run import Runs
    from vftcli.signals.errors import ParameterError

    wanted = parse_goal(goal, threshold)
    check_file(output, made.force)
    choice = logged.asked(
        Library([log]),
        anyway=anyway,
        free=free.choice(),
        observers=ObserverChoice(gains=LOG_GAINS, causal=True),
        refinement=bias.choice(),
    )
    recording, arm = prepared(choice.library.open(log, choice.read), choice)
    motion = read(recording, arm, choice, Runs())
    examinations = examine(motion, choice)
    found = model(motion, choice)
    if found is None or (spectra := found.plain.spectra) is None:
        why = found.plain.missing if found else "no free part"
        raise ParameterError(f"nothing to tune on: {why}")
    tuned = tune_all(spectra, wanted)
    reached = bounds_reached(tuned, spectra, wanted)
    notes = [str(remark) for remark in (*found.remarks, *reached)]
    doubts = overridden_lines(examinations)
    heading = [*doubts, command_line(), f"goal: {goal}", f"robot: {arm.name}", *notes]
    write_tuned(output, heading, spectra, tuned, force=made.force, form=made.figures)
    if made.json:
        rows = [jsonable(line.record) for line in tuned]
        health = jsonable(health_record(examinations))
        say_json({"goal": goal, "examination": health, "notes": notes, "observers": rows})
        return
    say_recording(recording)
    for note in (*arm.remarks, *notes):
        detail(f"note: {note}")
    typer.echo(terminal(tuned_grid(tuned, wanted.threshold is not None)).rstrip("\n"))
    say(f"wrote {output}: use it with --gains {output}")
