"""The reference as a wrench, in the frame the estimates are in."""

from dataclasses import replace

import numpy as np

from vftcli.evaluation.reference import ReferenceLoad
from vftcli.robots.kinematics import link_poses
from vftcli.robots.robot import Robot
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.frames import from_base
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor


def reference_wrench(
    recording: Recording, robot: Robot, reference: ReferenceLoad, sensor: VirtualSensor
) -> Wrench:
    """The wrench that estimates are judged by, in the virtual sensor's frame.

    A sensor's and a file's wrench are taken as they are; any other reference is a torque, and goes
    through least squares. Samples in which the pose cannot tell a wrench are masked alike.

    Args:
        recording: The log.
        robot: The arm.
        reference: The reference.
        sensor: Frame and mounting of the estimates.
    """
    torque = reference.torque
    # Plain least squares whatever the estimates' solver is: a reference is not to be smoothed.
    solved = replace(sensor, solver="pinv").wrench(torque, recording.q, robot.chain)
    if reference.wrench is None:
        return replace(solved, name=torque.name, sd=None, remarks=())
    flange = link_poses(robot.chain, recording.q).rotation[:, -1]
    X = from_base(sensor.frame, flange, sensor.mounting)
    return replace(
        solved,
        name=torque.name,
        values=np.einsum("tij,tj->ti", X, reference.wrench.values),
        sd=None,
        null_space=None,
        remarks=reference.wrench.remarks,
    )
