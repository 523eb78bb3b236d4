"""`vftcli admit`: what admittance control would have made of a log's forces."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vftcli.cli import options as opt
from vftcli.cli.bundles import taken_apart

if TYPE_CHECKING:
    from vftcli.admittance.closed_loop import ClosedLoop
    from vftcli.admittance.replay import Replay
    from vftcli.signals.recording import Recording

OBSERVER = "kfo-fe"
"""Whose estimate is the force unless another is named: the paper drives its controller with it."""

LogOrNone = Annotated[
    Path | None,
    typer.Argument(metavar="[LOG]", help="A log or an estimates.parquet; none with --release."),
]
Output = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Folder to write into; none: table only."),
]


@dataclass(frozen=True, kw_only=True)
class ControllerOptions(opt.Bundle):
    """Which controllers are compared."""

    alpha: Annotated[
        str | None,
        typer.Option(
            "--alpha",
            metavar="A,B,…",
            help="One variable controller for each; default the profile's.",
        ),
    ] = None
    controller: Annotated[
        list[str] | None,
        typer.Option(
            "--controller",
            metavar="variable|traditional",
            help="Repeatable; default both.",
        ),
    ] = None
    xi: Annotated[
        str | None,
        typer.Option(
            "--xi",
            metavar="NUMBER|from-B",
            help="Damping ratio of the recovery; default from B_d, M_d, K_d.",
        ),
    ] = None
    threshold_mode: Annotated[
        str | None,
        typer.Option(
            "--threshold-mode", metavar="hard|soft", help="The whole force above it, or the excess."
        ),
    ] = None
    parameters: Annotated[
        Path | None,
        typer.Option(
            "--parameters",
            metavar="FILE.toml",
            help="Take [admittance] from this file, not the profile.",
        ),
    ] = None
    force_unstable: Annotated[
        bool, typer.Option("--force-unstable", help="Run settings that are unstable, for study.")
    ] = False


@dataclass(frozen=True, kw_only=True)
class ReleaseOptions(opt.Bundle):
    """A release from rest, without a log."""

    release: Annotated[
        list[str] | None,
        typer.Option(
            "--release",
            metavar="AXIS=VALUE",
            help="Replay a release from rest: x=0.3 [m], rz=0.5 [rad].",
        ),
    ] = None
    start: Annotated[
        str | None,
        typer.Option(
            "--start",
            metavar="Q1,Q2,…",
            help="Start pose of a release [rad]; default the profile's.",
        ),
    ] = None
    duration: Annotated[
        float | None,
        typer.Option(
            "--duration", metavar="S", help="Length of a release; default until it is over."
        ),
    ] = None


@dataclass(frozen=True, kw_only=True)
class LoopOptions(opt.Bundle):
    """A controller in the loop of a simulation, without a log."""

    closed_loop: Annotated[
        str | None,
        typer.Option(
            "--closed-loop",
            metavar="SCENARIO",
            help="No log: run a scenario's contacts against the controller in simulation, then "
            "replay the force it acted on.",
        ),
    ] = None
    seed: Annotated[
        int | None, typer.Option("--seed", metavar="N", help="Seed of the closed loop.")
    ] = None
    torque: Annotated[
        str,
        typer.Option(
            "--torque", metavar="average|instant", help="What the closed loop's sensors report."
        ),
    ] = "average"


@dataclass(frozen=True, kw_only=True)
class ForceOptions(opt.Bundle):
    """Which force drives the replay, if not an observer's."""

    sensor: Annotated[bool, typer.Option("--sensor", help="Take the log's own wrench.")] = False
    truth: Annotated[
        Path | None,
        typer.Option(
            "--truth",
            metavar="FILE",
            help="Take the wrench of a truth file, flange, base axes.",
        ),
    ] = None
    zero: Annotated[
        list[str] | None,
        typer.Option(
            "--zero",
            metavar="A:B|start|LOG",
            help="The wrench's zero: an unloaded span, the unloaded start, or a free run.",
        ),
    ] = None


