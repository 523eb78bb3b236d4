"""The reference as a wrench, in the frame the estimates are in."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from vftcli.evaluation.reference import ReferenceRequest
from vftcli.evaluation.reference_sensor import torque_of
from vftcli.readers.references import read_reference
from vftcli.robots.kinematics import link_poses
from vftcli.robots.robot import Robot
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.frames import NOTHING, Mounting, from_base
from vftcli.virtual_sensor.log_wrench import logged_wrench
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor

FILE = "file:"


def reference_wrench(
    recording: Recording,
    robot: Robot,
    reference: ExternalTorque,
    sensor: VirtualSensor,
    asked: ReferenceRequest,
) -> Wrench:
    """The wrench that estimates are judged by, in the virtual sensor's frame.

    A sensor's and a file's wrench are taken as they are; any other reference is a torque, and goes
    through least squares. Samples in which the pose cannot tell a wrench are masked alike.

    Args:
        recording: The log.
        robot: The arm.
        reference: The reference torque.
        sensor: Frame and mounting of the estimates.
        asked: How the reference was asked for.

    Raises:
        ParameterError: If the wrench's frame is not one there is.
    """
    told = replace(sensor, solver="pinv").wrench(reference, recording.q, robot.chain)
    given = given_wrench(recording, robot, asked, sensor.mounting)
    if given is None:
        return replace(told, name=reference.name, sd=None, remarks=reference.remarks)
    flange = link_poses(robot.chain, recording.q).rotation[:, -1]
    X = from_base(sensor.frame, flange, sensor.mounting)
    return replace(
        told,
        name=reference.name,
        values=np.einsum("tij,tj->ti", X, given.values),
        sd=None,
        null_space=None,
        remarks=given.remarks,
    )


def given_wrench(
    recording: Recording,
    robot: Robot,
    asked: ReferenceRequest,
    mounting: Mounting,
) -> Wrench | None:
    """The sensor's or the file's own wrench in base axes, None where the reference is a torque."""
    if asked.name == "sensor":
        return logged_wrench(recording, robot.chain, mounting)
    if not asked.name.startswith(FILE):
        return None
    path = Path(asked.name.removeprefix(FILE))
    return wrench_of_file(recording, robot, path, mounting, asked.columns)


def wrench_of_file(
    recording: Recording, robot: Robot, path: Path, mounting: Mounting, columns: str | None
) -> Wrench | None:
    """A reference file's wrench in base axes about the flange, None if it has none.

    Its frame is base unless ``--reference-columns wrench[FRAME]=…`` says otherwise.
    """
    table = read_reference(path, columns)
    if table.wrench is None:
        return None
    t = table.t - recording.source.t0
    there = np.column_stack(
        [np.interp(recording.t, t, column, left=np.nan, right=np.nan) for column in table.wrench.T]
    )
    posed = replace(recording, wrench=there, wrench_frame=table.wrench_frame or "base")
    return logged_wrench(posed, robot.chain, mounting)


def torque_of_file(
    recording: Recording, robot: Robot, path: Path, asked: ReferenceRequest
) -> ExternalTorque:
    """Joint torque of a reference file that holds a wrench and no torques.

    Raises:
        ReferenceTorqueError: If its clock does not overlap the log's.
    """
    wrench = wrench_of_file(recording, robot, path, asked.mounting or NOTHING, asked.columns)
    if wrench is None or not np.isfinite(wrench.values).any():
        raise ReferenceTorqueError(
            f"{path}: its clock does not overlap the log's; both must be the log's own clock"
        )
    note = f"reference from {path.name}: its wrench through the transposed flange Jacobian"
    return torque_of(wrench, recording, robot, f"{FILE}{path.name}", note)
