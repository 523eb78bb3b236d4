"""Abrupt stops: a brake's jerk looks like a knock, and is none."""

import numpy as np

from vftcli.signals.recording import Recording
from vftcli.signals.rest import MOVES

SHORT = 0.3  #: Longest row that a stop explains. [s]
#: When the arm must have moved, how fast it was, and when it must rest: about the beginning of a
#: row, which is known to a block. A knock on an arm that stood still is none of this. [s]
BEFORE, AROUND, AFTER = (-0.25, -0.05), (-0.25, 0.1), (0.12, 0.35)
LEFT = 0.05  #: Share of the speed before that may be left at rest, while the arm rings.


def follows_stop(recording: Recording, start: float, stop: float, block: float) -> bool:
    """Whether a row begins where every joint that moved comes to rest at once, and is over soon.

    Args:
        recording: The log.
        start: When the row begins. [s]
        stop: When it ends. [s]
        block: Length of a block. [s]
    """
    if stop - start > SHORT + block:
        return False
    t, speed = recording.t - start, np.abs(recording.require("dq"))
    before, around, after = (
        speed[(t >= first) & (t <= last)]
        for first, last in (BEFORE, AROUND, (AFTER[0] + block, AFTER[1]))
    )
    if not len(before) or not len(after):
        return False
    rests = after.max(axis=0) < np.maximum(MOVES, LEFT * around.max(axis=0))
    # A median, since noise must not pass for motion.
    return bool(np.median(before, axis=0).max() > MOVES and rests.all())