@taken_apart
def admit(
    controllers: ControllerOptions,
    release: ReleaseOptions,
    loop: LoopOptions,
    force_from: ForceOptions,
    reading: opt.ReadOptions,
    robot: opt.RobotOptions,
    observers: opt.ObserverOptions,
    log: LogOrNone = None,
    output: Output = None,
    json: opt.Json = False,
    force: opt.Force = False,
) -> None:
    """Replay a log's external force through traditional and variable-parameter admittance.

    Writes DIR/index.html, recording.rrd, motion.parquet, comparison.{csv,json} and run.json.

    Example: vftcli admit --release x=0.3 --robot ur5 --alpha 1,1.3,1.6,1.9
    """
    from vftcli.admittance.parameters import is_admittance_setting
    from vftcli.cli.admit_runs import Choice, looped, released, replayed
    from vftcli.cli.console import say
    from vftcli.pipeline import AnalysisChoice
    from vftcli.readers.estimates import estimates_columns
    from vftcli.virtual_sensor.choice import ZeroChoice

    if sum((log is not None, bool(release.release), loop.closed_loop is not None)) != 1:
        raise typer.BadParameter("give one of LOG, --release AXIS=VALUE, --closed-loop SCENARIO")
    given = list(observers.assignments or ())
    own = [text for text in given if is_admittance_setting(text)]
    if controllers.xi is not None and controllers.xi != "from-B":
        own.append(f"admittance.xi={controllers.xi}")
    if controllers.threshold_mode is not None:
        own.append(f"admittance.threshold_mode={controllers.threshold_mode}")
    others = [text for text in given if text not in own]
    name, *more = observers.observer or [OBSERVER]
    if more:
        raise typer.BadParameter("one observer's force drives the replay; give --observer once")
    read = reading.choice()
    spec = estimates_columns(log, name) if log is not None and read.columns is None else None
    # A table of estimates may hold those of an observer that is none of ours.
    names = [name] if spec is None else None
    request = AnalysisChoice(
        read=read if spec is None else replace(read, columns=spec),
        robot=robot.choice(),
        observers=replace(observers, observer=names, assignments=others).choice(),
    )
    parameters = controllers.parameters
    choice = Choice(
        alpha=controllers.alpha,
        kinds=tuple(controllers.controller or ()),
        force_unstable=controllers.force_unstable,
        sensor=force_from.sensor,
        truth=force_from.truth,
        zero=ZeroChoice.parsed(force_from.zero or ()),
        release=tuple(release.release or ()),
        start=release.start,
        duration=release.duration,
        seed=loop.seed,
        torque=loop.torque,
    )
    recording, run = None, None
    if loop.closed_loop is not None:
        result, run = looped(loop.closed_loop, request, choice, own, parameters)
    elif log is None:
        result = released(request, choice, own, parameters)
    else:
        estimated = name if spec is not None else None
        result, recording = replayed(log, request, choice, own, parameters, estimated)
    show(result, run, json)
    if output is not None:
        write(output, result, recording, run, force)
        if not json:
            say(f"wrote {output}: open {output / 'index.html'}; rerun {output / 'recording.rrd'}")


def show(result: "Replay", run: "ClosedLoop | None", json: bool) -> None:
    """The comparison on stdout, remarks on stderr."""
    from vftcli.cli.console import say
    from vftcli.outputs.admittance.tables import (
        comparison_json,
        comparison_text,
        latency_text,
        parameter_text,
    )

    if json:
        typer.echo(comparison_json(result.rows).rstrip("\n"))
        return
    say(f"{result.robot.title or result.robot.name}: {result.source}")
    say(parameter_text(result))
    for note in result.notes:
        say(f"note: {note}")
    if run is not None:
        say(latency_text(run))
    typer.echo(comparison_text(result.rows))


def write(
    output: Path,
    result: "Replay",
    recording: "Recording | None",
    run: "ClosedLoop | None",
    force: bool,
) -> None:
    """The folder of a replay."""
    from vftcli.cli.console import command_line
    from vftcli.outputs.admittance.files import write_admittance

    write_admittance(output, result, recording, run, command=command_line(), force=force)
