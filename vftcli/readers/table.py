"""Tables: columns of numbers under names or in file order, whatever file they come from."""

import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from mmap import ACCESS_READ, mmap
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, NamedTuple
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from vftcli.readers.columns import SIGNALS, ColumnSpec, Item
from vftcli.signals.arrays import Array, release
from vftcli.signals.errors import LogError, NoLogError
from vftcli.signals.parsing import printable
from vftcli.signals.remarks import Remark, fact
from vftcli.signals.wrench import WrenchFrame

#: A cell of a Jacobian among the columns: row, then column.
JACOBIAN = re.compile(r"(?i)jac(obian)?_(\d)_(\d)")
Column = NDArray[Any]  #: One column as it is stored: (T,) numbers, or (T, k) for a column of lists.
Columns = dict[str, Column]  #: Name → column.
Block = dict[int, Column]  #: Place in the table → column, or some rows of it.
Places = Sequence[int]  #: Places of columns in the table.
Blocks = Iterator[Block]  #: All rows, some thousand at a time.
Notes = tuple[Remark, ...]  #: What is to be said of a log.
Signals = dict[str, Array]  #: Signal → a row a sample. (T, k)
Names = tuple[str, ...]  #: Names of columns, fields or joints, in their order.


class Table(ABC):
    """Columns of numbers that are loaded when they are asked for."""

    path: Path | str  #: What messages call the table: the file, and in a bag the topic.
    names: Names  #: Column names, none for a headerless table.
    width: int  #: Number of columns.
    remarks: Notes = ()  #: What loading dropped or mended.

    @property
    def lists(self) -> Mapping[int, int]:
        """Column → length of its lists, for columns that hold lists."""
        return {}

    @abstractmethod
    def blocks(self, columns: Places, clock: int | None) -> Blocks:
        """Columns as float64, some thousand rows at a time; the clock's may stay whole numbers."""

    def load(self, columns: Places, clock: int | None = None) -> Block:
        """All rows of some columns."""
        first, *more = self.blocks(columns, clock)
        return (
            {c: np.concatenate([first[c], *(b[c] for b in more)]) for c in columns}
            if more
            else first
        )


class Cell(NamedTuple):
    """A column, or one element of a column of lists; `turned` where its sign is."""

    column: int
    element: int | None = None
    turned: bool = False


Cells = tuple[Cell, ...]  #: The cells of a signal.


class Pick(NamedTuple):
    """The cells that make up one signal."""

    signal: str  #: Field of Recording, or "t".
    cells: Cells  #: One cell a joint, base to tip.
    factor: float = 1.0  #: Factor to SI units and to our sign.
    unit: str | None = None  #: The unit if it was stated.
    frame: WrenchFrame | None = None  #: Frame of a wrench if it was stated.
    remark: Remark | None = None  #: What was turned, if anything was.


class Picks(NamedTuple):
    """All signals of a table and its clock, or its rate [Hz] where it has no clock.

    `constants` are columns of which the last value counts; `origin` is the column of the
    log's own stamps [ns] in a table with a clock that starts at zero.
    """

    signals: tuple[Pick, ...]
    clock: Pick | None
    rate: float | None = None
    constants: tuple[int, ...] = ()
    origin: int | None = None


class JacobianError(LogError):
    """Torques beside a Jacobian where positions were looked for: `vftcli.readers.references`."""

    def __init__(self, message: str, table: Table, picks: Picks) -> None:
        super().__init__(message)
        self.table, self.picks = table, picks


def picks_of(table: Table, spec: ColumnSpec) -> Picks:
    """The columns that a --columns text of a log means."""
    return require_positions(table, unchecked_picks(table, spec))


