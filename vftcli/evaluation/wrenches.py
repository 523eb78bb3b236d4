"""Errors of wrenches against a reference wrench: rows below the joints'."""

from collections.abc import Iterable

import numpy as np
import polars as pl

from vftcli.evaluation.errors import SCHEMA, correlation, number, rmse
from vftcli.signals.external_torque import COVERS
from vftcli.signals.wrench import AXES, Wrench
from vftcli.virtual_sensor.detection import ContactScore
from vftcli.virtual_sensor.sensor_reading import SensorReading

#: Columns where wrenches are compared: `axis` fx…mz, `joint` null; forces fill rmse_N.
#:
#: `band_share` is the share of the samples with a 95 % band that holds the reference, `missing`
#: that without an answer where the pose can tell one, which counts as the answer 0.
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
    """One row per observer and axis, over the samples where the reference is known.

    Args:
        recording: The log's name, for the first column.
        wrenches: The observers' wrenches, on the reference's clock and in its frame.
        reference: What they are judged by.
    """
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
                    f"max_{unit}": number(np.max(np.abs(error))),
                    "correlation": number(correlation(x, y)),
                    "missing": float(np.mean(~answered[known, k])),
                }
                if wrench.sd is not None:
                    # An error of NaN lies in no band.
                    inside = np.abs(wrench.known[known, k] - y) <= COVERS * wrench.sd[known, k]
                    row["band_share"] = float(np.mean(inside))
            rows.append(row)
    return pl.DataFrame(rows, schema=WRENCH_SCHEMA)


def with_wrenches(errors: pl.DataFrame, recording: str, sensed: SensorReading) -> pl.DataFrame:
    """The joints' errors, then the wrenches' if a reference wrench is known."""
    if sensed.reference is None:
        return errors
    rows = evaluate_wrenches(recording, sensed.wrenches, sensed.reference)
    return pl.concat([errors, rows], how="diagonal")


#: Columns where contacts are judged: one row an observer; `signal` is "torque", "wrench" or "list".
#:
#: One to one: of the true contacts some are found; of those missed some are merged, which run into
#: others. Rows that are neither credited nor false alarms are splits.
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
