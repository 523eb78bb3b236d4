"""Reading bags: containers of messages, walked in bulk and decoded by topic."""

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from vftcli.readers.bags import db3
from vftcli.readers.bags.container import (
    MCAP,
    ROSBAG1,
    SQLITE,
    Batch,
    Ingest,
    printable,
    storage_files,
)
from vftcli.readers.bags.decode import Decoder, Stream
from vftcli.readers.bags.documents import WRENCH, Documents, read_documents
from vftcli.readers.bags.topics import OWN, aligned, host_times, leading
from vftcli.readers.formats import LogFormat
from vftcli.readers.reader import InOnePieceError, LogFile, RawLog, ReadChoice, open_log
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import Where, fact, warning

WHOLE_BYTES = 1 << 24  #: A bag of no more bytes is read in one piece.
#: Messages of a topic from which a block is made, and those that wait for others at most.
BLOCK_MESSAGES, MOST_MESSAGES = 1 << 13, 1 << 17
#: What is said of topics that do not pair message by message.
APART = frozenset({"signal-interpolated", "topic-too-short", "messages-left-out"})


def bag_blocks(
    batches: Iterable[Batch],
    ingest: Ingest,
    request: ReadChoice,
    count: Callable[[int], None],
) -> Iterator[RawLog]:
    """The log of a bag, block by block; one with something wrong is read whole, and said."""
    decoder, documents, waiting = Decoder(ingest), Documents(ingest), Waiting(ingest.path, request)
    messages, row = 0, 1
    wanted = request.wants("wrench")  # else topics that hold nothing but one are left out

    def block(streams: Sequence[Stream]) -> RawLog:
        raw = aligned(streams, ingest.path, request, decoder.others)
        if any(remark.code in APART for remark in raw.remarks):
            raise InOnePieceError
        return replace(raw, first_row=row, remarks=(*ingest.remarks, *raw.remarks))

    try:
        for batch in batches:
            messages += len(batch.offsets)
            if documents.take(batch):
                raise InOnePieceError
            decoder.take(batch)
            found = [s for s in decoder.taken() if wanted or s.channel.type != WRENCH]
            if (streams := waiting.add(found, decoder.others)) is not None:
                raw = block(streams)
                yield raw
                row += len(raw.stamps)
        count(messages)
        yield block(list(waiting.streams.values()))
    except LogError:
        raise InOnePieceError from None  # reading the whole says what is wrong


Key = tuple[object, ...]  #: What tells streams apart.


class Waiting:
    """Messages that wait until every topic that counts has come as far.

    Attributes:
        streams: Those that wait.
    """

    def __init__(self, path: Path, request: ReadChoice) -> None:
        self._path, self._request = path, request
        self._counting: set[Key] | None = None
        self._headless: set[Key] = set()
        self.streams: dict[Key, Stream] = {}

    def add(self, found: Iterable[Stream], others: dict[str, str]) -> list[Stream] | None:
        """Take up messages; all that have come as far as each other, if they are a block."""
        for part in found:
            key = (part.channel, part.names, part.frame, tuple(part.signals))
            stream = replace(part, header=None) if key in self._headless else part
            if self._counting is None or key in self._counting:
                before = self.streams.get(key)
                self.streams[key] = stream if before is None else behind(before, stream)
        most = max((s.messages for s in self.streams.values()), default=0)
        if most < BLOCK_MESSAGES:
            return None
        if most > MOST_MESSAGES:
            raise InOnePieceError
        streams = list(self.streams.values())
        first = self._counting is None
        lead = leading(streams, self._path, others, self._request)
        counting = {
            key: s
            for key, s in self.streams.items()
            if s is lead or s.channel.topic.startswith(OWN)
        }
        if min(s.messages for s in counting.values()) < 3:
            return None
        # Two are left: one message alone is no log, and one may be repeated.
        until = min(int(s.receive[-2]) for s in counting.values())
        parts = {key: divided(s, until) for key, s in counting.items()}
        if min(part.messages for part, _ in parts.values()) < 2:
            return None
        if first:
            # The first block tells for all whether a topic's headers hold its clock.
            self._headless = {k for k, (s, _) in parts.items() if host_times(s)[0] is s.receive}
        self._counting = set(counting)
        self.streams = {
            key: replace(rest, header=None) if key in self._headless else rest
            for key, (_, rest) in parts.items()
        }
        # The first block alone says what else there is.
        beside = [s for s in streams if first and not any(s is c for c in counting.values())]
        return [*(part for part, _ in parts.values()), *beside]


def behind(first: Stream, second: Stream) -> Stream:
    """Two parts of a stream as one."""
    if first.signals.keys() != second.signals.keys():
        raise InOnePieceError
    return replace(
        second,
        mixed=first.mixed or second.mixed,
        receive=np.concatenate([first.receive, second.receive]),
        header=both(first.header, second.header),
        robot=both(first.robot, second.robot),
        signals={n: np.concatenate([v, second.signals[n]]) for n, v in first.signals.items()},
    )


