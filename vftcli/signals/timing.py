"""Timing: what observers and checks ask of all of a log's stamps, gathered block by block."""

from dataclasses import dataclass
from typing import Self

import numpy as np

from vftcli.signals.arrays import EVEN, Array, median
from vftcli.signals.series import Clock

#: Different steps that are counted one by one; of more, those around the median.
DISTINCT = 1 << 17
LARGE = 2.0  #: A step this many times the median of the first block may be a gap: it is remembered.


@dataclass(frozen=True, kw_only=True)
class Timing:
    """The clock of a whole log."""

    samples: int  #: Number of samples T.
    start: float  #: Time of the first. [s]
    end: float  #: Time of the last. [s]
    step: float  #: Median time between samples. [s]
    uniform: bool  #: Whether all steps are equal, as `vftcli.signals.arrays.is_uniform` says.
    #: The longest steps, all that may be gaps among them, and the times at which they begin. (G, 2)
    #: [s]
    steps: Array

    @property
    def clock(self) -> Clock:
        """How the log is sampled, as `vftcli.signals.series.clock_of` says."""
        mean = (self.end - self.start) / (self.samples - 1)
        return Clock(self.uniform, mean if self.uniform else self.step)


class TimingCount:
    """The stamps of a log, block by block; memory does not grow with an even or noisy clock."""

    def __init__(self, least: float = -np.inf, most: float = np.inf) -> None:
        self.least, self.most = least, most
        self.below = self.above = 0
        self.samples = 0
        self.start = self.last = 0.0
        self.shortest, self.longest = np.inf, -np.inf
        self._steps, self._counts = np.empty(0), np.empty(0, dtype=np.int64)
        self._large: list[Array] = []
        self._limit = np.inf

    def add(self, t: Array) -> None:
        """Take up the stamps of the next block. (N,) [s]"""
        if not len(t):
            return
        before = t[:1] if self.samples == 0 else np.array([self.last])
        steps = np.diff(t, prepend=before)[int(self.samples == 0) :]
        if self.samples == 0:
            self.start = float(t[0])
        begun = np.concatenate([before, t])[-len(steps) - 1 : -1]
        self.samples, self.last = self.samples + len(t), float(t[-1])
        if not len(steps):
            return
        if np.isinf(self._limit):
            self._limit = LARGE * median(steps)
        self.shortest = min(self.shortest, float(steps.min()))
        self.longest = max(self.longest, float(steps.max()))
        large = steps > self._limit
        large[np.argmax(steps)] |= steps.max() >= self.longest
        self._large.append(np.column_stack([steps[large], begun[large]]))
        self._count(steps)

    def _count(self, steps: Array) -> None:
        """Count steps by their value."""
        self.below += int(np.count_nonzero(steps <= self.least))
        self.above += int(np.count_nonzero(steps >= self.most))
        values, counts = np.unique(
            steps[(steps > self.least) & (steps < self.most)], return_counts=True
        )
        both, places = np.unique(np.concatenate([self._steps, values]), return_inverse=True)
        self._counts = np.bincount(
            places, np.concatenate([self._counts, counts]), minlength=len(both)
        ).astype(np.int64)
        self._steps = both
        if len(both) > DISTINCT:
            self._narrow()

    def _narrow(self) -> None:
        """Keep the steps around the median so far, and only the number of the others."""
        middle = int(np.searchsorted(self.below + np.cumsum(self._counts), (self.samples - 1) // 2))
        first = max(0, min(middle - DISTINCT // 4, len(self._steps) - DISTINCT // 2))
        last = min(len(self._steps), first + DISTINCT // 2)
        self.below += int(self._counts[:first].sum())
        self.above += int(self._counts[last:].sum())
        if first:
            self.least = float(self._steps[first - 1])
        if last < len(self._steps):
            self.most = float(self._steps[last])
        self._steps, self._counts = self._steps[first:last], self._counts[first:last]

    def again(self) -> Self | None:
        """A count that tells the median in another pass, None where this one does."""
        steps = self.samples - 1
        low, high = (steps - 1) // 2, steps // 2
        if low < self.below:
            return type(self)(most=np.nextafter(self.least, np.inf))
        if high >= steps - self.above:
            return type(self)(least=np.nextafter(self.most, -np.inf))
        return None

    @property
    def timing(self) -> Timing:
        """What is known of all that was taken up; two samples or more."""
        steps = self.samples - 1
        ends = self.below + np.cumsum(self._counts)
        low, high = (
            float(self._steps[np.searchsorted(ends, k, side="right")])
            for k in ((steps - 1) // 2, steps // 2)
        )
        # As `vftcli.signals.arrays.median` does.
        usual = low if steps % 2 else 0.5 * (low + high)
        off = max(abs(self.longest - usual), abs(self.shortest - usual))
        return Timing(
            samples=self.samples,
            start=self.start,
            end=self.last,
            step=usual,
            uniform=off <= EVEN * usual,
            steps=np.concatenate(self._large),
        )
