"""`vftcli admit`: what admittance control would have made of a log's forces."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from vftcli.cli import options as opt

if TYPE_CHECKING:
    from vftcli.admittance.force import ForceRecord
    from vftcli.admittance.parameters import Admittance
    from vftcli.admittance.replay import Replay
    from vftcli.arrays import Array
    from vftcli.pipeline import Request
    from vftcli.recording import Recording
    from vftcli.robots.robot import Robot

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


@dataclass(frozen=True, kw_only=True)
class Choice:
    """Which controllers are compared, and on what.

    Attributes:
        alpha: Values of α, comma-separated, or None.
        kinds: Kinds of controllers; all if empty.
        force_unstable: Run unstable settings too.
        sensor: Take the log's own wrench.
        truth: A truth file, or None.
        frame: Frame of the log's own wrench, or None.
        zero: Span whose mean wrench is removed, or None.
        release: ``axis=value`` of a release; empty for a log.
        start: Start pose of a release, or None.
        duration: Its length, or None. [s]
    """

    alpha: str | None = None
    kinds: tuple[str, ...] = ()
    force_unstable: bool = False
    sensor: bool = False
    truth: Path | None = None
    frame: str | None = None
    zero: str | None = None
    release: tuple[str, ...] = ()
    start: str | None = None
    duration: float | None = None


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
    from vftcli.cli.asking import say
    from vftcli.pipeline import Request

    if (log is None) == (not release):
        raise typer.BadParameter("give a LOG, or --release AXIS=VALUE without one")
    given = list(assignments or ())
    own = [text for text in given if is_admittance_setting(text)]
    if xi is not None and xi != "from-B":
        own.append(f"admittance.xi={xi}")
    if threshold_mode is not None:
        own.append(f"admittance.threshold_mode={threshold_mode}")
    request = Request(
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
    )
    if log is None:
        result, recording = released(request, choice, own, parameters), None
    else:
        result, recording = replayed(log, request, choice, own, parameters)
    show(result, json)
    if output is not None:
        write(output, result, recording, force)
        if not json:
            say(f"wrote {output}: open {output / 'index.html'}; rerun {output / 'recording.rrd'}")


def released(
    request: "Request", choice: Choice, own: list[str], parameters: Path | None
) -> "Replay":
    """A release from rest."""
    from vftcli.admittance.law import controllers
    from vftcli.admittance.parameters import release_deviation
    from vftcli.admittance.replay import replay_release
    from vftcli.errors import ParameterError, RobotError
    from vftcli.observers import observer_settings
    from vftcli.robots import PROFILES, load_robot

    observer_settings(request.settings)  # nothing uses them, but a slip of the pen is told
    if request.robot is None:
        raise RobotError(f"a release needs an arm: --robot {'|'.join(PROFILES)}, or a file")
    arm = load_robot(request.robot)
    settings = read_parameters(arm, own, parameters)
    pose = choice.start or arm.document.get("admittance", {}).get("start")
    if pose is None:
        raise ParameterError(
            f"{arm.name} has no admittance.start; give the start pose with --start q1,…,"
            f"q{arm.joints} [rad]"
        )
    return replay_release(
        release_deviation(choice.release),
        arm,
        settings,
        controllers(settings, choice.kinds, numbers(choice.alpha, "--alpha")),
        start=numbers(pose, "--start") if isinstance(pose, str) else pose,
        duration=choice.duration,
        force_unstable=choice.force_unstable,
    )


def replayed(
    log: Path, request: "Request", choice: Choice, own: list[str], parameters: Path | None
) -> "tuple[Replay, Recording]":
    """A log's forces through every controller."""
    from dataclasses import replace

    from vftcli.admittance.law import controllers
    from vftcli.admittance.replay import replay
    from vftcli.pipeline import choose_robot, open_log, parse_interval
    from vftcli.readers.estimates import estimates_columns

    spec = estimates_columns(log, request.observers[0]) if request.columns is None else None
    recording = open_log(log, replace(request, columns=spec or request.columns))
    arm = choose_robot(request, recording)
    settings = read_parameters(arm, own, parameters)
    chosen = controllers(settings, choice.kinds, numbers(choice.alpha, "--alpha"))
    record = force_of(recording, arm, request, choice, estimated=spec is not None)
    if choice.zero is not None:
        record = record.zeroed(*parse_interval(choice.zero))
    result = replay(record, arm, settings, chosen, force_unstable=choice.force_unstable)
    return result, recording


