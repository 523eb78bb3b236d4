"""Tables: columns of numbers under names or in file order, from any file."""

import math
import re
from abc import ABC, abstractmethod
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from mmap import ACCESS_READ, mmap
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any
from weakref import finalize

import numpy as np
from numpy.typing import NDArray

from vftcli.readers.columns import Cell, Cells, ColumnSpec, Item
from vftcli.signals.arrays import Array, release
from vftcli.signals.errors import LogError, NoLogError
from vftcli.signals.parsing import printable
from vftcli.signals.remarks import Remark, fact

#: A cell of a Jacobian among the columns: row, then column.
JACOBIAN = re.compile(r"(?i)jac(obian)?_(\d)_(\d)")
#: One column as it is stored: (T,) numbers, or (T, k) for a column of lists.
Column = NDArray[Any]
Columns = dict[str, Column]  #: Name → column.
Block = dict[int, Column]  #: Place in the table → column, or some rows of it.
Places = Sequence[int]  #: Places of columns in the table.
Blocks = Iterator[Block]  #: All rows, some thousand at a time.
Notes = tuple[Remark, ...]  #: What is to be said of a log.
Signals = dict[str, Array]  #: Signal → a row a sample. (T, k)
Names = tuple[str, ...]  #: Names of columns, fields or joints, in their order.
Arrow = Any  #: An array, type or buffer of pyarrow, which has no stubs.


class Table(ABC):
    """Columns of numbers that are loaded when they are asked for."""

    path: Path | str  #: Its name in messages: the file, in a bag the topic.
    names: Names  #: Column names, none for a headerless table.
    width: int  #: Number of columns.
    remarks: Notes = ()  #: What loading dropped or mended.

    @property
    def lists(self) -> Mapping[int, int]:
        """Column → length of its lists, for columns that hold lists."""
        return {}

    @abstractmethod
    def blocks(self, columns: Places, clock: int | None) -> Blocks:
        """Columns as float64, some thousand rows each; a clock may stay integers."""

    def load(self, columns: Places, clock: int | None = None) -> Block:
        """All rows of some columns."""
        first, *more = self.blocks(columns, clock)
        if not more:
            return first
        return {c: np.concatenate([first[c], *(block[c] for block in more)]) for c in columns}


Picks = dict[str, Item]  #: Field of Recording → its cells.
#: The log's own stamps, as vftcli convert writes them. [ns]
OWN_STAMPS = "t_src_ns"
PAYLOAD = "payload"  #: Columns of which the last values are a mass and its centre.
BESIDE = {"t", OWN_STAMPS, PAYLOAD}  #: Columns that are kept as they are stored.


class JacobianError(LogError):
    """Torques beside a Jacobian instead of positions: `vftcli.readers.references`."""

    def __init__(self, message: str, table: Table, picks: Picks) -> None:
        super().__init__(message)
        self.table, self.picks = table, picks


class NoColumnError(LogError):
    """A column that is not there."""

    def __init__(self, table: Table, signal: str, name: str) -> None:
        super().__init__(
            f"{table.path}: no column {name!r} for {signal}; the table has {listed(table.names)}."
        )


class SameNameError(LogError):
    """Several columns of one name."""

    def __init__(self, table: Table, name: str) -> None:
        super().__init__(
            f"{table.path}: {table.names.count(name)} columns are called {name!r}. Count the "
            "columns in file order instead, as in t,q:6,_:12."
        )


def picks_of(table: Table, spec: ColumnSpec) -> Picks:
    """The columns that a --columns text means, whatever signals they are."""
    if spec.named:
        if not table.names:
            raise LogError(
                f"{table.path}: the table has no header, so --columns must count its "
                f"{table.width} columns in file order, as in t,q:6,dq:6,current:6."
            )
        found = [pick_of(item, named_cells(table, item)) for item in spec.items]
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
        widths = [(item.width or missing) * (item.rate is None) for item in spec.items]
        each = zip(spec.items, widths, strict=True)
        found = [pick_of(item, tuple(islice(left, width))) for item, width in each]
    return {item.field: item for item in found if item.signal != "_"}


def cells_of(table: Table, column: int, elements: slice = slice(None)) -> Cells:
    """The cell of a column, or of elements of its lists one each."""
    if column not in table.lists:
        return (Cell(column),)
    return tuple(Cell(column, k) for k in range(table.lists[column])[elements])


def pick_of(item: Item, cells: Cells) -> Item:
    """An item with its cells."""
    turned = item.factor < 0 or any(cell.turned for cell in cells)
    remark = fact("sign-turned", signal=item.signal) if turned else None
    return item._replace(cells=cells, remark=remark)


def named_cells(table: Table, item: Item) -> Cells:
    """The cells of a pattern, in the order of its indices; none of a stated rate."""
    if (pattern := item.pattern) is None:
        return ()
    if "{i}" not in pattern:
        return tuple(c for part in pattern.split("|") for c in _exact(table, item, part.strip()))
    template = re.compile(
        re.escape(pattern).replace(r"\{i\}", r"(\d{1,9})", 1).replace(r"\{i\}", r"\1")
    )
    found: dict[int, Cell] = {}
    for column, name in enumerate(table.names):
        if column in table.lists or not (match := template.fullmatch(name)):
            continue
        first = found.setdefault(int(match[1]), Cell(column))
        # Old libfranka logs call commands q_d and dq_d, as in the state before.
        if first != Cell(column) and not item.signal.startswith("target"):
            raise SameNameError(table, name)
    if not found:
        raise NoColumnError(table, item.signal, pattern)
    indices = range(min(found), min(found) + len(found))  # without holes
    if missing := [index for index in indices if index not in found]:
        raise LogError(
            f"{table.path}: {item.signal}={pattern} finds {len(found)} columns but none for "
            f"index {missing[0]}. Name them one by one with |."
        )
    return tuple(found[index] for index in indices)


