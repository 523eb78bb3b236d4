"""Where a log's sensor sits and what it weighs, found before it is compared with."""

from dataclasses import replace

import numpy as np

from vftcli.robots.chain import Chain
from vftcli.robots.kinematics import link_poses
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.pose import IDENTITY
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark
from vftcli.virtual_sensor.choice import FIT, WrenchChoice
from vftcli.virtual_sensor.frames import Mounting
from vftcli.virtual_sensor.log_wrench import UNSTATED, sensor_reading_of
from vftcli.virtual_sensor.sensor import fit_pose, weigh_tool
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor


def find_mounting(
    recording: Recording, robot: Robot, disturbance: ExternalTorque, choice: WrenchChoice
) -> tuple[Mounting, tuple[Remark, ...]]:
    """Tool and sensor poses as asked, and what was found: ``fit`` estimates the sensor's pose.

    Args:
        recording: The log.
        robot: The arm.
        disturbance: The torque whose wrench the sensor's reading is laid on.
        choice: What is asked.

    Raises:
        ParameterError: If a pose is malformed, or cannot be found in the log.
        MissingSignalError: If it is to be found and the log has no wrench.
    """
    mounting = choice.mounting(robot)
    if choice.sensor_pose != FIT:
        return mounting, ()
    reading = sensor_reading_of(recording, "--sensor-pose fit")
    ours = VirtualSensor(frame="flange").wrench(disturbance, recording.q, robot.chain)
    fit = fit_pose(ours.known, reading)
    return mounting._replace(sensor=fit.pose), (fit.remark,)


def without_tool_weight(
    recording: Recording, chain: Chain, mounting: Mounting, free: Mask
) -> tuple[Recording, tuple[Remark, ...]]:
    """The log with its sensor's tool weight and zero removed, and what was found.

    Args:
        recording: A log whose wrench is in sensor axes.
        chain: The arm.
        mounting: Where the sensor sits.
        free: Samples in which nothing touches the arm. (T,)

    Raises:
        ParameterError: If the unloaded samples are too few or all in one orientation, or the
            wrench is not in sensor axes.
    """
    reading = sensor_reading_of(recording, "--sensor-weight")
    if np.count_nonzero(free) < 10:
        raise ParameterError(
            "--sensor-weight: too few unloaded samples; name the unloaded spans with --zero A:B"
        )
    pose = mounting.sensor or IDENTITY
    rotation: Array = link_poses(chain, recording.q).rotation[:, -1] @ pose.rotation
    gravity = np.asarray(chain.gravity)
    tool = weigh_tool(reading[free], rotation[free], gravity)
    # The log keeps the sign that it states.
    sign = (recording.wrench_frame or UNSTATED).factor
    clean = sign * (reading - tool.reading(rotation, gravity))
    return replace(recording, wrench=clean), (tool.remark,)
