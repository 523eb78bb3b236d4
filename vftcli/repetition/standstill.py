"""Where a joint stands still: there it keeps whatever stiction it came to rest with."""

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.series import median_step, runs_of

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
    step = median_step(t)
    for j, speed in enumerate(np.abs(dq).T):
        for start, stop in runs_of(speed < STILL):
            length[start:stop, j] = t[stop - 1] - t[start] + step
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
        for start, end in runs_of(long):
            around = (t >= t[start] - BREAKAWAY) & (t <= t[end - 1] + BREAKAWAY)
            rest[around, j] = 1.0
    return rest
