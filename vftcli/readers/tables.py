"""Generic tables: by aliases, by --columns, or by the layout of a format."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.readers.aliases import TABLE, along_arm, picks_by_alias, robot_of
from vftcli.readers.columns import Cell, Item, guess_columns, parse_columns, tick_of
from vftcli.readers.delimited import EchoTable, TextTable, joint_names
from vftcli.readers.opening import LogFile
from vftcli.readers.reader import RawLog, ReadChoice
from vftcli.readers.reading import FORMATS, LogFormat
from vftcli.readers.table import (
    BESIDE,
    OWN_STAMPS,
    PAYLOAD,
    Block,
    Blocks,
    Column,
    Names,
    Notes,
    Picks,
    Places,
    Signals,
    Table,
    joined,
    picks_of,
    require_positions,
)
from vftcli.signals.arrays import Array
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import fact
from vftcli.signals.wrench import WrenchFrame

UR = FORMATS["ur-csv"]  #: The columns of UR's real-time data exchange.
#: Cycle of a CB3 controller, which its time stamps count; an e-Series has 2 ms. [s]
CB3_CYCLE = 8e-3
#: What only a controller with a sensor on the flange sends.
E_SERIES_FIELD = "ft_raw_wrench_0"
BLOCK_ROWS = 1 << 16  #: Rows of arrays that are read at a time.
WIDEST = 200  #: Most columns of a table without a header.


def from_table(
    table: Table,
    request: ReadChoice,
    layout: LogFormat = TABLE,
    *,
    names: Names = (),
    remarks: Notes = (),
) -> RawLog:
    """The log of a table by --columns, else by the columns of its layout or aliases.

    Signals that --columns leaves out are found by name. `names` are the joints', if known.
    """
    spec = request.spec
    if any("|" in (item.pattern or "") for item in spec.items):
        names = ()
    if not table.names and not spec.items:
        table, found = _by_values(table)
        spec = parse_columns(found)._replace(segment=spec.segment)
    if table.names and (spec.named or not spec.items):
        picks, names = picks_by_alias(table, spec.items, layout, names)
    else:
        picks = picks_of(table, spec)
    payload = layout.payload.split()
    if payload and set(payload) <= set(table.names):
        cells = (Cell(table.names.index(name)) for name in payload)
        picks[PAYLOAD] = Item(PAYLOAD, cells=tuple(cells))
    require_positions(table, picks)
    raw = load_signals(table, picks, request, "" if spec.item("t") else layout.clock)
    raw = replace(
        raw,
        segment=spec.segment,
        degrees_possible=picks["q"].unit is None,
        remarks=(*raw.remarks, *remarks),
    )
    if layout is UR:
        raw = replace(raw, wrench_frame=force_frame(table.names, raw.stamps * raw.tick))
    if not names or len(names) != len(picks["q"].cells):
        return raw
    names, signals = along_arm(names, dict(raw.signals))
    return replace(raw, signals=signals, joint_names=names, robot_hint=robot_of(names))


def _by_values(table: Table) -> tuple[Table, str]:
    """A table without a header, loaded, and its columns by value."""
    if table.width == 1:
        raise LogError(
            f"{table.path}: a single column of numbers: one signal in a file of its own. Join the "
            "files into one table, or build the log through the API: vftcli.Recording(t=…, q=…)."
        )
    columns: Block = {}
    if 1 < table.width <= WIDEST and not table.lists:
        with suppress(LogError):  # what is no number somewhere is no clue
            columns = table.load(range(table.width), clock=0)
    found = guess_columns(list(columns.values())) if columns else None
    if found is None or found.others:
        likely = "as in t,q:6,dq:6,current:6 (_:13 skips 13 columns)."
        if found is not None:
            likely = f"by its values {found.columns} or {' or '.join(found.others)}."
        raise LogError(
            f"{table.path}: a table of {table.width} columns without a header. Say what they are "
            f"with --columns, in file order, {likely}"
        )
    remark = fact("columns-by-value", count=table.width, columns=found.columns, why=found.why)
    named = {str(k): column for k, column in columns.items()}
    loaded = ArrayTable(table.path, named, headed=False, remarks=(*table.remarks, remark))
    return loaded, found.columns


@dataclass
class ArrayTable(Table):
    """A table of arrays of numbers or of lists, in memory or an open file's."""

    path: Path | str
    columns: Mapping[str, Any]  #: Name → (T,) or (T, k).
    headed: bool = True  #: Whether the names are the file's own.
    remarks: Notes = ()

    def __post_init__(self) -> None:
        self.names = tuple(self.columns) if self.headed else ()
        self.width = len(self.columns)

    @cached_property
    def lists(self) -> Mapping[int, int]:
        """Column → length of its rows, of matrices of several columns."""
        widths = enumerate(array.shape[1:] for array in self.columns.values())
        return {k: width[0] for k, width in widths if width and width != (1,)}

    def blocks(self, columns: Places, clock: int | None) -> Blocks:
        """All rows of some columns; whole stamps stay whole."""
        each = list(self.columns.items())
        if len({len(each[c][1]) for c in columns}) > 1:
            lengths = ", ".join(f"{each[c][0]} {len(each[c][1])}" for c in columns)
            raise LogError(
                f"{self.path}: the arrays differ in length: {lengths} rows. Save them equally long."
            )
        for start in range(0, max(len(each[columns[0]][1]), 1), BLOCK_ROWS):
            loaded = {}
            for c in columns:
                name, array = each[c]
                if array.dtype.kind not in "fiub":
                    raise LogError(f"{self.path}: {name} holds {array.dtype}, not numbers.")
                whole = c == clock and array.dtype.kind in "iu" and array.dtype.itemsize == 8
                values = np.asarray(array[start : start + BLOCK_ROWS])
                values = values.astype(np.int64 if whole else np.float64, copy=False)
                loaded[c] = values[:, 0] if values.ndim == 2 and c not in self.lists else values
            yield loaded


