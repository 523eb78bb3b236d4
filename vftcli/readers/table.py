"""Tables: columns of numbers under names or in file order, whatever file they come from."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from vftcli.readers.columns import SIGNALS, ColumnSpec, Item, tick_of
from vftcli.readers.reader import RawLog, ReadChoice
from vftcli.signals.arrays import Array
from vftcli.signals.errors import LogError
from vftcli.signals.letters import printable
from vftcli.signals.remarks import Remark, fact
from vftcli.signals.wrench import WrenchFrame

JACOBIAN = re.compile(r"(?i)jac(obian)?_(\d)_(\d)")
"""A cell of a Jacobian among the columns: row, then column."""

Column = NDArray[Any]
"""One column as it is stored: (T,) numbers, or (T, k) for a column of lists."""


class Table(Protocol):
    """Columns of numbers that are loaded when they are asked for."""

    @property
    def path(self) -> Path | str:
        """What messages call the table: the file, and in a bag the topic."""

    @property
    def names(self) -> tuple[str, ...] | None:
        """Column names, or None for a headerless table."""

    @property
    def width(self) -> int:
        """Number of columns."""

    @property
    def lists(self) -> Mapping[int, int]:
        """Column → length of its lists, for columns that hold lists."""

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What loading dropped or mended."""

    def load(self, columns: Sequence[int], clock: int | None) -> dict[int, Column]:
        """Load columns as float64; the clock's column may stay whole numbers."""


class Cell(NamedTuple):
    """A column, or one element of a column of lists."""

    column: int
    element: int | None = None


@dataclass(frozen=True, kw_only=True)
class Pick:
    """The cells that make up one signal.

    Attributes:
        signal: Field of Recording, or "t".
        cells: One cell a joint, base to tip.
        factor: Factor to SI units and to our sign.
        unit: The unit if it was stated.
        frame: Frame of a wrench if it was stated.
        remark: What was turned, if anything was.
    """

    signal: str
    cells: tuple[Cell, ...]
    factor: float = 1.0
    unit: str | None = None
    frame: WrenchFrame | None = None
    remark: Remark | None = None


@dataclass(frozen=True, kw_only=True)
class Picks:
    """All signals of a table and its clock, or its rate [Hz] where it has no clock.

    `constants` are columns of which the last value counts; `origin` is the column of the log's own
    stamps [ns] in a table whose clock starts at zero.
    """

    signals: tuple[Pick, ...]
    clock: Pick | None
    rate: float | None = None
    constants: tuple[int, ...] = ()
    origin: int | None = None


class JacobianError(LogError):
    """Torques beside a Jacobian where positions were looked for: `vftcli.readers.jacobian`."""

    def __init__(self, message: str, table: Table, picks: Picks) -> None:
        super().__init__(message)
        self.table, self.picks = table, picks


def picked(
    table: Table,
    picks: Picks,
    request: ReadChoice,
    *,
    clock_name: str = "",
    **more: Any,  # noqa: ANN401
) -> RawLog:
    """Load the picked columns of a table and scale them.

    Args:
        table: The table.
        picks: What to load.
        request: Signals nobody asked for are left unread.
        clock_name: Which clock the stamps are from, in words.
        more: Further fields of the RawLog.

    Raises:
        LogError: If the table has no clock, or no positions.
    """
    signals = tuple(p for p in picks.signals if request.wants(p.signal))
    clock = picks.clock.cells[0] if picks.clock else None
    wanted = {cell.column for pick in signals for cell in pick.cells} | set(picks.constants)
    wanted |= set() if picks.origin is None else {picks.origin}
    if picks.clock is not None:
        wanted |= {cell.column for cell in picks.clock.cells}
    loaded = table.load(sorted(wanted), clock.column if clock else None)
    arrays = {pick.signal: _stacked(pick, loaded) for pick in signals}
    stamps, tick, words = _stamps(table, picks, loaded, clock_name)
    if picks.origin is not None and len(stamps):
        more["origin"] = float(loaded[picks.origin][0]) * 1e-9 - float(stamps[0]) * tick
    remarks = (*table.remarks, *(pick.remark for pick in signals if pick.remark))
    wrench = next((pick for pick in signals if pick.signal == "wrench"), None)
    more.setdefault("wrench_frame", wrench.frame if wrench else None)
    return RawLog(
        stamps=stamps,
        tick=tick,
        clock=words,
        signals=arrays,
        remarks=(*remarks, *more.pop("remarks", ())),
        constants=tuple(
            float(column[-1]) if len(column) else float("nan")
            for column in (loaded[c] for c in picks.constants)
        ),
        **more,
    )


