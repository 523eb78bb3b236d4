"""Errors of wrenches and contacts; a log with its own Jacobian."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.evaluation.errors import SCHEMA, Schema, correlation, evaluate, rmse, tidy
from vftcli.free_motion.free_motion import within
from vftcli.readers.references import JacobianLog
from vftcli.signals.arrays import Z_95, Array
from vftcli.signals.errors import MissingSignalError, ParameterError, ReferenceTorqueError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.option import interval_text
from vftcli.signals.remarks import Remark, caution, fact
from vftcli.signals.wrench import AXES, Wrench
from vftcli.wrench import WrenchChoice, ZeroChoice
from vftcli.wrench.detection import ContactScore
from vftcli.wrench.sensor import RESEMBLES, fit_axes
from vftcli.wrench.solvers import LEAST_SIGMA, decompose, wrench_of

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


#: Columns where contacts are judged: one row an observer; `signal` is "torque", "wrench"
#: or "list".
#:
#: Rows neither credited to a true contact nor false alarms are pieces of one, or its echo.
CONTACT_SCHEMA: Schema = {
    "recording": pl.String,
    "observer": pl.String,
    "reference": pl.String,
    "signal": pl.String,
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
    errors: pl.DataFrame, recording: str, reference: str, contacts: Iterable[ContactScore]
) -> pl.DataFrame:
    """The errors, and below them one row an observer on its contacts."""
    rows = []
    for score in contacts:
        of, own = score.detection, (recording, score.name, reference, score.signal)
        counts = of.contacts, of.listed, of.found, of.missed, of.false_alarms
        row = (*own, *counts, of.false_alarms_per_h, of.mean_delay, of.longest_delay)
        rows.append(dict(zip(CONTACT_SCHEMA, row, strict=True)))
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
    zero = asked.zero if asked is not None else ZeroChoice()
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