def force_frame(names: Sequence[str], stamps: Array) -> WrenchFrame:
    """Frame of actual_TCP_force: base axes, about the TCP (CB3) or by the sensor.

    The sensor in an e-Series' flange gives the moment about the flange (three logs), a URCap's
    about the TCP; no field says which. Without `ft_raw_wrench`, and with stamps (T,) [s] of
    multiples of 8 ms, a log is a CB3's.
    """
    steps = stamps[np.isfinite(stamps)] / CB3_CYCLE
    # Half a millisecond: stamps may be written with three decimals.
    cb3 = bool(np.all(np.abs(steps - np.round(steps)) < 5e-4 / CB3_CYCLE))
    return WrenchFrame("base", "tool" if cb3 and E_SERIES_FIELD not in names else "controller")


def recognises(file: LogFile, layout: LogFormat) -> bool:
    """Whether a text is of a format: a printed JointState, a table."""
    if not file.lines:
        return False
    if layout.name == "ros2-echo":
        return EchoTable(file).joints > 0
    table = TextTable(file)
    if layout.name == "headerless" or not table.names:
        return layout.name == "headerless" and not table.names
    if len(table.sample) < 2:
        return table.width > 1
    cells = table.cells(table.sample[1])
    return len(cells) > 1 and sum(map(table.is_number, cells)) * 2 >= len(cells)


def read(file: LogFile, request: ReadChoice, layout: LogFormat) -> RawLog:
    """Read a table of text by its layout, --columns or aliases."""
    if layout.name in {"bagpy", "rostopic", "ros2-echo"}:
        printed = (EchoTable if layout.name == "ros2-echo" else TextTable)(file)
        return from_table(printed, request, names=joint_names(printed))
    return from_table(TextTable(file), request, UR if layout.name == "ur-rtde" else layout)


