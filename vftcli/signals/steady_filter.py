"""Filters whose coefficients do not change along the log, as products with short Toeplitz matrices.

s_t = F s_{t−1} + g d_t, with a scalar input d and a small state for each joint of which one
combination is wanted. Within a block of samples that is a triangular Toeplitz matrix of its impulse
response times the block's inputs, plus what the state at the block's start still contributes; BLAS
does that for all blocks at once. The states x_b at the blocks' starts obey the same kind of
recursion with R = F^BLOCK, summed by doubling: x_b ← x_b + R x_{b−1}, then x_b + R² x_{b−2}, …
until the filter has forgotten. It is the plain loop's sum in another order, to rounding.
"""

from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, empty_series

#: Samples handled at a time, so that memory does not grow with the log; blocks of a log that begin
#: at multiples of it give the numbers of the whole log to the last bit.
PIECE = 1 << 14
#: What is left of a state that counts as nothing: far below the last digit of anything.
FORGOTTEN = 1e-20
#: Samples in a block, a power of two: the work grows with it, the number of blocks shrinks.
BLOCK = 32


class BlockFilter(NamedTuple):
    """What a filter of n joints makes of one block."""

    toeplitz: Array  #: Block's inputs → what is wanted at each of its samples. (n, BLOCK, BLOCK)
    ends: Array  #: Block's inputs → the state at its end. (n, BLOCK, m)
    carry: Array  #: State before the block → what is wanted at each of its samples. (n, m, BLOCK)
    powers: Array  #: Fᵏ for k = 0 … BLOCK. (n, BLOCK + 1, m, m)


def steady_filter(F: Array, g: Array, d: Array, start: Array, wanted: Array) -> tuple[Array, Array]:
    """Run s_t = F s_{t−1} + g d_t.

    Args:
        F: Transition. (m, m, n)
        g: What the input adds to the state. (m, n)
        d: Input. (T, n)
        start: State before the first sample. (m, n)
        wanted: Weights of the state's entries. (m, n) or (m, 1)

    Returns:
        One combination of the state, wanted·s_t (T, n), and the state after the last sample (m, n).
    """
    blocks, state = blocks_of(F.transpose(2, 0, 1), g.T, wanted.T), start.T
    out = empty_series(*d.shape)
    columns = np.ascontiguousarray(d.T)
    for first in range(0, len(d), PIECE):
        span = slice(first, first + PIECE)
        state = filter_piece(blocks, columns[:, span], state, out.T[:, span])
    return out, state.T


def blocks_of(F: Array, g: Array, wanted: Array) -> BlockFilter:
    """Prepare a filter, joints first: F (n, m, m), g and wanted (n, m)."""
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
    return BlockFilter(
        toeplitz=impulse[:, BLOCK - 1 + at[None, :] - at[:, None]],
        ends=np.ascontiguousarray(response[:, ::-1]),
        carry=(wanted[:, None, None] @ powers[:, 1:])[:, :, 0].transpose(0, 2, 1).copy(),
        powers=powers,
    )


def filter_piece(blocks: BlockFilter, d: Array, state: Array, out: Array) -> Array:
    """Filter d (n, N) into `out` (n, N); the state before it → the state after it. (n, m)"""
    n, samples = d.shape
    count = samples // BLOCK
    covered = count * BLOCK
    inputs = d[:, :covered].reshape(n, count, BLOCK)
    x = np.empty((n, count + 1, state.shape[1]))
    x[:, 0] = state
    np.matmul(inputs, blocks.ends, out=x[:, 1:])
    sum_by_doubling(x, blocks.powers[:, BLOCK])
    for j in range(n):
        answer = out[j, :covered].reshape(count, BLOCK)
        np.matmul(inputs[j], blocks.toeplitz[j], out=answer)
        answer += np.dot(x[j, :-1], blocks.carry[j])
    # The few samples left fill no block: the same matrices, cut off.
    rest, left, state = d[:, None, covered:], samples - covered, x[:, -1]
    tail = rest @ blocks.toeplitz[:, :left, :left] + state[:, None] @ blocks.carry[:, :, :left]
    out[:, covered:] = tail[:, 0]
    forced = (rest @ blocks.ends[:, BLOCK - left :])[:, 0]
    return forced + (blocks.powers[:, left] @ state[..., None])[..., 0]


def sum_by_doubling(x: Array, R: Array) -> None:
    """Run x_b ← x_b + R x_{b−1} over all blocks in place: x (n, B, m), R (n, m, m)."""
    reach, apart = R.transpose(0, 2, 1), 1
    while apart < x.shape[1] and np.max(np.abs(reach)) > FORGOTTEN:
        # numpy.matmul is slow at states of one number.
        x[:, apart:] += x[:, :-apart] * reach if len(R[0]) == 1 else x[:, :-apart] @ reach
        reach = reach @ reach
        apart *= 2
