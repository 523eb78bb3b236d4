"""From a log, its free motion and the estimates to what the virtual sensor says of it."""

from collections.abc import Sequence
from dataclasses import replace

from vftcli.observers.observer import Observer
from vftcli.repetition.free_motion import FreeMotion
from vftcli.signals.external_torque import ExternalTorque
from vftcli.virtual_sensor.choice import WrenchChoice
from vftcli.virtual_sensor.log_wrench import logged_wrench
from vftcli.virtual_sensor.mounting import find_mounting, without_tool_weight
from vftcli.virtual_sensor.sensor_reading import (
    FreeRunTorque,
    SensorReading,
    free_run_torque,
    measure,
)
from vftcli.virtual_sensor.torque_error import Disturbance


def sense(
    motion: FreeMotion,
    observers: Sequence[Observer],
    estimates: Sequence[ExternalTorque],
    choice: WrenchChoice,
) -> SensorReading:
    """The wrenches of a log's estimates, and what is known of them.

    Args:
        motion: The log, its robot, and the free run whose torque is the zero, if there is one.
        observers: The observers.
        estimates: Their estimates, in the same order.
        choice: What is asked of the virtual sensor.

    Raises:
        ParameterError: If a frame, solver, pose or zero cannot be used.
        RobotError: If the arm has fewer than six joints.
    """
    recording, robot = motion.log.recording, motion.log.robot
    mounting, notes = find_mounting(recording, robot, estimates, choice)
    unloaded = zero_torque(motion, observers)
    free = motion.zero.terms if motion.zero is not None else None
    raw = Disturbance(terms=motion.log.terms, observers=observers, free=free)
    measured = measure(recording, robot, estimates, choice, unloaded, mounting, raw)
    logged = None
    if choice.sensor_weight:
        relieved, found = without_tool_weight(recording, robot.chain, mounting, measured.free)
        logged = logged_wrench(relieved, robot.chain, mounting)
        notes += found
    return replace(measured, logged=logged, notes=(*map(str, notes), *measured.notes))


def zero_torque(motion: FreeMotion, observers: Sequence[Observer]) -> FreeRunTorque | None:
    """What the observers read in the free run of ``--zero LOG``, None without one."""
    if motion.zero is None:
        return None
    estimates = tuple(observer.estimate(motion.zero.terms) for observer in observers)
    return free_run_torque(motion.zero, estimates)
