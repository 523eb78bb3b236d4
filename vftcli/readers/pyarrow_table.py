"""Tables that pyarrow decodes: on a damaged page of some, polars would end the whole process."""

from abc import abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from vftcli.readers.columnar import ColumnarTable, HeldColumns
from vftcli.readers.table import Column
from vftcli.signals.errors import LogError
from vftcli.signals.packages import needed


class PyarrowTable(ColumnarTable):
    """A table of record batches."""

    def _held_of(self, schema: Any, rows: int, metadata: Any) -> HeldColumns:  # noqa: ANN401
        """What a schema and the metadata beside it say."""
        lists = tuple(is_list(kind) for kind in schema.types)
        return HeldColumns(tuple(schema.names), lists, rows, (metadata or {}).get(b"vftcli", b"{}"))

    def _errors(self) -> tuple[type[BaseException], ...]:
        return (needed("pyarrow", "a table").ArrowException,)

    @abstractmethod
    def _decoded(self, columns: Sequence[int]) -> Any:  # noqa: ANN401 - pyarrow
        """Some columns of all rows, as a table."""

    def _numbers(self, columns: Sequence[int], clock: int | None) -> dict[int, Column]:
        # One after the other: of a long log all of them have no room in two forms.
        return {c: self._column(self._kept(c), c, clock) for c in columns}

    def _kept(self, column: int) -> Any:  # noqa: ANN401 - pyarrow
        """One column's rows, those that are kept."""
        values = self._decoded([column]).column(0)
        return values if self._rows is None else values.take(self._rows)

    def _column(self, values: Any, column: int, clock: int | None) -> Column:  # noqa: ANN401
        """A column as numbers; whole stamps stay whole, times become nanoseconds."""
        pa = needed("pyarrow", "a table")

        if column in self.lists:
            return self._matrix(values, column)
        kind, name = values.type, self._held.names[column]
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
        return plain(values).astype(target, copy=False)

    def _matrix(self, values: Any, column: int) -> Column:  # noqa: ANN401 - pyarrow
        """A column of lists of one length. (T, k)"""
        length, name = self.lists[column], self._held.names[column]
        values = values.combine_chunks()
        if hasattr(values, "chunks"):  # pyarrow keeps an empty or split column as chunks
            values = values.chunk(0) if values.num_chunks else values
        flat = values.flatten()
        even = np.all(np.asarray(values.value_lengths()) == length) if len(values) else True
        if values.null_count or not even or len(flat) != length * len(values):
            raise LogError(f"{self.path}: the lists of {name} are not all {length} long.")
        if not is_number(flat.type):
            raise LogError(f"{self.path}: the lists of {name} hold {flat.type}.")
        return plain(flat).astype(np.float64).reshape(len(values), length)


def plain(values: Any) -> Column:  # noqa: ANN401 - pyarrow
    """Numbers as an array, NaN where there is none.

    Where none is missing without pyarrow's own way, which imports pandas: 50 MB and half a second.
    """
    if hasattr(values, "chunks"):
        values = values.combine_chunks()
    if hasattr(values, "chunks") and values.num_chunks == 1:
        values = values.chunk(0)
    if values.null_count or hasattr(values, "chunks") or values.type.bit_width < 8:
        return np.asarray(values.to_numpy(zero_copy_only=False))
    return np.from_dlpack(values)


def is_list(kind: Any) -> bool:  # noqa: ANN401 - a pyarrow type
    """Whether a column holds lists."""
    pa = needed("pyarrow", "a table")

    tests = (pa.types.is_list, pa.types.is_large_list, pa.types.is_fixed_size_list)
    return any(test(kind) for test in tests)


def is_number(kind: Any) -> bool:  # noqa: ANN401 - a pyarrow type
    """Whether a column holds numbers."""
    pa = needed("pyarrow", "a table")

    return bool(pa.types.is_integer(kind) or pa.types.is_floating(kind))
