"""Where a joint rests: there it keeps whatever stiction it came to rest with.

In every function t is a clock (T,) [s], and dq are joint velocities (T, n) [rad/s].
"""

import numpy as np

from vftcli.signals.arrays import Array, Mask, grown, median_step, runs_of, summed

#: Above it, more than noise and last digits, a joint has a direction: a log moves. [rad/s]
NONZERO = 1e-3
#: Below it stiction holds the joint: above noise, up to an encoder's steps over 24 ms. [rad/s]
REST = 0.01
MOVES = 0.02  #: Above it, twice that, no noise is motion: friction is that of motion. [rad/s]
#: Below it a joint of filtered speed may stick, above it its friction shows. [rad/s]
SLIDES = 0.05
HELD, WINDOW = 1e-3, 0.2  #: Way up to which a joint is held [rad], and within how long. [s]
#: Shorter stops are reversals, which the friction model's account of them covers. [s]
LEAST = 0.25
BREAKAWAY = 0.1  #: Time around a stop in which the joint settles or breaks away. [s]
AROUND = 0.15  #: Time around a sample that says whether the joint rests. [s]
NEAR_REST = 0.3  #: Stiction counts so long around a rest, without a free part. [s]


def slower(dq: Array, speed: float = REST) -> Mask:
    """Where joints are slower than a speed, not at just that [rad/s]. As `dq`"""
    return (dq < speed) & (dq > -speed)


def faster(dq: Array, speed: float = MOVES) -> Mask:
    """Where joints are faster than a speed [rad/s]. As `dq`"""
    return (dq > speed) | (dq < -speed)


def duration(t: Array, dq: Array) -> Array:
    """Length of the stop that a sample belongs to, 0 in motion. (T, n) [s]"""
    length = np.zeros(dq.shape)
    step = median_step(t)
    for j, slow in enumerate(slower(dq).T):
        if stops := runs_of(slow):
            start, stop = np.array(stops).T
            length[slow, j] = np.repeat(t[stop - 1] - t[start] + step, stop - start)
    return length


def standing(t: Array, dq: Array) -> Mask:
    """Where a joint stops for `LEAST` seconds, and moments around. (T, n)"""
    # It is stuck before its speed is zero and settles after breaking away.
    return np.column_stack([grown(t, long, BREAKAWAY) for long in (duration(t, dq) >= LEAST).T])


def resting(t: Array, dq: Array) -> Mask:
    """Where a joint is slower than `REST` in most of the time around. (T, n)"""
    first = t.searchsorted(t - AROUND, side="left")
    last = t.searchsorted(t + AROUND, side="right")
    rests = np.zeros(dq.shape, bool)
    for j, slow in enumerate(slower(dq).T):
        count = summed(slow)
        rests[:, j] = 2.0 * (count[last] - count[first]) > last - first
    return rests


def held(q: Array, step: float) -> Mask:
    """Where no joint travels further than `HELD`; q (T, n) [rad]. (T,)"""
    reach = max(1, round(0.5 * WINDOW / step))
    found = np.zeros(len(q), bool)
    if len(q) > 2 * reach:
        travel = abs(q[2 * reach :] - q[: -2 * reach])
        found[reach:-reach] = np.all(travel <= HELD, axis=1)
    return found
