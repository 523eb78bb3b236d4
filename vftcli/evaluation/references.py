"""Reference torques and wrenches by source, and estimates beside them: a table of errors."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.evaluation import ReferenceChoice
from vftcli.evaluation.errors import (
    SCHEMA,
    Schema,
    correlation,
    evaluate,
    rmse,
    tidy,
)
from vftcli.free_motion.free_motion import FreeMotion, within
from vftcli.free_motion.two_cycle import two_cycle_reference
from vftcli.observers.table import BEST
from vftcli.readers.reader import RawLog
from vftcli.readers.references import JacobianLog, read_reference
from vftcli.robots.chain import flange_jacobian, link_poses
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Z_95, Array, resample_columns
from vftcli.signals.errors import (
    MissingSignalError,
    ParameterError,
    ReferenceTorqueError,
)
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.option import interval_text
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, caution, fact
from vftcli.signals.wrench import AXES, Wrench, WrenchFrame
from vftcli.wrench import WrenchChoice, ZeroChoice
from vftcli.wrench.detection import ContactInterval, Detection, judge_contacts
from vftcli.wrench.sensor import RESEMBLES, SensorReading, fit_axes, with_reference
from vftcli.wrench.solvers import (
    LEAST_SIGMA,
    NOTHING,
    Mounting,
    VirtualSensor,
    decompose,
    from_base,
    in_base_axes,
    logged_wrench,
    wrench_of,
)

#: Columns where wrenches are compared: `axis` fx…mz, `joint` null; forces fill rmse_N.
#:
#: `band_share` is the share of samples with a 95 % band that holds the reference, `missing`
#: that without an answer where the pose shows one: it counts as the answer 0.
WRENCH_SCHEMA: Schema = {
    **SCHEMA,
    "axis": pl.String,
    "rmse_N": pl.Float64,
    "bias_N": pl.Float64,
    "max_N": pl.Float64,
    "band_share": pl.Float64,
}


def evaluate_wrenches(
    recording: str, wrenches: Iterable[Wrench], reference: Wrench
) -> pl.DataFrame:
    """One row per observer and axis, over the samples where the reference is known."""
    rows: list[dict[str, object]] = []
    for wrench in wrenches:
        answered = np.isfinite(wrench.known)
        answers = np.where(answered, wrench.known, 0.0)
        overall = rmse(answers, reference.known)
        for k, axis in enumerate(AXES):
            known = np.isfinite(reference.known[:, k])
            x, y = answers[known, k], reference.known[known, k]
            error, unit = x - y, "N" if k < 3 else "Nm"
            row: dict[str, object] = {
                "recording": recording,
                "observer": wrench.name,
                "axis": axis,
                f"rmse_{unit}": overall[k],
                "reference": reference.name,
                "samples": len(error),
            }
            if len(error):
                row |= {
                    f"bias_{unit}": error.mean(),
                    f"max_{unit}": abs(error).max(),
                    "correlation": correlation(x, y),
                    "missing": np.mean(~answered[known, k]),
                }
                if wrench.sd is not None:
                    # NaN lies in no band.
                    inside = abs(wrench.known[known, k] - y) <= Z_95 * wrench.sd[known, k]
                    row["band_share"] = inside.mean()
            rows.append(row)
    return tidy(rows, WRENCH_SCHEMA)


#: Columns where contacts are judged: one row a list.
#:
#: Rows neither credited to a true contact nor false alarms are pieces of one, or its echo.
CONTACT_SCHEMA: Schema = {
    "recording": pl.String,
    "observer": pl.String,
    "reference": pl.String,
    "contacts": pl.Int64,
    "listed_contacts": pl.Int64,
    "found_contacts": pl.Int64,
    "missed_contacts": pl.Int64,
    "false_alarms": pl.Int64,
    "false_alarms_per_h": pl.Float64,
    "detection_delay_s": pl.Float64,
    "longest_delay_s": pl.Float64,
}


def with_contacts(
    errors: pl.DataFrame, recording: str, reference: str, of: Detection
) -> pl.DataFrame:
    """The errors, and below them one row on the list of contacts."""
    counts = of.contacts, of.listed, of.found, of.missed, of.false_alarms
    delays = of.false_alarms_per_h, of.mean_delay, of.longest_delay
    row = (recording, BEST, reference, *counts, *delays)
    rows = [dict(zip(CONTACT_SCHEMA, row, strict=True))]
    return pl.concat([errors, tidy(rows, CONTACT_SCHEMA)], how="diagonal")


class JacobianJudgement(NamedTuple):
    """A vendor's torques beside a sensor, by a log without positions."""

    log: JacobianLog  #: The log.
    errors: pl.DataFrame  #: The tidy error table.
    remarks: tuple[Remark, ...]  #: Limits of the numbers.


