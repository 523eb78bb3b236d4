"""From what the drives measure to torque at the joints."""

import numpy as np

from vftcli.robots.kernels import momentum_terms
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import MissingSignalError, RobotError
from vftcli.signals.names import EFFORTS
from vftcli.signals.parsing import check_kind
from vftcli.signals.recording import Recording

#: How well drive constants and torque sensors are known: a weighed 2.805 kg reads 2.88 kg through
#: the constants of a UR10e's maker. [1]
CONSTANT_SD, SENSOR_SD = 0.03, 0.01


def check_joints(recording: Recording, robot: Robot) -> None:
    """Raise a RobotError unless the log and the robot have the same number of joints."""
    check_kind(recording, Recording, "the recording", "vftcli.read(LOG)")
    check_kind(robot, Robot, "the robot", "vftcli.load_robot('ur5')")
    if recording.joints != robot.joints:
        raise RobotError(
            f"{recording.name}: the log has {recording.joints} joints but robot {robot.name!r} has "
            f"{robot.joints}; choose another with --robot (vftcli help robots lists them)"
        )


def uses_current(recording: Recording, robot: Robot) -> bool:
    """Whether the drive torque comes from motor current rather than from a torque signal."""
    if robot.torque_source == "current":
        return recording.current is not None or not has_torque(recording)
    return not has_torque(recording) and recording.current is not None


def effort_name(recording: Recording, robot: Robot) -> str:
    """The signal that the drive torque comes from, one of `vftcli.signals.recording.EFFORTS`."""
    if uses_current(recording, robot):
        return "current"
    return "torque" if recording.torque is not None else "torque_without_gravity"


def gain_sd(recording: Recording, robot: Robot) -> float:
    """How well a log's torques are known as a whole: a standard deviation over the value. [1]"""
    return CONSTANT_SD if uses_current(recording, robot) else SENSOR_SD


def has_torque(recording: Recording) -> bool:
    """Whether the log has a torque signal, with gravity in it or without."""
    return recording.torque is not None or recording.torque_without_gravity is not None


def drive_torque(recording: Recording, robot: Robot) -> Array:
    """Torque of the drives at the joints, friction not yet taken off. (T, n) [N·m]

    τ = K i where the robot's torque source is current, else the measured torque. A robot described
    by currents whose log has only torques uses the torques, and the other way round if its file
    has torque constants. Torques without gravity get the gravity torque g(q) of the arm with its
    payload: τ = e + g(q).
    """
    check_joints(recording, robot)
    if all(getattr(recording, name) is None for name in EFFORTS):
        raise MissingSignalError(
            f"{recording.name}: the log has no joint torques and no motor currents, and "
            f"positions alone carry no force; it has {', '.join(recording.signals)}. Record "
            "them, or name their columns with --columns"
        )
    name = effort_name(recording, robot)
    if name == "torque_without_gravity" and recording.torque_without_gravity is not None:
        still = np.zeros_like(recording.q)
        gravity = momentum_terms(robot.loaded_chain, recording.q, still).gravity
        return np.asarray(recording.torque_without_gravity + gravity)
    if name != "current":
        return recording.require("torque")
    current = recording.require("current")
    if robot.torque_constant is None:
        raise MissingSignalError(
            f"{recording.name}: the log has motor currents but robot {robot.name!r} has no "
            "torque_constant; give one per joint in its TOML file, or record torques"
        )
    return current * robot.torque_constant
