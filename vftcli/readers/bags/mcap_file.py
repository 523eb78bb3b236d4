"""MCAP files: mcap's stream reader from the start, so that a cut file reads up to its last chunk.

Format: https://mcap.dev/spec. The reader unpacks a chunk to whatever it holds, so chunks are
unpacked here, within bounds, and handed to it as files of records.
"""

import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from typing import BinaryIO

from mcap import records
from mcap.exceptions import EndOfFile, RecordLengthLimitExceeded
from mcap.stream_reader import MAGIC_SIZE, StreamReader

from vftcli.readers.bags.container import (
    Batch,
    Census,
    Channel,
    ChannelRun,
    Ingest,
    batched,
    chunk_file,
    file_of,
    printable,
    type_name,
)
from vftcli.readers.reader import LogFile
from vftcli.signals.errors import LogError

DATA = (
    records.Schema, records.Channel, records.Message, records.Chunk, records.MessageIndex,
    records.Attachment, records.Metadata,
)  # fmt: skip
DATA_END_BYTES = 13  #: Length of the record that ends the data, its head included.

ENCODINGS = {"cdr", "ros1", "json", "protobuf"}  #: How messages are serialised that may be read.


def batches(file: LogFile, ingest: Ingest) -> Iterator[Batch]:
    """Messages of an MCAP file, up to the last whole chunk."""
    return batched(_Mcap(ingest).runs(file.content), ingest)


def _records(
    file: BinaryIO, size: int, *, inside: bool
) -> Iterator[tuple[records.McapRecord, int]]:
    """The records of a file, or inside a chunk, up to the last whole one; where each ends."""
    # A chunk inside a chunk is none: they could hold one another without end.
    reader = StreamReader(file, skip_magic=inside, emit_chunks=True, record_size_limit=size)
    with suppress(EndOfFile, RecordLengthLimitExceeded, struct.error):
        for record in reader.records:
            yield record, file.tell()


class _Mcap:
    """Schemas and channels met so far, what the summary says, and what was found."""

    def __init__(self, ingest: Ingest) -> None:
        self.ingest = ingest
        self.census = Census()
        self.schemas: dict[int, records.Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.indexed = 0

    def runs(self, content: memoryview) -> Iterator[ChannelRun]:
        """The messages of the file, chunk by chunk, those outside chunks one by one."""
        census, end = self.census, MAGIC_SIZE
        for record, place in _records(file_of(content), len(content), inside=False):
            end = place
            if isinstance(record, DATA) and not census.closed:
                census.data_end = end
            if isinstance(record, records.Message):
                census.kept += 1
                yield ChannelRun(
                    self.channels.get(record.channel_id), [record.log_time], [record.data]
                )
            elif isinstance(record, records.Chunk):
                census.chunks += 1
                yield from self._chunk(record)
            elif isinstance(record, records.Footer):
                self._close(record, len(content) - end)
                end = len(content)
                break
            else:
                self._take(record, end)
        if self.indexed > census.chunks:
            census.counted_chunks = self.indexed
        census.tell(self.ingest, len(content) - end, "its statistics")

    def _take(self, record: records.McapRecord, end: int) -> None:
        """Take up a record that is neither a message nor a chunk."""
        if isinstance(record, records.Schema):
            self.schemas[record.id] = record
        elif isinstance(record, records.Channel):
            self._channel(record)
        elif isinstance(record, records.Statistics):
            self.census.closed, self.census.counted = True, record.message_count
        elif isinstance(record, records.ChunkIndex):
            self.indexed += 1
        elif isinstance(record, records.DataEnd):
            self.census.closed, self.census.data_end = True, end - DATA_END_BYTES

    def _close(self, footer: records.Footer, left: int) -> None:
        """Take up the footer, which says where the messages should end."""
        if left != MAGIC_SIZE:
            raise LogError(
                f"{self.ingest.path}: {left} bytes follow its end where {MAGIC_SIZE} should; it "
                "is damaged."
            )
        if footer.summary_start:
            data_end = footer.summary_start - DATA_END_BYTES
            self.census.missing = data_end - self.census.data_end

    def _channel(self, record: records.Channel) -> None:
        """Take up a channel, whose schema came before it."""
        schema = self.schemas.get(record.schema_id, records.Schema(0, b"", "", ""))
        is_ros = schema.encoding in {"ros1msg", "ros2msg", "ros2idl"}
        text = schema.data.decode("utf-8", "replace") if is_ros else ""
        self.channels[record.id] = Channel(
            topic=printable(record.topic),
            type=type_name(schema.name) if text else printable(schema.name),
            encoding=record.message_encoding if record.message_encoding in ENCODINGS else "other",
            definition=text,
            idl=schema.encoding == "ros2idl",
        )

    def _chunk(self, chunk: records.Chunk) -> Iterator[ChannelRun]:
        """The messages of a chunk, unpacked and checked."""
        file = chunk_file(self.ingest, chunk.compression, chunk.data, chunk.uncompressed_size)
        # A checksum of zero means that the writer made none.
        if chunk.uncompressed_crc and zlib.crc32(file.getbuffer()) != chunk.uncompressed_crc:
            raise LogError(f"{self.ingest.path}: a chunk does not match its checksum; damaged.")
        found: dict[int, ChannelRun] = {}
        end, size = 0, len(file.getbuffer())
        for record, place in _records(file, size, inside=True):
            end = place
            if isinstance(record, records.Message):
                if (number := record.channel_id) not in found:
                    found[number] = ChannelRun(self.channels.get(number), [], [])
                found[number].times.append(record.log_time)
                found[number].contents.append(record.data)
            else:
                self._take(record, 0)
        if end < size:
            raise LogError(f"{self.ingest.path}: a record ends outside its chunk; damaged.")
        self.census.kept += sum(len(run.contents) for run in found.values())
        yield from found.values()
