"""Files beside logs: reference torques, others' estimates, torques by a Jacobian.

They are tables with a clock and one external torque a joint, but no positions.
"""

from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from vftcli.readers.aliases import NamedColumns
from vftcli.readers.cleaning import kept, measured, seconds, without_repeats
from vftcli.readers.columns import Cell, Item, parse_columns
from vftcli.readers.delimited import TextTable
from vftcli.readers.opening import open_log, sha256_of
from vftcli.readers.parquet import ParquetTable
from vftcli.readers.reader import RawLog, ReadChoice
from vftcli.readers.table import (
    JACOBIAN,
    JacobianError,
    NoColumnError,
    Notes,
    Picks,
    Table,
    listed,
    named_cells,
    picks_of,
)
from vftcli.readers.tables import load_signals
from vftcli.signals.arrays import Array, check_clock
from vftcli.signals.errors import ClockError, LogError
from vftcli.signals.option import interval_text
from vftcli.signals.wrench import AXES

TORQUE = "tau_ext"


def table_at(path: Path) -> Table:
    """The table of a file: Parquet, text or compressed text."""
    file = open_log(path)
    return ParquetTable(file) if file.head.startswith(b"PAR1") else TextTable(file)


def program_log(table: Table, picks: Picks, choice: ReadChoice) -> RawLog:
    """The log of a table that a program made; its clock must be whole. [s]"""
    raw = load_signals(table, picks, choice)
    t = np.asarray(raw.stamps, dtype=np.float64) * raw.tick
    check_clock(t, str(table.path))
    return replace(raw, stamps=t, tick=1.0)


def read_reference(path: Path, columns: str | None = None) -> RawLog:
    """Read a reference file: text, compressed text or Parquet.

    Stamps [s] on its log's clock; `tau_ext` (T, n), `wrench` (T, 6) or both, on the robot.
    """
    table = table_at(path)
    if not columns:
        picks = _found(table)
    else:
        picks = picks_of(table, parse_columns(columns, log=False))
        if picks.keys().isdisjoint({TORQUE, "wrench"}):
            raise LogError(
                f"{path}: --reference-columns names no tau_ext or wrench, as in t,tau_ext:6."
            )
        if (wrench := picks.get("wrench")) and len(wrench.cells) != 6:
            raise LogError(f"{path}: a wrench has 6 columns, not {len(wrench.cells)}.")
    raw = program_log(table, picks, ReadChoice(signals=frozenset({TORQUE, "wrench"})))
    for name, values in raw.signals.items():
        if not np.all(np.isfinite(values)):
            row, column = np.argwhere(~np.isfinite(values))[0]
            raise LogError(f"{path}: {name} {column + 1} is not a number in row {row + 1}.")
    return raw


def read_outside(path: Path, name: str) -> RawLog:
    """Another program's `tau_ext`, and its `band` and `wrench` if there.

    Its columns are t, tau_ext/1…, band/1… (one standard deviation), wrench/fx… (force and
    moment on the robot, base axes); a file of `vftcli estimate` has them as
    tau_ext/NAME/1…. NaN is no answer.
    """
    table = table_at(path)
    inner = f"/{name}/" if f"{TORQUE}/{name}/1" in table.names else "/"
    columns = {"t": "t", TORQUE: f"{TORQUE}{inner}{{i}}", "band": f"band{inner}{{i}}"}
    columns["wrench"] = "|".join(f"wrench{inner}{axis}" for axis in AXES)
    picks = {}
    for signal, pattern in columns.items():
        item = Item(signal, unit="s" if signal == "t" else None, pattern=pattern)
        with suppress(NoColumnError):
            picks[signal] = item._replace(cells=named_cells(table, item))
    if not {"t", TORQUE} <= picks.keys():
        raise LogError(
            f"{path}: estimates have columns t, {TORQUE}/1, {TORQUE}/2 …; it has "
            f"{listed(table.names)}"
        )
    return program_log(table, picks, ReadChoice())


def read_list(path: Path) -> list[tuple[float, float, float, float, bool]]:
    """A list of contacts from CSV: start, stop [s], peak, band [N], whether a load."""
    import polars as pl

    try:
        rows = pl.read_csv(path, infer_schema_length=None).to_dicts()
        return [
            (
                float(row["start_s"]),
                float(row["stop_s"]),
                float(row.get("peak_force_N") or 0.0),
                float(row.get("peak_force_band_N") or 0.0),
                row.get("kind") == "load",
            )
            for row in rows
        ]
    except (OSError, KeyError, TypeError, ValueError, pl.exceptions.PolarsError):
        raise LogError(f"{path}: a list has columns start_s, stop_s, peak_force_N") from None