def _stacked(pick: Pick, loaded: Mapping[int, Column]) -> Array:
    """One signal's cells side by side, scaled. (T, n)"""
    rows = len(loaded[pick.cells[0].column])
    out = np.empty((rows, len(pick.cells)))
    for j, cell in enumerate(pick.cells):
        column = loaded[cell.column]
        out[:, j] = column if cell.element is None else column[:, cell.element]
    if pick.factor != 1.0:
        out *= pick.factor
        out += 0.0  # a turned zero is plain zero
    return out


def _stamps(
    table: Table, picks: Picks, loaded: Mapping[int, Column], clock_name: str
) -> tuple[Column, float, str]:
    """The stamps, the length of their tick and which clock they are."""
    if picks.clock is None:
        if picks.rate is None:
            raise LogError(
                f"{table.path}: no clock. Name its column with --columns (t=…, or t in file "
                "order), or say the rate of a log without one: t@125Hz."
            )
        rows = len(next(iter(loaded.values())))
        return np.arange(rows), 1 / picks.rate, rate_words(picks.rate)
    cell = picks.clock.cells[0]
    column = loaded[cell.column]
    stamps = column if cell.element is None else column[:, cell.element]
    name = table.names[cell.column] if table.names else f"column {cell.column + 1}"
    words = clock_name or f"column {name}" if table.names else name
    if picks.clock.factor < 0:
        raise LogError(
            f"{table.path}: --columns turns the sign of the clock; time cannot run back."
        )
    if len(picks.clock.cells) == 2:
        return _of_pair(table, stamps, loaded[picks.clock.cells[1].column]), 1e-9, words
    if picks.clock.unit is not None:
        return stamps, picks.clock.factor, f"{words} [{picks.clock.unit}]"
    tick, unit = tick_of(stamps, name)
    return stamps, tick, words if unit == "s" else f"{words}, taken as {unit}"


def rate_words(rate: float) -> str:
    """What the clock of a table without one is, given its rate. [Hz]"""
    return f"none: {rate:g} Hz as stated"


def _of_pair(table: Table, seconds: Column, rest: Column) -> Column:
    """Stamps of a column of whole seconds and one of the nanoseconds within them. (T,) [ns]

    Raises:
        LogError: If they are no such pair: seconds with a fraction, or a second too many.
    """
    whole = all(bool(np.all(np.mod(part, 1) == 0)) for part in (seconds, rest))
    if not whole or not np.all((rest >= 0) & (rest < 1e9) & (np.abs(seconds) < 9e9)):
        raise LogError(
            f"{table.path}: the two columns of the clock are no whole seconds and the nanoseconds "
            "within them. Name one column of time with --columns, as in t=…"
        )
    return seconds.astype(np.int64) * 1_000_000_000 + rest.astype(np.int64)


def picks_of(
    table: Table, spec: ColumnSpec, check: Callable[[Table, Picks], Picks] | None = None
) -> Picks:
    """Find the columns that a --columns text means; `check` replaces the check for a log's signals.

    Raises:
        LogError: If the table lacks a column that is named, or has another number of columns.
    """
    if spec.named:
        if table.names is None:
            raise LogError(
                f"{table.path}: the table has no header, so --columns must count its "
                f"{table.width} columns in file order, as in t,q:6,dq:6,current:6."
            )
        found = [pick_of(item, named_cells(table, item)) for item in spec.items if item.pattern]
    else:
        found = list(_counted(table, spec))
    signals = tuple(pick for pick in found if pick.signal not in {"t", "_"})
    clock = next((pick for pick in found if pick.signal == "t"), None)
    rate = next((item.rate for item in spec.items if item.rate is not None), None)
    return (check or checked)(table, Picks(signals=signals, clock=clock, rate=rate))


def _counted(table: Table, spec: ColumnSpec) -> list[Pick]:
    """Picks of a text that counts the columns in file order."""
    cells = [
        cell
        for column in range(table.width)
        for cell in (
            [Cell(column, k) for k in range(table.lists[column])]
            if column in table.lists
            else [Cell(column)]
        )
    ]
    if spec.width != len(cells):
        missing = len(cells) - spec.width
        remedy = f"skip the rest with _:{missing}" if missing > 0 else "leave some out"
        raise LogError(
            f"{table.path}: --columns describes {spec.width} columns, the table has "
            f"{len(cells)}; {remedy}."
        )
    picks, start = [], 0
    for item in spec.items:
        if item.rate is not None:
            continue
        picks.append(pick_of(item, tuple(cells[start : start + item.count])))
        start += item.count
    return picks


def pick_of(item: Item, cells: tuple[Cell, ...]) -> Pick:
    """The cells of an item, with its factor to SI units."""
    wrench = item.signal == "wrench"
    return Pick(
        signal=SIGNALS.get(item.signal, item.signal),
        cells=cells,
        factor=item.factor,
        unit=item.unit,
        frame=WrenchFrame.parsed(item.unit) if wrench and item.unit else None,
        remark=fact("sign-turned", signal=item.signal) if item.factor < 0 else None,
    )


