"""`vftcli admit`: what admittance control would have made of a log's forces."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vftcli.admittance.choice import ControlChoice
from vftcli.cli import options as opt
from vftcli.cli.analysis import AnalysisOptions
from vftcli.signals.option import OUTPUT, WRITE, Option

if TYPE_CHECKING:
    from vftcli.admittance.closed_loop import ClosedLoop
    from vftcli.admittance.driving_force import DrivingForce
    from vftcli.admittance.replay import Replay
    from vftcli.doctor import Examination
    from vftcli.pipeline import AnalysisChoice
    from vftcli.robots.robot import Robot
    from vftcli.signals.recording import Recording

#: Whose estimate is the force unless another is named: the paper drives its controller with it.
OBSERVER = "kfo-fe"
WITHOUT_LOG = "Without a log"  #: Heading of what needs none.


class ReleaseOptions(opt.Bundle):
    """A release from rest, without a log."""

    GROUP = WITHOUT_LOG

    release: Annotated[
        list[str] | None,
        Option("--release", "AXIS=VALUE", "Replay a release from rest: x=0.3 [m], rz=0.5 [rad]."),
    ]
    start: Annotated[
        str | None,
        Option(
            "--start",
            "Q1,Q2,…",
            "Start pose of a release [rad]; default the profile's.",
            seldom=True,
        ),
    ]
    duration: Annotated[
        float | None,
        Option("--duration", "S", "Length of a release; default until it is over.", seldom=True),
    ]


class LoopOptions(opt.Bundle):
    """A controller in the loop of a simulation, without a log."""

    GROUP = WITHOUT_LOG

    closed_loop: Annotated[
        str | None,
        Option(
            "--closed-loop",
            "SCENARIO",
            "Run a scenario against the controller. Its contacts are simulated, then the force "
            "that it acted on is replayed.",
        ),
    ]
    seed: Annotated[int | None, opt.SEED._replace(seldom=True)]
    torque: Annotated[
        str,
        Option(
            "--torque", "average|instant", "What the closed loop's sensors report.", seldom=True
        ),
    ] = "average"


class ForceOptions(opt.Bundle):
    """Which force drives the replay, if not an observer's."""

    GROUP = "The force"

    sensor: Annotated[bool, Option("--sensor", "", "Take the log's own wrench.")]
    truth: Annotated[
        Path | None,
        Option(
            "--truth", "FILE", "Take the wrench of a truth file, flange, base axes.", seldom=True
        ),
    ]


class ShownOptions(opt.Bundle):
    """What is shown and drawn of the comparison."""

    figures: opt.Figures
    json: opt.Json
    latex: Annotated[bool, opt.LATEX._replace(seldom=True, group=OUTPUT)]


