"""ROS 1 bags, version 2.0: records from the start, so that an unclosed bag reads too.

Format: http://wiki.ros.org/Bags/Format/2.0. The reader of rosbags needs the index at the end,
which a cut bag lacks, and unpacks without bounds; its parser of records takes twice the time.
"""

import struct
from collections.abc import Iterator
from typing import Any

from rosbags.rosbag1.reader import RecordType

from vftcli.readers.bags.container import (
    Batch,
    Census,
    Channel,
    CutError,
    Ingest,
    Message,
    batched,
    printable,
    sized,
    type_name,
    unpacked,
)
from vftcli.readers.opening import LogFile
from vftcli.signals.errors import LogError

MAGIC_SIZE = 13  #: Bytes before the first record.
MESSAGE, CONNECTION = bytes([RecordType.MSGDATA]), bytes([RecordType.CONNECTION])
#: What a field of a header takes at least, but for those that no recorder writes.
BYTES_PER_FIELD = 8

Header = dict[bytes, bytes]  #: Name of a field → its bytes.


def batches(file: LogFile, ingest: Ingest) -> Iterator[Batch]:
    """Messages of a bag, chunk by chunk, up to the last whole chunk."""
    return batched(_Bag(ingest).messages(file.content.obj), ingest)


def _fields(head: bytes) -> Header:
    fields, place = {}, 0
    while place < len(head):
        field, place = sized(head, place)
        name, equal, value = field.partition(b"=")
        if not equal:
            raise CutError("a header without fields")
        fields[name] = value
    return fields


class _Bag:
    """What is known of a bag while its records come in.

    Attributes:
        census: What its header and index count, and what was found.
        channels: Connection → topic.
        starts, indexed: Where messages begin in the last chunk, by it and by the records behind it.
        listed, counted: Chunks that the index at the end lists; messages that it counts.
    """

    def __init__(self, ingest: Ingest) -> None:
        self.ingest = ingest
        self.census = Census()
        self.channels: dict[bytes, Channel] = {}
        self.starts: list[int] = []
        self.indexed: list[int] = []
        self.listed = self.counted = 0

    def messages(self, content: Any) -> Iterator[Message]:  # noqa: ANN401 - bytes or a mapped file
        """The messages of the content, up to the last whole chunk."""
        end = MAGIC_SIZE
        while True:
            try:
                header, data, place = self._record(content, end)
            except CutError:
                break
            yield from self._take(header, data)
            end = place
        self._check_index()
        self.census.tell(self.ingest, len(content) - end, "its index")

    def _record(self, content: Any, place: int) -> tuple[Header, bytes, int]:  # noqa: ANN401
        head, place = sized(content, place)
        self.ingest.spend(1 + len(head) // BYTES_PER_FIELD)
        data, place = sized(content, place)
        return _fields(head), data, place

    def _take(self, header: Header, data: bytes) -> Iterator[Message]:
        """Take up a record; the messages in it, if it is a chunk."""
        op, census = header[b"op"][0], self.census
        if op == RecordType.IDXDATA:
            self.indexed += [place for *_, place in struct.iter_unpack("<III", data)]
            return
        self._check_index()
        if op == RecordType.CHUNK:
            census.chunks += 1
            yield from self._chunk(header, data)
        elif op == RecordType.CONNECTION:
            self._connect(header, data)
        elif op == RecordType.CHUNK_INFO:
            self.listed += 1
            self.counted += sum(count for _, count in struct.iter_unpack("<II", data))
            census.counted = self.counted if self.listed == census.counted_chunks else None
        elif op == RecordType.BAGHEADER:
            if header.get(b"encryptor"):
                raise LogError(f"{self.ingest.path}: the bag is encrypted. Decrypt it first.")
            # The place of the index is written when the bag is closed.
            census.closed = any(header[b"index_pos"])
            chunks = int.from_bytes(header[b"chunk_count"], "little")
            census.counted_chunks = chunks if census.closed else None
        else:
            raise LogError(f"{self.ingest.path}: an unknown record; the bag is damaged.")

    def _connect(self, header: Header, data: bytes) -> None:
        about = {name: value.decode("utf-8", "replace") for name, value in _fields(data).items()}
        self.channels[header[b"conn"]] = Channel(
            topic=printable(header[b"topic"].decode("utf-8", "replace")),
            type=type_name(about[b"type"]),
            encoding="ros1",
            definition=about[b"message_definition"],
        )

    def _chunk(self, header: Header, data: bytes) -> Iterator[Message]:
        name, size = header[b"compression"].decode(), int.from_bytes(header[b"size"], "little")
        chunk, place = unpacked(self.ingest, name, data, size), 0
        while place < len(chunk):
            start = place
            inner, content, place = self._record(chunk, start)
            if inner[b"op"] == MESSAGE:
                self.starts.append(start)
                seconds, rest = struct.unpack("<II", inner[b"time"])
                yield self.channels.get(inner[b"conn"]), seconds * 10**9 + rest, content
            elif inner[b"op"] == CONNECTION:
                self._connect(inner, content)
            else:
                raise LogError(f"{self.ingest.path}: an unknown record; the bag is damaged.")
        self.census.kept += len(self.starts)

    def _check_index(self) -> None:
        """Check that the records behind a chunk list the messages that it holds."""
        if self.indexed and sorted(self.indexed) != self.starts:
            raise LogError(
                f"{self.ingest.path}: a chunk and its index count differently; it is damaged."
            )
        self.starts, self.indexed = [], []
