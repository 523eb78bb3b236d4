"""Reference files: a table with a clock and one external torque a joint, but no positions."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vftcli.readers.aliases import _clock, _wrench, filled_cells, grouped
from vftcli.readers.columns import parse_columns
from vftcli.readers.delimited import TextTable
from vftcli.readers.parquet import ParquetTable
from vftcli.readers.picking import picked
from vftcli.readers.reader import ReadChoice, open_log
from vftcli.readers.table import Pick, Picks, Table, listed, picks_of
from vftcli.signals.arrays import Array, check_clock
from vftcli.signals.errors import LogError
from vftcli.signals.wrench import WrenchFrame

TORQUE = "tau_ext"


@dataclass(frozen=True, kw_only=True)
class ReferenceTable:
    """What a reference file holds."""

    t: Array  #: Its stamps, on the clock of the log it belongs to. (T,) [s]
    tau: Array | None  #: External torque on the robot, or None. (T, n) [N·m]
    wrench: Array | None  #: Force then moment on the robot, or None. (T, 6) [N, N·m]
    #: Frame of the wrench as the columns' description gave it, or None.
    wrench_frame: WrenchFrame | None


def read_reference(path: Path, columns: str | None = None) -> ReferenceTable:
    """Read a reference file: text, compressed text or Parquet."""
    file = open_log(path)
    is_parquet = file.head.startswith(b"PAR1")
    table: Table = ParquetTable(file) if is_parquet else TextTable(file)
    spec = parse_columns(columns, log=False) if columns else None
    picks = found(table) if spec is None else picks_of(table, spec, as_given)
    raw = picked(table, picks, ReadChoice(signals=frozenset({TORQUE, "wrench"})))
    t = np.asarray(raw.stamps, dtype=np.float64) * raw.tick
    # No cleaning here: a reference is made by a program, and must be whole.
    check_clock(t, str(path))
    for name, values in raw.signals.items():
        if not np.all(np.isfinite(values)):
            row, column = np.argwhere(~np.isfinite(values))[0]
            raise LogError(f"{path}: {name} {column + 1} is not a number in row {row + 1}.")
    return ReferenceTable(
        t=t,
        tau=raw.signals.get(TORQUE),
        wrench=raw.signals.get("wrench"),
        wrench_frame=raw.wrench_frame,
    )


def as_given(table: Table, picks: Picks) -> Picks:
    """Accept the picks of a reference: a torque or a wrench, and one column of time."""
    signals = {pick.signal: pick for pick in picks.signals}
    if not {TORQUE, "wrench"} & set(signals):
        raise LogError(
            f"{table.path}: --reference-columns names no tau_ext or wrench, as in t,tau_ext:6."
        )
    if (wrench := signals.get("wrench")) and len(wrench.cells) != 6:
        raise LogError(f"{table.path}: a wrench has 6 columns, not {len(wrench.cells)}.")
    return picks


def found(table: Table) -> Picks:
    """Find the clock, the torques and the wrench by their names."""
    if not table.names:
        raise LogError(
            f"{table.path}: a table without a header. Say what its {table.width} columns are with "
            "--reference-columns, as in t,tau_ext:6."
        )
    groups = {name: g for name, g in grouped(table).items() if name.endswith(TORQUE)}
    wrench = _wrench(table)
    if len(groups) > 1 or not (groups or wrench):
        there = " and ".join(groups) or f"no column ends in {TORQUE} among {listed(table.names)}"
        raise LogError(
            f"{table.path}: the reference torques cannot be told: {there}. Name them with "
            "--reference-columns, as in t=time,tau_ext=true_tau_{i}."
        )
    picks = [
        Pick(signal=TORQUE, cells=filled_cells(table, name, group))
        for name, group in groups.items()
    ]
    if wrench is not None:
        picks.append(wrench)
    return Picks(signals=tuple(picks), clock=_clock(table))
