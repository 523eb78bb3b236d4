"""From what the drives measure to torque at the joints."""

from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import MissingSignalError, RobotError
from vftcli.signals.recording import Recording


def check_joints(recording: Recording, robot: Robot) -> None:
    """Raise a RobotError unless the log and the robot have the same number of joints."""
    if recording.joints != robot.joints:
        raise RobotError(
            f"{recording.name}: the log has {recording.joints} joints but robot {robot.name!r} has "
            f"{robot.joints}; choose another with --robot (vftcli robots lists them)"
        )


def uses_current(recording: Recording, robot: Robot) -> bool:
    """Whether the drive torque comes from motor current rather than from a torque signal."""
    if robot.torque_source == "current":
        return recording.current is not None or recording.torque is None
    return recording.torque is None and recording.current is not None


def drive_torque(recording: Recording, robot: Robot) -> Array:
    """Torque of the drives at the joints, friction not yet taken off. (T, n) [N·m]

    τ = K i where the robot's torque source is current, else the measured torque. A robot described
    by currents whose log has only torques uses the torques, and the other way round if its file
    has torque constants.

    Raises:
        MissingSignalError: If the log has neither, or currents without drive constants.
        RobotError: If the number of joints differs.
    """
    check_joints(recording, robot)
    if not uses_current(recording, robot):
        return recording.require("torque")
    current = recording.require("current")
    if robot.torque_constant is None:
        raise MissingSignalError(
            f"{recording.name}: the log has motor currents but robot {robot.name!r} has no "
            "torque_constant; give one per joint in its TOML file, or record torques"
        )
    torque: Array = current * robot.torque_constant
    return torque