def force_of(
    recording: "Recording", robot: "Robot", request: "Request", choice: Choice, *, estimated: bool
) -> "ForceRecord":
    """The wrench that drives the replay: truth, sensor, or an observer's."""
    from vftcli.admittance.force import from_sensor, from_torque
    from vftcli.torque import ExternalTorque

    if choice.sensor and choice.truth is not None:
        raise typer.BadParameter("choose one of --sensor and --truth")
    if choice.truth is not None:
        return truth_of(recording, choice.truth)
    if choice.sensor:
        return from_sensor(recording, robot, choice.frame)
    name = request.observers[0]
    if estimated:
        tau = recording.require("tau_ext")
        estimate = ExternalTorque(name=name, t=recording.t, tau=tau)
    else:
        from vftcli.pipeline import analyse

        estimate = analyse(recording, robot, request).estimates[0]
    return from_torque(estimate, recording.q, robot)


def truth_of(recording: "Recording", path: Path) -> "ForceRecord":
    """The wrench of a truth file, on the log's own clock, base axes."""
    from vftcli.admittance.force import from_truth
    from vftcli.errors import ReferenceTorqueError
    from vftcli.readers.references import read_reference

    table = read_reference(path)
    if table.wrench is None:
        raise ReferenceTorqueError(
            f"{path}: it has no wrench; a truth file has wrench/fx … wrench/mz at the flange"
        )
    t = table.t - recording.source.t0
    if t[-1] < recording.t[0] or t[0] > recording.t[-1]:
        raise ReferenceTorqueError(
            f"{path}: its clock ({table.t[0]:g} to {table.t[-1]:g} s) does not overlap the log's; "
            "both must be the log's own clock"
        )
    return from_truth(recording, t, table.wrench, f"truth of {path.name}, base axes")


def read_parameters(robot: "Robot", own: list[str], path: Path | None) -> "Admittance":
    """The admittance parameters: the file's or the profile's, then the command line's."""
    from vftcli.admittance.parameters import from_document, parse_settings

    document: Any = robot.document
    if path is not None:
        from vftcli.robots.profile import RobotFile

        document = RobotFile(path).document
    return from_document(document, robot.name, parse_settings(own))


def numbers(text: str | None, option: str) -> "Array":
    """A comma-separated list of numbers; empty for None.

    Raises:
        typer.BadParameter: If one is no number.
    """
    import numpy as np

    try:
        return np.array([float(part) for part in text.split(",")] if text else [])
    except ValueError:
        raise typer.BadParameter(f"{option} {text!r} is not a list of numbers") from None


def show(result: "Replay", json: bool) -> None:
    """The comparison on stdout, remarks on stderr."""
    from vftcli.cli.asking import say
    from vftcli.outputs.admittance import comparison_json, comparison_text, parameter_text

    if json:
        typer.echo(comparison_json(result.rows))
        return
    say(f"{result.robot.title or result.robot.name}: {result.source}")
    say(parameter_text(result))
    for note in result.notes:
        say(f"note: {note}")
    typer.echo(comparison_text(result.rows))


def write(output: Path, result: "Replay", recording: "Recording | None", force: bool) -> None:
    """The folder of a replay."""
    from vftcli.cli.asking import command_line
    from vftcli.outputs.admittance import write_admittance

    write_admittance(output, result, recording, command=command_line(), force=force)
