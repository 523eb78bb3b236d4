"""What `vftcli admit` runs: a release, a log's forces, or a closed loop in simulation."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

if TYPE_CHECKING:
    from vftcli.admittance.closed_loop import ClosedLoop
    from vftcli.admittance.force import ForceRecord
    from vftcli.admittance.parameters import Admittance
    from vftcli.admittance.replay import Replay
    from vftcli.pipeline import AnalysisChoice
    from vftcli.robots.robot import Robot
    from vftcli.signals.recording import Recording


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
        seed: Seed of a closed loop, or None for the scenario's.
        torque: What its sensors report, "average" or "instant".
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
    seed: int | None = None
    torque: str = "average"


def released(
    request: "AnalysisChoice", choice: Choice, own: list[str], parameters: Path | None
) -> "Replay":
    """A release from rest."""
    import numpy as np

    from vftcli.admittance.law import controllers
    from vftcli.admittance.parameters import release_deviation
    from vftcli.admittance.replay import replay_release
    from vftcli.robots import PROFILES, load_robot
    from vftcli.signals.errors import ParameterError, RobotError

    if request.robot.name is None:
        raise RobotError(f"a release needs an arm: --robot {'|'.join(PROFILES)}, or a file")
    arm = load_robot(request.robot.name)
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
        start=np.array(numbers(pose, "--start") if isinstance(pose, str) else pose, dtype=float),
        duration=choice.duration,
        force_unstable=choice.force_unstable,
    )


def replayed(
    log: Path,
    request: "AnalysisChoice",
    choice: Choice,
    own: list[str],
    parameters: Path | None,
    estimated: str | None = None,
) -> "tuple[Replay, Recording]":
    """A log's forces through every controller.

    Args:
        log: The log.
        request: What is asked of it.
        choice: Which controllers, and which force.
        own: Settings of the controllers.
        parameters: A file of their parameters, or None.
        estimated: The observer whose torque the log itself holds, None if it is to be estimated.
    """
    from vftcli.admittance.law import controllers
    from vftcli.admittance.replay import replay
    from vftcli.signals.parsing import interval

    recording = request.library.open(log, request.read)
    arm = request.robot.load(recording)
    settings = read_parameters(arm, own, parameters)
    chosen = controllers(settings, choice.kinds, numbers(choice.alpha, "--alpha"))
    record = force_of(recording, arm, request, choice, estimated)
    if choice.zero is not None:
        record = record.zeroed(*interval(choice.zero))
    result = replay(record, arm, settings, chosen, force_unstable=choice.force_unstable)
    return result, recording


def looped(
    name: str, request: "AnalysisChoice", choice: Choice, own: list[str], parameters: Path | None
) -> "tuple[Replay, ClosedLoop]":
    """A scenario with a controller in the loop, and the force it acted on through all of them."""
    from vftcli.admittance.closed_loop import run_closed_loop
    from vftcli.admittance.law import controllers
    from vftcli.admittance.replay import replay
    from vftcli.cli.simulate import progress_bar
    from vftcli.observers import KalmanObserver
    from vftcli.robots import load_robot
    from vftcli.signals.errors import ParameterError
    from vftcli.signals.parsing import interval
    from vftcli.simulation import load_scenario
    from vftcli.simulation.sensing import log_rate

    scenario = load_scenario(name, ())
    arm = load_robot(scenario.robot)
    settings = read_parameters(arm, own, parameters)
    observer = request.observers.build(arm, 1.0 / log_rate(scenario.sensing, arm))[0][0]
    if not isinstance(observer, KalmanObserver):
        raise ParameterError("the closed loop runs kfo-fe or kfo-zoh; choose one with --observer")
    chosen = controllers(settings, choice.kinds, numbers(choice.alpha, "--alpha"))
    run = run_closed_loop(
        scenario,
        chosen[-1],
        observer,
        seed=choice.seed,
        torque=choice.torque,
        zero=interval(choice.zero) if choice.zero is not None else UNLOADED,
        force_unstable=choice.force_unstable,
        progress=progress_bar(),
    )
    result = replay(run.record, arm, settings, chosen, force_unstable=choice.force_unstable)
    return result, run


UNLOADED = (0.5, 3.0)
"""In all built-in closed-loop scenarios nothing touches the arm in this span. [s]"""


def force_of(
    recording: "Recording",
    robot: "Robot",
    request: "AnalysisChoice",
    choice: Choice,
    estimated: str | None,
) -> "ForceRecord":
    """The wrench that drives the replay: truth, sensor, or an observer's."""
    from vftcli.admittance.force import from_sensor, from_torque
    from vftcli.signals.external_torque import ExternalTorque

    if choice.sensor and choice.truth is not None:
        raise typer.BadParameter("choose one of --sensor and --truth")
    if choice.truth is not None:
        return truth_of(recording, choice.truth)
    if choice.sensor:
        return from_sensor(recording, robot, choice.frame)
    if estimated is not None:
        tau = recording.require("tau_ext")
        estimate = ExternalTorque(name=estimated, t=recording.t, tau=tau)
    else:
        from vftcli.pipeline import analyse

        estimate = analyse(recording, robot, request).estimates[0]
    return from_torque(estimate, recording.q, robot)


def truth_of(recording: "Recording", path: Path) -> "ForceRecord":
    """The wrench of a truth file, on the log's own clock, base axes."""
    from vftcli.admittance.force import from_truth
    from vftcli.readers.references import read_reference
    from vftcli.signals.errors import ReferenceTorqueError

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


def numbers(text: str | None, option: str) -> list[float]:
    """A comma-separated list of numbers; empty for None.

    Raises:
        typer.BadParameter: If one is no number.
    """
    try:
        return [float(part) for part in text.split(",")] if text else []
    except ValueError:
        raise typer.BadParameter(f"{option} {text!r} is not a list of numbers") from None
