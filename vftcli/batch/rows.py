"""Rows of a batch: a log × observer × joint or axis, in fixed columns."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import polars as pl

from vftcli.analysis import Analysis
from vftcli.evaluation import WRENCH_SCHEMA
from vftcli.outputs.believability import grounds, health
from vftcli.signals.arrays import Array
from vftcli.signals.wrench import AXES

#: Columns with one value a log.
OF_LOG: dict[str, Any] = {
    "robot": pl.String,
    "samples": pl.Int64,
    "duration_s": pl.Float64,
    "rate_hz": pl.Float64,
    "health": pl.String,
    "reason": pl.String,
    "findings": pl.List(pl.String),
    "contacts": pl.Int64,
    "load": pl.Boolean,
    "hardest_N": pl.Float64,
    "hardest_band_N": pl.Float64,
    "hardest_s": pl.Float64,
    "told_N": pl.Float64,
}
#: Which estimate, and its size: root mean square, and what 99 % of |τ̂| stay below.
OF_ESTIMATE: dict[str, Any] = {
    "observer": pl.String,
    "joint": pl.Int64,
    "axis": pl.String,
    "rms_Nm": pl.Float64,
    "p99_Nm": pl.Float64,
    "rms_N": pl.Float64,
    "p99_N": pl.Float64,
}
COMPARED = "compared_samples"  #: Samples of a comparison; `samples` are the log's.
#: Columns of the errors, as `vftcli compare --json` has them; null without a reference.
OF_ERROR: dict[str, Any] = {
    COMPARED if name == "samples" else name: kind
    for name, kind in WRENCH_SCHEMA.items()
    if name not in {"recording", *OF_ESTIMATE}
}
#: Columns of a log's rows.
SCHEMA: dict[str, Any] = {"key": pl.String, **OF_LOG, **OF_ESTIMATE, **OF_ERROR}
JOINED = ("observer", "joint", "axis")  #: By which an estimate and its error belong together.


def rows_of(analysis: Analysis, key: str) -> pl.DataFrame:
    """The rows of one log; a single one without an observer where none ran."""
    sizes = pl.DataFrame(list(estimate_sizes(analysis)), schema=OF_ESTIMATE)
    if analysis.errors is not None:
        others = pl.all().exclude("recording", "samples")
        errors = analysis.errors.select(others, pl.col("samples").alias(COMPARED))
        missing = [name for name in (*JOINED, *OF_ERROR) if name not in errors.columns]
        kinds = {**OF_ESTIMATE, **OF_ERROR}
        errors = errors.with_columns(pl.lit(None, kinds[name]).alias(name) for name in missing)
        order = {"how": "full", "coalesce": True, "nulls_equal": True}
        sizes = sizes.join(errors, on=JOINED, maintain_order="left_right", **order)  # type: ignore[arg-type]
    if sizes.is_empty():
        sizes = pl.DataFrame({"observer": [None]})
    told = {"key": key, **log_facts(analysis)}
    of_log = [pl.lit(value, SCHEMA[name]).alias(name) for name, value in told.items()]
    absent = [pl.lit(None, kind).alias(n) for n, kind in SCHEMA.items() if n not in sizes.columns]
    return (
        sizes.with_columns(absent)
        .with_columns(of_log)
        .select(pl.col(n).cast(kind) for n, kind in SCHEMA.items())
    )


def log_facts(analysis: Analysis) -> dict[str, Any]:
    """Facts of a log as a whole, by the names of `OF_LOG`."""
    recording, found = analysis.recording, analysis.contacts
    worst = health(grounds(analysis))
    codes = [f.code for one in analysis.examinations[:1] for f in one.warnings]
    facts: dict[str, Any] = {
        "robot": analysis.robot.name,
        "samples": recording.samples,
        "duration_s": recording.duration,
        "rate_hz": 1.0 / recording.median_step if recording.samples > 1 else None,
        "health": worst.standing,
        "reason": f"{worst.subject}: {worst.sentence}" if worst.standing != "good" else "sound",
        "findings": list(dict.fromkeys(codes)),
    }
    if found is None:
        return facts
    hardest = found.hardest
    return facts | {
        "contacts": len(found.contacts),
        "load": any(contact.is_load for contact in found.contacts),
        "hardest_N": None if hardest is None else hardest.peak_force,
        "hardest_band_N": None if hardest is None else hardest.peak_band,
        "hardest_s": None if hardest is None else hardest.peak,
        "told_N": found.detectable_force,
    }


def estimate_sizes(analysis: Analysis) -> Iterator[dict[str, Any]]:
    """Size of each estimate, a row per observer and joint, then per axis."""
    for estimate in analysis.estimates:
        for joint, column in enumerate(estimate.tau.T, start=1):
            rms, most = size_of(column)
            yield {"observer": estimate.name, "joint": joint, "rms_Nm": rms, "p99_Nm": most}
    sensed = analysis.virtual_sensor
    for wrench in sensed.wrenches if sensed is not None else ():
        for k, axis in enumerate(AXES):
            rms, most = size_of(wrench.known[:, k])
            unit = "N" if k < 3 else "Nm"
            row = {"observer": wrench.name, "axis": axis}
            yield {**row, f"rms_{unit}": rms, f"p99_{unit}": most}


def size_of(values: Array) -> tuple[float | None, float | None]:
    """Root mean square, and the 99 % quantile of the size, of what is known; None of nothing."""
    known = np.abs(values[np.isfinite(values)])
    if not len(known):
        return None, None
    return float(np.sqrt(np.mean(known**2))), float(np.quantile(known, 0.99))
