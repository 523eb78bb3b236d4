"""Generic tables: headed by aliases, described by --columns, or by the layout of a format."""

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.readers.aliases import RESIDUAL_TURNED, picks_by_alias, table_clock
from vftcli.readers.columns import ColumnSpec, Item, parse_columns
from vftcli.readers.delimited import TextTable, as_number
from vftcli.readers.formats import LogFormat
from vftcli.readers.headless import guessed
from vftcli.readers.joints import robot_of
from vftcli.readers.picking import picked
from vftcli.readers.reader import LogFile, RawLog, ReadChoice
from vftcli.readers.table import Cell, Column, Table, missing_column, named_cells, picks_of
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Remark, fact

WIDEST = 200  #: Columns beyond which a table without a header is not looked through.


def from_table(table: Table, request: ReadChoice, **more: Any) -> RawLog:  # noqa: ANN401
    """Read a table by its --columns text, else by the aliases of its column names.

    A text that names signals says something of these; what it leaves out is found by name.

    Raises:
        LogError: If the columns cannot be told.
    """
    spec = request.spec
    more["segment"] = spec.segment
    stated = (item := spec.item("q")) is not None and item.unit is not None
    if spec.items and (not table.names or not spec.named):
        return picked(table, picks_of(table, spec), request, degrees_possible=not stated, **more)
    if not table.names and table.width == 1:
        raise LogError(
            f"{table.path}: a single column of numbers: one signal in a file of its own. Join the "
            "files into one table, or build the log through the API: vftcli.Recording(t=…, q=…)."
        )
    if not table.names:
        return read_by_values(table, request, **more)
    picks, joints = picks_by_alias(table, spec.items)
    return picked(
        table,
        picks,
        request,
        degrees_possible=not stated,
        joint_names=joints,
        robot_hint=robot_of(joints),
        **more,
    )


def read_layout(
    table: Table,
    layout: LogFormat,
    request: ReadChoice,
    **more: Any,  # noqa: ANN401
) -> RawLog:
    """Read a table by the columns of its format; what it has not of them is left out.

    Args:
        table: The table.
        layout: Its format.
        request: What is wanted.
        more: Further fields of the RawLog.

    Raises:
        LogError: If it has no clock or no positions.
    """
    spec = parse_columns(layout.columns)
    if spec.named:
        spec = replace(spec, items=tuple(known_items(table, layout, spec)))
    picks, names = picks_of(table, spec), table.names
    # Of the vendors' signals libfranka's residual alone is turned.
    signals = [replace(p, remark=RESIDUAL_TURNED if p.remark else None) for p in picks.signals]
    payload = layout.payload.split()
    constants = tuple(map(names.index, payload)) if set(payload) <= set(names) else ()
    picks = replace(picks, signals=tuple(signals), constants=constants)
    return picked(table, picks, request, clock_name=layout.clock, **more)


def known_items(table: Table, layout: LogFormat, spec: ColumnSpec) -> Iterator[Item]:
    """The items of a layout of which a table has all columns, a joint each."""
    names = table.names
    for item in spec.items:
        cells: tuple[Cell, ...] = ()
        with suppress(LogError):
            cells = named_cells(table, item)
        if item.signal == "t" and cells:
            table_clock(table, cells[0].column)
        wanted = {"t": 1, "wrench": layout.joints and 6}.get(item.signal, layout.joints)
        if len(cells) == wanted if wanted else len(cells) > 1:
            yield item
        elif item.signal in {"t", "q"}:
            raise LogError(
                f"{table.path}: no {item.pattern} among its {len(names)} columns. {layout.remedy}"
            )


def described(table: Table, usual: str, request: ReadChoice, **more: Any) -> RawLog:  # noqa: ANN401
    """Read a table whose columns are known, but for what a --columns text says of them."""
    stated = request.spec
    if stated.items and not stated.named:
        return from_table(table, request, **more)
    items = {item.signal: item for item in parse_columns(usual).items if there(table, item)}
    if stated.item("q") is not None:
        items = {signal: item for signal, item in items.items() if signal == "t"}
    for item in stated.items:
        items[item.signal] = restated(table, item, items.get(item.signal))
    spec = ColumnSpec(items=tuple(items.values()), named=True, segment=stated.segment)
    unit = items["q"].unit if "q" in items else None
    more = {"segment": spec.segment, "degrees_possible": unit is None, **more}
    return picked(table, picks_of(table, spec), request, **more)


