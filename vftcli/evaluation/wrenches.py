"""Errors of wrenches and of contacts below the joints'; a log with a Jacobian of its own."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.evaluation.errors import SCHEMA, correlation, evaluate, number, rmse
from vftcli.free_motion.free_motion import within
from vftcli.readers.references import JacobianLog
from vftcli.signals.arrays import Array
from vftcli.signals.errors import MissingSignalError, ParameterError, ReferenceTorqueError
from vftcli.signals.external_torque import COVERS, ExternalTorque
from vftcli.signals.option import interval_text
from vftcli.signals.remarks import Remark, caution, fact
from vftcli.signals.wrench import AXES, Wrench
from vftcli.wrench.choice import WrenchChoice, ZeroChoice
from vftcli.wrench.detection import ContactScore
from vftcli.wrench.sensor import RESEMBLES, fit_axes
from vftcli.wrench.solvers import LEAST_SIGMA, decompose, null_space, wrench_of

#: Columns where wrenches are compared: `axis` fx…mz, `joint` null; forces fill rmse_N.
#:
#: `band_share` is the share of the samples with a 95 % band that holds the reference,
#: `missing` that without an answer where the pose can tell one, which counts as the
#: answer 0.
WRENCH_SCHEMA: dict[str, type[pl.DataType]] = {
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
                f"rmse_{unit}": number(overall[k]),
                "reference": reference.name,
                "samples": len(error),
            }
            if len(error):
                row |= {
                    f"bias_{unit}": number(error.mean()),
                    f"max_{unit}": number(abs(error).max()),
                    "correlation": number(correlation(x, y)),
                    "missing": float(np.mean(~answered[known, k])),
                }
                if wrench.sd is not None:
                    # An error of NaN lies in no band.
                    inside = abs(wrench.known[known, k] - y) <= COVERS * wrench.sd[known, k]
                    row["band_share"] = float(inside.mean())
            rows.append(row)
    return pl.DataFrame(rows, schema=WRENCH_SCHEMA)


#: Columns where contacts are judged: one row an observer; `signal` is "torque", "wrench"
#: or "list".
#:
#: One to one: of the true contacts some are found; of those missed some are merged, which
#: run into others. Rows that are neither credited nor false alarms are splits.
CONTACT_SCHEMA: dict[str, type[pl.DataType]] = {
    "recording": pl.String,
    "observer": pl.String,
    "reference": pl.String,
    "signal": pl.String,
    "contacts": pl.Int64,
    "listed_contacts": pl.Int64,
    "found_contacts": pl.Int64,
    "missed_contacts": pl.Int64,
    "merged_contacts": pl.Int64,
    "split_contacts": pl.Int64,
    "false_alarms": pl.Int64,
    "false_alarms_per_h": pl.Float64,
    "detection_delay_s": pl.Float64,
    "longest_delay_s": pl.Float64,
}


def with_contacts(
    errors: pl.DataFrame, recording: str, reference: str, contacts: Iterable[ContactScore]
) -> pl.DataFrame:
    """The errors, and below them one row an observer: how it tells contacts."""
    rows = [
        (
            *(recording, score.name, reference, score.signal),
            *(of.contacts, of.listed, of.found, of.missed, of.merged, of.split, of.false_alarms),
            *map(number, (of.false_alarms_per_h, of.mean_delay, of.longest_delay)),
        )
        for score in contacts
        for of in (score.detection,)
    ]
    table = pl.DataFrame(rows, schema=CONTACT_SCHEMA, orient="row")
    return pl.concat([errors, table], how="diagonal")


VENDOR, SENSOR = "vendor", "sensor"
#: The frame of such a wrench: axes and point of the log's Jacobian.
AXES_OF_LOG = "jacobian"


class Compared(NamedTuple):
    """One source of torque on the robot and the wrench that goes with it."""

    torque: ExternalTorque
    wrench: Wrench


@dataclass(frozen=True, kw_only=True)
class JacobianJudgement:
    """Wrenches and errors by a log of torques and a Jacobian."""

    log: JacobianLog  #: The log.
    vendor: Compared  #: The vendor's torques, and their wrench through the Jacobian.
    #: The sensor's wrench, and its torques, or None where nothing is compared.
    sensor: Compared | None
    errors: pl.DataFrame | None  #: The tidy error table, None where nothing is compared.
    remarks: tuple[Remark, ...]  #: Limits of the numbers.


def judge_jacobian(
    log: JacobianLog, asked: WrenchChoice | None, reference: str | None
) -> JacobianJudgement:
    """Wrench of the vendor's torques, compared with the sensor's if asked."""
    zero = asked.zero if asked is not None else ZeroChoice()
    if asked is not None and asked != WrenchChoice(zero=ZeroChoice(spans=zero.spans)):
        raise ParameterError(
            f"{log.name}: the log has no positions, so its wrench is least squares in the axes of "
            "its own Jacobian: of the wrench's options it takes only --zero A:B"
        )
    if reference not in {None, SENSOR}:
        raise ReferenceTorqueError(
            f"{log.name}: the log has no positions; its torques can be compared with its "
            f"{SENSOR} alone: --reference {SENSOR}"
        )
    parts = decompose(log.jacobian)
    sigma, loose = parts.sigma_min, null_space(parts, log.tau_ext[:, :, None])[:, :, 0]
    wrench = Wrench(
        name=VENDOR,
        t=log.t,
        values=unloaded(log, wrench_of(log.tau_ext, log.jacobian).values, zero),
        frame=AXES_OF_LOG,
        sigma_min=sigma,
        null_space=np.linalg.norm(loose, axis=1) if log.tau_ext.shape[1] > 6 else None,
    )
    least = float(sigma.min())
    remarks: tuple[Remark, ...] = (caution("logged-jacobian", sigma_min_m=least),)
    if least < LEAST_SIGMA:
        remarks += (
            caution("logged-jacobian-near-singular", sigma_min_m=least, limit_m=LEAST_SIGMA),
        )
    vendor = Compared(ExternalTorque(name=VENDOR, t=log.t, tau=log.tau_ext), wrench)
    if reference is None:
        return JacobianJudgement(log=log, vendor=vendor, sensor=None, errors=None, remarks=remarks)
    sensor, fitted = sensor_of(log, wrench, zero)
    errors = evaluate(log.name, [vendor.torque], sensor.torque)
    if asked is not None:
        rows = evaluate_wrenches(log.name, [wrench], sensor.wrench)
        errors = pl.concat([errors, rows], how="diagonal")
    remarks = (*remarks, fitted)
    return JacobianJudgement(log=log, vendor=vendor, sensor=sensor, errors=errors, remarks=remarks)


def sensor_of(log: JacobianLog, ours: Wrench, zero: ZeroChoice) -> tuple[Compared, Remark]:
    """Sensor's wrench in the Jacobian's axes, order and signs fitted; torques."""
    if log.wrench is None:
        raise MissingSignalError(
            f"{log.name}: the log has no wrench of a sensor to compare with. Name its columns with "
            "--columns, as in wrench=fx|fy|fz|mx|my|mz"
        )
    fit = fit_axes(ours.force, log.wrench[:, :3])
    # Offsets do not tell axes, and without a contact nothing does.
    known = fit.correlation > RESEMBLES
    turn = fit.matrix if known else np.eye(3)
    values = log.wrench.reshape(-1, 2, 3) @ turn
    values = unloaded(log, values.reshape(-1, 6), zero)
    wrench = replace(ours, name=SENSOR, values=values, sigma_min=None, null_space=None)
    tau = np.einsum("tij,ti->tj", log.jacobian, values)
    remark = (
        fact("sensor-axes-fitted", axes=fit.words, correlation=fit.correlation)
        if known
        else caution("sensor-axes-unknown", correlation=fit.correlation)
    )
    return Compared(ExternalTorque(name=SENSOR, t=log.t, tau=tau), wrench), remark


def unloaded(log: JacobianLog, values: Array, zero: ZeroChoice) -> Array:
    """A wrench less its mean over the first unloaded span, where one is given. (T, 6)"""
    if not zero.spans:
        return values
    inside = within(log.t, zero.spans[:1])
    if not inside.any():
        where = interval_text(*zero.spans[0])
        raise ParameterError(f"{log.name}: --zero {where} holds no sample of the log")
    return np.asarray(values - values[inside].mean(axis=0))