def unchecked_picks(table: Table, spec: ColumnSpec) -> Picks:
    """The columns that a --columns text means, whatever signals they are."""
    if spec.named:
        if not table.names:
            raise LogError(
                f"{table.path}: the table has no header, so --columns must count its "
                f"{table.width} columns in file order, as in t,q:6,dq:6,current:6."
            )
        found = [pick_of(item, named_cells(table, item)) for item in spec.items if item.pattern]
    else:
        cells = [cell for column in range(table.width) for cell in cells_of(table, column)]
        missing = len(cells) - spec.width
        if missing < 0 or (missing and not any(item.width == 0 for item in spec.items)):
            remedy = f"skip the rest with _:{missing}" if missing > 0 else "leave some out"
            raise LogError(
                f"{table.path}: --columns describes {spec.width} columns, the table has "
                f"{len(cells)}; {remedy}."
            )
        left = iter(cells)
        items = [item for item in spec.items if item.rate is None]
        found = [pick_of(item, tuple(islice(left, item.width or missing))) for item in items]
    signals = tuple(pick for pick in found if pick.signal not in {"t", "_"})
    clock = next((pick for pick in found if pick.signal == "t"), None)
    rate = next((item.rate for item in spec.items if item.rate is not None), None)
    return Picks(signals, clock, rate)


def cells_of(table: Table, column: int, elements: slice = slice(None)) -> Cells:
    """The cell of a column, or of elements of its lists one each."""
    if column not in table.lists:
        return (Cell(column),)
    return tuple(Cell(column, k) for k in range(table.lists[column])[elements])


def pick_of(item: Item, cells: Cells) -> Pick:
    """The cells of an item, with its factor to SI units."""
    wrench, turned = item.signal == "wrench", any(cell.turned for cell in cells)
    return Pick(
        signal=SIGNALS.get(item.signal, item.signal),
        cells=cells,
        factor=item.factor,
        unit=item.unit,
        frame=WrenchFrame.parsed(item.unit) if wrench and item.unit else None,
        remark=fact("sign-turned", signal=item.signal) if item.factor < 0 or turned else None,
    )


def named_cells(table: Table, item: Item) -> Cells:
    """The cells that a pattern names, in the order of its indices."""
    pattern = item.pattern or ""
    names = table.names
    if "|" in pattern:
        return tuple(c for part in pattern.split("|") for c in _exact(table, item, part.strip()))
    if "{i}" not in pattern:
        return _exact(table, item, pattern)
    template = re.compile(
        re.escape(pattern).replace(r"\{i\}", r"(\d{1,9})", 1).replace(r"\{i\}", r"\1")
    )
    found = {
        int(match[1]): column
        for column, name in reversed(list(enumerate(names)))  # of two of one name the first
        if (match := template.fullmatch(name))
    }
    if not found:
        raise missing_column(table, item.signal, pattern)
    indices = range(min(found), min(found) + len(found))  # from 0 or from 1, but without holes
    if missing := [index for index in indices if index not in found]:
        raise LogError(
            f"{table.path}: {item.signal}={pattern} finds {len(found)} columns but none for "
            f"index {missing[0]}. Name them one by one with |."
        )
    return tuple(Cell(found[index]) for index in indices)


def _exact(table: Table, item: Item, name: str) -> Cells:
    """The cells of one column by its name, or of some elements of its lists: name[0:7], -name."""
    names = table.names
    if name not in names and name.startswith("-"):
        return tuple(cell._replace(turned=True) for cell in _exact(table, item, name[1:]))
    bare, elements = name, slice(None)
    match = re.fullmatch(r"(.+)\[(\d{1,9}|\d{0,9}:\d{0,9})\]", name)
    if name not in names and match:
        bare, (first, colon, last) = match[1], match[2].partition(":")
        stop = last if colon else int(first) + 1
        elements = slice(int(first or 0), int(stop) if stop else None)
    if names.count(bare) != 1:
        if bare in names:
            raise LogError(
                f"{table.path}: {names.count(bare)} columns are called {bare!r}. Count the "
                "columns in file order instead, as in t,q:6,_:12."
            )
        raise missing_column(table, item.signal, bare)
    column = names.index(bare)
    length, cells = table.lists.get(column), cells_of(table, column, elements)
    if length is None and bare != name:
        raise LogError(f"{table.path}: {bare!r} is a column of numbers, not of lists: {name!r}.")
    if length is not None and (not cells or (elements.stop or 0) > length):
        raise LogError(f"{table.path}: {bare!r} holds lists of {length}; there is no {name!r}.")
    return cells


