"""How often the truth lies within an estimate's 95 % band."""

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import COVERS, ExternalTorque

LEAST = 10
"""Fewest samples that a share is told of."""


def coverage(estimate: ExternalTorque, reference: ExternalTorque) -> Array:
    """Share of the samples in which the reference lies within ±1.96 sd of the estimate. (n,)

    Samples in which the joint rests do not count: stiction hides there what the band cannot know.
    NaN where the estimate has no band or the joint hardly moves.
    """
    if estimate.error_sd is None:
        return np.full(estimate.joints, np.nan)
    error = estimate.tau - reference.tau
    counted = np.isfinite(error)
    for torque in (estimate, reference):
        if torque.moving is not None:
            counted &= torque.moving
    inside = counted & (np.abs(np.nan_to_num(error)) <= COVERS * estimate.error_sd)
    count = np.count_nonzero(counted, axis=0)
    share = np.count_nonzero(inside, axis=0) / np.maximum(count, 1)
    return np.where(count >= LEAST, share, np.nan)
