"""Estimates and wrenches beside a reference: one table of errors."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.evaluation.errors import evaluate, joint_means
from vftcli.evaluation.reference_choice import ReferenceChoice
from vftcli.evaluation.references import ReferenceLoad, make_reference
from vftcli.evaluation.wrenches import with_contacts, with_wrenches
from vftcli.free_motion.free_motion import FreeMotion
from vftcli.observers.observer import Tuning
from vftcli.observers.table import BEST, PAPER
from vftcli.refinement.refine import EXPECTED, MEASURED, gap_remark
from vftcli.robots.chain import link_poses
from vftcli.robots.robot import Robot
from vftcli.signals.errors import VftError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, caution
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.detection import KnownContacts, judge_contacts
from vftcli.virtual_sensor.frames import NOTHING, from_base
from vftcli.virtual_sensor.sensor_reading import SensorReading, with_reference
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor


class Judgement(NamedTuple):
    """Errors of one log's estimates against a reference; fields of `vftcli.Analysis`."""

    reference: ExternalTorque  #: The torque they are judged by.
    errors: pl.DataFrame  #: The tidy error table (`vftcli.evaluation.SCHEMA`).
    #: The wrenches, with the reference's beside them; None without wrenches.
    virtual_sensor: SensorReading | None


def with_measured_gap(
    remarks: Sequence[Remark], errors: pl.DataFrame, tunings: Mapping[str, Tuning]
) -> tuple[Remark, ...]:
    """Remarks on the measured cost of the paper's gains, where both sides ran."""
    means = joint_means(errors).errors
    delays = {name: tunings[name].delay for name in PAPER if name in means}
    gap = gap_remark(MEASURED, means, delays) if delays and BEST in means else None
    if gap is None:
        return tuple(remarks)
    return (*(remark for remark in remarks if remark.code not in EXPECTED), gap)


def judge(
    motion: FreeMotion,
    estimates: Sequence[ExternalTorque],
    sensed: SensorReading | None,
    choice: ReferenceChoice,
    told: KnownContacts | None = None,
) -> Judgement:
    """Make the reference and compare with it.

    Args:
        motion: The log and its free motion.
        estimates: The observers' torques.
        sensed: Their wrenches, or None.
        choice: Which reference.
        told: Known contacts of the log, None for none.

    Raises:
        ReferenceTorqueError: If the reference cannot be made.
    """
    recording, robot = motion.log.recording, motion.log.robot
    mounting = NOTHING if sensed is None else sensed.sensor.mounting
    made = make_reference(motion, choice, mounting)
    reference = made.torque
    errors = evaluate(recording.name, estimates, reference)
    if sensed is not None:
        theirs = reference_wrench(recording, robot, made, sensed.sensor)
        sensed = with_reference(sensed, theirs, of_sensor=choice.name == "sensor")
        errors = with_wrenches(errors, recording.name, sensed)
    if choice.contacts:
        try:
            scores = judge_contacts(estimates, sensed, reference, told)
            errors = with_contacts(errors, recording.name, reference.name, scores)
        except VftError as error:
            reason = caution("contacts-not-judged", reason=str(error))
            reference = replace(reference, remarks=(*reference.remarks, reason))
    return Judgement(reference=reference, errors=errors, virtual_sensor=sensed)


def reference_wrench(
    recording: Recording, robot: Robot, reference: ReferenceLoad, sensor: VirtualSensor
) -> Wrench:
    """The wrench that estimates are judged by, in the virtual sensor's frame.

    A sensor's or a file's stays; any other reference is a torque, solved by least squares.
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
