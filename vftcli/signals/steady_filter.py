"""Recursive filters over a whole log, by blocks: s_t = F s_{t−1} + g d_t.

F is (m, m) a joint. The states x_b at the blocks' starts obey a like recursion with R,
the product of a block's transitions, summed by doubling: x_b ← x_b + R x_{b−1}, then x_b
+ R² x_{b−2}, … until the filter has forgotten. To rounding it is the plain loop's sum.

With constant coefficients a block is a triangular Toeplitz matrix of its impulse response
times its inputs, plus the part of the state at its start; BLAS does all blocks at once.
With others (`recursion`) the blocks run side by side, each from zero; the state that
enters a block is then run through it and added.
"""

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, Indices, empty_series

#: Samples at a time: blocks that begin at its multiples give the whole log's numbers.
PIECE = 1 << 14
FORGOTTEN = 1e-20  #: Share of a state that counts as nothing.
#: Samples in a block, a power of two: more work, fewer blocks.
BLOCK = 32
LENGTH = 36  #: Most samples in a block of `recursion`.


def filtered(
    F: Array, g: Array, d: Array, start: Array, wanted: Sequence[Array]
) -> tuple[list[Array], Array]:
    """Each wanted·s_t (T, n) of s_t = F_t s_{t−1} + g_t d_t; the last state (m, n).

    F is (m, m, n) and g (m, n) of the whole log, or (m, m, T, n) and (m, T, n) of every
    sample; the input d (T, n), the state `start` before the first sample (m, n), weights
    (m, n), (m, 1) or (m, T, n).
    """
    if F.ndim == 3:
        each = [steady_filter(F, g, d, start, weights) for weights in wanted]
        return [found for found, _ in each], each[0][1]
    states = recursion(F, g * d, start)
    found = [sum(w * s for w, s in zip(weights, states, strict=True)) for weights in wanted]
    return found, states[:, -1]


def steady_filter(
    F: Array, g: Array, d: Array, start: Array, wanted: Array
) -> tuple[Array, Array]:
    """One combination (m, n) of `filtered`, with F (m, m, n), g (m, n) of the log."""
    toeplitz, ends, carry, powers = blocks_of(F.transpose(2, 0, 1), g.T, wanted.T)
    out, state, columns = empty_series(*d.shape), start.T, np.ascontiguousarray(d.T)
    for first in range(0, len(d), PIECE):
        piece, answer = columns[:, first : first + PIECE], out.T[:, first : first + PIECE]
        n, samples = piece.shape
        count = samples // BLOCK
        covered = count * BLOCK
        inputs = piece[:, :covered].reshape(n, count, BLOCK)
        x = np.empty((n, count + 1, state.shape[1]))
        x[:, 0] = state
        np.matmul(inputs, ends, out=x[:, 1:])
        # x_b ← x_b + R x_{b−1} over all blocks in place.
        reach, apart = powers[:, BLOCK].transpose(0, 2, 1), 1
        while apart < x.shape[1] and abs(reach).max() > FORGOTTEN:
            # numpy.matmul is slow at states of one number.
            one = reach.shape[1] == 1
            x[:, apart:] += x[:, :-apart] * reach if one else x[:, :-apart] @ reach
            reach = reach @ reach
            apart *= 2
        for j in range(n):
            rows = answer[j, :covered].reshape(count, BLOCK)
            np.matmul(inputs[j], toeplitz[j], out=rows)
            rows += np.dot(x[j, :-1], carry[j])
        # The few samples left: the same matrices, cut off.
        rest, left, state = piece[:, None, covered:], samples - covered, x[:, -1]
        tail = rest @ toeplitz[:, :left, :left] + state[:, None] @ carry[:, :, :left]
        answer[:, covered:] = tail[:, 0]
        forced = (rest @ ends[:, BLOCK - left :])[:, 0]
        state = forced + (powers[:, left] @ state[..., None])[..., 0]
    return out, state.T


