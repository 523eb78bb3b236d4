"""Parquet tables: pyarrow decodes them, and polars where it is not installed."""

from collections.abc import Iterator, Sequence
from io import BytesIO
from typing import Any

import numpy as np

from vftcli.readers.columnar import ColumnarTable, HeldColumns, episodes_of, read_columns
from vftcli.readers.pyarrow_table import PyarrowTable
from vftcli.readers.reader import InOnePieceError, LogFile, Reader
from vftcli.readers.table import Column
from vftcli.signals.errors import LogError
from vftcli.signals.packages import installed, needed

#: Rows that are decoded at a time of a long table, and bytes of a column that are read for them.
BLOCK_ROWS, BUFFER_BYTES = 1 << 13, 1 << 18


def parquet_table(file: LogFile) -> ColumnarTable:
    """A Parquet file as a table."""
    return PyarrowParquet(file) if installed("pyarrow") else PolarsParquet(file)


class PyarrowParquet(PyarrowTable):
    """A Parquet file, decoded by pyarrow."""

    def _opened(self, file: LogFile) -> HeldColumns:
        pq = needed("pyarrow.parquet", "a Parquet file")
        source = file.direct or BytesIO(file.content)
        self._direct = file.direct
        self._file = pq.ParquetFile(source, memory_map=False, pre_buffer=False)
        about = self._file.metadata
        return self._held_of(self._file.schema_arrow, int(about.num_rows), about.metadata)

    def _first_list(self, column: int) -> Any:  # noqa: ANN401 - pyarrow
        name = self._held.names[column]
        batches = self._file.iter_batches(batch_size=1, columns=[name], use_threads=False)
        first = next(iter(batches), None)
        return first.column(name)[0].as_py() if first is not None and first.num_rows else None

    def _decoded(self, columns: Sequence[int]) -> Any:  # noqa: ANN401 - pyarrow
        names = self._held.names
        return self._file.read(columns=[names[c] for c in columns], use_threads=False)

    @property
    def rows(self) -> int:
        """How many rows it has."""
        return self._held.rows

    def blocks(self, columns: Sequence[int], clock: int | None) -> Iterator[dict[int, Column]]:
        """Decode some columns as `load` does, some thousand rows at a time."""
        pa = needed("pyarrow", "a Parquet file")
        pq = needed("pyarrow.parquet", "a Parquet file")

        if self._rows is not None or self._direct is None:
            raise InOnePieceError
        names = self._names_of(columns)
        self._check_size(columns)
        with self._guarded():
            # Read ahead, or as a mapped file, all of it would lie in memory; so would groups that
            # are asked for together.
            file = pq.ParquetFile(
                self._direct, memory_map=False, pre_buffer=False, buffer_size=BUFFER_BYTES
            )
            for group in range(file.num_row_groups):
                for batch in file.iter_batches(
                    BLOCK_ROWS, [group], list(names.values()), use_threads=False
                ):
                    table = pa.Table.from_batches([batch])
                    yield {c: self._column(table.column(names[c]), c, clock) for c in columns}


class PolarsParquet(ColumnarTable):
    """A Parquet file, decoded by polars: a damaged one may show its words, or end the process."""

    def _opened(self, file: LogFile) -> HeldColumns:
        import polars as pl

        self._content = file.content
        schema = pl.read_parquet_schema(BytesIO(self._content))
        lists = tuple(isinstance(kind, pl.List | pl.Array) for kind in schema.values())
        told = pl.read_parquet_metadata(BytesIO(self._content)).get("vftcli", "{}")
        rows = pl.scan_parquet(BytesIO(self._content)).select(pl.len()).collect().item()
        return HeldColumns(tuple(schema), lists, rows, told)

    def _errors(self) -> tuple[type[BaseException], ...]:
        from polars.exceptions import PanicException, PolarsError

        return PolarsError, PanicException

    def _first_list(self, column: int) -> Any:  # noqa: ANN401 - a list
        import polars as pl

        name = self._held.names[column]
        return pl.scan_parquet(BytesIO(self._content)).select(name).head(1).collect().item()

    def _numbers(self, columns: Sequence[int], clock: int | None) -> dict[int, Column]:
        import polars as pl

        names = [self._held.names[c] for c in columns]
        table = pl.read_parquet(BytesIO(self._content), columns=names)
        if self._rows is not None:
            table = table[self._rows]
        each = zip(columns, names, strict=True)
        return {c: self._column(table[name], c, c == clock) for c, name in each}

    def _column(self, values: Any, column: int, is_clock: bool) -> Column:  # noqa: ANN401 - polars
        """A column as numbers, (T,) or (T, k); times become nanoseconds."""
        import polars as pl

        if column in self.lists:
            return self._matrix(values, self.lists[column])
        if isinstance(values.dtype, pl.Datetime | pl.Duration):
            values = values.dt.cast_time_unit("ns").to_physical()
        elif values.dtype == pl.Boolean:
            values = values.cast(pl.UInt8)
        elif not is_number(values.dtype):
            raise LogError(f"{self.path}: column {values.name} holds {values.dtype}, not numbers.")
        whole = is_clock and values.dtype.is_integer() and not values.null_count()
        return np.asarray(values.to_numpy()).astype(np.int64 if whole else np.float64)

    def _matrix(self, values: Any, length: int) -> Column:  # noqa: ANN401 - polars
        """A column of lists of one length. (T, k)"""
        import polars as pl

        lists = values.arr.to_list() if isinstance(values.dtype, pl.Array) else values
        if lists.null_count() or (lists.list.len() != length).any():
            raise LogError(f"{self.path}: the lists of {values.name} are not all {length} long.")
        if not is_number(lists.dtype.inner):
            raise LogError(f"{self.path}: the lists of {values.name} hold {lists.dtype.inner}.")
        numbers = np.empty((len(lists), length))
        numbers[:] = lists.list.to_array(length).to_numpy() if length else 0.0
        return numbers


def is_number(kind: Any) -> bool:  # noqa: ANN401 - a type of polars
    """Whether a column holds numbers."""
    return bool(kind.is_integer() or kind.is_float())


PARQUET = Reader(
    name="parquet",
    recognises=lambda file: file.head.startswith(b"PAR1"),
    read=lambda file, request: read_columns(parquet_table(file), request),
    episodes=lambda file: episodes_of(parquet_table(file).episodes()),
)
