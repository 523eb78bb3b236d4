"""Bags a block after another: the messages of the topics that count, up to one time, on one clock.

A bag whose signals have to be interpolated from one topic to another's times, or whose topics run
apart, is read in one piece.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from vftcli.readers.bags.container import Batch, Ingest
from vftcli.readers.bags.decode import Decoder, Stream
from vftcli.readers.bags.documents import Documents
from vftcli.readers.bags.json_messages import WRENCH
from vftcli.readers.bags.topics import OWN, aligned, host_times, leading
from vftcli.readers.reader import InOnePieceError, RawLog, ReadChoice
from vftcli.signals.errors import LogError

WHOLE_BYTES = 1 << 24  #: A bag of no more bytes is read in one piece.
#: Messages of a topic from which a block is made, and those that wait for others at most.
BLOCK_MESSAGES, MOST_MESSAGES = 1 << 13, 1 << 17
#: What is said of topics that cannot be laid side by side, message by message.
APART = frozenset({"signal-interpolated", "topic-too-short", "messages-left-out"})


def bag_blocks(
    batches: Iterable[Batch],
    ingest: Ingest,
    request: ReadChoice,
    count: Callable[[int], None],
) -> Iterator[RawLog]:
    """The log of a bag, block by block."""
    try:
        yield from _blocks(batches, ingest, request, count)
    except LogError:
        raise InOnePieceError from None  # what is wrong is told by the whole


def _blocks(
    batches: Iterable[Batch],
    ingest: Ingest,
    request: ReadChoice,
    count: Callable[[int], None],
) -> Iterator[RawLog]:
    """The blocks of a bag with nothing wrong."""
    decoder, documents, waiting = Decoder(ingest), Documents(ingest), Waiting(ingest.path, request)
    messages, row = 0, 1
    wanted = request.wants("wrench")  # else topics that hold nothing but one are left out

    def block(streams: Sequence[Stream]) -> RawLog:
        raw = aligned(streams, ingest.path, request, decoder.others)
        if any(remark.code in APART for remark in raw.remarks):
            raise InOnePieceError
        return replace(raw, first_row=row, remarks=(*ingest.remarks, *raw.remarks))

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
        # What else there is is told once.
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
