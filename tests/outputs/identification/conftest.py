from pathlib import Path

import numpy as np
import pytest

from vftcli.identification import Task, identify
from vftcli.robots import load_robot
from vftcli.robots.friction import friction_torque
from vftcli.robots.kernels import chain_parameters, torque_regressor
from vftcli.signals.recording import Recording, Source


@pytest.fixture(scope="session")
def found():
    """A short identification whose log has a name that would break a careless page."""
    robot = load_robot("ur5")
    t = np.arange(0, 20, 0.008)
    w = 2 * np.pi * np.array([0.1, 0.15, 0.2, 0.25, 0.3, 0.35])
    q, dq = 0.5 * np.sin(w * t[:, None]), 0.5 * w * np.cos(w * t[:, None])
    noise = np.random.default_rng(0).normal(size=q.shape)
    ddq = -0.5 * w**2 * np.sin(w * t[:, None])
    torque = torque_regressor(robot.chain, q, dq, ddq) @ chain_parameters(robot.chain)
    torque += robot.chain.rotor_inertia * ddq + friction_torque(robot.friction, dq) + 0.2 * noise
    source = Source(path=Path("<b>log & co</b>.csv"), sha256="0" * 64)
    log = Recording(t=t, q=q, dq=dq, current=torque / robot.torque_constant, source=source)
    return identify([log], robot, Task(method="friction", name="mine"), [log]), log