def judge_jacobian(
    log: JacobianLog, asked: WrenchChoice | None, reference: str | None
) -> JacobianJudgement:
    """Errors of the vendor's torques, and of their wrench if asked, by the sensor.

    The wrench is in the axes and about the point of the log's own Jacobian; the sensor's
    axes, their order and signs, are fitted to it.
    """
    zero = asked.zero if asked else ZeroChoice()
    if asked is not None and asked != WrenchChoice(zero=ZeroChoice(spans=zero.spans)):
        raise ParameterError(
            f"{log.name}: the log has no positions, so its wrench is least squares in the axes of "
            "its own Jacobian: of the wrench's options it takes only --zero A:B"
        )
    if reference != "sensor":
        raise ReferenceTorqueError(
            f"{log.name}: the log has no positions; its torques can be compared with its sensor "
            "alone: --reference sensor"
        )
    if log.wrench is None:
        raise MissingSignalError(
            f"{log.name}: the log has no wrench of a sensor to compare with. Name its columns with "
            "--columns, as in wrench=fx|fy|fz|mx|my|mz"
        )
    sigma = decompose(log.jacobian).sigma_min
    values = unloaded(log, wrench_of(log.tau_ext, log.jacobian)[0], zero)
    ours = Wrench(name="vendor", t=log.t, values=values, frame="jacobian", sigma_min=sigma)
    least = sigma.min()
    remarks = [caution("logged-jacobian", sigma_min_m=least)]
    if least < LEAST_SIGMA:
        near = "logged-jacobian-near-singular"
        remarks.append(caution(near, sigma_min_m=least, limit_m=LEAST_SIGMA))
    fit = fit_axes(ours.force, log.wrench[:, :3])
    # Offsets do not show axes, and without a contact nothing does.
    known = fit.correlation > RESEMBLES
    turned = log.wrench.reshape(-1, 2, 3) @ (fit.matrix if known else np.eye(3))
    values = unloaded(log, turned.reshape(-1, 6), zero)
    remarks.append(
        fact("sensor-axes-fitted", axes=fit.words, correlation=fit.correlation)
        if known
        else caution("sensor-axes-unknown", correlation=fit.correlation)
    )
    tau = np.einsum("tij,ti->tj", log.jacobian, values)
    vendor = ExternalTorque(name="vendor", t=log.t, tau=log.tau_ext)
    errors = evaluate(log.name, [vendor], ExternalTorque(name="sensor", t=log.t, tau=tau))
    if asked is not None:
        sensor = Wrench(name="sensor", t=log.t, values=values, frame="jacobian")
        rows = evaluate_wrenches(log.name, [ours], sensor)
        errors = pl.concat([errors, rows], how="diagonal")
    return JacobianJudgement(log, errors, tuple(remarks))


def unloaded(log: JacobianLog, values: Array, zero: ZeroChoice) -> Array:
    """A wrench less its mean over the first unloaded span, if given. (T, 6)"""
    if not zero.spans:
        return values
    inside = within(log.t, zero.spans[:1])
    if not inside.any():
        where = interval_text(*zero.spans[0])
        raise ParameterError(f"{log.name}: --zero {where} holds no sample of the log")
    return np.asarray(values - values[inside].mean(axis=0))


class ReferenceLoad(NamedTuple):
    """Reference torque and wrench on the log's clock."""

    torque: ExternalTorque  #: The reference torque of every joint.
    #: Its wrench, in base axes about the flange point, as force on the robot; None for a
    #: reference that is a torque.
    wrench: Wrench | None = None


def load_of(
    wrench: Wrench, recording: Recording, robot: Robot, name: str, remark: Remark
) -> ReferenceLoad:
    """A wrench in base axes about the flange point, and its joint torque."""
    J = flange_jacobian(robot.chain, recording.q)
    tau, remarks = np.einsum("tij,ti->tj", J, wrench.values), (remark, *wrench.remarks)
    torque = ExternalTorque(name=name, t=recording.t, tau=tau, remarks=remarks)
    return ReferenceLoad(torque=torque, wrench=wrench)


def make_reference(
    motion: FreeMotion, choice: ReferenceChoice, mounting: Mounting = NOTHING
) -> ReferenceLoad:
    """The reference asked for, on the clock of the log.

    No contact, and the vendor's estimate, have an unknown error.
    """
    name, log, robot = choice.name, motion.log.recording, motion.log.robot
    if choice.path is not None:
        return file_reference(choice.path, log, robot, mounting, choice.columns)
    if name == "two-cycle":
        return ReferenceLoad(two_cycle_reference(motion))
    remark = caution(f"reference-{name}")
    if name == "sensor":
        return load_of(logged_wrench(log, robot.chain, mounting), log, robot, name, remark)
    tau = np.zeros(log.q.shape) if name == "zero" else log.require("tau_ext")
    return ReferenceLoad(ExternalTorque(name=name, t=log.t, tau=tau, remarks=(remark,)))


