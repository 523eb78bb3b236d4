"""Columns of Arrow's kind, flat or of lists as LeRobot writes them, by pyarrow.

Parquet, Feather 2 and streams of record batches; polars ends the process on some damage.
"""

import json
import struct
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import cached_property, partial
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.readers.opening import LogFile, check_unpacked, naming_damage
from vftcli.readers.reader import Episodes, RawLog, ReadChoice
from vftcli.readers.table import Arrow, Blocks, Column, Places, Table, numbers_of
from vftcli.readers.tables import from_table
from vftcli.signals.arrays import Indices
from vftcli.signals.errors import LogError
from vftcli.signals.wrench import WrenchFrame

EPISODE = "episode_index"
#: Rows that are decoded at a time, and bytes of a column that are read for them.
BLOCK_ROWS, BUFFER_BYTES = 1 << 13, 1 << 18

FILE_MAGIC = b"ARROW1\0\0"  #: How a file of Arrow begins.
ARROW = (FILE_MAGIC, b"\xff\xff\xff\xff")  #: How a file and a stream of Arrow begin.
#: Whole numbers in a message: an offset or a count, and a number of 64 bits.
COUNT, NUMBER = struct.Struct("<I"), struct.Struct("<q")
#: Fields of Arrow's messages, by format/Message.fbs.
MESSAGE_HEADER, BATCH_ROWS, BATCH_BUFFERS, BATCH_PACKING, DICTIONARY_BATCH = 2, 0, 2, 3, 1


@contextmanager
def guarded(path: Path) -> Iterator[None]:
    """Turn errors of pyarrow, and Python's own, into a LogError naming the file."""
    from pyarrow import ArrowException

    with naming_damage(path, "a damaged Parquet or Arrow file", ArrowException):
        yield


class ColumnarTable(Table):
    """A file of columns; only those asked for are decoded."""

    def __init__(self, file: LogFile) -> None:
        self.path: Path = file.path
        self.rows: Indices | None = None  #: Rows to decode, None for all.
        self._size = len(file.content)
        with guarded(self.path):
            schema, self._count = self._opened(file)
            about = (schema.metadata or {}).get(b"vftcli", b"{}")
            lists = ("list<", "large_list<", "fixed_size_list<")
            self._lists = [
                k for k, kind in enumerate(schema.types) if str(kind).startswith(lists)
            ]
            if self._count == 0:
                raise LogError(
                    f"{file.path}: the table has no rows; nothing was recorded into it."
                )
        #: What vftcli convert wrote beside the columns, else nothing.
        self.about: dict[str, Any] = {}
        with suppress(ValueError, RecursionError, AttributeError):
            found = json.loads(about)
            self.about = found if isinstance(found.get("joint_names", []), list) else {}
        self.names = tuple(schema.names)
        self.width = len(self.names)

    @abstractmethod
    def _opened(self, file: LogFile) -> tuple[Any, int]:
        """Open the file; its schema, and how many rows it says it has."""

    @abstractmethod
    def _batches(self, columns: Places, rows: int) -> Iterator[Arrow]:
        """Some columns of all rows, not many more than so many at a time."""

    @cached_property
    def lists(self) -> Mapping[int, int]:
        """Columns of lists and their length in the first row."""
        with guarded(self.path):
            found = {}
            for k in self._lists:
                batch = next((b for b in self._batches([k], 1) if b.num_rows), None)
                first = None if batch is None else batch.column(0)[0].as_py()
                found[k] = len(first or ())
            return found

    def blocks(self, columns: Places, clock: int | None) -> Blocks:
        """Decoded columns, their size checked: a few bytes may claim a billion rows.

        Rows are asked for, not pages: pyarrow ends the process on a damaged page header.
        """
        # Decoders hand over two columns of one name under that name.
        if any(self.names.count(self.names[c]) > 1 for c in columns):
            raise LogError(f"{self.path}: two columns have one name; rename one of them.")
        width = sum(self.lists.get(column, 1) for column in columns)
        check_unpacked(self.path, 8 * width * self._count, self._size)
        with guarded(self.path):
            start = 0
            for batch in self._batches(columns, BLOCK_ROWS):
                each = {c: batch.column(self.names[c]) for c in columns}
                if self.rows is not None:
                    ends = np.searchsorted(self.rows, [start, start + batch.num_rows])
                    own = self.rows[slice(*ends)] - start
                    each = {c: values.take(own) for c, values in each.items()}
                start += batch.num_rows
                yield {c: self._column(values, c, clock) for c, values in each.items()}

    def _column(self, values: Arrow, column: int, clock: int | None) -> Column:
        """A column as numbers; whole stamps stay whole, times become nanoseconds."""
        import pyarrow as pa

        name, length = self.names[column], self.lists.get(column)
        if length is not None:
            even, flat = np.all(np.asarray(values.value_lengths()) == length), values.flatten()
            if values.null_count or not even or len(flat) != length * len(values):
                raise LogError(f"{self.path}: the lists of {name} are not all {length} long.")
            values = flat
        kind = values.type
        if pa.types.is_timestamp(kind) or pa.types.is_duration(kind):
            unit = pa.timestamp("ns") if pa.types.is_timestamp(kind) else pa.duration("ns")
            values = values.cast(unit).cast(pa.int64())
        elif pa.types.is_boolean(kind):
            values = values.cast(pa.uint8())
        elif not pa.types.is_integer(kind) and not pa.types.is_floating(kind):
            raise LogError(f"{self.path}: column {name} holds {kind}, not numbers.")
        whole = column == clock and pa.types.is_integer(values.type) and not values.null_count
        target = np.int64 if whole else np.float64
        # What is picked of it is copied once more.
        numbers = numbers_of(values).astype(target, copy=False)
        return numbers if length is None else numbers.reshape(-1, length)

    def episodes(self) -> Column:
        """The episode of each row as LeRobot numbers them; empty elsewhere. (T,)"""
        if EPISODE not in self.names:
            return np.empty(0)
        column = self.names.index(EPISODE)
        numbers = self.load([column])[column]
        if numbers.ndim != 1 or not np.isfinite(numbers).all():
            raise LogError(f"{self.path}: {EPISODE} is not a number in every row.")
        return numbers