def blocks_of(F: Array, g: Array, wanted: Array) -> tuple[Array, Array, Array, Array]:
    """One block's matrices of a filter of n joints; F (n, m, m), g and wanted (n, m).

    From a block's inputs to the wanted samples (n, BLOCK, BLOCK) and the state at its end
    (n, BLOCK, m); from the state before it to the wanted samples (n, m, BLOCK); Fᵏ, k = 0
    … BLOCK.
    """
    n, m = g.shape
    powers = np.empty((n, BLOCK + 1, m, m))
    powers[:, 0], powers[:, 1] = np.eye(m), F
    k = 1
    while k < BLOCK:
        powers[:, k + 1 : 2 * k + 1] = powers[:, 1 : k + 1] @ powers[:, k : k + 1]
        k *= 2
    response = (powers[:, :BLOCK] @ g[:, None, :, None])[..., 0]
    impulse = np.zeros((n, 2 * BLOCK - 1))
    impulse[:, BLOCK - 1 :] = (response @ wanted[..., None])[..., 0]
    at = np.arange(BLOCK)
    toeplitz = impulse[:, BLOCK - 1 + at[None, :] - at[:, None]]
    carry = (wanted[:, None, None] @ powers[:, 1:])[:, :, 0].transpose(0, 2, 1).copy()
    return toeplitz, np.ascontiguousarray(response[:, ::-1]), carry, powers


class Fold(NamedTuple):
    """A piece of a log as position in block × joint × block, for all blocks at once."""

    length: int  #: Samples in a block; the last one is filled up.
    samples: int  #: Samples of the piece.

    @classmethod
    def of(cls, samples: int) -> "Fold":
        """The layout of a piece, of a short one square."""
        return cls(min(LENGTH, int(np.ceil(np.sqrt(samples)))), samples)

    def fold(self, x: Array) -> Array:
        """Samples in blocks: (…, N, k) → (…, length, k, blocks)."""
        filled = np.concatenate([x, x[..., -1:, :].repeat(-self.samples % self.length, -2)], -2)
        blocks = filled.reshape(*x.shape[:-2], -1, self.length, x.shape[-1])
        return np.moveaxis(blocks, -3, -1).copy()

    def unfold(self, y: Array) -> Array:
        """Samples in their order: (…, length, k, blocks) → (…, N, k)."""
        columns = np.moveaxis(y, -3, -1).reshape(*y.shape[:-3], y.shape[-2], -1)
        return columns[..., : self.samples].swapaxes(-1, -2)

    def last(self, y: Array) -> Array:
        """The last sample of what is in blocks: (…, length, k, blocks) → (…, k)."""
        return y[..., (self.samples - 1) % self.length, :, -1]


def spans(samples: int, *, begins: bool) -> list[slice]:
    """Pieces of a log's block: they end at multiples of their length."""
    edges = [int(begins), *range(PIECE, samples, PIECE), samples]
    return [slice(a, b) for a, b in pairwise(edges) if a < b]


def recursion(F: Array, x: Array, start: Array) -> Array:
    """States y_t = F_t y_{t−1} + x_t from y_{−1} = `start` (m, n). (m, T, n)

    F (m, m, T, n) are the transitions of m states for each of n joints, x (m, T, n) inputs.
    """
    y = np.empty((len(x), x.shape[2], x.shape[1])).swapaxes(1, 2)
    for span in spans(x.shape[1], begins=False):
        fold = Fold.of(span.stop - span.start)
        states = run_blocks(fold.fold(F[:, :, span]), fold.fold(x[:, span]), start)
        y[:, span], start = fold.unfold(states), fold.last(states)
    return y


def run_blocks(F: Array, y: Array, start: Array, kind: Indices | slice = slice(None)) -> Array:
    """One piece of `recursion` in blocks: the states are written over the input y.

    F is (m, m, length, kinds, blocks), y (m, length, n, blocks), the state before the
    first sample (m, n); `kind` tells which of the kinds each joint is. (n,)
    """
    steps, samples = np.moveaxis(F, 2, 0), np.moveaxis(y, 1, 0)
    columns = steps[0].swapaxes(0, 1).copy()  # of the whole block's transition, Φ
    for step, before, sample in zip(steps[1:], samples, samples[1:], strict=False):
        np.add(sample, moved(step[:, :, kind], before), out=sample)
        columns = moved(step, columns)
    ends, reach, apart = samples[-1].copy(), columns.swapaxes(0, 1), 1
    ends[..., :1] += moved(reach[:, :, kind, :1], start[..., None])
    while apart < ends.shape[-1] and abs(reach[..., apart:]).max() > FORGOTTEN:
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
    total = F[:, 0] * state[..., :1, :, :]
    for k in range(1, len(F)):
        total += F[:, k] * state[..., k : k + 1, :, :]
    return total
