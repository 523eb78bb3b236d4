"""ROS 1 bags, version 2.0: rosbags' records from the start, so that an unclosed bag reads too.

Format: http://wiki.ros.org/Bags/Format/2.0. The reader of rosbags needs the index at the end,
which a cut bag lacks, unpacks without bounds, and parses the head of every message by itself. Here
the index behind each chunk says where its messages begin, and their heads are read as columns.
"""

import io
from collections.abc import Iterator
from typing import BinaryIO

import numpy as np
from rosbags.rosbag1.reader import Header, ReaderError, RecordType, read_bytes, read_uint32

from vftcli.readers.bags.container import (
    Batch,
    Bytes,
    Census,
    Channel,
    Ingest,
    Integers,
    chunk_file,
    file_of,
    printable,
    strided,
    type_name,
)
from vftcli.readers.opening import LogFile
from vftcli.signals.errors import LogError

MESSAGE, CONNECTION = bytes([RecordType.MSGDATA]), bytes([RecordType.CONNECTION])
MAGIC_SIZE = 13  #: Bytes before the first record.
ROWS = 65_536  #: Heads that are gathered at once.
#: What a field of a header takes at least, but for those that no recorder writes.
BYTES_PER_FIELD = 8


def batches(file: LogFile, ingest: Ingest) -> Iterator[Batch]:
    """Messages of a bag, chunk by chunk, up to the last whole chunk."""
    bag, records = _Bag(ingest), file_of(file.content)
    end = records.seek(MAGIC_SIZE)
    while True:
        try:
            header, data = _record(records, ingest)
        except ReaderError:  # the content ends before or inside it
            break
        yield from bag.take(header, data)
        end = records.tell()
    yield from bag.last_chunk()
    bag.census.tell(ingest, len(file.content) - end, "its index")