class ParquetTable(ColumnarTable):
    """A Parquet file."""

    def _opened(self, file: LogFile) -> tuple[Any, int]:
        import pyarrow.parquet as pq

        # Read ahead, or as a mapped file, all of it would lie in memory.
        self.file = pq.ParquetFile(
            file.direct or BytesIO(file.content),
            memory_map=False,
            pre_buffer=False,
            buffer_size=BUFFER_BYTES,
        )
        about = self.file.metadata  # vftcli's own is the file's, not the schema's
        return self.file.schema_arrow.with_metadata(about.metadata), int(about.num_rows)

    def _batches(self, columns: Places, rows: int) -> Iterator[Arrow]:
        names = [self.names[c] for c in columns]
        for group in range(self.file.num_row_groups):  # one at a time in memory
            yield from self.file.iter_batches(rows, [group], names, use_threads=False)


class ArrowTable(ColumnarTable):
    """An Arrow file or stream: a file is a stream behind its magic."""

    def _opened(self, file: LogFile) -> tuple[Any, int]:
        import pyarrow as pa

        content = pa.py_buffer(file.content)
        self._content = content.slice(len(FILE_MAGIC) if file.head.startswith(FILE_MAGIC) else 0)
        batches = tuple(claims(self._content))
        check_unpacked(file.path, sum(size for _, size in batches), self._size)
        return pa.ipc.open_stream(self._content).schema, sum(rows for rows, _ in batches)

    def _batches(self, columns: Places, rows: int) -> Iterator[Arrow]:
        import pyarrow as pa

        options = pa.ipc.IpcReadOptions(use_threads=False, included_fields=list(columns))
        for batch in pa.ipc.open_stream(self._content, options=options):
            batch.validate(full=True)  # a damaged offset would lead out of the file
            for start in range(0, batch.num_rows, rows):
                yield batch.slice(start, rows)


def claims(content: Arrow) -> Iterator[tuple[int, int]]:
    """Rows of each batch, and the bytes that it says to unpack to."""
    import pyarrow as pa

    for message in pa.ipc.MessageReader.open_stream(content):
        if message.type not in {"record batch", "dictionary"}:
            continue
        rows, size = 0, 0
        data, body = memoryview(message.metadata), memoryview(message.body or b"")
        try:
            table = fields_at(data, fields_at(data, 0)[MESSAGE_HEADER])
            if message.type == "dictionary":
                table = fields_at(data, table[DICTIONARY_BATCH])
            elif BATCH_ROWS in table:
                (rows,) = NUMBER.unpack_from(data, table[BATCH_ROWS])
            place = table.get(BATCH_BUFFERS, 0)
            place += COUNT.unpack_from(data, place)[0]
            count = COUNT.unpack_from(data, place)[0] if BATCH_BUFFERS in table else 0
            pairs = iter(struct.unpack_from(f"<{2 * count}q", data, place + COUNT.size))
            for start, length in zip(pairs, pairs, strict=True):
                behind = BATCH_PACKING in table and length >= NUMBER.size
                claimed = NUMBER.unpack_from(body, start)[0] if behind else length
                size += length if claimed == -1 else claimed  # -1: stored as it is
        except (struct.error, KeyError):
            raise ValueError("a batch that contradicts itself") from None
        if rows < 0 or size < 0:
            raise ValueError("a batch of negative size")
        yield rows, size


def fields_at(data: memoryview, place: int) -> dict[int, int]:
    """Places of the fields of a flatbuffer's table."""
    start = place + COUNT.unpack_from(data, place)[0]
    own = start - struct.unpack_from("<i", data, start)[0]
    if own < 0:
        raise struct.error
    size, _ = struct.unpack_from("<2H", data, own)
    offsets = enumerate(struct.unpack_from(f"<{size // 2 - 2}H", data, own + 4))
    return {k: start + offset for k, offset in offsets if offset}


@contextmanager
def episodes(file: LogFile) -> Iterator[Episodes]:
    """The logs of a table: ours, a user's, or the episodes of a LeRobot file."""
    table = (ArrowTable if file.head.startswith(ARROW) else ParquetTable)(file)
    numbers, about = table.episodes(), table.about
    there = episodes_of(numbers)

    def read(number: int, request: ReadChoice) -> RawLog:
        table.rows = np.flatnonzero(numbers == number) if len(there) > 1 else None
        raw = from_table(table, request)
        names = raw.joint_names or tuple(str(name) for name in about.get("joint_names") or ())
        frame = raw.wrench_frame or WrenchFrame.of_conversion(about.get("wrench_frame"))
        hint = raw.robot_hint or about.get("robot")
        return replace(raw, wrench_frame=frame, joint_names=names, robot_hint=hint)

    yield {number: partial(read, number) for number in there}


def episodes_of(numbers: Column) -> tuple[int, ...]:
    """The numbers of a table's episodes, rising; 0 of one without."""
    return tuple(int(number) for number in np.unique(numbers)) or (0,)