@opt.command
def admit(
    controllers: opt.Typed[ControlChoice],
    release: ReleaseOptions,
    loop: LoopOptions,
    source: ForceOptions,
    analysis: AnalysisOptions,
    shown: ShownOptions,
    log: Annotated[
        Path | None,
        Option("", "[LOG]", "A log or an estimates.parquet; none with --release."),
    ],
    output: Annotated[
        Path | None,
        Option("-o/--output", "DIR", "Folder to write into; none: table only.", group=WRITE),
    ],
    force: opt.Force,
    show_made: opt.Open,
) -> None:
    """Replay a log's external force through admittance controllers.

    Traditional ones and variable-parameter ones. Writes DIR/index.html, motion.parquet,
    comparison.{csv,json} and run.json. The force is that of one observer, kfo-fe unless another
    is named. --set also takes the controllers' parameters:
    position.stiffness=12, rz.threshold=4, admittance.xi=1.

    Example: vftcli admit --release x=0.3 --robot ur5 --alpha 1,1.3,1.6,1.9
    """
    from vftcli.admittance.choice import split_settings
    from vftcli.cli.console import command_line, say, say_left_out
    from vftcli.cli.opening import open_made
    from vftcli.outputs.admittance import files_of_replay, write_admittance
    from vftcli.outputs.files import OutputFolder
    from vftcli.signals.packages import check_installed

    asked = log is not None, bool(release.release), loop.closed_loop is not None
    if sum(asked) != 1:
        raise typer.BadParameter("give one of LOG, --release AXIS=VALUE, --closed-loop SCENARIO")
    check_installed("pinocchio", "vftcli admit")
    typed = analysis.observers.words
    own, typed["set"] = split_settings(typed["set"] or ())
    control = replace(controllers.choice(), assignments=tuple(own), as_printed=typed["as_printed"])
    form = shown.figures
    if output is not None:
        OutputFolder(output, force, files_of_replay(form)).check()
    elif show_made or form:
        raise typer.BadParameter("--open and --figures are of what -o DIR writes; give -o too")
    if shown.json and shown.latex:
        raise typer.BadParameter("choose one of --json and --latex")
    recording, run = None, None
    examinations: tuple[Examination, ...] = ()
    if loop.closed_loop is not None:
        result, run = looped(loop, analysis, control)
    elif log is None:
        result = released(release, analysis, control)
    else:
        result, recording, examinations = replayed(log, source, analysis, control)
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
            say(f"wrote {output}: vftcli open {output}")
        say_left_out(files_of_replay(form))
        if show_made:
            open_made(output)


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
    release: ReleaseOptions, analysis: AnalysisOptions, control: ControlChoice
) -> "Replay":
    """A release from rest."""
    from vftcli.admittance.choice import released_robot, start_pose
    from vftcli.admittance.parameters import release_deviation
    from vftcli.admittance.replay import replay_release

    deviation = release_deviation(release.release or ())
    arm = released_robot(chosen(analysis).robot)
    settings = control.parameters(arm)
    return replay_release(
        deviation,
        arm,
        settings,
        control.controllers(settings),
        start=start_pose(arm, release.start),
        duration=release.duration,
        force_unstable=control.force_unstable,
    )


def replayed(
    log: Path, source: ForceOptions, analysis: AnalysisOptions, control: ControlChoice
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
    driving = force_of(recording, arm, choice, source, stored)
    result = replay(
        driving.wrench,
        recording.q,
        arm,
        settings,
        control.controllers(settings),
        source=driving.source,
        force_unstable=control.force_unstable,
    )
    result = replace(result, remarks=(*driving.remarks, *result.remarks))
    return result, recording, choice.examiner.examinations


def force_of(
    recording: "Recording",
    robot: "Robot",
    choice: "AnalysisChoice",
    source: ForceOptions,
    stored: str | None,
) -> "DrivingForce":
    """The wrench that drives the replay."""
    from vftcli.admittance import driving_force
    from vftcli.pipeline import analyse

    if source.sensor and source.truth is not None:
        raise typer.BadParameter("choose one of --sensor and --truth")
    assert choice.wrench is not None, "`chosen` asks for one"
    if source.truth is not None:
        return driving_force.truth_force(recording, robot, choice.wrench, source.truth)
    if source.sensor:
        return driving_force.sensor_force(recording, robot, choice.wrench)
    if stored is not None:
        return driving_force.stored_force(recording, robot, choice.wrench, stored)
    reading = analyse(recording, robot, choice).virtual_sensor
    assert reading is not None, "a wrench was asked for"
    return driving_force.observed_force(reading)


def looped(
    loop: LoopOptions, analysis: AnalysisOptions, control: ControlChoice
) -> "tuple[Replay, ClosedLoop]":
    """A scenario with a controller in the loop, and the force it acted on through all of them."""
    from vftcli.admittance.closed_loop import UNLOADED, run_closed_loop
    from vftcli.admittance.replay import replay
    from vftcli.cli.simulate import progress_bar
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
        raise ParameterError("--closed-loop holds still over a span: give it as --zero A:B")
    scenario = load_scenario(str(loop.closed_loop), ())
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
        seed=loop.seed,
        torque=loop.torque,
        zero=zero.spans[0] if zero.spans else UNLOADED,
        force_unstable=control.force_unstable,
        progress=progress_bar(),
    )
    result = replay(
        run.wrench,
        run.q,
        arm,
        settings,
        controllers,
        source=fact("force-of-loop"),
        force_unstable=control.force_unstable,
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