def _record(file: BinaryIO, ingest: Ingest) -> tuple[Header, bytes]:
    fields = read_bytes(file, read_uint32(file))
    ingest.spend(1 + len(fields) // BYTES_PER_FIELD)
    return _header(fields), read_bytes(file, read_uint32(file))


def _header(fields: bytes) -> Header:
    return Header.read(io.BytesIO(len(fields).to_bytes(4, "little") + fields))


class _Bag:
    """What is known of a bag while its records come in.

    Attributes:
        census: What its header and index count, and what was found.
        channels: Connection → topic.
        chunk: The last chunk, until its messages were yielded.
        starts: Where messages begin in it, as the records behind it say.
        listed, counted: Chunks that the index at the end lists; messages that it counts.
    """

    def __init__(self, ingest: Ingest) -> None:
        self.ingest = ingest
        self.census = Census()
        self.channels: dict[bytes, Channel] = {}
        self.chunk: io.BytesIO | None = None
        self.starts: list[Integers] = []
        self.listed = self.counted = 0

    def take(self, header: Header, data: bytes) -> Iterator[Batch]:
        """Take up a record; the messages of the chunk before it, if it is another."""
        op, census = header.get_uint8("op"), self.census
        if op == RecordType.IDXDATA:
            self.starts.append(np.frombuffer(data, dtype="<u4")[2::3].astype(np.int64))
            return
        yield from self.last_chunk()
        if op == RecordType.CHUNK:
            name, size = header.get_string("compression"), header.get_uint32("size")
            self.chunk = chunk_file(self.ingest, name, data, size)
        elif op == RecordType.CONNECTION:
            self._connect(header, data)
        elif op == RecordType.CHUNK_INFO:
            self.listed += 1
            self.counted += int(np.frombuffer(data, dtype="<u4")[1::2].sum())
            census.counted = self.counted if self.listed == census.counted_chunks else None
        elif op == RecordType.BAGHEADER:
            if header.get("encryptor"):
                raise self._refusal("the bag is encrypted. Decrypt it first.")
            census.closed = header.get_uint64("index_pos") > 0  # written when the bag is closed
            census.counted_chunks = header.get_uint32("chunk_count") if census.closed else None
        else:
            raise self._refusal("an unknown record; the bag is damaged.")

    def _refusal(self, why: str) -> LogError:
        return LogError(f"{self.ingest.path}: {why}")

    def _connect(self, header: Header, data: bytes) -> None:
        about = _header(data)
        self.channels[header["conn"]] = Channel(
            topic=printable(header["topic"].decode("utf-8", "replace")),
            type=type_name(about.get_string("type")),
            encoding="ros1",
            definition=about["message_definition"].decode("utf-8", "replace"),
        )

    def last_chunk(self) -> Iterator[Batch]:
        """The messages of the last chunk, if they were not yielded yet."""
        chunk, starts = self.chunk, self.starts
        if chunk is None:
            return
        self.chunk, self.starts = None, []
        buffer = np.frombuffer(chunk.getbuffer(), dtype=np.uint8)
        begins = np.sort(np.concatenate(starts)) if starts else self._begins(chunk, len(buffer))
        self.census.chunks += 1
        self.census.kept += len(begins)
        if not begins.size:
            return
        heads = _heads(buffer, begins)
        size = heads.shape[1]
        lengths, data = _words(heads, size - 4)[:, 0], begins + size
        self._between(chunk, np.append(0, data + lengths), np.append(begins, len(buffer)))
        first = heads[0].tobytes()
        conn, time = first.find(b"conn=") + 5, first.find(b"time=") + 5
        varied = np.r_[conn : conn + 4, time : time + 8, size - 4 : size]
        alike, header = np.delete(heads, varied, axis=1), _header(first[4:-4])
        settled = MESSAGE, first[conn : conn + 4], first[time : time + 8]
        if (header["op"], header["conn"], header["time"]) != settled or (alike != alike[0]).any():
            raise self._refusal("heads of a chunk's messages differ; damaged.")
        numbers, times = _words(heads, conn)[:, 0], _words(heads, time, 2) @ (10**9, 1)
        for place in np.sort(np.unique(numbers, return_index=True)[1]):
            number, rows = heads[place, conn : conn + 4].tobytes(), numbers == numbers[place]
            if number not in self.channels:
                raise self._refusal("messages of an unknown topic; damaged.")
            channel = self.channels[number]
            yield Batch(channel, buffer, data[rows], lengths[rows], times[rows])

    def _begins(self, chunk: io.BytesIO, end: int) -> Integers:
        begins, place = [], 0
        while place < end:
            if _record(chunk, self.ingest)[0]["op"] == MESSAGE:
                begins.append(place)
            place = chunk.tell()
        return np.array(begins, dtype=np.int64)

    def _between(self, chunk: io.BytesIO, starts: Integers, ends: Integers) -> None:
        """Take up what lies between messages: nothing but connections."""
        for start, end in np.stack([starts, ends], axis=1)[starts != ends].tolist():
            chunk.seek(start)
            while chunk.tell() < end:
                header, data = _record(chunk, self.ingest)
                if header["op"] != CONNECTION:
                    break
                self._connect(header, data)
            if chunk.tell() != end:
                raise self._refusal("a chunk and its index count differently; it is damaged.")


def _heads(buffer: Bytes, begins: Integers) -> Bytes:
    """The heads of messages, as long as the first one's, with their data's lengths. (k, size)"""
    size = 8 + int(buffer[begins[0] : begins[0] + 4].view("<u4")[0])
    if max(int(begins[-1]) + size, size * len(begins)) > len(buffer):
        raise ReaderError("the index of a chunk points outside it")
    pieces = np.array_split(begins, 1 + len(begins) // ROWS)
    return np.concatenate([strided(buffer, piece, 0, size) for piece in pieces])


def _words(heads: Bytes, start: int, count: int = 1) -> Integers:
    part = np.ascontiguousarray(heads[:, start : start + 4 * count])
    return part.view("<u4").astype(np.int64)
