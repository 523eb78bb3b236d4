"""rosbag2 through rosbags."""

from pathlib import Path

from vftcli.errors import ParameterError
from vftcli.simulation.experiment import Simulation


def write_rosbag2(path: Path, simulation: Simulation) -> None:
    """Placeholder until the messages are written."""
    raise ParameterError(f"{path}: rosbag2 is not written yet for {simulation.robot.name}")
