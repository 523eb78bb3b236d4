"""Columnar tables of Arrow's kind: flat columns, or columns of lists as LeRobot writes them."""

import json
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vftcli.readers.opening import UNPACKED_LIMIT, UNPACKED_RATIO
from vftcli.readers.parts import episode_of
from vftcli.readers.reader import LogFile, RawLog, ReadChoice
from vftcli.readers.table import Column
from vftcli.readers.tables import from_table
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Remark
from vftcli.signals.wrench import WrenchFrame

EPISODE = "episode_index"


@contextmanager
def guarded(path: Path, errors: tuple[type[BaseException], ...]) -> Iterator[None]:
    """Turn the errors of a decoder, beside Python's own, into a LogError that names the file."""
    usual = (OSError, ValueError, KeyError, MemoryError, OverflowError)
    try:
        yield
    except BaseException as error:
        if not isinstance(error, (*usual, *errors)):
            raise
        reason = str(error).split("\n")[0][:120]
        raise LogError(f"{path}: a damaged Parquet or Arrow file ({reason})") from None


class HeldColumns(NamedTuple):
    """What a table says that it holds."""

    names: tuple[str, ...]  #: Of its columns.
    lists: tuple[bool, ...]  #: Whether each is a column of lists.
    rows: int  #: Their number.
    told: bytes | str  #: What `vftcli convert` wrote beside the columns, as JSON; "{}" for nothing.


class ColumnarTable(ABC):
    """A file of columns; only those asked for are decoded, and nothing is ever mended.

    Attributes:
        path: The file.
        names: Column names.
    """

    remarks: tuple[Remark, ...] = ()

    def __init__(self, file: LogFile) -> None:
        self.path: Path = file.path
        self._rows: Any = None
        self._size = len(file.content)
        with self._guarded():
            held = self._opened(file)
            if held.rows == 0:
                raise LogError(f"{file.path}: the table has no rows; nothing was recorded into it.")
        self.names: tuple[str, ...] | None = held.names
        self._held = held

    @abstractmethod
    def _opened(self, file: LogFile) -> HeldColumns:
        """Open the file; what it says it holds."""

    @abstractmethod
    def _errors(self) -> tuple[type[BaseException], ...]:
        """What the decoder raises on a damaged file, beside Python's own errors."""

    @abstractmethod
    def _first_list(self, column: int) -> Any:  # noqa: ANN401 - a list
        """The value in the first row of a column of lists, None for none."""

    @abstractmethod
    def _numbers(self, columns: Sequence[int], clock: int | None) -> dict[int, Column]:
        """Decode columns, of the rows that are kept; whole stamps stay whole."""

    def _guarded(self) -> AbstractContextManager[None]:
        """Turn the errors of its decoder into a LogError that names the file."""
        return guarded(self.path, self._errors())

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self._held.names)

    def told(self) -> dict[str, Any]:
        """What vftcli convert wrote beside the columns; nothing for files of other programs."""
        try:
            told = json.loads(self._held.told)
        except (ValueError, RecursionError):
            return {}
        good = isinstance(told, dict) and isinstance(told.get("joint_names", []), list)
        return told if good else {}

    @cached_property
    def lists(self) -> Mapping[int, int]:
        """Columns of lists and their length in the first row."""
        return {k: self._first_length(k) for k, is_list in enumerate(self._held.lists) if is_list}

    def _first_length(self, column: int) -> int:
        """Length of the list in the first row of a column, 0 for an empty one."""
        with self._guarded():
            value = self._first_list(column)
        return len(value) if value is not None else 0

    def load(self, columns: Sequence[int], clock: int | None) -> dict[int, Column]:
        """Decode some columns."""
        self._names_of(columns)
        self._check_size(columns)
        with self._guarded():
            return self._numbers(sorted(columns), clock)

    def _names_of(self, columns: Sequence[int]) -> dict[int, str]:
        """The names of some columns, each of one column only."""
        names = self._held.names
        # Decoders hand over both under one name.
        if any(names.count(names[c]) > 1 for c in columns):
            raise LogError(f"{self.path}: two columns have one name; rename one of them.")
        return {c: names[c] for c in columns}

    def _check_size(self, columns: Sequence[int]) -> None:
        """Check that columns may be unpacked: a few bytes of a page may stand for a billion rows.

        The rows are asked for, not the pages: on a damaged page's description pyarrow ends the
        whole process.
        """
        limit = max(UNPACKED_LIMIT, UNPACKED_RATIO * self._size)
        width = sum(self.lists.get(column, 1) for column in columns)
        if 8 * width * self._held.rows > limit:
            raise LogError(
                f"{self.path}: its columns unpack to more than {limit >> 20} MiB, more than a log "
                "of this size can hold. It is damaged or made to fill memory."
            )

    def episodes(self) -> Column:
        """The episode of each row, as datasets of LeRobot number them; none elsewhere. (T,)"""
        if self.names is None or EPISODE not in self.names:
            return np.empty(0)
        column = self.names.index(EPISODE)
        numbers = self.load([column], None)[column]
        if numbers.ndim != 1 or not np.isfinite(numbers).all():
            raise LogError(f"{self.path}: {EPISODE} is not a number in every row.")
        return numbers

    def keep(self, rows: Any) -> None:  # noqa: ANN401 - numbers of rows
        """Keep some rows only, all for None."""
        self._rows = rows


def read_columns(table: ColumnarTable, request: ReadChoice) -> RawLog:
    """Read a table: ours, a user's, or one episode of a LeRobot file."""
    part, numbers = "", table.episodes()
    remarks: tuple[Remark, ...] = ()
    if numbers.size or request.episode is not None:
        number, part, remarks = episode_of(table.path, request, episodes_of(numbers))
        table.keep(np.flatnonzero(numbers == number) if part else None)
    raw = from_table(table, request)
    told = table.told()
    names = tuple(str(name) for name in told.get("joint_names") or ())
    return replace(
        raw,
        wrench_frame=raw.wrench_frame or WrenchFrame.of_conversion(told.get("wrench_frame")),
        joint_names=raw.joint_names or names,
        robot_hint=raw.robot_hint or told.get("robot"),
        part=part,
        remarks=(*remarks, *raw.remarks),
    )


def episodes_of(numbers: Column) -> tuple[int, ...]:
    """The numbers of a table's episodes, rising; one, 0, of a table that counts none."""
    return tuple(int(number) for number in np.unique(numbers)) or (0,)
