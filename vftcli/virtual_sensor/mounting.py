"""Where a log's sensor sits and what it weighs, found before it is compared with."""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import Chain
from vftcli.robots.kinematics import link_poses
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.pose import IDENTITY
from vftcli.signals.recording import Recording
from vftcli.virtual_sensor.choice import FIT, WrenchChoice
from vftcli.virtual_sensor.frames import Mounting
from vftcli.virtual_sensor.log_wrench import stated
from vftcli.virtual_sensor.sensor import described, fit_pose, tool_words, weigh_tool, without_tool
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor

BEST = "kfo-fe"
"""The observer whose wrench a sensor's pose is fitted to, where it runs."""


class Placed(NamedTuple):
    """Where tool and sensor sit.

    Attributes:
        mounting: Their poses on the flange.
        notes: What was found, one sentence each.
    """

    mounting: Mounting
    notes: tuple[str, ...] = ()


def placed(
    recording: Recording,
    robot: Robot,
    estimates: Sequence[ExternalTorque],
    request: WrenchChoice,
) -> Placed:
    """Tool and sensor poses as asked; the sensor's estimated from the log for ``fit``.

    Raises:
        ParameterError: If a pose is malformed, or cannot be found in the log.
        MissingSignalError: If it is to be found and the log has no wrench.
    """
    mounting = request.mounting(robot)
    if request.sensor_pose != FIT:
        return Placed(mounting)
    reading = recording.require("wrench")
    how = stated(recording.wrench_frame, mounting)
    if how.axes != "sensor":
        raise ParameterError(
            f"--sensor-pose fit: the log's wrench is in {recording.wrench_frame!r}, not in sensor "
            "axes; name it with --columns wrench[sensor]=…, or leave the option out"
        )
    if not estimates:
        raise ParameterError("--sensor-pose fit: no observer runs, so there is nothing to fit to")
    best = next((e for e in estimates if e.name == BEST), estimates[0])
    ours = VirtualSensor(frame="flange").wrench(best, recording.q, robot.chain)
    fit = fit_pose(ours.known, how.sign * reading)
    return Placed(mounting._replace(sensor=fit.pose), (described(fit),))


def weighed(
    recording: Recording, chain: Chain, mounting: Mounting, free: Mask
) -> tuple[Recording, tuple[str, ...]]:
    """The log with its sensor's tool weight and zero removed, and what was found.

    Args:
        recording: A log whose wrench is in sensor axes.
        chain: The arm.
        mounting: Where the sensor sits.
        free: FreeRunTorque samples. (T,)

    Raises:
        ParameterError: If the unloaded samples are too few or all in one orientation, or the
            wrench is not in sensor axes.
    """
    reading = recording.require("wrench")
    if stated(recording.wrench_frame, mounting).axes != "sensor":
        raise ParameterError(
            f"--sensor-weight: the log's wrench is in {recording.wrench_frame!r}, not in "
            "sensor axes"
        )
    if np.count_nonzero(free) < 10:
        raise ParameterError(
            "--sensor-weight: too few unloaded samples; name the unloaded spans with --zero A:B"
        )
    pose = mounting.sensor if mounting.sensor is not None else IDENTITY
    rotation: Array = link_poses(chain, recording.q).rotation[:, -1] @ pose.rotation
    gravity = np.asarray(chain.gravity)
    tool = weigh_tool(reading[free], rotation[free], gravity)
    clean = without_tool(reading, tool, rotation, gravity)
    return replace(recording, wrench=clean), (tool_words(tool),)
