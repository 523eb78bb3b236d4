"""Parquet tables."""

from collections.abc import Mapping, Sequence
from io import BytesIO
from typing import Any

from vftcli.readers.columnar import ColumnarTable, episodes_of, read_columns
from vftcli.readers.reader import LogFile, Reader


class ParquetTable(ColumnarTable):
    """A Parquet file."""

    def _opened(self, file: LogFile) -> Any:  # noqa: ANN401 - pyarrow
        import pyarrow.parquet as pq

        source = file.direct or BytesIO(file.content)
        self._file = pq.ParquetFile(source, memory_map=False, pre_buffer=False)
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


PARQUET = Reader(
    name="parquet",
    recognises=lambda file: file.head.startswith(b"PAR1"),
    read=lambda file, request: read_columns(ParquetTable(file), request),
    episodes=lambda file: episodes_of(ParquetTable(file).episodes()),
)