def there(table: Table, item: Item) -> bool:
    """Whether a table has the columns of an item; its clock and positions are always looked for."""
    columns = (item.pattern or "").split("|")
    return item.signal in {"t", "q"} or any(c.partition("[")[0] in table.names for c in columns)


def restated(table: Table, item: Item, usual: Item | None) -> Item:
    """An item of a --columns text, its columns the usual ones where it names none."""
    if item.pattern is not None or item.rate is not None:
        return item
    if usual is None:
        raise missing_column(table, item.signal, item.signal)
    scale = usual.factor if item.unit is None else math.copysign(1.0, usual.factor)
    factor = item.factor * scale
    return replace(usual, factor=factor, unit=item.unit or usual.unit)


def read_by_values(table: Table, request: ReadChoice, **more: Any) -> RawLog:  # noqa: ANN401
    """Read a table without a header whose values settle what its columns are, and say it."""
    columns: dict[int, Column] = {}
    if 1 < table.width <= WIDEST and not table.lists:
        with suppress(LogError):  # what is no number somewhere is no clue
            columns = table.load(range(table.width), 0)
    found = guessed(list(columns.values())) if columns else None
    if found is None or found.others:
        likely = "as in t,q:6,dq:6,current:6 (_:13 skips 13 columns)."
        if found is not None:
            likely = f"by its values {found.columns} or {' or '.join(found.others)}."
        raise LogError(
            f"{table.path}: a table of {table.width} columns without a header. Say what they are "
            f"with --columns, in file order, {likely}"
        )
    told = fact("columns-by-value", count=table.width, columns=found.columns, why=found.why)
    named = {str(k): column for k, column in columns.items()}
    loaded = ArrayTable(path=table.path, columns=named, headed=False, remarks=table.remarks)
    picks = picks_of(loaded, parse_columns(found.columns))
    return picked(loaded, picks, request, degrees_possible=True, remarks=(told,), **more)


@dataclass
class ArrayTable:
    """A table of arrays of numbers or of lists, in memory or an open file's."""

    path: Path | str  #: What messages call it: the file, and in a bag the topic.
    columns: Mapping[str, Any]  #: Name → (T,) or (T, k).
    headed: bool = True  #: Whether the names are the file's own.
    remarks: tuple[Remark, ...] = ()  #: What had to be done to the arrays.
    lists: Mapping[int, int] = field(init=False)

    def __post_init__(self) -> None:
        arrays = enumerate(self.columns.values())
        self.lists = {k: array.shape[1] for k, array in arrays if array.ndim == 2}

    @property
    def names(self) -> tuple[str, ...]:
        """The columns' names, none if the file has none."""
        return tuple(self.columns) if self.headed else ()

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self.columns)

    def load(self, columns: Sequence[int], clock: int | None) -> dict[int, Column]:
        """Return columns as float64; whole stamps stay whole."""
        arrays = list(self.columns.values())
        names = list(self.columns)
        lengths = {len(arrays[c]) for c in columns}
        if len(lengths) > 1:
            told = ", ".join(f"{names[c]} {len(arrays[c])}" for c in columns)
            raise LogError(f"{self.path}: the arrays differ in length: {told} rows.")
        loaded = {}
        for c in columns:
            if arrays[c].dtype.kind not in "fiub":
                raise LogError(f"{self.path}: {names[c]} holds {arrays[c].dtype}, not numbers.")
            whole = c == clock and arrays[c].dtype.kind in "iu" and arrays[c].dtype.itemsize == 8
            values = np.asarray(arrays[c]).astype(np.int64 if whole else np.float64, copy=False)
            loaded[c] = values[:, 0] if values.ndim == 2 and c not in self.lists else values
        return loaded


def recognises(file: LogFile, layout: LogFormat) -> bool:
    """Whether a text is a table without a header, or a line of names above mostly numbers."""
    if not file.lines:
        return False
    table = TextTable(file)
    if layout.name == "headerless" or not table.names:
        return layout.name == "headerless" and not table.names
    if len(table.sample) < 2:
        return table.width > 1
    cells = table.cells(table.sample[1])
    numbers = [as_number(cell, decimal_comma=table.decimal_comma) for cell in cells]
    return len(cells) > 1 and sum(n is not None for n in numbers) * 2 >= len(cells)


def read(file: LogFile, request: ReadChoice, layout: LogFormat) -> RawLog:
    """Read a table of text by its layout, --columns or aliases."""
    if layout.columns:
        return read_layout(TextTable(file), layout, request)
    return from_table(TextTable(file), request)
