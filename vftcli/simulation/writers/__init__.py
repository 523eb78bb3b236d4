"""Simulated logs in the vendors' own formats."""

from collections.abc import Callable
from pathlib import Path

from vftcli.signals.errors import ParameterError
from vftcli.simulation.experiment import Simulation
from vftcli.simulation.schema import unknown_name
from vftcli.simulation.writers.libfranka import write_libfranka
from vftcli.simulation.writers.parquet import write_parquet
from vftcli.simulation.writers.rosbag2 import write_rosbag2
from vftcli.simulation.writers.rtde import write_rtde, write_ur_rtde

WRITERS: dict[str, Callable[[Path, Simulation], None]] = {
    "rtde": write_rtde,
    "ur-rtde": write_ur_rtde,
    "libfranka": write_libfranka,
    "rosbag2": write_rosbag2,
    "parquet": write_parquet,
}
"""Name at ``--as`` → the function that writes it."""

USUAL = {"current": "rtde", "link_torque": "libfranka", "joint_torque": "parquet"}
"""Kind of drive measurement → the format such a robot logs in."""


def usual_format(simulation: Simulation, wanted: str = "") -> str:
    """Return the format asked for, the scenario's, or the vendor's usual one.

    Raises:
        ParameterError: If there is no such format, or the robot cannot log in it.
    """
    name = wanted or simulation.scenario.format or USUAL[simulation.robot.torque_source]
    if name not in WRITERS:
        raise ParameterError(unknown_name(f"log format {name!r}", name, WRITERS))
    return name
