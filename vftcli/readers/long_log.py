"""Long logs: read twice, a block at a time, so that memory does not grow with them.

The first time tells the clock and all that is said of a log, and draws stretches of it by which it
is examined; the second time yields what is computed with. A log in which something is odd, that
only all of it can tell, is read in one piece as ever.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from vftcli.readers.cleaning import (
    ABSURD,
    FARTHEST_START,
    GAP_STEPS,
    LONGEST_LOG,
    SHORTEST_STEP,
    recording_of,
    refuse_degrees,
    source_of,
    told_gaps,
    told_repeats,
    without_leading_garbage,
)
from vftcli.readers.reader import InOnePieceError, RawLog
from vftcli.signals.arrays import Array
from vftcli.signals.errors import LogError
from vftcli.signals.recording import LongLog, Recording
from vftcli.signals.timing import TimingCount

#: Samples of a stretch that is drawn, and stretches at least; at most twice as many.
STRETCH_ROWS, STRETCHES = 1 << 11, 8
Rows = dict[str, Array]  #: Clean samples: "t" and the signals, by their names.


def long_recording(
    raw: RawLog,
    read: Callable[[], RawLog],
    path: Path,
    format_name: str,
    sha256: Callable[[], str],
    label: str = "",
) -> Recording:
    """A recording of stretches of a long log, with the log behind it."""
    count, draw, cleaner = TimingCount(), Drawer(), Cleaner()
    for rows in cleaner.rows(raw):
        count.add(rows["t"])
        draw.add(rows)
    while count.samples > 1 and (counter := count.again()) is not None:
        for rows in Cleaner().rows(read()):
            counter.add(rows["t"])
        count = counter
    if count.samples < 2:
        raise InOnePieceError
    timing, last = count.timing, cleaner.last
    span = timing.end - timing.start
    source = source_of(cleaner.first, path, format_name, sha256, label)
    if not (
        abs(source.t0) <= FARTHEST_START and timing.step >= SHORTEST_STEP and span <= LONGEST_LOG
    ):
        raise InOnePieceError
    cleaner.finish(path)
    repeats = told_repeats(cleaner.repeats, cleaner.different) if cleaner.repeats else ()
    garbage = cleaner.first.remarks[len(raw.remarks) :]
    gaps = timing.steps[timing.steps[:, 0] > GAP_STEPS * timing.step]
    source = replace(
        source,
        rows=cleaner.read,
        duplicates=cleaner.repeats,
        remarks=(
            *last.remarks,
            *garbage,
            *repeats,
            *told_gaps(gaps),
        ),
    )
    told = replace(cleaner.first, payload_mass=last.payload_mass, payload_com=last.payload_com)
    told = told.told_payload(last.constants)

    def blocks(size: int) -> Iterator[Recording]:
        samples = 0
        for rows in in_blocks(Cleaner().rows(read()), size):
            samples += len(rows["t"])
            yield recording_of(told, rows.pop("t"), rows, source)
        if samples != timing.samples:
            raise LogError(f"{path}: it changed while it was read. Let its recorder end first.")

    rows = draw.drawn()
    drawn = recording_of(told, rows.pop("t"), rows, source)
    return replace(drawn, long=LongLog(timing=timing, read=blocks))


class Cleaner:
    """Cleans a log as `vftcli.readers.cleaning.cleaned` does, block by block.

    Attributes:
        read: Rows so far.
        repeats: Rows that were dropped because their stamp repeated the one before.
        different: Those of them with other values.
    """

    first: RawLog  #: The first block, what is no sample of it left out.
    last: RawLog  #: The last one, as it was read.

    def __init__(self) -> None:
        self.read = self.repeats = self.different = 0
        self._before: Rows | None = None
        self._low, self._high = np.empty(0), np.empty(0)

    def rows(self, raw: RawLog) -> Iterator[Rows]:
        """The clean samples of a log."""
        for block in chain([raw], raw.rest or ()):
            self.last = block
            self.read += len(block.stamps)
            if len(block.stamps):
                with np.errstate(all="ignore"):
                    yield self._clean(block)

    def _clean(self, raw: RawLog) -> Rows:
        """The clean samples of one block."""
        if self._before is None:
            if raw.segment is not None:
                raise InOnePieceError
            self.first = raw = without_leading_garbage(raw)
            self._low = self._high = raw.signals["q"][0]
        if raw.signals.keys() != self.first.signals.keys() or (raw.tick, raw.clock) != (
            self.first.tick,
            self.first.clock,
        ):
            raise InOnePieceError
        found = {"stamps": raw.stamps, **raw.signals}
        good = np.isfinite(raw.stamps).all() and all(
            max(float(np.max(value)), -float(np.min(value))) < ABSURD
            for value in raw.signals.values()
        )
        if not good:
            raise InOnePieceError
        self._low = np.minimum(self._low, raw.signals["q"].min(axis=0))
        self._high = np.maximum(self._high, raw.signals["q"].max(axis=0))
        fresh = self._fresh(found)
        rows = {name: value[fresh] for name, value in found.items()}
        elapsed = (rows.pop("stamps") - self.first.stamps[0]).astype(np.float64)
        return {"t": elapsed if raw.tick == 1.0 else elapsed * raw.tick, **rows}

    def _fresh(self, found: Rows) -> Array:
        """Which rows do not repeat the stamp of the row before. (N,)"""
        before = self._before or {name: value[:1] for name, value in found.items()}
        joined = {name: np.concatenate([before[name], value]) for name, value in found.items()}
        steps = np.diff(joined["stamps"])
        if np.any(steps < 0):
            raise InOnePieceError
        fresh = steps > 0
        fresh[0] |= self._before is None
        again = np.flatnonzero(~fresh)
        changed = np.zeros(again.size, dtype=bool)
        for name, value in joined.items():
            if name != "stamps":
                changed |= (value[again + 1] != value[again]).any(axis=1)
        self.repeats += again.size
        self.different += int(changed.sum())
        self._before = {name: value[-1:].copy() for name, value in found.items()}
        return np.asarray(fresh)

    def finish(self, path: Path) -> None:
        """Judge what only the whole log tells."""
        if 2 * self.different > self.read:
            raise InOnePieceError
        if self.first.degrees_possible:
            reached = {"q": np.stack([self._low, self._high])}
            refuse_degrees(replace(self.first, signals=reached), path)


class Drawer:
    """Draws stretches of a log, evenly spread, while it goes by."""

    def __init__(self) -> None:
        self.samples = 0
        self._every = STRETCH_ROWS
        self._stretches: dict[int, list[Rows]] = {}
        self._tail: Rows = {}

    def add(self, rows: Rows) -> None:
        """Draw of the next samples."""
        first, last = self.samples, self.samples + len(rows["t"])
        self.samples = last
        start = first - first % self._every
        while start < last:
            a, b = max(start, first) - first, min(start + STRETCH_ROWS, last) - first
            if a < b:
                part = {name: value[a:b].copy() for name, value in rows.items()}
                self._stretches.setdefault(start, []).append(part)
            start += self._every
        self._tail = joined([self._tail, rows] if self._tail else [rows], STRETCH_ROWS)
        while len(self._stretches) > 2 * STRETCHES:
            self._every *= 2
            kept = self._stretches.items()
            self._stretches = {k: parts for k, parts in kept if k % self._every == 0}

    def drawn(self) -> Rows:
        """The stretches one behind the other, the end of the log last."""
        parts = [part for stretch in self._stretches.values() for part in stretch]
        behind = self._tail["t"] > parts[-1]["t"][-1]
        return joined([*parts, {name: value[behind] for name, value in self._tail.items()}])


def joined(parts: list[Rows], most: int | None = None) -> Rows:
    """Samples one behind the other, of more than `most` the last."""
    kept = slice(None) if most is None else slice(-most, None)
    return {name: np.concatenate([part[name] for part in parts])[kept] for name in parts[0]}


def in_blocks(parts: Iterator[Rows], size: int) -> Iterator[Rows]:
    """Samples in blocks of one size, but for the last."""
    held: list[Rows] = []
    count = 0
    for part in parts:
        held.append(part)
        count += len(part["t"])
        if count < size:
            continue
        rows = joined(held)
        for start in range(0, count - count % size, size):
            yield {name: value[start : start + size] for name, value in rows.items()}
        held = [{name: value[count - count % size :] for name, value in rows.items()}]
        count %= size
    if count:
        yield joined(held)
