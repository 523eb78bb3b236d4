"""From estimates and wrenches to how they compare with a reference: one table of errors."""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import polars as pl

from vftcli.evaluation.errors import evaluate
from vftcli.evaluation.joint_means import joint_means
from vftcli.evaluation.reference_choice import ReferenceChoice, ReferenceSource, make_reference
from vftcli.evaluation.reference_wrench import reference_wrench
from vftcli.evaluation.wrenches import with_contacts, with_wrenches
from vftcli.observers.observer import Tuning
from vftcli.observers.table import BEST, PAPER
from vftcli.refinement.limits import EXPECTED, MEASURED, gap_remark
from vftcli.repetition.free_motion import FreeMotion
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark
from vftcli.virtual_sensor.detection import ContactScore, ToldContacts, judge_contacts
from vftcli.virtual_sensor.sensor_reading import SensorReading, with_reference


class Judgement(NamedTuple):
    """How the estimates of one log compare with a reference; fields of `vftcli.Analysis`.

    Attributes:
        reference: What they are judged by.
        errors: The tidy error table (`vftcli.evaluation.SCHEMA`).
        virtual_sensor: The wrenches, with the reference's beside them; None without wrenches.
        contacts: How each observer tells contacts, or empty where it was not asked.
    """

    reference: ExternalTorque
    errors: pl.DataFrame
    virtual_sensor: SensorReading | None
    contact_scores: tuple[ContactScore, ...]


def with_measured_gap(
    remarks: Sequence[Remark], errors: pl.DataFrame, tunings: Mapping[str, Tuning]
) -> tuple[Remark, ...]:
    """Remarks in which what the paper's gains cost is measured, where both sides of it ran.

    Args:
        remarks: What there is to say of the run; what was expected of the gains gives way.
        errors: The errors of the run's observers.
        tunings: What their gains mean, by name; they are those of the robot's file.
    """
    means = joint_means(errors).errors
    delays = {name: tunings[name].delay for name in PAPER if name in means}
    if not delays or BEST not in means:
        return tuple(remarks)
    gap = gap_remark(MEASURED, means, delays)
    if gap is None:
        return tuple(remarks)
    return (*(remark for remark in remarks if remark.code not in EXPECTED), gap)


def judge(
    motion: FreeMotion,
    estimates: Sequence[ExternalTorque],
    sensed: SensorReading | None,
    choice: ReferenceChoice,
    told: ToldContacts | None = None,
) -> Judgement:
    """Make the reference and compare with it.

    Args:
        motion: The log and its free motion.
        estimates: The observers' torques.
        sensed: Their wrenches, or None.
        choice: Which reference.
        told: What is known of the log's contacts, None for nothing.

    Raises:
        ReferenceTorqueError: If the reference cannot be made.
    """
    recording, robot = motion.log.recording, motion.log.robot
    source = ReferenceSource(motion=motion)
    if sensed is not None:
        mounting = sensed.sensor.mounting
        source = ReferenceSource(motion=motion, mounting=mounting, logged=sensed.logged)
    made = make_reference(source, choice)
    reference = made.torque
    errors = evaluate(recording.name, estimates, reference)
    if sensed is not None:
        theirs = reference_wrench(recording, robot, made, sensed.sensor)
        sensed = with_reference(sensed, theirs, of_sensor=choice.name == "sensor")
        errors = with_wrenches(errors, recording.name, sensed)
    scores: tuple[ContactScore, ...] = ()
    if choice.contacts:
        scores = judge_contacts(estimates, sensed, reference, told)
        errors = with_contacts(errors, recording.name, reference.name, scores)
    return Judgement(
        reference=reference, errors=errors, virtual_sensor=sensed, contact_scores=scores
    )
