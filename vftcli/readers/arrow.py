"""Arrow tables: Feather files (version 2) and streams of record batches."""

import struct
from collections.abc import Iterator, Sequence
from typing import Any

from vftcli.readers.formats import LogFormat
from vftcli.readers.opening import check_unpacked
from vftcli.readers.parquet import ColumnarTable, episodes_of, read_columns
from vftcli.readers.reader import LogFile, RawLog, ReadChoice

FILE_MAGIC = b"ARROW1\0\0"  #: How a file begins; a stream has no such mark.
NUMBER = struct.Struct("<q")  #: A whole number in a message.
#: Places of fields in Arrow's Message, RecordBatch and DictionaryBatch (format/Message.fbs).
MESSAGE_HEADER, BATCH_ROWS, BATCH_BUFFERS, BATCH_PACKING, DICTIONARY_BATCH = 2, 0, 2, 3, 1


class ArrowTable(ColumnarTable):
    """An Arrow file or stream; a file is a stream behind its magic, its index is not needed."""

    def _opened(self, file: LogFile) -> tuple[Any, int]:
        import pyarrow as pa

        content = pa.py_buffer(file.content)
        self._content = content.slice(len(FILE_MAGIC) if file.head.startswith(FILE_MAGIC) else 0)
        batches = tuple(claims(self._content))
        check_unpacked(file.path, sum(size for _, size in batches), self._size)
        return pa.ipc.open_stream(self._content).schema, sum(rows for rows, _ in batches)

    def _first_list(self, column: int) -> Any:  # noqa: ANN401 - pyarrow
        for batch in self._stream([column]):
            batch.validate(full=True)
            if batch.num_rows:
                return batch.column(0)[0].as_py()
        return None

    def _decoded(self, columns: Sequence[int]) -> Any:  # noqa: ANN401 - pyarrow
        table = self._stream(columns).read_all()
        table.validate(full=True)  # a damaged offset would lead out of the file
        return table

    def _stream(self, columns: Sequence[int]) -> Any:  # noqa: ANN401 - pyarrow
        """The batches, of some columns."""
        import pyarrow as pa

        options = pa.ipc.IpcReadOptions(use_threads=False, included_fields=list(columns))
        return pa.ipc.open_stream(self._content, options=options)


def claims(content: Any) -> Iterator[tuple[int, int]]:  # noqa: ANN401 - pyarrow
    """Rows of each batch, and the bytes it says to unpack to; nothing is unpacked."""
    import pyarrow as pa

    reader = pa.ipc.MessageReader.open_stream(content)
    while True:
        try:
            message = reader.read_next_message()
        except StopIteration:
            return
        if message.type not in {"record batch", "dictionary"}:
            continue
        try:
            table = Flat(memoryview(message.metadata)).table(MESSAGE_HEADER)
            if message.type == "dictionary":
                table = table.table(DICTIONARY_BATCH)
            size = unpacked(table, memoryview(message.body or b""))
            rows = table.number(BATCH_ROWS) if message.type == "record batch" else 0
        except struct.error:
            raise ValueError("a batch that contradicts itself") from None
        if rows < 0 or size < 0:
            raise ValueError("a batch of negative size")
        yield rows, size


def unpacked(batch: "Flat", body: memoryview) -> int:
    """Bytes that the buffers of a batch say to unpack to."""
    packed, total = batch.has(BATCH_PACKING), 0
    for start, length in batch.pairs(BATCH_BUFFERS):
        claimed = length
        if packed and length >= NUMBER.size:
            (claimed,) = NUMBER.unpack_from(body, start)
            claimed = length if claimed == -1 else claimed  # -1: stored as it is
        total += claimed
    return total


class Flat:
    """A table of a flatbuffer, in which Arrow describes a batch."""

    def __init__(self, data: memoryview, place: int | None = None) -> None:
        self._data = data
        self._place = self._at("<I", 0) if place is None else place
        self._fields = self._place - self._at("<i", self._place)

    def _at(self, kind: str, place: int) -> int:
        """A number at a place."""
        if place < 0:
            raise struct.error
        return int(struct.unpack_from(kind, self._data, place)[0])

    def _field(self, index: int) -> int | None:
        """Place of a field, None where it is left out."""
        if 4 + 2 * index >= self._at("<H", self._fields):
            return None
        offset = self._at("<H", self._fields + 4 + 2 * index)
        return self._place + offset if offset else None

    def has(self, index: int) -> bool:
        """Whether a field is there."""
        return self._field(index) is not None

    def number(self, index: int) -> int:
        """A field of 64 bits, 0 where it is left out."""
        place = self._field(index)
        return 0 if place is None else self._at("<q", place)

    def table(self, index: int) -> "Flat":
        """A field that is a table."""
        place = self._field(index)
        if place is None:
            raise struct.error
        return Flat(self._data, place + self._at("<I", place))

    def pairs(self, index: int) -> Iterator[tuple[int, int]]:
        """A field that is a row of pairs of numbers."""
        place = self._field(index)
        if place is None:
            return
        place += self._at("<I", place)
        for k in range(self._at("<I", place)):
            at = place + 4 + 16 * k
            yield self._at("<q", at), self._at("<q", at + 8)


def read(file: LogFile, request: ReadChoice, _: LogFormat) -> RawLog:
    """Read an Arrow file or stream."""
    return read_columns(ArrowTable(file), request)


def episodes_in(file: LogFile) -> tuple[int, ...]:
    """The numbers of its episodes."""
    return episodes_of(ArrowTable(file).episodes())
