"""estimates.parquet and its CSV: flat columns that every plotting tool can read."""

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vftcli.analysis import Analysis
from vftcli.arrays import Array

if TYPE_CHECKING:
    import polars as pl


def estimates_table(analysis: Analysis) -> "pl.DataFrame":
    """Time, motion, every observer's torque and the reference's, one flat column each.

    Columns: ``t`` [s]; ``q/1``… [rad]; ``dq/1``… [rad/s]; ``tau_ext/<observer>/1``… [N·m];
    ``sd/<observer>/1``… [N·m] where the observer gives one; ``tau_ext/reference/1``… [N·m].
    What is not known is null.
    """
    import polars as pl

    table = pl.DataFrame(dict(columns(analysis)))
    unknown = [s.name for s in table if s.dtype == pl.Float64 and s.is_nan().any()]
    return table.with_columns(pl.col(unknown).fill_nan(None)) if unknown else table


def columns(analysis: Analysis) -> Iterator[tuple[str, Array]]:
    """Name and values of every column, in order."""
    recording = analysis.recording
    yield "t", recording.t
    yield from per_joint("q", recording.q)
    if recording.dq is not None:
        yield from per_joint("dq", recording.dq)
    for estimate in analysis.estimates:
        yield from per_joint(f"tau_ext/{estimate.name}", estimate.tau)
        if estimate.sd is not None:
            yield from per_joint(f"sd/{estimate.name}", estimate.sd)
    if analysis.reference is not None:
        yield from per_joint("tau_ext/reference", analysis.reference.tau)
        if analysis.reference.sd is not None:
            yield from per_joint("sd/reference", analysis.reference.sd)


def per_joint(name: str, values: Array) -> Iterator[tuple[str, Array]]:
    """One contiguous column a joint, named from 1."""
    for j, column in enumerate(np.ascontiguousarray(values.T), start=1):
        yield f"{name}/{j}", column


def write_estimates(path: Path, analysis: Analysis) -> None:
    """Write the table as Parquet (zstd)."""
    table = estimates_table(analysis)
    table.write_parquet(path, compression="zstd", compression_level=1, statistics=False)


def write_csv(path: Path, analysis: Analysis) -> None:
    """Write the table as CSV with nine significant digits after the point; unknown is empty."""
    estimates_table(analysis).write_csv(path, float_precision=9)
