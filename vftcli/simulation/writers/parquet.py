"""Flat Parquet tables: the log under our own column names, and the truth file."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.columns import StatedFrame, described_schema
from vftcli.simulation.experiment import AXES, Simulation, Truth
from vftcli.simulation.writers.signals import joint_signals

TRUTH_FRAME = "base axes, moment about the flange point"  #: Of the truth's wrench.
#: Of the wrench of one contact elsewhere on the arm.
AT_CONTACT = "base axes, moment about the point that is touched"


def write_parquet(path: Path, simulation: Simulation) -> None:
    """Write the log as one flat table, `t`, `q/1`, `dq/1` and so on."""
    rows = np.array(simulation.measured.rows)
    start = simulation.scenario.sensing.start
    columns: dict[str, Array] = {"t": simulation.measured.stamp + start}
    for name, values in joint_signals(simulation).items():
        labels = AXES if name == "wrench" else tuple(map(str, range(1, values.shape[1] + 1)))
        columns |= {f"{name}/{a}": c for a, c in zip(labels, values.T, strict=True)}
    write_columns(path, {name: values[rows] for name, values in columns.items()})


def write_truth(path: Path, truth: Truth, start: float) -> None:
    """Write the truth beside a log whose first stamp is `start` [s]: the same clock."""
    columns = truth.columns()
    touched = {name.rpartition("/")[0] for name in columns if name.startswith("contact/")}
    frames = {"wrench": StatedFrame(TRUTH_FRAME)} | dict.fromkeys(touched, StatedFrame(AT_CONTACT))
    write_columns(path, columns | {"t": columns["t"] + start}, frames)


def write_columns(
    path: Path, columns: dict[str, Array], frames: Mapping[str, StatedFrame] | None = None
) -> None:
    """Write named columns (M,) of doubles as one Parquet table; wrenches have these frames."""
    import polars as pl

    table = pl.DataFrame(columns)
    schema = described_schema(table, frames)
    table.write_parquet(path, compression="zstd", arrow_schema=schema)