def missing_column(table: Table, signal: str, name: str) -> LogError:
    """The error for a column that is not there, listing what is."""
    return LogError(
        f"{table.path}: no column {name!r} for {signal}; the table has {listed(table.names)}."
    )


def listed(names: Sequence[str], most: int = 24) -> str:
    """Names for a message; a long list is cut."""
    clean = [printable(name[:41]) for name in names[:most]]
    shown = ", ".join(name if len(name) <= 40 else name[:37] + "…" for name in clean)
    return f"{shown} and {len(names) - most} more" if len(names) > most else shown


def require_positions(table: Table, picks: Picks) -> Picks:
    """Return the picks, or raise unless there are positions and all signals have their width."""
    joints = next((len(p.cells) for p in picks.signals if p.signal == "q"), 0)
    if joints == 0:
        there = listed(table.names) if table.names else f"{table.width} columns without names"
        if any(JACOBIAN.match(name) for name in table.names):
            raise JacobianError(
                f"{table.path}: no joint positions (q), but a vendor's estimate beside its "
                "Jacobian: no observer can run on that. Its torques and wrench are set beside the "
                "log's sensor by `compare --reference sensor --wrench`.",
                table,
                picks,
            )
        raise NoLogError(
            f"{table.path}: no joint positions (q) among {there}. Name their columns with "
            "--columns, as in q=joint_pos_{i}; a table without positions is no log of an arm "
            "(a reference goes to --reference file:PATH)."
        )
    for pick in picks.signals:
        if len({cell[:2] for cell in pick.cells}) < len(pick.cells):
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


#: Bytes of a signal that wait in memory. A longer one lies in a nameless file in the
#: system's folder for temporary files, and is an array all the same.
HELD = 1 << 23


class NoRoomError(LogError):
    """The folder of temporary files has no room for a log."""


class JoinedRows:
    """The rows of a signal, part by part; beyond `held` bytes they wait in a file.

    Attributes:
        count: How many there are so far.
        shapes: The shapes of single rows.
    """

    def __init__(self, held: float | None = None) -> None:
        self.count, self.shapes = 0, set[tuple[int, ...]]()
        self._most = HELD if held is None else held
        self._held: list[Column] = []
        self._size = 0
        self._file: Any = None

    def add(self, rows: Column) -> None:
        """Take up the next rows. (N, k) or (N,)"""
        self.count += len(rows)
        self.shapes.add(rows.shape[1:])
        self._kind = rows.dtype
        self._held.append(rows)
        self._size += rows.nbytes
        if self._size > self._most and self.count > len(rows):
            self._write()

    def _write(self) -> None:
        try:
            if self._file is None:
                self._file = TemporaryFile()  # noqa: SIM115 - open until all rows are there
                finalize(self, self._file.close)
            for rows in self._held:
                self._file.write(np.ascontiguousarray(rows))
                release(rows)
            self._file.flush()
        except OSError as error:
            raise NoRoomError(
                f"a long log has no room in the folder of temporary files ({error.strerror}). "
                "Name another: TMPDIR=FOLDER"
            ) from None
        self._held, self._size = [], 0

    def whole(self) -> Column:
        """All rows, where they have one shape; nothing can be added any more."""
        if self._file is None:
            return np.concatenate(self._held) if len(self._held) > 1 else self._held[0]
        self._write()
        mapped = mmap(self._file.fileno(), 0, access=ACCESS_READ)  # stays when the file is closed
        return np.frombuffer(mapped, self._kind).reshape(-1, *min(self.shapes))


def joined(parts: Iterable[Signals], held: float | None = None) -> Signals:
    """Signals that come part by part, each as one array; all parts have the same signals.

    Beyond `held` bytes, by default `HELD`, a signal waits in a file.
    """
    found: dict[str, JoinedRows] = {}
    for part in parts:
        for name, rows in part.items():
            found.setdefault(name, JoinedRows(held)).add(rows)
    if not found:
        raise LogError("the log has no rows; nothing was recorded into it")
    return {name: rows.whole() for name, rows in found.items()}
