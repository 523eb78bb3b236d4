"""`vftcli admit`: what admittance control would have made of a log's forces."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vftcli.cli import options as opt

if TYPE_CHECKING:
    from vftcli.admittance.closed_loop import ClosedLoop
    from vftcli.admittance.replay import Replay
    from vftcli.signals.recording import Recording

LogOrNone = Annotated[
    Path | None,
    typer.Argument(metavar="[LOG]", help="A log or an estimates.parquet; none with --release."),
]
Output = Annotated[
    Path | None,
    typer.Option("-o", "--output", metavar="DIR", help="Folder to write into; none: table only."),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        metavar="SECTION.PARAMETER=VALUE",
        help="Repeatable: position.stiffness=12, rz.threshold=4, admittance.xi=1, or an "
        "observer's, as kfo.noise_convention=discrete.",
    ),
]
Alpha = Annotated[
    str | None,
    typer.Option(metavar="A,B,…", help="One variable controller for each; default the profile's."),
]
Kinds = Annotated[
    list[str] | None,
    typer.Option("--controller", metavar="variable|traditional", help="Repeatable; default both."),
]
Xi = Annotated[
    str | None,
    typer.Option(
        metavar="NUMBER|from-B", help="Damping ratio of the recovery; default from B_d, M_d, K_d."
    ),
]
Mode = Annotated[
    str | None,
    typer.Option(
        "--threshold-mode", metavar="hard|soft", help="The whole force above it, or the excess."
    ),
]
Release = Annotated[
    list[str] | None,
    typer.Option(metavar="AXIS=VALUE", help="Replay a release from rest: x=0.3 [m], rz=0.5 [rad]."),
]
Start = Annotated[
    str | None,
    typer.Option(metavar="Q1,Q2,…", help="Start pose of a release [rad]; default the profile's."),
]
Duration = Annotated[
    float | None, typer.Option(metavar="S", help="Length of a release; default until it is over.")
]
ClosedLoopOf = Annotated[
    str | None,
    typer.Option(
        "--closed-loop",
        metavar="SCENARIO",
        help="No log: run a scenario's contacts against the controller in simulation, then replay "
        "the force it acted on.",
    ),
]
Seed = Annotated[int | None, typer.Option(metavar="N", help="Seed of the closed loop.")]
Torque = Annotated[
    str,
    typer.Option(
        "--torque", metavar="average|instant", help="What the closed loop's sensors report."
    ),
]
Sensor = Annotated[bool, typer.Option("--sensor", help="Take the log's own wrench.")]
Truth = Annotated[
    Path | None,
    typer.Option(metavar="FILE", help="Take the wrench of a truth file, flange, base axes."),
]
Frame = Annotated[
    str | None, typer.Option(metavar="NAME", help="Frame of the log's own wrench: base, flange.")
]
Zero = Annotated[
    str | None, typer.Option(metavar="A:B", help="Remove the mean wrench of this unloaded span.")
]
Parameters = Annotated[
    Path | None,
    typer.Option(metavar="FILE.toml", help="Take [admittance] from this file, not the profile."),
]
Unstable = Annotated[
    bool, typer.Option("--force-unstable", help="Run settings that are unstable, for study.")
]


def admit(
    log: LogOrNone = None,
    output: Output = None,
    robot: opt.RobotName = None,
    alpha: Alpha = None,
    controller: Kinds = None,
    xi: Xi = None,
    threshold_mode: Mode = None,
    release: Release = None,
    start: Start = None,
    duration: Duration = None,
    closed_loop: ClosedLoopOf = None,
    seed: Seed = None,
    torque: Torque = "average",
    parameters: Parameters = None,
    assignments: Settings = None,
    force_unstable: Unstable = False,
    observer: Annotated[
        str, typer.Option("--observer", metavar="NAME", help="Whose estimate is the force.")
    ] = "kfo-fe",
    sensor: Sensor = False,
    truth: Truth = None,
    frame: Frame = None,
    zero: Zero = None,
    format_: opt.Format = None,
    columns: opt.Columns = None,
    interval: opt.Interval = None,
    friction: opt.Friction = "profile",
    payload: opt.PayloadName = None,
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

    if sum((log is not None, bool(release), closed_loop is not None)) != 1:
        raise typer.BadParameter("give one of LOG, --release AXIS=VALUE, --closed-loop SCENARIO")
    given = list(assignments or ())
    own = [text for text in given if is_admittance_setting(text)]
    if xi is not None and xi != "from-B":
        own.append(f"admittance.xi={xi}")
    if threshold_mode is not None:
        own.append(f"admittance.threshold_mode={threshold_mode}")
    request = AnalysisChoice(
        format=format_,
        columns=columns,
        robot=robot,
        interval=interval,
        observers=(observer,),
        settings=tuple(text for text in given if text not in own),
        friction=friction,
        payload=payload,
    )
    choice = Choice(
        alpha=alpha,
        kinds=tuple(controller or ()),
        force_unstable=force_unstable,
        sensor=sensor,
        truth=truth,
        frame=frame,
        zero=zero,
        release=tuple(release or ()),
        start=start,
        duration=duration,
        seed=seed,
        torque=torque,
    )
    recording, run = None, None
    if closed_loop is not None:
        result, run = looped(closed_loop, request, choice, own, parameters)
    elif log is None:
        result = released(request, choice, own, parameters)
    else:
        result, recording = replayed(log, request, choice, own, parameters)
    show(result, run, json)
    if output is not None:
        write(output, result, recording, run, force)
        if not json:
            say(f"wrote {output}: open {output / 'index.html'}; rerun {output / 'recording.rrd'}")


def show(result: "Replay", run: "ClosedLoop | None", json: bool) -> None:
    """The comparison on stdout, remarks on stderr."""
    from vftcli.cli.console import say
    from vftcli.outputs.admittance.files import (
        comparison_json,
        comparison_text,
        latency_text,
        parameter_text,
    )

    if json:
        typer.echo(comparison_json(result.rows))
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
