"""Presliding friction: the teeth of a gear give before they slide, which the angle alone tells.

The play (backlash) operator follows the joint angle q at a distance of at most the presliding
length s₀,

    cᵗ = clip(cᵗ⁻¹, qᵗ − s₀, qᵗ + s₀),   sᵗ = (qᵗ − cᵗ)/s₀ ∈ [−1, 1],

so that s is the sign of the motion once the joint has moved 2 s₀, and holds its value while the
joint rests. It is causal and asks for no velocity and no clock: across a gap only the net
displacement counts.

References:
    A. Visintin, "Differential Models of Hysteresis", Springer, 1994, Ch. III, for play and stop;
    F. Al-Bender, J. Swevers, "Characterization of friction force dynamics", IEEE Control Systems
    Magazine 28(6), 2008, for presliding friction in drives.
"""

from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array

BLOCK = 32  #: Samples in a block: the Python loop has this length, once a level.


class Play(NamedTuple):
    """The play operator along a stretch of a log."""

    state: Array  #: s, the share of full deflection. (T, n)
    centre: Array  #: c after the last sample, from which the next stretch goes on. (n,) [rad]


def play(q: Array, length: Array | float, centre: Array | None = None) -> Play:
    """Deflection s of the play operator; the same in one piece and in stretches.

    A sample is the map x → clip(x, q − s₀, q + s₀). Two such maps make one of the same kind,
    clip(clip(x, a, b), a′, b′) = clip(x, clip(a, a′, b′), clip(b, a′, b′)), so blocks of samples
    run side by side and the maps of whole blocks one after another. Only comparisons are made: the
    result is that of a loop to the last bit.

    Args:
        q: Joint angles. (T, n) [rad]
        length: Presliding length s₀ > 0, one number or one a joint. [rad]
        centre: c before the first sample; None for one that starts undeflected, c = q⁰, which is
            wrong by at most the whole deflection until the joint has moved 2 s₀. (n,) [rad]
    """
    reach = np.asarray(length, dtype=np.float64)
    if not len(q):
        return Play(np.zeros_like(q), np.zeros(q.shape[1:]) if centre is None else centre)
    start = q[0] if centre is None else centre
    centres = follow(q - reach, q + reach, start)
    state: Array = (q - centres) / reach
    return Play(np.clip(state, -1.0, 1.0, out=state), centres[-1])


def follow(low: Array, high: Array, start: Array) -> Array:
    """What clipping to [low, high] sample after sample makes of `start`. (T, n)

    Args:
        low: Lower limits. (T, n)
        high: Upper limits, none below the lower one. (T, n)
        start: The value before the first sample. (n,)
    """
    samples = len(low)
    if samples <= BLOCK:
        out, value = np.empty_like(low), start
        for k in range(samples):
            out[k] = value = clipped(value, low[k], high[k])
        return out
    blocks = -(-samples // BLOCK)
    low, high = in_blocks(low, blocks), in_blocks(high, blocks)
    for i in range(1, BLOCK):
        # Both ends of the map so far go through this sample's clip, which both still have to see.
        low[i], high[i] = (clipped(end[i - 1], low[i], high[i]) for end in (low, high))
    ends = follow(low[-1], high[-1], start)
    entering = np.concatenate([start[None], ends[:-1]])
    inside = clipped(entering, low, high)
    return inside.swapaxes(0, 1).reshape(blocks * BLOCK, -1)[:samples]


def clipped(value: Array, low: Array, high: Array) -> Array:
    """`numpy.clip` without its checks, which cost more than a row of a block."""
    result: Array = np.minimum(np.maximum(value, low), high)
    return result


def in_blocks(limits: Array, blocks: int) -> Array:
    """Samples as position in block × block × joint, the last block filled with its last sample."""
    padded = np.concatenate([limits, np.repeat(limits[-1:], blocks * BLOCK - len(limits), axis=0)])
    shaped = padded.reshape(blocks, BLOCK, -1)
    return np.ascontiguousarray(shaped.swapaxes(0, 1))