def _exact(table: Table, item: Item, name: str) -> Cells:
    """The cells of a column, or of some elements of its lists: name[0:7], -name."""
    names = table.names
    if name not in names and name.startswith("-"):
        return tuple(cell._replace(turned=True) for cell in _exact(table, item, name[1:]))
    bare, elements = name, slice(None)
    match = re.fullmatch(r"(.+)\[(\d{1,9}|\d{0,9}:\d{0,9})\]", name)
    if name not in names and match:
        bare, (first, colon, last) = match[1], match[2].partition(":")
        stop = last if colon else int(first) + 1
        elements = slice(int(first or 0), int(stop) if stop else None)
    if bare not in names:
        raise NoColumnError(table, item.signal, bare)
    if names.count(bare) > 1:
        raise SameNameError(table, bare)
    column = names.index(bare)
    length, cells = table.lists.get(column), cells_of(table, column, elements)
    if length is None and bare != name:
        raise LogError(f"{table.path}: {bare!r} is a column of numbers, not of lists: {name!r}.")
    if length is not None and (not cells or (elements.stop or 0) > length):
        raise LogError(f"{table.path}: {bare!r} holds lists of {length}; there is no {name!r}.")
    return cells


def listed(names: Sequence[str], most: int = 24) -> str:
    """Names for a message; a long list is cut."""
    clean = [printable(name[:41]) for name in names[:most]]
    shown = ", ".join(name if len(name) <= 40 else name[:37] + "…" for name in clean)
    return f"{shown} and {len(names) - most} more" if len(names) > most else shown


def require_positions(table: Table, picks: Picks) -> None:
    """Raise unless there are positions and all signals have their width."""
    if not (joints := len(picks.get("q", Item("q")).cells)):
        there = listed(table.names) if table.names else f"{table.width} columns without names"
        if any(JACOBIAN.match(name) for name in table.names):
            raise JacobianError(
                f"{table.path}: no joint positions (q), but a Jacobian: no observer can run on "
                "that. `compare --reference sensor --wrench` compares its wrench with its sensor.",
                table,
                picks,
            )
        raise NoLogError(
            f"{table.path}: no joint positions (q) among {there}. Name their columns with "
            "--columns, as in q=joint_pos_{i}; a reference goes to --reference file:PATH."
        )
    for signal, pick in picks.items():
        if signal in BESIDE:
            continue
        count, wrench = len(pick.cells), signal == "wrench"
        if len({cell[:2] for cell in pick.cells}) < count:
            raise LogError(f"{table.path}: --columns names a column of {signal} twice.")
        if count != (6 if wrench else joints):
            expected = "a wrench has 6" if wrench else f"q has {joints}"
            raise LogError(
                f"{table.path}: {signal} has {count} columns, {expected}. Check --columns."
            )
    clock = picks.get("t")
    if clock is not None and clock.rate is None and not 1 <= len(clock.cells) <= 2:
        raise LogError(
            f"{table.path}: the clock holds {len(clock.cells)} numbers a row, but a sample has one "
            "time, or seconds and nanoseconds. Name another column with --columns, as in t=…,q=…"
        )


#: Bytes of a signal in memory; a longer one is in a temporary file.
HELD = 1 << 23


class JoinedRows:
    """The rows of a signal, part by part; beyond `HELD` bytes in a file."""

    def __init__(self) -> None:
        self.count, self.shapes = 0, set[tuple[int, ...]]()
        self._held: list[Column] = []
        self._size, self._written, self._most = 0, 0, float(HELD)
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
                self._file = TemporaryFile(buffering=0)  # noqa: SIM115 - open until all is there
                finalize(self, self._file.close)
            while self._held:
                rows = np.ascontiguousarray(self._held[0]).reshape(-1).view(np.uint8)
                while rows.size:
                    rows = rows[self._file.write(rows.data) :]
                self._written += self._held[0].nbytes
                release(self._held.pop(0))
            self._size = 0
        except OSError:  # it has no room
            self._most = math.inf

    def whole(self) -> Column:
        """All rows, where they have one shape; nothing can be added any more."""
        if self._file is not None and self._most < math.inf:
            self._write()
        if self._written:
            # The memory of the file stays when it is closed.
            mapped = mmap(self._file.fileno(), self._written, access=ACCESS_READ)
            first = np.frombuffer(mapped, self._kind).reshape(-1, *min(self.shapes))
            self._held.insert(0, first)
        return np.concatenate(self._held) if len(self._held) > 1 else self._held[0]


def numbers_of(values: Arrow) -> Column:
    """A column of Arrow's numbers; NaN for what is missing. (T,)"""
    # Pyarrow's own way imports pandas: 50 MB, half a second.
    if values.null_count or values.type.bit_width < 8:
        return np.asarray(values.to_numpy(zero_copy_only=False))
    return np.from_dlpack(values)


def joined(parts: Iterable[Signals]) -> Signals:
    """Signals joined of parts, each as one array."""
    found: dict[str, JoinedRows] = {}
    for part in parts:
        for name, rows in part.items():
            found.setdefault(name, JoinedRows()).add(rows)
    if not found:
        raise LogError("the log has no rows; nothing was recorded into it")
    return {name: rows.whole() for name, rows in found.items()}
