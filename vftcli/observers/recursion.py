"""Linear recursions along time whose coefficients change with every sample.

y_t = F_t y_{t−1} + x_t with a small state for each joint. The log is cut into blocks that are run
side by side, each from zero; the states at the blocks' ends obey the same kind of recursion, once a
block, and are summed by doubling: x_b ← x_b + Φ_b x_{b−1}, then over two blocks, four, … until the
filter has forgotten. What enters a block is then run through it and added. That is the plain loop's
sum in another order, so it agrees with it to rounding.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, Indices
from vftcli.signals.steady_filter import FORGOTTEN, PIECE

#: Samples in a block at most: the Python loops have this length. From 32 to 64 all take as long.
LENGTH = 36


class Fold(NamedTuple):
    """A piece of a log laid out as position in block × joint × block.

    Every operation then runs along many blocks at once.
    """

    length: int  #: Samples in a block; the last one is filled up with its last sample.
    blocks: int  #: Number of blocks.
    samples: int  #: Samples of the piece.

    @classmethod
    def of(cls, samples: int) -> "Fold":
        """The layout of a piece: of short ones as many blocks as samples in a block."""
        length = min(LENGTH, int(np.ceil(np.sqrt(samples))))
        return cls(length, -(-samples // length), samples)

    def fold(self, x: Array) -> Array:
        """Samples in blocks: (…, N, k) → (…, length, k, blocks)."""
        *entries, _, k = x.shape
        whole = self.samples // self.length
        covered, out = whole * self.length, np.empty((*entries, self.length, k, self.blocks))
        inside = x[..., :covered, :].reshape(*entries, whole, self.length, k)
        out[..., :whole] = np.moveaxis(inside, -3, -1)
        if whole < self.blocks:
            out[..., -1] = x[..., -1:, :]
            out[..., : self.samples - covered, :, -1] = x[..., covered:, :]
        return out

    def unfold(self, y: Array) -> Array:
        """Samples in their order: (…, length, k, blocks) → (…, N, k), columns whole."""
        columns = np.moveaxis(y, -3, -1).reshape(*y.shape[:-3], y.shape[-2], -1)
        return columns[..., : self.samples].swapaxes(-1, -2)

    def last(self, y: Array) -> Array:
        """The last sample of what is in blocks: (…, length, k, blocks) → (…, k)."""
        return y[..., (self.samples - 1) % self.length, :, -1]


def spans(samples: int, *, begins: bool) -> list[slice]:
    """The pieces of a block of a log: they end at multiples of their length, wherever it begins."""
    edges = [int(begins), *range(PIECE, samples, PIECE), samples]
    return [slice(a, b) for a, b in pairwise(edges) if a < b]


def recursion(F: Array, x: Array, start: Array) -> Array:
    """Run y_t = F_t y_{t−1} + x_t from y_{−1} = `start`, in pieces that carry their state.

    Args:
        F: Transitions of an m-state filter for each of n joints. (m, m, T, n)
        x: Input. (m, T, n)
        start: State before the first sample. (m, n)

    Returns:
        The states y. (m, T, n)
    """
    y = np.empty_like(x)
    for span in spans(x.shape[1], begins=False):
        fold = Fold.of(span.stop - span.start)
        states = run_blocks(fold.fold(F[:, :, span]), fold.fold(x[:, span]), start)
        y[:, span], start = fold.unfold(states), fold.last(states)
    return y


def run_blocks(F: Array, y: Array, start: Array, kind: Indices | slice = slice(None)) -> Array:
    """One piece of `recursion`, everything in blocks.

    Args:
        F: Transitions of each kind of joint. (m, m, length, kinds, blocks)
        y: The input x, over which the states are written. (m, length, n, blocks)
        start: State before the first sample. (m, n)
        kind: Which of the kinds each joint is. (n,)
    """
    steps, samples = np.moveaxis(F, 2, 0), np.moveaxis(y, 1, 0)
    columns = steps[0].swapaxes(0, 1).copy()  # of the whole block's transition, Φ
    for step, before, sample in zip(steps[1:], samples, samples[1:], strict=False):
        np.add(sample, moved(step[:, :, kind], before), out=sample)
        columns = moved(step, columns)
    ends, reach, apart = samples[-1].copy(), columns.swapaxes(0, 1), 1
    ends[..., :1] += moved(reach[:, :, kind, :1], start[..., None])
    while apart < ends.shape[-1] and np.max(np.abs(reach[..., apart:])) > FORGOTTEN:
        ends[..., apart:] += moved(reach[:, :, kind, apart:], ends[..., :-apart])
        columns[..., apart:] = moved(reach[..., apart:], columns[..., :-apart])
        apart *= 2
    entering = np.concatenate([start[..., None], ends[..., :-1]], axis=-1)
    for step, sample in zip(steps, samples, strict=True):
        entering = moved(step[:, :, kind], entering)
        np.add(sample, entering, out=sample)
    return y


def moved(F: Array, state: Array) -> Array:
    """F·state for every joint and block: (m, m, n, B), (…, m, n, B) → (…, m, n, B)."""
    total: Array = F[:, 0] * state[..., :1, :, :]
    for k in range(1, len(F)):
        total += F[:, k] * state[..., k : k + 1, :, :]
    return total
