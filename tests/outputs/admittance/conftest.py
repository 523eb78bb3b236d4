"""Replays short enough to be shown in a test: a release, and a push of one axis."""

import numpy as np
import pytest

from vftcli.admittance.law import controllers, from_table
from vftcli.admittance.replay import Replay, replay, replay_release
from vftcli.robots import load_robot
from vftcli.signals.remarks import fact
from vftcli.signals.wrench import Wrench

START = np.array([0.0, -1.35, 1.9, -2.1208, -1.5708, 0.0])
"""Pose of the UR5 in which the paper drags it. [rad]"""


@pytest.fixture(scope="session")
def release() -> Replay:
    """The UR5 let go at 0.1 m along x, watched for two seconds."""
    robot = load_robot("ur5")
    p = from_table(robot.admittance, robot.name, {})
    x = np.array([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    return replay_release(x, robot, controllers(p), start=START, duration=2.0)


@pytest.fixture(scope="session")
def push() -> Replay:
    """24 N along y from 1 to 1.6 s of a log of 4 s at 125 Hz, the arm at rest."""
    robot = load_robot("ur5")
    p = from_table(robot.admittance, robot.name, {})
    t = 0.008 * np.arange(500)
    values = np.zeros((500, 6))
    values[(t > 1.0) & (t < 1.6), 1] = 24.0
    wrench = Wrench(name="push", t=t, values=values, frame="base")
    source = fact("force-of-sensor", frame="a push")
    return replay(wrench, np.tile(START, (500, 1)), robot, controllers(p), source=source)
