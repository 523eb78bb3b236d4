"""`vftcli admit`: what admittance control would have made of a log's forces."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vftcli.admittance.choice import FILE, ControlChoice
from vftcli.cli import options as opt
from vftcli.cli.analysis import AnalysisOptions
from vftcli.signals.option import OUTPUT, WRITE, Option

if TYPE_CHECKING:
    from collections.abc import Sequence

    from vftcli.admittance.closed_loop import ClosedLoop
    from vftcli.admittance.driving_force import DrivingForce
    from vftcli.admittance.replay import Replay
    from vftcli.doctor import Examination
    from vftcli.pipeline import AnalysisChoice
    from vftcli.robots.robot import Robot
    from vftcli.signals.recording import Recording

#: Whose estimate is the force unless another is named: the paper drives its controller with it.
OBSERVER = "kfo-fe"


class ShownOptions(opt.Bundle):
    """What is shown and drawn of the comparison."""

    figures: opt.Figures
    json: opt.Json
    latex: Annotated[bool, opt.LATEX._replace(group=OUTPUT)]


@opt.command
def admit(
    controllers: opt.Typed[ControlChoice],
    release: Annotated[
        list[str] | None,
        Option("--release", "AXIS=VALUE", "Release from rest, without a log: x=0.3, rz=0.5."),
    ],
    seed: Annotated[int | None, opt.SEED],
    analysis: AnalysisOptions,
    shown: ShownOptions,
    log: Annotated[
        Path | None,
        Option("", "[LOG|SCENARIO]", "A log, an estimates.parquet, or a scenario to simulate."),
    ],
    output: Annotated[
        Path | None,
        Option("-o/--output", "DIR", "Folder to write into; none: table only.", group=WRITE),
    ],
    force: opt.Force,
    show_made: opt.Open,
) -> None:
    """Replay a log's external force through admittance controllers.

    The force is that of kfo-fe; a scenario runs with the controller in the loop.

    Example: vftcli admit --release x=0.3 --robot ur5 --alpha 1,1.3,1.6,1.9
    """
    from vftcli.cli.console import command_line, open_made, say, say_left_out
    from vftcli.outputs.admittance import files_of_replay, write_admittance
    from vftcli.outputs.files import OutputFolder
    from vftcli.signals.packages import check_installed

    if (log is None) != bool(release):
        raise typer.BadParameter("give one of LOG, SCENARIO, --release AXIS=VALUE")
    check_installed("pinocchio", "vftcli admit")
    control = replace(controllers.choice(), as_printed=analysis.observers.words["as_printed"])
    form = shown.figures
    if output is not None:
        OutputFolder(output, force, files_of_replay(form)).check()
    elif show_made or form:
        raise typer.BadParameter("--open and --figures are of what -o DIR writes; give -o too")
    if shown.json and shown.latex:
        raise typer.BadParameter("choose one of --json and --latex")
    recording, run = None, None
    examinations: tuple[Examination, ...] = ()
    if log is None:
        result = released(release or [], analysis, control)
    elif is_scenario(log):
        result, run = looped(str(log), seed, analysis, control)
    else:
        result, recording, examinations = replayed(log, analysis, control)
    show(result, run, shown)
    if output is not None:
        write_admittance(
            output,
            result,
            recording,
            run,
            command=command_line(),
            force=force,
            examinations=examinations,
            form=form,
        )
        if not (shown.json or shown.latex):
            say(f"wrote {output}: open {output / 'index.html'}")
        say_left_out(files_of_replay(form))
        if show_made:
            open_made(output)


def is_scenario(log: Path) -> bool:
    """Whether a word names a scenario: a file of one, or what has no ending and is no file."""
    return log.suffix == ".toml" or not (log.exists() or log.suffix or len(log.parts) > 1)


def chosen(analysis: AnalysisOptions, log: Path | None = None) -> "AnalysisChoice":
    """What is asked of the log: one observer, and its wrench in base axes."""
    from vftcli.readers.library import Library
    from vftcli.signals.errors import ParameterError
    from vftcli.virtual_sensor.choice import WrenchChoice

    named = analysis.observers.words["observer"] or [OBSERVER]
    if len(named) > 1:
        raise ParameterError("one observer's force drives the replay; give --observer once")
    choice = analysis.choice(Library([log] if log else []), observer=named)
    if analysis.wrench.words["frame"] not in {None, "base"}:
        raise ParameterError(
            "the replay is in base axes about the flange point; leave --frame away"
        )
    return replace(choice, wrench=replace(choice.wrench or WrenchChoice(), frame="base"))


def released(
    release: "Sequence[str]", analysis: AnalysisOptions, control: ControlChoice
) -> "Replay":
    """A release from rest."""
    from vftcli.admittance.choice import released_robot
    from vftcli.admittance.parameters import release_deviation
    from vftcli.admittance.replay import replay_release

    deviation = release_deviation(release)
    arm = released_robot(chosen(analysis).robot)
    settings = control.parameters(arm)
    return replay_release(
        deviation,
        arm,
        settings,
        control.controllers(settings),
        start=control.start_pose(arm),
        duration=control.duration,
        anyway=analysis.anyway,
    )


def replayed(
    log: Path, analysis: AnalysisOptions, control: ControlChoice
) -> "tuple[Replay, Recording, tuple[Examination, ...]]":
    """A log's force through every controller."""
    from vftcli.admittance.replay import replay
    from vftcli.pipeline import check_logged, prepared
    from vftcli.readers.estimates import estimates_columns

    stored, typed = None, analysis.observers.words
    if analysis.log.reading.words["columns"] is None:
        name = (typed["observer"] or [OBSERVER])[0]
        if (columns := estimates_columns(log, name)) is not None:
            # A table of estimates may hold those of an observer that is none of ours.
            stored, typed["observer"] = name, None
            analysis.log.reading.words["columns"] = columns
    choice = chosen(analysis, log)
    recording, arm = prepared(choice.library.open(log, choice.read), choice)
    check_logged(recording, "admit runs a controller that must not see the future")
    if stored is None:  # estimates of an earlier run were examined in it
        choice.examiner.examine(recording, arm)
    settings = control.parameters(arm)
    driving = force_of(recording, arm, choice, control.force, stored)
    result = replay(
        driving.wrench,
        recording.q,
        arm,
        settings,
        control.controllers(settings),
        source=driving.source,
        anyway=analysis.anyway,
    )
    result = replace(result, remarks=(*driving.remarks, *result.remarks))
    return result, recording, choice.examiner.examinations


