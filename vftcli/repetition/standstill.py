"""Where a joint stands still: there it keeps whatever stiction it came to rest with."""

import numpy as np
from numpy.typing import NDArray

from vftcli.signals.arrays import Array

Flags = NDArray[np.bool_]
"""True or false, sample by sample or joint by joint."""

STILL = 0.01
"""Speed below which a joint counts as standing. [rad/s]"""

LEAST = 0.25
"""Shorter stops are reversals, which the friction model's account of them covers. [s]"""

BREAKAWAY = 0.1
"""Time around a stop in which the joint settles or breaks away. [s]"""


def stops(t: Array, dq: Array) -> Array:
    """How long the stop lasts that a sample belongs to, 0 where the joint moves. (T, n) [s]

    Args:
        t: Clock. (T,) [s]
        dq: Joint velocities. (T, n) [rad/s]
    """
    length = np.zeros(dq.shape)
    step = float(np.median(np.diff(t)))
    for j, speed in enumerate(np.abs(dq).T):
        for first, last in runs(speed < STILL):
            length[first : last + 1, j] = t[last] - t[first] + step
    return length


def at_rest(t: Array, stop: Array) -> Array:
    """1 where a joint rests, with the moments before and after, 0 where it moves. (T, n)

    A joint rests where it stops for at least `LEAST` seconds.

    Args:
        t: Clock. (T,) [s]
        stop: Lengths of stops, as from `stops`. (T, n) [s]
    """
    rest = np.zeros(stop.shape)
    for j, long in enumerate((stop >= LEAST).T):
        for first, last in runs(long):
            around = (t >= t[first] - BREAKAWAY) & (t <= t[last] + BREAKAWAY)
            rest[around, j] = 1.0
    return rest


def runs(flags: Flags) -> NDArray[np.int64]:
    """First and last index of every unbroken run of true flags. (R, 2)"""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int64), [0]])))
    return np.asarray(edges.reshape(-1, 2) - np.array([0, 1]))
