"""Simulated logs in the vendors' own formats."""

from collections.abc import Callable
from pathlib import Path

from vftcli.robots import Robot
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import check_known
from vftcli.simulation.experiment import Simulation
from vftcli.simulation.scenario import Scenario
from vftcli.simulation.sensing import drive_constants
from vftcli.simulation.writers.rosbag2 import ROBOT_STATE, write_rosbag2
from vftcli.simulation.writers.tables import LIBFRANKA, RTDE, UR_RTDE, write_parquet

#: Name at ``--as`` → the function that writes it.
WRITERS: dict[str, Callable[[Path, Simulation], None]] = {
    "rtde": RTDE.write,
    "ur-rtde": UR_RTDE.write,
    "libfranka": LIBFRANKA.write,
    "rosbag2": write_rosbag2,
    "parquet": write_parquet,
}

UR_JOINTS, FRANKA_JOINTS = 6, 7


def usual_format(scenario: Scenario, robot: Robot, wanted: str = "") -> str:
    """Return the format asked for, the scenario's, or the vendor's usual one.

    Raises:
        ParameterError: If there is no such format, or the arm cannot log in it.
    """
    name = wanted or scenario.format or vendor_format(robot)
    check_known(name, WRITERS, f"no log format {name!r}")
    if name in {"rtde", "ur-rtde"} and not is_ur(robot):
        raise ParameterError(
            f"robot {robot.name!r} has no motor currents or not six joints and cannot log in a UR "
            "format; choose libfranka, rosbag2 or parquet with --as"
        )
    if name == "libfranka" and robot.joints != FRANKA_JOINTS:
        raise ParameterError(
            f"robot {robot.name!r} has {robot.joints} joints and cannot log as a Franka arm; "
            "choose rtde, rosbag2 or parquet with --as"
        )
    return name


def is_ur(robot: Robot) -> bool:
    """Whether an arm measures motor currents and has six joints."""
    return drive_constants(robot) is not None and robot.joints == UR_JOINTS


def vendor_format(robot: Robot) -> str:
    """The format an arm's vendor logs in: RTDE for a UR, libfranka's for a Franka, else a table."""
    if is_ur(robot):
        return "rtde"
    return "libfranka" if robot.ros_state == ROBOT_STATE else "parquet"
