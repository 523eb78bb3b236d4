"""Parquet tables."""

from collections.abc import Iterator, Mapping, Sequence
from io import BytesIO
from typing import Any

from vftcli.readers.columnar import ColumnarTable, episodes_of, guarded, read_columns
from vftcli.readers.reader import InOnePieceError, LogFile, Reader
from vftcli.readers.table import Column

BLOCK_ROWS, BUFFER_BYTES = 1 << 13, 1 << 18
"""Rows that are decoded at a time of a long table, and bytes of a column that are read for them."""


class ParquetTable(ColumnarTable):
    """A Parquet file."""

    def _opened(self, file: LogFile) -> Any:  # noqa: ANN401 - pyarrow
        import pyarrow.parquet as pq

        source = file.direct or BytesIO(file.content)
        self._direct = file.direct
        self._file = pq.ParquetFile(source, memory_map=file.direct is not None)
        return self._file.schema_arrow

    @property
    def _row_count(self) -> int:
        return int(self._file.metadata.num_rows)

    @property
    def _metadata(self) -> Mapping[bytes, bytes]:
        return self._file.metadata.metadata or {}

    def _first_list(self, column: int) -> Any:  # noqa: ANN401 - pyarrow
        name = self._schema.names[column]
        batches = self._file.iter_batches(batch_size=1, columns=[name], use_threads=False)
        first = next(iter(batches), None)
        return first.column(name)[0].as_py() if first is not None and first.num_rows else None

    def _decoded(self, columns: Sequence[int]) -> Any:  # noqa: ANN401 - pyarrow
        names = self._schema.names
        return self._file.read(columns=[names[c] for c in columns], use_threads=False)

    @property
    def rows(self) -> int:
        """How many rows it has."""
        return self._row_count

    def blocks(self, columns: Sequence[int], clock: int | None) -> Iterator[dict[int, Column]]:
        """Decode some columns as `load` does, some thousand rows at a time.

        Raises:
            InOnePieceError: If rows of one episode stand among others.
            LogError: As `load` raises it.
        """
        import pyarrow as pa
        import pyarrow.parquet as pq

        if self._rows is not None or self._direct is None:
            raise InOnePieceError
        names = self._names_of(columns)
        self._check_size(columns)
        with guarded(self.path):
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
                    yield {c: self._numbers(table.column(names[c]), c, clock) for c in columns}


PARQUET = Reader(
    name="parquet",
    recognises=lambda file: file.head.startswith(b"PAR1"),
    read=lambda file, request: read_columns(ParquetTable(file), request),
    episodes=lambda file: episodes_of(ParquetTable(file).episodes()),
)
