"""Columnar tables of Arrow's kind: flat columns, or columns of lists as LeRobot writes them."""

import json
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

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


class ColumnarTable(ABC):
    """A file of columns; only those asked for are decoded, and nothing is ever mended.

    pyarrow decodes it: on a damaged page polars would end the whole process.

    Attributes:
        path: The file.
        names: Column names.
    """

    remarks: tuple[Remark, ...] = ()

    def __init__(self, file: LogFile, rows: Any = None) -> None:  # noqa: ANN401 - numbers of rows
        self.path = file.path
        self._rows = rows
        self._size = len(file.content)
        with guarded(self.path):
            self._schema = self._opened(file)
            if self._row_count == 0:
                raise LogError(f"{file.path}: the table has no rows; nothing was recorded into it.")
        self.names: tuple[str, ...] | None = tuple(self._schema.names)

    @abstractmethod
    def _opened(self, file: LogFile) -> Any:  # noqa: ANN401 - pyarrow
        """Open the file; its schema."""

    @property
    @abstractmethod
    def _row_count(self) -> int:
        """Rows that the file claims to have."""

    @abstractmethod
    def _first_list(self, column: int) -> Any:  # noqa: ANN401 - pyarrow
        """The value in the first row of a column of lists, None for none."""

    @abstractmethod
    def _decoded(self, columns: Sequence[int]) -> Any:  # noqa: ANN401 - pyarrow
        """Some columns of all rows, as a table."""

    @property
    def _metadata(self) -> Mapping[bytes, bytes]:
        """What was written beside the columns."""
        return self._schema.metadata or {}

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self._schema)

    def told(self) -> dict[str, Any]:
        """What vftcli convert wrote beside the columns; nothing for files of other programs."""
        text = self._metadata.get(b"vftcli", b"{}")
        try:
            told = json.loads(text)
        except (ValueError, RecursionError):
            return {}
        good = isinstance(told, dict) and isinstance(told.get("joint_names", []), list)
        return told if good else {}

    @cached_property
    def lists(self) -> Mapping[int, int]:
        """Columns of lists and their length in the first row."""
        kinds = list(enumerate(self._schema.types))
        return {k: self._first_length(k) for k, kind in kinds if is_list(kind)}

    def _first_length(self, column: int) -> int:
        """Length of the list in the first row of a column, 0 for an empty one."""
        with guarded(self.path):
            value = self._first_list(column)
        return len(value) if value is not None else 0

    def load(self, columns: Sequence[int], clock: int | None) -> dict[int, Column]:
        """Decode some columns.

        Raises:
            LogError: If a column holds no numbers or its lists differ in length.
        """
        names = self._schema.names
        # pyarrow would hand over both under one name.
        if any(names.count(names[c]) > 1 for c in columns):
            raise LogError(f"{self.path}: two columns have one name; rename one of them.")
        self._check_size(columns)
        with guarded(self.path):
            # One after the other: of a long log all of them have no room in two forms.
            return {c: self._numbers(self._column(c), c, clock) for c in sorted(columns)}

    def _column(self, column: int) -> Any:  # noqa: ANN401 - pyarrow
        """One column's rows, those that are kept."""
        values = self._decoded([column]).column(0)
        return values if self._rows is None else values.take(self._rows)

    def _check_size(self, columns: Sequence[int]) -> None:
        """Check that columns may be unpacked: a few bytes of a page may stand for a billion rows.

        The rows are asked for, not the pages: on a damaged page's description pyarrow ends the
        whole process.

        Raises:
            LogError: If they hold more numbers than a log of this size can.
        """
        limit = max(UNPACKED_LIMIT, UNPACKED_RATIO * self._size)
        width = sum(self.lists.get(column, 1) for column in columns)
        if 8 * width * self._row_count > limit:
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

    def _numbers(self, values: Any, column: int, clock: int | None) -> Column:  # noqa: ANN401
        """A column as numbers; whole stamps stay whole, times become nanoseconds."""
        import pyarrow as pa

        if column in self.lists:
            return self._matrix(values, column)
        kind, name = values.type, self._schema.names[column]
        if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
            unit = pa.timestamp("ns") if pa.types.is_timestamp(kind) else pa.duration("ns")
            values = values.cast(unit).cast(pa.int64())
        elif pa.types.is_boolean(kind):
            values = values.cast(pa.uint8())
        elif not is_number(kind):
            raise LogError(f"{self.path}: column {name} holds {kind}, not numbers.")
        whole = column == clock and pa.types.is_integer(values.type) and not values.null_count
        target = np.int64 if whole else np.float64
        # Not copied where nothing is to be changed: what is picked of it is copied once more.
        return np.asarray(values.to_numpy()).astype(target, copy=False)

    def _matrix(self, values: Any, column: int) -> Column:  # noqa: ANN401 - pyarrow
        """A column of lists of one length. (T, k)"""
        length, name = self.lists[column], self._schema.names[column]
        values = values.combine_chunks()
        if hasattr(values, "chunks"):  # pyarrow keeps an empty or split column as chunks
            values = values.chunk(0) if values.num_chunks else values
        flat = values.flatten()
        even = np.all(np.asarray(values.value_lengths()) == length) if len(values) else True
        if values.null_count or not even or len(flat) != length * len(values):
            raise LogError(f"{self.path}: the lists of {name} are not all {length} long.")
        if not is_number(flat.type):
            raise LogError(f"{self.path}: the lists of {name} hold {flat.type}.")
        numbers = np.asarray(flat.to_numpy(zero_copy_only=False)).astype(np.float64)
        return numbers.reshape(len(values), length)


def is_list(kind: Any) -> bool:  # noqa: ANN401 - a pyarrow type
    """Whether a column holds lists."""
    import pyarrow as pa

    tests = (pa.types.is_list, pa.types.is_large_list, pa.types.is_fixed_size_list)
    return any(test(kind) for test in tests)


def is_number(kind: Any) -> bool:  # noqa: ANN401 - a pyarrow type
    """Whether a column holds numbers."""
    import pyarrow as pa

    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind))


@contextmanager
def guarded(path: Path) -> Iterator[None]:
    """Turn the errors of pyarrow's decoders into a LogError that names the file."""
    import pyarrow as pa

    try:
        yield
    except (
        pa.ArrowException, OSError, ValueError, KeyError, MemoryError, OverflowError,
    ) as error:  # fmt: skip
        reason = str(error).split("\n")[0][:120]
        raise LogError(f"{path}: a damaged Parquet or Arrow file ({reason})") from None


def read_columns(table: ColumnarTable, request: ReadChoice) -> RawLog:
    """Read a table: ours, a user's, or a file of a LeRobot dataset, of which one episode is read.

    Raises:
        LogError: If the columns cannot be told, or there is no such episode.
    """
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
