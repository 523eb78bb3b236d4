"""Where a joint stands still: there it keeps whatever stiction it came to rest with."""

import numpy as np

from vftcli.signals.arrays import Array, Mask
from vftcli.signals.intervals import grown, runs_of
from vftcli.signals.series import median_step

STILL = 0.01  #: Speed below which a joint counts as standing. [rad/s]
LEAST = 0.25  #: Shorter stops are reversals, which the friction model's account of them covers. [s]
BREAKAWAY = 0.1  #: Time around a stop in which the joint settles or breaks away. [s]
AROUND = 0.15  #: Time before and after a sample that says whether the joint rests in it. [s]


def duration(t: Array, dq: Array) -> Array:
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


def standing(t: Array, dq: Array) -> Mask:
    """Where a joint stops for at least `LEAST` seconds, the moments before and after too. (T, n)

    Args:
        t: Clock. (T,) [s]
        dq: Joint velocities. (T, n) [rad/s]
    """
    # A joint is stuck before its speed is zero and settles after it has broken away.
    return np.column_stack([grown(t, long, BREAKAWAY) for long in (duration(t, dq) >= LEAST).T])


def resting(t: Array, dq: Array) -> Mask:
    """Where a joint is slower than `STILL` for more than half of the time around. (T, n)

    Unlike `standing` it knows no shortest stop: it tells friction at rest from friction in motion.

    Args:
        t: Clock. (T,) [s]
        dq: Joint velocities. (T, n) [rad/s]
    """
    first = np.searchsorted(t, t - AROUND, side="left")
    last = np.searchsorted(t, t + AROUND, side="right")
    rests, count = np.zeros(dq.shape, dtype=bool), np.zeros(len(t) + 1, dtype=np.intp)
    for j, speed in enumerate(dq.T):
        np.cumsum(np.abs(speed) < STILL, out=count[1:])
        rests[:, j] = 2 * (count[last] - count[first]) > last - first
    return rests
