"""Abrupt stops: a brake's jerk looks like a knock, and is none."""

import numpy as np

from vftcli.signals.recording import Recording

SHORT = 0.3
"""Longest row that a stop explains. [s]"""

BEFORE, AFTER = (-0.25, 0.1), (0.12, 0.35)
"""When the arm must have moved and when it must rest, about the beginning of a row, which is known
to a block. [s]"""

MOVED, RESTS, LEFT = 0.02, 0.02, 0.05
"""A speed that counts as motion and one that counts as rest [rad/s]; and what may be left of the
speed before, while the arm rings."""


def follows_stop(recording: Recording, start: float, stop: float, block: float) -> bool:
    """Whether a row begins where every joint that moved comes to rest at once, and is over soon.

    Args:
        recording: The log.
        start: When the row begins. [s]
        stop: When it ends. [s]
        block: Length of a block, to which both are known. [s]
    """
    if stop - start > SHORT + block:
        return False
    t, dq = recording.t, np.abs(recording.require("dq"))
    before = dq[(t >= start + BEFORE[0]) & (t <= start + BEFORE[1])]
    after = dq[(t >= start + AFTER[0] + block) & (t <= start + AFTER[1])]
    if not len(before) or not len(after):
        return False
    speed = before.max(axis=0)
    rests = after.max(axis=0) < np.maximum(RESTS, LEFT * speed)
    return bool(speed.max() > MOVED and rests.all())
