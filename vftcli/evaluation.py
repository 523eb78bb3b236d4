"""Errors of estimates against a reference: one tidy table, the unit in each column's name."""

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from vftcli.arrays import Array
from vftcli.errors import ShapeError
from vftcli.torque import ExternalTorque
from vftcli.wrench.wrench import AXES, Wrench

if TYPE_CHECKING:
    from vftcli.wrench.measurement import Measurement

SCHEMA: dict[str, type[pl.DataType]] = {
    "recording": pl.String,
    "observer": pl.String,
    "joint": pl.Int64,
    "rmse_Nm": pl.Float64,
    "bias_Nm": pl.Float64,
    "max_Nm": pl.Float64,
    "correlation": pl.Float64,
    "reference": pl.String,
    "reference_floor_Nm": pl.Float64,
    "samples": pl.Int64,
}
"""Columns of the errors table; `joint` counts from 1."""


def rmse(estimate: Array, reference: Array) -> Array:
    """Root-mean-square error per joint over the samples where both are finite. (n,)

    Raises:
        ShapeError: If the two have different shapes.
    """
    if estimate.shape != reference.shape:
        raise ShapeError(f"estimate {estimate.shape} against reference {reference.shape}")
    error = estimate - reference
    known = np.isfinite(error)
    count = np.count_nonzero(known, axis=0)
    total = np.sum(np.where(known, error, 0.0) ** 2, axis=0)
    result: Array = np.sqrt(np.where(count > 0, total / np.maximum(count, 1), np.nan))
    return result


def correlation(x: Array, y: Array) -> float:
    """Pearson's correlation of two series, NaN where one of them does not vary."""
    x, y = x - x.mean(), y - y.mean()
    power = float(np.sqrt(np.sum(x**2) * np.sum(y**2)))
    return float(np.sum(x * y)) / power if power > 0 else float("nan")


def evaluate(
    recording: str, estimates: Iterable[ExternalTorque], reference: ExternalTorque
) -> pl.DataFrame:
    """One row per observer and joint, over the samples where both are known.

    Args:
        recording: The log's name, for the first column.
        estimates: The observers' estimates, on the reference's clock.
        reference: What they are judged by; its `floor` stands beside every error.
    """
    rows = []
    for estimate in estimates:
        overall = rmse(estimate.tau, reference.tau)
        for j in range(estimate.joints):
            x, y = estimate.tau[:, j], reference.tau[:, j]
            known = np.isfinite(x) & np.isfinite(y)
            error = (x - y)[known]
            some = len(error) > 0
            rows.append(
                {
                    "recording": recording,
                    "observer": estimate.name,
                    "joint": j + 1,
                    "rmse_Nm": number(overall[j]),
                    "bias_Nm": number(error.mean()) if some else None,
                    "max_Nm": number(np.max(np.abs(error))) if some else None,
                    "correlation": number(correlation(x[known], y[known])) if some else None,
                    "reference": reference.name,
                    "reference_floor_Nm": (
                        number(reference.floor[j]) if reference.floor is not None else None
                    ),
                    "samples": len(error),
                }
            )
    return pl.DataFrame(rows, schema=SCHEMA)


WRENCH_SCHEMA: dict[str, type[pl.DataType]] = {
    **SCHEMA,
    "axis": pl.String,
    "rmse_N": pl.Float64,
    "bias_N": pl.Float64,
    "max_N": pl.Float64,
}
"""Columns where wrenches are compared: `axis` fx…mz, `joint` null; forces fill rmse_N."""


def evaluate_wrenches(
    recording: str, wrenches: Iterable[Wrench], reference: Wrench
) -> pl.DataFrame:
    """One row per observer and axis, over the samples where the pose can tell both.

    Args:
        recording: The log's name, for the first column.
        wrenches: The observers' wrenches, on the reference's clock and in its frame.
        reference: What they are judged by.
    """
    rows: list[dict[str, object]] = []
    for wrench in wrenches:
        overall = rmse(wrench.known, reference.known)
        for k, axis in enumerate(AXES):
            x, y = wrench.known[:, k], reference.known[:, k]
            known = np.isfinite(x) & np.isfinite(y)
            error, unit = (x - y)[known], "N" if k < 3 else "Nm"
            some = len(error) > 0
            rows.append(
                {
                    "recording": recording,
                    "observer": wrench.name,
                    "axis": axis,
                    f"rmse_{unit}": number(overall[k]),
                    f"bias_{unit}": number(error.mean()) if some else None,
                    f"max_{unit}": number(np.max(np.abs(error))) if some else None,
                    "correlation": number(correlation(x[known], y[known])) if some else None,
                    "reference": reference.name,
                    "samples": len(error),
                }
            )
    return pl.DataFrame(rows, schema=WRENCH_SCHEMA)


def with_wrenches(errors: pl.DataFrame, recording: str, sensed: "Measurement") -> pl.DataFrame:
    """The joints' errors, and below them the wrenches' where a reference wrench is known."""
    if sensed.reference is None:
        return errors
    rows = evaluate_wrenches(recording, sensed.wrenches, sensed.reference)
    return pl.concat([errors, rows], how="diagonal")


def number(value: float) -> float | None:
    """A finite number, or None, which tables and JSON can hold."""
    return float(value) if np.isfinite(value) else None