def force_of(
    recording: "Recording",
    robot: "Robot",
    choice: "AnalysisChoice",
    source: str | None,
    stored: str | None,
) -> "DrivingForce":
    """The wrench that drives the replay."""
    from vftcli.admittance import driving_force
    from vftcli.pipeline import analyse

    assert choice.wrench is not None, "`chosen` asks for one"
    if source == "sensor":
        return driving_force.sensor_force(recording, robot, choice.wrench)
    if source is not None:
        truth = Path(source.removeprefix(FILE))
        return driving_force.truth_force(recording, robot, choice.wrench, truth)
    if stored is not None:
        return driving_force.stored_force(recording, robot, choice.wrench, stored)
    reading = analyse(recording, robot, choice).virtual_sensor
    assert reading is not None, "a wrench was asked for"
    return driving_force.observed_force(reading)


def looped(
    name: str, seed: int | None, analysis: AnalysisOptions, control: ControlChoice
) -> "tuple[Replay, ClosedLoop]":
    """A scenario with a controller in the loop, and the force it acted on through all of them."""
    from vftcli.admittance.closed_loop import UNLOADED, run_closed_loop
    from vftcli.admittance.replay import replay
    from vftcli.cli.console import steps
    from vftcli.observers import KalmanObserver
    from vftcli.robots import load_robot
    from vftcli.signals.errors import ParameterError
    from vftcli.signals.remarks import fact
    from vftcli.simulation import load_scenario
    from vftcli.simulation.sensing import log_rate

    choice = chosen(analysis)
    assert choice.wrench is not None, "`chosen` asks for one"
    zero = choice.wrench.zero
    if zero.start:
        raise ParameterError("the closed loop holds still over a span: give it as --zero A:B")
    scenario = load_scenario(name, ())
    arm = load_robot(scenario.robot)
    settings = control.parameters(arm)
    step = 1.0 / log_rate(scenario.sensing, arm)
    observer = choice.observers.build(arm, step)[0][0]
    if not isinstance(observer, KalmanObserver):
        raise ParameterError("the closed loop runs kfo-fe or kfo-zoh; choose one with --observer")
    controllers = control.controllers(settings)
    run = run_closed_loop(
        scenario,
        controllers[-1],
        observer,
        seed=seed,
        torque=control.loop_torque,
        zero=zero.spans[0] if zero.spans else UNLOADED,
        anyway=analysis.anyway,
        progress=steps(),
    )
    result = replay(
        run.wrench,
        run.q,
        arm,
        settings,
        controllers,
        source=fact("force-of-loop"),
        anyway=analysis.anyway,
    )
    return result, run


def show(result: "Replay", run: "ClosedLoop | None", shown: ShownOptions) -> None:
    """The comparison on stdout, remarks on stderr."""
    from vftcli.cli.console import detail, say
    from vftcli.outputs.admittance_tables import (
        comparison_text,
        latency_text,
        latex_text,
        parameter_text,
    )
    from vftcli.outputs.grid import json_rows

    if shown.json:
        typer.echo(json_rows(result.rows).rstrip("\n"))
        return
    if shown.latex:
        typer.echo(latex_text(result).rstrip("\n"))
        return
    say(f"{result.robot.title or result.robot.name}: {result.source}")
    say(parameter_text(result))
    for note in result.remarks:
        detail(f"note: {note}")
    if run is not None:
        say(latency_text(run))
    typer.echo(comparison_text(result.rows))
