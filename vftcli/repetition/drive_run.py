"""What the two-cycle difference is made from: a log's torque, and what the model says of it."""

from typing import NamedTuple

import numpy as np

from vftcli.repetition.standstill import at_rest, stops
from vftcli.robots.drive import drive_torque
from vftcli.robots.friction import SMOOTHING, friction_torque
from vftcli.robots.robot import Robot
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording


class DriveRun(NamedTuple):
    """One log's signals on its own clock.

    Attributes:
        name: The log's name.
        t: Clock. (T,) [s]
        q: Joint positions. (T, n) [rad]
        dq: Joint velocities. (T, n) [rad/s]
        torque: Drive torque. (T, n) [N·m]
        model: Drive torque the model expects of the motion without contact, ṗ − Cᵀq̇ + g + F_f,
            with ṗ by central differences. (T, n) [N·m]
        momentum: p = M q̇. (T, n) [kg·m²/s]
        coulomb: Dry friction of each joint by the robot's model, 0 without one. (n,) [N·m]
        stop: Length of the stop a sample belongs to, 0 where the joint moves. (T, n) [s]
        rest: 1 where a joint rests. (T, n)
    """

    name: str
    t: Array
    q: Array
    dq: Array
    torque: Array
    model: Array
    momentum: Array
    coulomb: Array
    stop: Array
    rest: Array


def drive_run_of(recording: Recording, robot: Robot) -> DriveRun:
    """Evaluate a log's drive torque and the model's.

    Raises:
        MissingSignalError: If velocities, or both currents and torques, are missing.
        RobotError: If the number of joints differs.
    """
    torque, terms = drive_torque(recording, robot), dynamics_terms(recording, robot)
    dq = recording.require("dq")
    stop = stops(recording.t, dq)
    return DriveRun(
        name=recording.name,
        t=recording.t,
        q=recording.q,
        dq=dq,
        torque=torque,
        model=np.gradient(terms.p, recording.t, axis=0) - terms.mu + torque,
        momentum=terms.p,
        coulomb=dry_friction(robot),
        stop=stop,
        rest=at_rest(recording.t, stop),
    )


def dry_friction(robot: Robot) -> Array:
    """Friction at a speed at which the smoothed sign has settled, as half the step there. (n,)"""
    slow = np.full((1, robot.joints), 5.0 * SMOOTHING)
    there, back = (friction_torque(robot.friction, v)[0] for v in (slow, -slow))
    step: Array = 0.5 * np.abs(there - back)
    return step
