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
    ROSBAG1,
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
from vftcli.signals.errors import LogError

MESSAGE, CONNECTION = bytes([RecordType.MSGDATA]), bytes([RecordType.CONNECTION])


def batches(content: memoryview, ingest: Ingest) -> Iterator[Batch]:
    """Messages of a bag, chunk by chunk, up to the last whole chunk.

    Raises:
        LogError: If a chunk is damaged or the bag is encrypted.
    """
    bag, file = _Bag(ingest), file_of(content)
    end = file.seek(len(ROSBAG1))
    while (whole := _whole(file)) is not None:
        yield from bag.take(*whole)
        end = file.tell()
    yield from bag.last_chunk()
    bag.census.tell(ingest, len(content) - end, "its index")


def record(file: BinaryIO) -> tuple[Header, bytes]:
    """The header and the data of the next record.

    Raises:
        ReaderError: If the file ends before or inside it.
    """
    return Header.read(file), read_bytes(file, read_uint32(file))


def _whole(file: BinaryIO) -> tuple[Header, bytes] | None:
    """The next record, None where the file ends before or inside it."""
    try:
        return record(file)
    except ReaderError:
        return None


class _Bag:
    """What is known of a bag while its records come in.

    Attributes:
        census: What its header and index count, and what was found.
        channels: Connection → topic.
        chunk: The last chunk, until its messages were yielded.
        starts: Where messages begin in it, as the records behind it say.
        listed: Chunks that the index at the end lists, and the messages it counts.
    """

    def __init__(self, ingest: Ingest) -> None:
        self.ingest = ingest
        self.census = Census()
        self.channels: dict[bytes, Channel] = {}
        self.chunk: io.BytesIO | None = None
        self.starts: list[Integers] = []
        self.listed = [0, 0]

    def take(self, header: Header, data: bytes) -> Iterator[Batch]:
        """Take up a record; the messages of the chunk before it, if it is another.

        Raises:
            LogError: If it is damaged.
        """
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
            self.listed[0] += 1
            self.listed[1] += int(np.frombuffer(data, dtype="<u4")[1::2].sum())
            census.counted = self.listed[1] if self.listed[0] == census.counted_chunks else None
        elif op == RecordType.BAGHEADER:
            if header.get("encryptor"):
                raise LogError(f"{self.ingest.path}: the bag is encrypted. Decrypt it first.")
            census.closed = header.get_uint64("index_pos") > 0  # written when the bag is closed
            census.counted_chunks = header.get_uint32("chunk_count") if census.closed else None
        else:
            raise LogError(f"{self.ingest.path}: an unknown record; the bag is damaged.")

    def _connect(self, header: Header, data: bytes) -> None:
        """Take up a connection record."""
        about = Header.read(io.BytesIO(len(data).to_bytes(4, "little") + data))
        self.channels[header["conn"]] = Channel(
            topic=printable(header["topic"].decode("utf-8", "replace")),
            type=type_name(about.get_string("type")),
            encoding="ros1",
            definition=about["message_definition"].decode("utf-8", "replace"),
        )

    def last_chunk(self) -> Iterator[Batch]:
        """The messages of the last chunk, if they were not yielded yet.

        Raises:
            LogError: If messages are not where the index says, or of an unknown topic.
        """
        chunk, starts = self.chunk, self.starts
        if chunk is None:
            return
        self.chunk, self.starts = None, []
        buffer = np.frombuffer(chunk.getbuffer(), dtype=np.uint8)
        begins = np.sort(np.concatenate(starts)) if starts else _begins(chunk, len(buffer))
        self.census.chunks += 1
        self.census.kept += len(begins)
        if not begins.size:
            return
        heads = _heads(buffer, begins)
        lengths = _words(heads, heads.shape[1] - 4)[:, 0]
        data = begins + heads.shape[1]
        self._between(chunk, np.append(0, data + lengths), np.append(begins, len(buffer)))
        first = heads[0].tobytes()
        conn, time = first.find(b"conn=") + 5, first.find(b"time=") + 5
        numbers, seconds = _words(heads, conn)[:, 0], _words(heads, time, 2) @ (10**9, 1)
        varied = [
            *range(conn, conn + 4),
            *range(time, time + 8),
            *range(len(first) - 4, len(first)),
        ]
        alike = np.delete(heads, varied, axis=1)
        header = Header.read(io.BytesIO(first))
        settled = MESSAGE, first[conn : conn + 4], first[time : time + 8]
        if (header["op"], header["conn"], header["time"]) != settled or (alike != alike[0]).any():
            raise LogError(
                f"{self.ingest.path}: messages of a chunk differ in form; it is damaged."
            )
        for place in np.sort(np.unique(numbers, return_index=True)[1]):
            rows = numbers == numbers[place]
            number = heads[place, conn : conn + 4].tobytes()
            if number not in self.channels:
                raise LogError(f"{self.ingest.path}: messages of an unknown topic; damaged.")
            yield Batch(
                channel=self.channels[number],
                buffer=buffer,
                offsets=data[rows],
                lengths=lengths[rows],
                times=seconds[rows],
            )

    def _between(self, chunk: io.BytesIO, starts: Integers, ends: Integers) -> None:
        """Take up what lies between messages: nothing but connections.

        Raises:
            LogError: If there is anything else.
        """
        for start, end in np.stack([starts, ends], axis=1)[starts != ends].tolist():
            chunk.seek(start)
            while chunk.tell() < end:
                header, data = record(chunk)
                if header["op"] == CONNECTION:
                    self._connect(header, data)
                else:
                    break
            if chunk.tell() != end:
                raise LogError(
                    f"{self.ingest.path}: a chunk and its index count differently; it is damaged."
                )


def _begins(chunk: io.BytesIO, end: int) -> Integers:
    """Where messages begin in a chunk of which the index is lost."""
    begins, place = [], 0
    while place < end:
        if record(chunk)[0]["op"] == MESSAGE:
            begins.append(place)
        place = chunk.tell()
    return np.array(begins, dtype=np.int64)


def _heads(buffer: Bytes, begins: Integers) -> Bytes:
    """The heads of messages, as long as the first one's, with their data's lengths. (k, size)"""
    size = 8 + int(buffer[begins[0] : begins[0] + 4].view("<u4")[0])
    if begins[-1] + size > len(buffer):
        raise ReaderError("an index that points outside its chunk")
    return strided(buffer, begins, 0, size)


def _words(heads: Bytes, start: int, count: int = 1) -> Integers:
    """Numbers of four bytes in each head. (k, count)"""
    part = np.ascontiguousarray(heads[:, start : start + 4 * count])
    return part.view("<u4").astype(np.int64)
