"""Friction that changed between two logs: joints warm up, and then it does not cancel."""

import numpy as np

from vftcli.repetition.drive_run import DriveRun
from vftcli.repetition.standstill import STILL
from vftcli.signals.arrays import Array, Mask

BLOCK = 1.0
"""Length of the pieces whose scatter tells chance from change. [s]"""

SURE = 3.0
"""Standard errors from which on a change is believed: contacts alone rarely look like one."""


def friction_change(motion: DriveRun, tau: Array, moving: Mask) -> Array:
    """Change of dry friction from the free run to the log, 0 where it may be chance. (n,) [N·m]

    The mean of the difference times the sign of the velocity. Contacts do not follow the sign of
    the velocity over a whole log; its scatter over pieces of `BLOCK` says how sure the mean is.

    Args:
        motion: The log.
        tau: The two-cycle difference, NaN where there is none. (T, n) [N·m]
        moving: Whether the joint moves. (T, n)
    """
    t, n = motion.t, tau.shape[1]
    piece = ((t - t[0]) / BLOCK).astype(np.int64)
    change = np.zeros(n)
    for j in range(n):
        used = np.isfinite(tau[:, j]) & moving[:, j] & (np.abs(motion.dq[:, j]) > STILL)
        along = tau[used, j] * np.sign(motion.dq[used, j])
        count = np.bincount(piece[used]).astype(np.float64)
        total = np.bincount(piece[used], weights=along)
        means = total[count > 0] / count[count > 0]
        if len(means) < 5:
            continue
        spread = float(np.std(means, ddof=1)) / np.sqrt(len(means))
        if abs(float(np.mean(means))) > SURE * spread:
            change[j] = float(np.mean(along))
    return change
