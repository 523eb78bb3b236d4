"""Loading the picked columns of a table: scaled to SI units, with the stamps of their rows."""

import re
from collections.abc import Iterator, Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from vftcli.readers.joining import joined
from vftcli.readers.opening import WHOLE_ROWS
from vftcli.readers.reader import RawLog, ReadChoice
from vftcli.readers.table import (
    Column,
    LongTable,
    Pick,
    Picks,
    Table,
)
from vftcli.signals.arrays import Array
from vftcli.signals.errors import LogError
from vftcli.signals.series import median_step


def picked(
    table: Table,
    picks: Picks,
    request: ReadChoice,
    *,
    clock_name: str = "",
    **more: Any,  # noqa: ANN401
) -> RawLog:
    """Load the picked columns of a table and scale them."""
    signals = tuple(p for p in picks.signals if request.wants(p.signal))
    clock = picks.clock.cells[0] if picks.clock else None
    last = {cell.column: pick.signal for pick in signals for cell in pick.cells}
    kept = {cell.column for cell in picks.clock.cells} if picks.clock else set()
    kept |= set() if picks.origin is None else {picks.origin}
    asked = sorted(kept.union(last, picks.constants)), clock.column if clock else None
    columns: dict[int, list[Column]] = {}
    constants: tuple[float, ...] = ()

    def stacked(parts: Iterator[dict[int, Column]]) -> Iterator[dict[str, Array]]:
        nonlocal constants
        columns.clear()
        for loaded in parts:
            for column in kept:
                columns.setdefault(column, []).append(loaded[column])
            constants, arrays = _last(loaded, picks), {}
            for pick in signals:
                arrays[pick.signal] = _stacked(pick, loaded)
                # Columns and what is picked of them have no room beside each other.
                for column in [c for c in loaded if last.get(c) == pick.signal]:
                    del loaded[column]
            yield arrays

    arrays: dict[str, Array] = {}
    if isinstance(table, LongTable) and table.rows > WHOLE_ROWS:
        with suppress(LogError):  # in one piece it can be mended, or it is known what is wrong
            arrays = joined(stacked(table.blocks(*asked)))
    arrays = arrays or joined(stacked(table.load(*asked) for _ in range(1)))
    loaded = {c: np.concatenate(x) if len(x) > 1 else x[0] for c, x in columns.items()}
    rows = len(next(iter(arrays.values())))
    stamps, tick, words = _stamps(table, picks, loaded, rows, clock_name)
    if picks.origin is not None and len(stamps):
        more["origin"] = float(loaded[picks.origin][0]) * 1e-9 - float(stamps[0]) * tick
    if constants and np.isfinite(constants).all():
        more |= {"payload_mass": constants[0], "payload_com": constants[1:] or None}
    remarks = (*table.remarks, *(pick.remark for pick in signals if pick.remark))
    wrench = next((pick for pick in signals if pick.signal == "wrench"), None)
    more.setdefault("wrench_frame", wrench.frame if wrench else None)
    return RawLog(
        stamps=stamps,
        tick=tick,
        clock=words,
        signals=arrays,
        remarks=(*remarks, *more.pop("remarks", ())),
        **more,
    )


def _last(loaded: Mapping[int, Column], picks: Picks) -> tuple[float, ...]:
    """The last values of a table's constants."""
    columns = (loaded[c] for c in picks.constants)
    return tuple(float(column[-1]) if len(column) else float("nan") for column in columns)


def _stacked(pick: Pick, loaded: Mapping[int, Column]) -> Array:
    """One signal's cells side by side, scaled. (T, n)"""
    rows = len(loaded[pick.cells[0].column])
    out = np.empty((rows, len(pick.cells)))
    for j, cell in enumerate(pick.cells):
        column = loaded[cell.column]
        out[:, j] = column if cell.element is None else column[:, cell.element]
        if cell.turned:
            out[:, j] = 0.0 - out[:, j]
    if pick.factor != 1.0:
        out *= pick.factor
        out += 0.0  # a turned zero is plain zero
    return out


def _stamps(
    table: Table,
    picks: Picks,
    loaded: Mapping[int, Column],
    rows: int,
    clock_name: str,
) -> tuple[Column, float, str]:
    """The stamps, the length of their tick and which clock they are."""
    stamps = _ticks(table, picks, loaded, rows)
    if picks.clock is None:
        rate = picks.rate or 0.0
        return stamps, 1 / rate, clock_name or f"none: {rate:g} Hz as stated"
    cell = picks.clock.cells[0]
    name = table.names[cell.column] if table.names else f"column {cell.column + 1}"
    words = clock_name or f"column {name}" if table.names else name
    if len(picks.clock.cells) == 2:
        return stamps, 1e-9, words
    if picks.clock.unit is not None:
        return stamps, picks.clock.factor, f"{words} [{picks.clock.unit}]"
    tick, unit = tick_of(stamps, name)
    return stamps, tick, words if unit == "s" else f"{words}, taken as {unit}"


def _ticks(table: Table, picks: Picks, loaded: Mapping[int, Column], rows: int) -> Column:
    """The stamps of the rows. (T,)"""
    if picks.clock is None:
        if picks.rate is None:
            raise LogError(
                f"{table.path}: no clock. Name its column with --columns (t=…, or t in file "
                "order), or say the rate of a log without one: t@125Hz."
            )
        return np.arange(rows)
    if picks.clock.factor < 0 or any(cell.turned for cell in picks.clock.cells):
        raise LogError(
            f"{table.path}: --columns turns the sign of the clock; time cannot run back."
        )
    cell, *rest = picks.clock.cells
    column = loaded[cell.column]
    stamps: Column = column if cell.element is None else column[:, cell.element]
    return _of_pair(table, stamps, loaded[rest[0].column]) if rest else stamps


def _of_pair(table: Table, seconds: Column, rest: Column) -> Column:
    """Stamps of a column of whole seconds and one of the nanoseconds within them. (T,) [ns]"""
    whole = all(bool(np.all(np.mod(part, 1) == 0)) for part in (seconds, rest))
    if not whole or not np.all((rest >= 0) & (rest < 1e9) & (np.abs(seconds) < 9e9)):
        raise LogError(
            f"{table.path}: the two columns of the clock are no whole seconds and the nanoseconds "
            "within them. Name one column of time with --columns, as in t=…"
        )
    return seconds.astype(np.int64) * 1_000_000_000 + rest.astype(np.int64)


def tick_of(stamps: Column, name: str) -> tuple[float, str]:
    """Length of a tick of unstated unit: from the name, else from the size of stamps and steps.

    Whole numbers one apart are milliseconds of a 1 kHz log; epoch stamps tell by their size;
    everything else is seconds.
    """
    units = {"ns": 1e-9, "us": 1e-6, "ms": 1e-3, "s": 1.0}
    if match := re.search(r"[_\[(.](ns|us|ms|s)[\])]?$", name.lower()):
        return units[match[1]], match[1]
    if len(stamps) == 0:
        return 1.0, "s"
    usual = abs(float(stamps[len(stamps) // 2]))  # the first may be garbage
    # Counts since 1970 are near 1.7e18 ns, 1.7e15 µs and 1.7e12 ms.
    for size, unit in ((1e17, "ns"), (1e14, "us"), (1e11, "ms")):
        if size < usual < 1e20:
            return units[unit], unit
    step = median_step(stamps) if len(stamps) > 1 else 0.0
    whole = stamps.dtype.kind in "iu" or bool(np.all(np.mod(stamps[:1000], 1) == 0))
    return (1e-3, "ms") if whole and 0.8 <= step <= 1.2 else (1.0, "s")
