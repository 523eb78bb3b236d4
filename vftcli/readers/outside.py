"""What other programs write: their estimates, their lists of contacts, a log in several files."""

from collections.abc import Iterable, Mapping
from itertools import count, takewhile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vftcli.readers.delimited import TextTable
from vftcli.readers.opening import open_log
from vftcli.readers.parquet import ParquetTable
from vftcli.readers.reader import ReadChoice
from vftcli.readers.references import TORQUE
from vftcli.readers.table import Cell, Pick, Picks, Table, listed
from vftcli.readers.tables import load_signals
from vftcli.signals.arrays import Array, check_clock
from vftcli.signals.errors import LogError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.wrench import AXES


def read_outside(path: Path, name: str) -> tuple[ExternalTorque, Array | None]:
    """Torque and wrench (T, 6) or None of another program's file, at its own stamps.

    Its columns are t, tau_ext/1…, band/1… (one standard deviation), wrench/fx… (force and
    moment on the robot, base axes); a file of `vftcli estimate` has them as
    tau_ext/NAME/1…. NaN is no answer.
    """
    file = open_log(path)
    table: Table = ParquetTable(file) if file.head.startswith(b"PAR1") else TextTable(file)
    inner = f"/{name}/" if f"{TORQUE}/{name}/1" in table.names else "/"
    columns = {column: Cell(k) for k, column in enumerate(table.names)}

    def cells(kind: str, ends: Iterable[object]) -> tuple[Cell, ...]:
        wanted = (f"{kind}{inner}{end}" for end in ends)
        return tuple(columns[each] for each in takewhile(columns.__contains__, wanted))

    found = {kind: cells(kind, count(1)) for kind in (TORQUE, "band")}
    found["wrench"] = cells("wrench", AXES)
    if "t" not in columns or not found[TORQUE]:
        raise LogError(
            f"{path}: estimates have columns t, {TORQUE}/1, {TORQUE}/2 …; it has "
            f"{listed(table.names)}"
        )
    picks = [Pick(kind, each) for kind, each in found.items() if each]
    clock = Pick("t", (columns["t"],), unit="s")
    raw = load_signals(table, Picks(tuple(picks), clock), ReadChoice())
    wrench = raw.signals.get("wrench") if len(found["wrench"]) == len(AXES) else None
    t = np.asarray(raw.stamps, dtype=np.float64) * raw.tick
    check_clock(t, str(path))
    tau, sd = raw.signals[TORQUE], raw.signals.get("band")
    return ExternalTorque(name=name, t=t, tau=tau, error_sd=sd), wrench


class ListedRow(NamedTuple):
    """One row of a list of contacts."""

    start: float  #: [s]
    stop: float  #: [s]
    peak: float = 0.0  #: Its largest force, 0 where it has none. [N]
    band: float = 0.0  #: Half width of its 95 % band. [N]
    is_load: bool = False  #: Whether it is called a load.


def read_list(path: Path) -> list[ListedRow]:
    """A list of contacts from CSV."""
    import polars as pl

    try:
        rows = pl.read_csv(path, infer_schema_length=None).to_dicts()
        return [
            ListedRow(
                start=float(row["start_s"]),
                stop=float(row["stop_s"]),
                peak=float(row.get("peak_force_N") or 0.0),
                band=float(row.get("peak_force_band_N") or 0.0),
                is_load=row.get("kind") == "load",
            )
            for row in rows
        ]
    except (OSError, KeyError, TypeError, ValueError, pl.exceptions.PolarsError):
        raise LogError(f"{path}: a list has columns start_s, stop_s, peak_force_N") from None


def read_parts(files: Mapping[str, Path]) -> dict[str, Array]:
    """Columns t, q1… of a log in a text file a signal, t first, its numbers row after row."""
    columns: dict[str, Array] = {}
    samples = 0
    for signal, path in files.items():
        try:
            values = np.loadtxt(path, ndmin=1).ravel()
            rows = values.reshape(samples or len(values), -1)
        except (OSError, UnicodeDecodeError, ValueError):
            raise LogError(
                f"{path}: not numbers, as many for each of {samples or 'its'} samples"
            ) from None
        samples = len(rows)
        names = ["t"] if signal == "t" else [f"{signal}{j + 1}" for j in range(rows.shape[1])]
        columns |= dict(zip(names, rows.T, strict=True))
    return columns
