"""A vendor's torques through a log's own Jacobian, beside its sensor."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.evaluation.errors import evaluate
from vftcli.evaluation.wrenches import evaluate_wrenches
from vftcli.readers.references import JacobianLog
from vftcli.signals.arrays import Array
from vftcli.signals.errors import MissingSignalError, ParameterError, ReferenceTorqueError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.parsing import interval_text
from vftcli.signals.remarks import Remark, caution, fact
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.choice import WrenchChoice, ZeroChoice
from vftcli.virtual_sensor.sensor import RESEMBLES, fit_axes
from vftcli.virtual_sensor.solvers import LEAST_SIGMA, decompose, null_space, wrench_of

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
    sigma, loose = parts.sigma_min, null_space(parts, log.tau_ext)
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
    start, stop = zero.spans[0]
    inside = (log.t >= start) & (log.t <= stop)
    if not inside.any():
        where = interval_text(start, stop)
        raise ParameterError(f"{log.name}: --zero {where} holds no sample of the log")
    less: Array = values - values[inside].mean(axis=0)
    return less