def named_cells(table: Table, item: Item) -> tuple[Cell, ...]:
    """The cells that a pattern names, in the order of its indices."""
    pattern = item.pattern or ""
    names = table.names or ()
    if "|" in pattern:
        return tuple(c for part in pattern.split("|") for c in _exact(table, item, part.strip()))
    if "{i}" not in pattern:
        return _exact(table, item, pattern)
    template = re.compile(
        re.escape(pattern).replace(r"\{i\}", r"(\d{1,9})", 1).replace(r"\{i\}", r"\1")
    )
    found = {
        int(match[1]): column
        for column, name in enumerate(names)
        if (match := template.fullmatch(name))
    }
    if not found:
        raise missing_column(table, item.signal, pattern)
    # Indices may count from 0 or from 1, but without holes.
    first = min(found)
    for index in range(first, first + len(found)):
        if index not in found:
            raise LogError(
                f"{table.path}: {item.signal}={pattern} finds {len(found)} columns but none for "
                f"index {index}. Name them one by one with |."
            )
    return tuple(Cell(found[index]) for index in range(first, first + len(found)))


def _exact(table: Table, item: Item, name: str) -> tuple[Cell, ...]:
    """The cells of one column by its name, or of some elements of its lists: name[0:7]."""
    names = table.names or ()
    bare, elements = name, slice(None)
    if name not in names and (match := re.fullmatch(r"(.+)\[(\d{0,9}):(\d{0,9})\]", name)):
        bare = match[1]
        elements = slice(*(int(text) if text else None for text in match.group(2, 3)))
    elif name not in names and (match := re.fullmatch(r"(.+)\[(\d{1,9})\]", name)):
        bare, elements = match[1], slice(int(match[2]), int(match[2]) + 1)
    if names.count(bare) != 1:
        if bare in names:
            raise LogError(
                f"{table.path}: {names.count(bare)} columns are called {bare!r}. Count the "
                "columns in file order instead, as in t,q:6,_:12."
            )
        raise missing_column(table, item.signal, bare)
    column = names.index(bare)
    if column not in table.lists:
        if bare != name:
            raise LogError(
                f"{table.path}: {bare!r} is a column of numbers, not of lists: {name!r}."
            )
        return (Cell(column),)
    length = table.lists[column]
    cells = tuple(Cell(column, k) for k in range(length)[elements])
    if not cells or (elements.stop or 0) > length:
        raise LogError(f"{table.path}: {bare!r} holds lists of {length}; there is no {name!r}.")
    return cells


def missing_column(table: Table, signal: str, name: str) -> LogError:
    """The error for a column that is not there, listing what is."""
    return LogError(
        f"{table.path}: no column {name!r} for {signal}; the table has {listed(table.names or ())}."
    )


def listed(names: Sequence[str], most: int = 24) -> str:
    """Names for a message; a long list is cut."""
    clean = [printable(name[:41]) for name in names[:most]]
    shown = ", ".join(name if len(name) <= 40 else name[:37] + "…" for name in clean)
    return shown + (f" and {len(names) - most} more" if len(names) > most else "")


def checked(table: Table, picks: Picks) -> Picks:
    """Return the picks, or raise unless there are positions and all signals have their width.

    Raises:
        LogError: If q is missing or a signal has another number of columns than q.
    """
    joints = next((len(p.cells) for p in picks.signals if p.signal == "q"), 0)
    if joints == 0:
        there = listed(table.names) if table.names else f"{table.width} columns without names"
        if any(JACOBIAN.match(name) for name in table.names or ()):
            raise JacobianError(
                f"{table.path}: no joint positions (q), but a vendor's estimate beside its "
                "Jacobian: no observer can run on that. The vendor's wrench, pinv(Jᵀ) tau_ext, is "
                "written by `estimate --wrench`, and beside the log's sensor by `compare "
                "--reference sensor --wrench`.",
                table,
                picks,
            )
        raise LogError(
            f"{table.path}: no joint positions (q) among {there}. Name their columns with "
            "--columns, as in q=joint_pos_{i}; a table without positions is no log of an arm "
            "(a reference goes to --reference file:PATH)."
        )
    for pick in picks.signals:
        if len(set(pick.cells)) < len(pick.cells):
            raise LogError(
                f"{table.path}: --columns names a column of {pick.signal} twice; every joint has "
                "one of its own."
            )
        expected = 6 if pick.signal == "wrench" else joints
        if len(pick.cells) != expected:
            raise LogError(
                f"{table.path}: {pick.signal} has {len(pick.cells)} columns, "
                + ("a wrench has 6" if pick.signal == "wrench" else f"q has {joints}")
                + ". Check --columns."
            )
    if picks.clock is not None and not 1 <= len(picks.clock.cells) <= 2:
        raise LogError(
            f"{table.path}: t must be one column, or one of seconds and one of nanoseconds, not "
            f"{len(picks.clock.cells)}."
        )
    return picks
