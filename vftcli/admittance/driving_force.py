"""The wrench that drives a replay: an observer's, the log's own sensor's, or a truth file's."""

from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from vftcli.robots.robot import Robot
from vftcli.signals.errors import ParameterError, ReferenceTorqueError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.choice import SMOOTHER, WrenchChoice
from vftcli.virtual_sensor.log_wrench import logged_wrench
from vftcli.virtual_sensor.sensor_reading import SensorReading, without_zero
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor


class DrivingForce(NamedTuple):
    """The wrench that drives a replay."""

    wrench: Wrench  #: Force on the robot, base axes, about the flange point.
    source: Remark  #: Where it comes from.
    remarks: tuple[Remark, ...]  #: What a reader should know of it.


def observed_force(reading: SensorReading) -> DrivingForce:
    """What the virtual sensor makes of the one observer that ran."""
    wrench = reading.wrenches[0]
    code = "force-smoothed" if wrench.name in reading.smoothed else "force-of-observer"
    return DrivingForce(wrench, fact(code, observer=wrench.name), reading.remarks)


def stored_force(
    recording: Recording, robot: Robot, choice: WrenchChoice, observer: str
) -> DrivingForce:
    """What the virtual sensor makes of an observer's torque that a file of estimates holds."""
    if choice.solver == SMOOTHER:
        raise ParameterError(
            "virtual-sensor.solver=smoother needs the log itself, not a file of estimates; "
            "give the log, or leave the setting away"
        )
    tau = recording.require("tau_ext")
    estimate = ExternalTorque(name=observer, t=recording.t, tau=tau)
    sensor = VirtualSensor(
        solver=choice.by_pose, frame=choice.frame, mounting=choice.mounting(robot)
    )
    # The band of a torque whose covariance nobody kept says nothing of the replay.
    seen = replace(sensor.wrench(estimate, recording.q, robot.chain), remarks=())
    return less_zero(seen, fact("force-of-observer", observer=observer), choice)


def sensor_force(recording: Recording, robot: Robot, choice: WrenchChoice) -> DrivingForce:
    """The log's own wrench."""
    frame = recording.wrench_frame
    source = fact("force-of-sensor", frame=str(frame) if frame else "frame not stated")
    wrench = logged_wrench(recording, robot.chain, choice.mounting(robot))
    return less_zero(wrench, source, choice)


def truth_force(
    recording: Recording, robot: Robot, choice: WrenchChoice, path: Path
) -> DrivingForce:
    """The wrench of a truth file, on the log's own clock."""
    # Few replays have a truth, and reading one loads the references.
    from vftcli.evaluation.references import file_reference

    wrench = file_reference(path, recording, robot, choice.mounting(robot)).wrench
    if wrench is None:
        raise ReferenceTorqueError(
            f"{path}: it has no wrench; a truth file has wrench/fx … wrench/mz at the flange"
        )
    return less_zero(wrench, fact("force-of-truth", file=path.name), choice)


def less_zero(wrench: Wrench, source: Remark, choice: WrenchChoice) -> DrivingForce:
    """A wrench that no observer of this run made, its zero removed as it is chosen."""
    wrench = without_zero(wrench, choice.zero)
    return DrivingForce(wrench, source, wrench.remarks)