def load_signals(table: Table, picks: Picks, request: ReadChoice, clock_name: str = "") -> RawLog:
    """Load the picked columns of a table and scale them."""
    signals = [p for s, p in picks.items() if s not in BESIDE and request.wants(s)]
    beside = {s: [cell.column for cell in picks[s].cells] for s in BESIDE & picks.keys()}
    whole: dict[int, list[Column]] = {column: [] for each in beside.values() for column in each}
    asked = sorted({*whole, *(cell.column for pick in signals for cell in pick.cells)})

    def stacked() -> Iterator[Signals]:
        for loaded in table.blocks(asked, next(iter(beside.get("t", ())), None)):
            for column, parts in whole.items():
                parts.append(loaded[column])
            yield {pick.field: _stacked(pick, loaded) for pick in signals}

    arrays = joined(stacked())
    loaded = {c: np.concatenate(parts) for c, parts in whole.items()}
    rows = len(next(iter(arrays.values())))
    more: dict[str, Any] = {}
    stamps, tick, words = _stamps(table, picks.get("t"), loaded, rows, clock_name)
    if OWN_STAMPS in beside and rows:
        start = float(loaded[beside[OWN_STAMPS][0]][0]) * 1e-9
        more["origin"] = start - float(stamps[0]) * tick
    constants = tuple(float(loaded[c][-1]) for c in beside.get(PAYLOAD, ()) if rows)
    if constants and np.isfinite(constants).all():
        more |= {"payload_mass": constants[0], "payload_com": constants[1:] or None}
    if (wrench := next((p for p in signals if p.signal == "wrench"), None)) and wrench.unit:
        more["wrench_frame"] = WrenchFrame.parsed(wrench.unit)
    remarks = (*table.remarks, *(pick.remark for pick in signals if pick.remark))
    return RawLog(stamps=stamps, tick=tick, clock=words, signals=arrays, remarks=remarks, **more)


def _stacked(pick: Item, loaded: Block) -> Array:
    """One signal's cells side by side, scaled. (T, n)"""
    out = np.stack([_numbers(loaded, cell) for cell in pick.cells], axis=1, dtype=np.float64)
    factors = [-pick.factor if cell.turned else pick.factor for cell in pick.cells]
    if set(factors) != {1.0}:
        out *= factors
        out += 0.0  # a turned zero is plain zero
    return out


def _numbers(loaded: Block, cell: Cell) -> Column:
    column = loaded[cell.column]
    return column if cell.element is None else column[:, cell.element]


def _stamps(
    table: Table, clock: Item | None, loaded: Block, rows: int, clock_name: str
) -> tuple[Column, float, str]:
    """The rows' stamps (T,), their tick's length and which clock it is."""
    if clock is None:
        raise LogError(
            f"{table.path}: no clock. Name its column (--columns t=…) or the rate (t@125Hz)."
        )
    if clock.rate is not None:
        words = clock_name or f"none: {clock.rate:g} Hz as stated"
        return np.arange(rows), 1 / clock.rate, words
    if clock.factor < 0 or any(cell.turned for cell in clock.cells):
        raise LogError(
            f"{table.path}: --columns turns the sign of the clock; time cannot run back."
        )
    cell, *rest = clock.cells
    stamps = _numbers(loaded, cell)
    name = table.names[cell.column] if table.names else f"column {cell.column + 1}"
    words = clock_name or f"column {name}" if table.names else name
    if rest:
        parts = stamps, _numbers(loaded, rest[0])
        whole = all(bool(np.all(np.mod(part, 1) == 0)) for part in parts)
        if not whole or not np.all((parts[1] >= 0) & (parts[1] < 1e9) & (np.abs(stamps) < 9e9)):
            raise LogError(
                f"{table.path}: the two columns of the clock are no whole seconds and the "
                "nanoseconds within them. Name one column of time with --columns, as in t=…"
            )
        seconds, nanoseconds = (part.astype(np.int64) for part in parts)
        return seconds * 1_000_000_000 + nanoseconds, 1e-9, words
    if clock.unit is not None:
        return stamps, clock.factor, f"{words} [{clock.unit}]"
    tick, unit = tick_of(stamps, name)
    return stamps, tick, words if unit == "s" else f"{words}, read as {unit}"
