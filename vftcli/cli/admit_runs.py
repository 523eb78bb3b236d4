"""What `vftcli admit` runs: a release, a log's forces, or a closed loop in simulation."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import typer

if TYPE_CHECKING:
    from vftcli.admittance.closed_loop import ClosedLoop
    from vftcli.admittance.parameters import Admittance
    from vftcli.admittance.replay import Replay
    from vftcli.pipeline import AnalysisChoice
    from vftcli.robots.robot import Robot
    from vftcli.signals.recording import Recording
    from vftcli.signals.remarks import Note, Remark
    from vftcli.signals.wrench import Wrench
    from vftcli.virtual_sensor.choice import ZeroChoice


@dataclass(frozen=True, kw_only=True)
class Choice:
    """Which controllers are compared, and on what.

    Attributes:
        alpha: Values of α, comma-separated, or None.
        kinds: Kinds of controllers; all if empty.
        force_unstable: Run unstable settings too.
        sensor: Take the log's own wrench.
        truth: A truth file, or None.
        zero: What is taken as the zero of the wrench.
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
    zero: "ZeroChoice"
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
    from dataclasses import replace

    from vftcli.admittance.law import controllers
    from vftcli.admittance.replay import replay

    recording = request.library.open(log, request.read)
    arm = request.robot.load(recording)
    settings = read_parameters(arm, own, parameters)
    chosen = controllers(settings, choice.kinds, numbers(choice.alpha, "--alpha"))
    force = force_of(recording, arm, request, choice, estimated)
    result = replay(
        force.wrench,
        recording.q,
        arm,
        settings,
        chosen,
        source=force.source,
        force_unstable=choice.force_unstable,
    )
    return replace(result, notes=(*force.notes, *result.notes)), recording


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
    from vftcli.signals.remarks import fact
    from vftcli.simulation import load_scenario
    from vftcli.simulation.sensing import log_rate

    if choice.zero.start or choice.zero.log is not None:
        raise ParameterError("--closed-loop holds still over a span: give it as --zero A:B")
    zero = choice.zero.spans[0] if choice.zero.spans else UNLOADED
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
        zero=zero,
        force_unstable=choice.force_unstable,
        progress=progress_bar(),
    )
    result = replay(
        run.wrench,
        run.q,
        arm,
        settings,
        chosen,
        source=fact("force-of-loop"),
        force_unstable=choice.force_unstable,
    )
    return result, run


UNLOADED = (0.5, 3.0)
"""In all built-in closed-loop scenarios nothing touches the arm in this span. [s]"""


class DrivingForce(NamedTuple):
    """The wrench that drives a replay.

    Attributes:
        wrench: Force on the robot, base axes, about the flange point.
        source: Where it comes from.
        notes: What a reader should know of it.
    """

    wrench: "Wrench"
    source: "Remark"
    notes: "tuple[Note, ...]"


def force_of(
    recording: "Recording",
    robot: "Robot",
    request: "AnalysisChoice",
    choice: Choice,
    estimated: str | None,
) -> DrivingForce:
    """The wrench that drives the replay: truth, sensor, or an observer's, its zero removed."""
    from dataclasses import replace

    from vftcli.signals.external_torque import ExternalTorque
    from vftcli.signals.remarks import fact
    from vftcli.virtual_sensor.choice import WrenchChoice
    from vftcli.virtual_sensor.log_wrench import logged_wrench
    from vftcli.virtual_sensor.virtual_sensor import VirtualSensor
    from vftcli.virtual_sensor.zero import zeroed

    if choice.sensor and choice.truth is not None:
        raise typer.BadParameter("choose one of --sensor and --truth")
    asked = WrenchChoice(frame="base", zero=choice.zero)
    if choice.truth is not None:
        wrench = truth_of(recording, robot, choice.truth)
        source = fact("force-of-truth", file=choice.truth.name)
    elif choice.sensor:
        wrench = logged_wrench(recording, robot.chain, asked.mounting(robot))
        frame = recording.wrench_frame
        source = fact("force-of-sensor", frame=str(frame) if frame else "frame not stated")
    elif estimated is not None:
        tau = recording.require("tau_ext")
        estimate = ExternalTorque(name=estimated, t=recording.t, tau=tau)
        seen = VirtualSensor(frame="base").wrench(estimate, recording.q, robot.chain)
        # What it says of its band does not matter here.
        wrench = replace(seen, remarks=())
        source = fact("force-of-observer", observer=estimated)
    else:
        from vftcli.pipeline import analyse

        reading = analyse(recording, robot, replace(request, wrench=asked)).virtual_sensor
        assert reading is not None
        wrench = reading.wrenches[0]
        source = fact("force-of-observer", observer=wrench.name)
        return DrivingForce(wrench, source, (*reading.notes, *reading.warnings))
    wrench, notes = zeroed(wrench, choice.zero)
    return DrivingForce(wrench, source, (*wrench.remarks, *notes))


def truth_of(recording: "Recording", robot: "Robot", path: Path) -> "Wrench":
    """The wrench of a truth file, on the log's own clock, base axes."""
    from vftcli.evaluation.reference_file import file_reference
    from vftcli.signals.errors import ReferenceTorqueError
    from vftcli.virtual_sensor.frames import Mounting

    wrench = file_reference(path, recording, robot, Mounting()).wrench
    if wrench is None:
        raise ReferenceTorqueError(
            f"{path}: it has no wrench; a truth file has wrench/fx … wrench/mz at the flange"
        )
    return wrench


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
