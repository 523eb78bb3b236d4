"""Linear recursions along time, without a Python loop over samples and without losing exactness.

y_t = F_t y_{t−1} + x_t with a small state for each joint, where F_t changes with the sample time.
The log is cut into blocks that are run side by side, each from zero; the states at the blocks' ends
obey the same kind of recursion, once a block, and their effect is added back. That is the same sum
in another order, so it agrees with a sample-by-sample loop to rounding.
"""

import numpy as np

from vftcli.signals.arrays import Array

BLOCK = 32
"""Samples in a block: the Python loop has this length, once a level."""

FEW = 48
"""Below this many samples a plain loop is as quick."""

PIECE = 1 << 14
"""Samples handled at a time, so that memory does not grow with the log; blocks of a log that begin
at multiples of it give the numbers of the whole log to the last bit."""


def recursion(F: Array, x: Array, start: Array) -> Array:
    """Run y_t = F_t y_{t−1} + x_t from y_{−1} = `start`, in pieces that carry their state.

    Args:
        F: Transitions of an m-state filter for each of n joints. (T, m, m, n)
        x: Input. (T, m, n)
        start: State before the first sample. (m, n)

    Returns:
        The states y. (T, m, n)
    """
    y = np.empty_like(x)
    for first in range(0, len(x), PIECE):
        span = slice(first, first + PIECE)
        y[span] = blockwise(F[span], x[span], start)
        start = y[min(span.stop, len(x)) - 1]
    return y


def blockwise(F: Array, x: Array, start: Array) -> Array:
    """One piece of `recursion`: blocks side by side, then the recursion over their ends.

    Arrays are laid out as position in block × … × block, so that every operation runs along many
    blocks at once.
    """
    samples, m, n = x.shape
    if samples <= FEW:
        return stepwise(F, x, start)
    blocks = -(-samples // BLOCK)
    y, reach = by_position(x, blocks), by_position(F, blocks)
    room = np.empty((n, blocks))
    for i in range(1, BLOCK):
        add_product(reach[i], y[i - 1], y[i], room)
        reach[i] = transition_product(reach[i], reach[i - 1])
    ends = blockwise(np.moveaxis(reach[-1], -1, 0), np.moveaxis(y[-1], -1, 0), start)
    entering = np.ascontiguousarray(np.concatenate([start[None], ends[:-1]]).transpose(1, 2, 0))
    for i in range(BLOCK):
        add_product(reach[i], entering, y[i], room)
    return y.transpose(3, 0, 1, 2).reshape(blocks * BLOCK, m, n)[:samples]


def by_position(x: Array, blocks: int) -> Array:
    """Arrange samples as position in block × … × block, the last block filled up with zeros."""
    padded = np.zeros((blocks * BLOCK, *x.shape[1:]))
    padded[: len(x)] = x
    shaped = padded.reshape(blocks, BLOCK, *x.shape[1:])
    return np.ascontiguousarray(np.moveaxis(shaped, 0, -1))


def stepwise(F: Array, x: Array, start: Array) -> Array:
    """The recursion as it is written, one sample after another."""
    y = x.copy()
    state, room = start, np.empty(x.shape[2])
    for k in range(len(y)):
        add_product(F[k], state, y[k], room)
        state = y[k]
    return y


def add_product(F: Array, state: Array, out: Array, room: Array) -> None:
    """Add F·state to `out` for every joint and block, with `room` for one term. (m, n, …)"""
    for row in range(len(state)):
        for column in range(len(state)):
            np.multiply(F[row, column], state[column], out=room)
            out[row] += room


def transition_product(F: Array, G: Array) -> Array:
    """F·G for every joint and block. (m, m, n, …)"""
    out = np.zeros_like(G)
    room = np.empty_like(G[0, 0])
    for column in range(len(G)):
        add_product(F, G[:, column], out[:, column], room)
    return out