def _found(table: Table) -> Picks:
    if not table.names:
        raise LogError(
            f"{table.path}: a table without a header. Say what its {table.width} columns are with "
            "--reference-columns, as in t,tau_ext:6."
        )
    columns = NamedColumns(table)
    groups = [name for name in columns.groups if name.endswith(TORQUE)]
    wrench = columns.find("wrench")
    if len(groups) > 1 or not (groups or wrench):
        there = " and ".join(groups) or f"no column ends in {TORQUE} among {listed(table.names)}"
        raise LogError(
            f"{table.path}: which columns are the reference torques is unclear: {there}. "
            "Name them with --reference-columns, as in t=time,tau_ext=true_tau_{i}."
        )
    found = [
        *(Item(TORQUE, cells=columns.cells(name)) for name in groups),
        wrench,
        columns.find("t"),
    ]
    return {pick.field: pick for pick in found if pick is not None}


UNIT = 1e-3  #: How far from 1 the axis of a joint may be in the Jacobian.


class JacobianLog(NamedTuple):
    """Such a log; the Jacobian's axes and point are the log's own."""

    name: str  #: What it is called in tables.
    path: Path
    sha256: str  #: Digest of its bytes.
    t: Array  #: Time since its first sample. (T,) [s]
    tau_ext: Array  #: The vendor's estimate, on the robot. (T, n) [N·m]
    jacobian: Array  #: Rows of velocity, then of angular velocity. (T, 6, n)
    wrench: Array | None  #: A sensor's, in its axes, or None. (T, 6) [N, N·m]
    remarks: Notes = ()  #: What reading dropped or turned.


@np.errstate(all="ignore")  # a damaged file is judged, not computed with
def jacobian_log(path: Path, found: JacobianError, choice: ReadChoice, name: str) -> JacobianLog:
    """Read the log in which positions were looked for in vain."""
    table = found.table
    picks = {s: p for s, p in found.picks.items() if s in {"t", TORQUE, "wrench"}}
    places = {
        (int(match[2]), int(match[3])): Cell(column)
        for column, name in enumerate(table.names)
        if (match := JACOBIAN.fullmatch(name))
    }
    rows, columns = (sorted({place[k] for place in places}) for k in (0, 1))
    n = len(columns)
    if len(rows) != 6 or n < 6 or len(places) != 6 * n:
        raise LogError(
            f"{table.path}: the Jacobian has {len(rows)} rows, {n} columns and "
            f"{len(places)} cells; a wrench needs 6 rows and a column for each of 6 joints or more."
        )
    if TORQUE not in picks or len(picks[TORQUE].cells) != n:
        raise LogError(
            f"{path}: a Jacobian of {n} joints and no external torques of {n} joints beside it. "
            "Name their columns with --columns, as in tau_ext=tau_ext_{i}."
        )
    picks["jacobian"] = Item("jacobian", cells=tuple(places[r, c] for r in rows for c in columns))
    raw = without_repeats(measured(load_signals(table, picks, ReadChoice()), path), path)
    t = seconds(raw)
    start, stop = choice.interval or (-np.inf, np.inf)
    inside = (t >= start) & (t <= stop)
    if np.count_nonzero(inside) < 2:
        raise ClockError(f"{path}: fewer than two samples in {interval_text(start, stop)} [s]")
    signals = kept(raw, inside).signals
    # Revolute axes have length 1: the other rows are those of the velocity, which go first.
    stored = signals["jacobian"].reshape(-1, 6, n)
    for jacobian in (stored, np.roll(stored, 3, axis=1)):
        if np.all(np.abs(np.linalg.norm(jacobian[:, 3:], axis=1) - 1) < UNIT):
            break
    else:
        raise LogError(
            f"{path}: no three rows of the Jacobian are axes of revolute joints, of length 1."
        )
    return JacobianLog(
        name=name,
        path=path,
        sha256=sha256_of(path),
        t=t[inside],
        tau_ext=signals[TORQUE],
        jacobian=jacobian,
        wrench=signals.get("wrench"),
        remarks=raw.remarks,
    )


PREFIX = "tau_ext/"


def estimates_columns(path: Path, observer: str) -> str | None:
    """The --columns text of an observer's torque as tau_ext; None if not our file."""
    if not (held := stored_observers(path)):
        return None
    if observer not in held:
        raise LogError(
            f"{path}: holds no estimates of {observer!r}; it holds {', '.join(held)} (--observer)."
        )
    return f"t=t,q=q/{{i}},tau_ext={PREFIX}{observer}/{{i}}"


def stored_observers(path: Path) -> list[str]:
    """The observers of a file of our estimates, none of another."""
    try:
        file = open_log(path)
        names = ParquetTable(file).names if file.head.startswith(b"PAR1") else ()
    except LogError:  # what is damaged is said by whoever reads it
        return []
    held = sorted({n.split("/")[1] for n in names if n.startswith(PREFIX) and n.count("/") == 2})
    return held if "t" in names and "q/1" in names else []


def refuse_estimates(path: Path) -> None:
    """Raise where a log is needed and a file of our estimates is given."""
    if stored_observers(path):
        raise LogError(
            f"{path} holds estimates, not what the drives measured; give the log. Its "
            "run.json has the contacts, and `vftcli admit` replays its force"
        )