def file_reference(
    path: Path,
    recording: Recording,
    robot: Robot,
    mounting: Mounting,
    columns: str | None = None,
) -> ReferenceLoad:
    """External torque, wrench or both from a table on the log's own clock.

    A file without torques gives those of its wrench, Jᵀ w, in base axes about the flange
    unless its columns have ``wrench[FRAME]=…``.
    """
    table = read_reference(path, columns)
    # The recording counts from its first sample, a reference file from the log's zero.
    table = replace(table, stamps=table.stamps - recording.source.t0)
    return table_reference(table, path, recording, robot, mounting)


def table_reference(
    table: RawLog, path: Path, recording: Recording, robot: Robot, mounting: Mounting
) -> ReferenceLoad:
    """A file's reference at the log's times, its own from the first sample."""
    t, name = table.stamps, f"file:{path.name}"
    wrench = None
    if (values := table.signals.get("wrench")) is not None:
        values = on_the_logs_clock(t, values, recording, path)
        frame = table.wrench_frame or WrenchFrame("base", "flange")
        given = replace(recording, wrench=values, wrench_frame=frame)
        # Zero throughout is the truth of a log that nobody touched.
        wrench = in_base_axes(given, robot.chain, mounting)
    if (tau := table.signals.get("tau_ext")) is None:
        if wrench is None:
            raise ReferenceTorqueError(f"{path}: it holds neither a torque nor a wrench")
        remark = caution("reference-wrench-file", file=path.name)
        return load_of(wrench, recording, robot, name, remark)
    if tau.shape[1] != recording.joints:
        raise ReferenceTorqueError(
            f"{path}: {tau.shape[1]} torque columns for a log of {recording.joints} joints"
        )
    tau = on_the_logs_clock(t, tau, recording, path)
    covered = np.count_nonzero(np.isfinite(tau[:, 0]))
    remark = caution("reference-file", file=path.name, covered=covered, samples=recording.samples)
    torque = ExternalTorque(name=name, t=recording.t, tau=tau, remarks=(remark,))
    return ReferenceLoad(torque=torque, wrench=wrench)


def since_start(t: Array, recording: Recording) -> Array:
    """Times of a file [s] from the log's first sample, on either clock.

    They are on the log's own clock if that matches more of the log's stamps, or if none
    match either way and they overlap it.
    """
    zero = recording.source.t0
    stamps = np.round(recording.t, 6)
    own, counted = (np.count_nonzero(np.isin(np.round(x, 6), stamps)) for x in (t - zero, t))
    overlaps = bool(t[0] <= zero + recording.t[-1] and t[-1] >= zero)
    return t - zero if own > counted or (own == counted and overlaps) else t


def on_the_logs_clock(t: Array, columns: Array, recording: Recording, path: Path) -> Array:
    """Columns (M, k) at times [s], interpolated to the log's, NaN beyond. (T, k)"""
    # Half a sample: two programs round one clock differently.
    slack = 0.5 * recording.median_step
    inside = (recording.t >= t[0] - slack) & (recording.t <= t[-1] + slack)
    if not inside.any():
        start = recording.source.t0
        raise ReferenceTorqueError(
            f"{path}: its clock ({t[0] + start:g} to {t[-1] + start:g} s) does not overlap the "
            f"log's ({recording.t[0] + start:g} to {recording.t[-1] + start:g} s); both must be "
            "the log's own clock"
        )
    there = resample_columns(recording.t, t, columns)
    return np.where(inside[:, None], there, np.nan)


def judge(
    motion: FreeMotion,
    estimates: Sequence[ExternalTorque],
    sensed: SensorReading | None,
    choice: ReferenceChoice,
    listed: Sequence[ContactInterval] | None = None,
) -> tuple[ExternalTorque, pl.DataFrame, SensorReading | None]:
    """The chosen reference, and errors of estimates and of their wrenches, if any.

    Contacts are compared where they are `listed`.

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
        rows = evaluate_wrenches(recording.name, sensed.wrenches, sensed.reference or theirs)
        errors = pl.concat([errors, rows], how="diagonal")
    if listed is not None:
        found = judge_contacts(listed, reference)
        errors = with_contacts(errors, recording.name, reference.name, found)
    return reference, errors, sensed


def reference_wrench(
    recording: Recording, robot: Robot, reference: ReferenceLoad, sensor: VirtualSensor
) -> Wrench:
    """The reference's wrench in the virtual sensor's frame.

    A sensor's or a file's stays; any other reference is a torque, solved by least squares.
    """
    torque = reference.torque
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
