"""Simulated logs in the vendors' own formats."""

from collections.abc import Callable
from pathlib import Path

from vftcli.robots import Robot
from vftcli.signals.errors import ParameterError
from vftcli.simulation.experiment import Simulation
from vftcli.simulation.scenario import Scenario
from vftcli.simulation.schema import unknown_name
from vftcli.simulation.writers.libfranka import check_franka, write_libfranka
from vftcli.simulation.writers.parquet import write_parquet
from vftcli.simulation.writers.rosbag2 import ROBOT_STATE, write_rosbag2
from vftcli.simulation.writers.rtde import UR_JOINTS, check_ur, write_rtde, write_ur_rtde

WRITERS: dict[str, Callable[[Path, Simulation], None]] = {
    "rtde": write_rtde,
    "ur-rtde": write_ur_rtde,
    "libfranka": write_libfranka,
    "rosbag2": write_rosbag2,
    "parquet": write_parquet,
}
"""Name at ``--as`` → the function that writes it."""

CHECKS: dict[str, Callable[[Robot], None]] = {
    "rtde": check_ur,
    "ur-rtde": check_ur,
    "libfranka": check_franka,
}
"""Name at ``--as`` → the function that refuses an arm that cannot log so."""


def usual_format(scenario: Scenario, robot: Robot, wanted: str = "") -> str:
    """Return the format asked for, the scenario's, or the vendor's usual one.

    Raises:
        ParameterError: If there is no such format, or the arm cannot log in it.
    """
    name = wanted or scenario.format or vendor_format(robot)
    if name not in WRITERS:
        raise ParameterError(unknown_name(f"log format {name!r}", name, WRITERS))
    if name in CHECKS:
        CHECKS[name](robot)
    return name


def vendor_format(robot: Robot) -> str:
    """The format an arm's vendor logs in: RTDE for a UR, libfranka's for a Franka, else a table."""
    if robot.torque_source == "current" and robot.joints == UR_JOINTS:
        return "rtde"
    return "libfranka" if robot.ros_state == ROBOT_STATE else "parquet"