def both(first: np.ndarray | None, second: np.ndarray | None) -> np.ndarray | None:
    """Two parts of a series as one, None where neither is there."""
    if first is None and second is None:
        return None
    if first is None or second is None:
        raise InOnePieceError
    return np.concatenate([first, second])


def divided(stream: Stream, until: int) -> tuple[Stream, Stream]:
    """The messages of a stream that were received before a time [ns], and the others."""
    if np.any(np.diff(stream.receive) < 0):
        raise InOnePieceError
    row = int(np.searchsorted(stream.receive, until))

    def part(rows: slice) -> Stream:
        return replace(
            stream,
            receive=stream.receive[rows],
            header=None if stream.header is None else stream.header[rows],
            robot=None if stream.robot is None else stream.robot[rows],
            signals={name: value[rows] for name, value in stream.signals.items()},
        )

    return part(slice(None, row)), part(slice(row, None))


METADATA_BYTES = 1024 * 1024


def recognises(file: LogFile, _: LogFormat) -> bool:
    """Whether a folder holds files of a ROS 2 bag."""
    return bool(storage_files(file))


def read(file: LogFile, request: ReadChoice, _: LogFormat) -> RawLog:
    """Read any container of messages."""
    ingest = Ingest(path=file.path, size=_size(file))
    if request.blocks and ingest.size > WHOLE_BYTES:
        count = partial(_check_count, file, ingest)
        blocks = bag_blocks(_batches(file, ingest), ingest, request, count)
        return replace(next(blocks), rest=blocks)
    decoder, documents = Decoder(ingest), Documents(ingest)
    messages = 0
    for batch in _batches(file, ingest):
        messages += len(batch.offsets)
        if not documents.take(batch):
            decoder.take(batch)
    _check_count(file, ingest, messages)
    if messages == 0:
        said = "; ".join(["no messages in any whole chunk", *map(str, ingest.remarks)])
        raise LogError(f"{file.path}: {said}.")
    of_documents = documents.streams(request)
    streams = [*decoder.streams(), *of_documents]
    # ROS messages go before documents: their types say what they hold.
    if documents.rows and not any("q" in stream.signals for stream in streams):
        raw = read_documents(file, documents, request)
    else:
        known = {stream.channel.topic for stream in of_documents}
        rows = (channel for channel in documents.rows if channel.topic not in known)
        others = decoder.others | {c.topic: c.type or c.encoding for c in rows}
        raw = aligned(streams, file.path, request, others)
    return replace(raw, remarks=(*ingest.remarks, *raw.remarks))


def _size(file: LogFile) -> int:
    """Bytes of a file or of all storage files of a folder."""
    if not file.is_folder:
        return len(file.content)
    return sum((file.path / name).stat().st_size for name in storage_files(file))


def _batches(file: LogFile, ingest: Ingest) -> Iterator[Batch]:
    """The messages of a file, or of a folder's files one behind the other."""
    if not file.is_folder:
        yield from _file_batches(file, ingest)
        return
    for name in storage_files(file):
        inner = open_log(file.path / name)
        yield from _file_batches(inner, ingest)
        for remark in inner.remarks:
            ingest.note(replace(remark, where=Where(about=name)))


def _file_batches(file: LogFile, ingest: Ingest) -> Iterator[Batch]:
    """The messages of one file; whatever a library raises on it is told in one line."""
    try:
        for batch in _container(file, ingest):
            yield batch
            file.release()
    except LogError:
        raise
    except MemoryError:
        raise LogError(
            f"{ingest.path}: a part of it claims more memory than the file holds; it is damaged."
        ) from None
    except Exception as error:  # noqa: BLE001 - libraries document none of what damage raises
        reason = printable(f"{type(error).__name__}: {error}")[:100]
        raise LogError(f"{ingest.path}: not a readable bag; it is damaged ({reason}).") from None


def _container(file: LogFile, ingest: Ingest) -> Iterator[Batch]:
    """The messages of one file, by the container that its first bytes tell."""
    if file.head.startswith(ROSBAG1):
        from vftcli.readers.bags import rosbag1

        return rosbag1.batches(file.content, ingest)
    if file.head.startswith(MCAP):
        from vftcli.readers.bags import mcap_file

        return mcap_file.batches(file.content, ingest)
    if file.head.startswith(SQLITE):
        return db3.batches(file, ingest)
    raise LogError(f"{file.path}: neither a ROS bag nor an MCAP file.")


def _check_count(file: LogFile, ingest: Ingest, messages: int) -> None:
    """Say so if metadata.yaml counts another number of messages than were found."""
    if "metadata.yaml" not in file.entries:
        return
    with (file.path / "metadata.yaml").open("rb") as metadata:
        text = metadata.read(METADATA_BYTES)
    match = re.search(rb"^  message_count: (\d{1,15})\s*$", text, flags=re.MULTILINE)
    if match is None or (counted := int(match[1])) == messages:
        return
    if messages < counted:
        ingest.note(warning("messages-missing", kept=messages, counted=counted, by="metadata.yaml"))
    else:
        ingest.note(fact("message-count-differs", counted=counted, found=messages))
