"""Filters whose coefficients do not change along the log, as products with short Toeplitz matrices.

s_t = F s_{t−1} + g d_t, with a scalar input d and a small state for each joint of which one
combination is wanted. Within a block of samples that is a triangular Toeplitz matrix of its impulse
response times the block's inputs, plus what the state at the block's start still contributes; BLAS
does that for all blocks at once. The states at the blocks' ends obey the same kind of recursion,
once a block. It is the plain loop's sum in another order, to rounding.
"""

import numpy as np

from vftcli.observers.recursion import PIECE, recursion
from vftcli.signals.arrays import Array, empty_series

BLOCK = 32
"""Samples in a block: the work grows with it, the number of blocks shrinks."""


def steady_filter(F: Array, g: Array, d: Array, start: Array, wanted: Array) -> Array:
    """Run s_t = F s_{t−1} + g d_t and return one combination of the state, wanted·s_t. (T, n)

    Args:
        F: Transition. (m, m, n)
        g: What the input adds to the state. (m, n)
        d: Input. (T, n)
        start: State before the first sample. (m, n)
        wanted: Weights of the state's entries. (m, n)
    """
    samples, n = d.shape
    out = empty_series(samples, n)
    kernels = [Kernel(F[:, :, j], g[:, j], wanted[:, j]) for j in range(n)]
    state = start
    for first in range(0, samples, PIECE):
        span = slice(first, min(first + PIECE, samples))
        state = piece(F, kernels, d[span], state, out[span])
    return out


class Kernel:
    """One joint's block: impulse response, its effect on the block's end, and the state's decay.

    Attributes:
        inputs: Block's inputs → what is wanted, then the state at its end. (BLOCK, BLOCK + m)
        carry: State at the block's start → what is wanted. (m, BLOCK)
        reach: State at the block's start → at its end. (m, m)
    """

    def __init__(self, F: Array, g: Array, wanted: Array) -> None:
        m = len(g)
        powers = np.empty((BLOCK + 1, m, m))
        powers[0] = np.eye(m)
        for i in range(BLOCK):
            powers[i + 1] = F @ powers[i]
        response = powers[:BLOCK] @ g
        lag = np.arange(BLOCK)[None, :] - np.arange(BLOCK)[:, None]
        toeplitz = np.where(lag >= 0, (response @ wanted)[np.maximum(lag, 0)], 0.0)
        self.inputs = np.ascontiguousarray(np.hstack([toeplitz, response[::-1]]))
        self.carry = np.ascontiguousarray((wanted @ powers[1:]).T)
        self.reach = powers[BLOCK]


def piece(F: Array, kernels: list[Kernel], d: Array, state: Array, out: Array) -> Array:
    """Filter one piece into `out` and return the state at its end. (m, n)"""
    samples = len(d)
    whole = samples // BLOCK
    covered = whole * BLOCK
    if whole:
        made = [
            d[:covered, j].reshape(whole, BLOCK) @ kernel.inputs for j, kernel in enumerate(kernels)
        ]
        reach = np.stack([kernel.reach for kernel in kernels], axis=-1)
        ends = recursion(reach, np.stack([x[:, BLOCK:] for x in made], axis=-1), state)
        entering = np.concatenate([state[None], ends[:-1]])
        for j, kernel in enumerate(kernels):
            answer = np.ascontiguousarray(entering[:, :, j]) @ kernel.carry
            answer += made[j][:, :BLOCK]
            out[:covered, j] = answer.ravel()
        state = ends[-1]
    return state if covered == samples else tail(F, kernels, d[covered:], state, out[covered:])


def tail(F: Array, kernels: list[Kernel], d: Array, state: Array, out: Array) -> Array:
    """Filter the few samples that fill no block, and return the state at their end. (m, n)"""
    left, m = len(d), len(state)
    for j, kernel in enumerate(kernels):
        out[:, j] = d[:, j] @ kernel.inputs[:left, :left] + state[:, j] @ kernel.carry[:, :left]
    forced = np.stack([d[:, j] @ k.inputs[BLOCK - left :, -m:] for j, k in enumerate(kernels)], -1)
    for _ in range(left):
        state = np.einsum("abj,bj->aj", F, state)
    return forced + state
