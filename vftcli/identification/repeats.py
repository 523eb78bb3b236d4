"""Whether two logs repeat one trajectory: then one is no test of a model made from the other."""

import numpy as np

from vftcli.identification.processing import PreparedLog
from vftcli.signals.series import resampled

NEAR = 0.01
"""Largest joint distance at which two samples are the same place. [rad]"""

SLOWNESS = 0.1
"""Velocity difference that counts as much as that distance. [s]"""

SHARE = 0.8
"""Share of the test log's samples that must lie on the training trajectory."""


def repeated_share(train: PreparedLog, test: PreparedLog) -> float:
    """Share of the test's moving samples that lie on the training log's path through (q, q̇)."""
    from scipy.spatial import cKDTree

    if train.samples == 0 or test.samples == 0:
        return 0.0
    tree = cKDTree(densified(train))
    points = np.hstack([test.q, SLOWNESS * test.dq])
    distance, _ = tree.query(points, p=np.inf, distance_upper_bound=NEAR)
    return float(np.mean(np.isfinite(distance)))


def densified(motion: PreparedLog, per_step: int = 4) -> np.ndarray:
    """The path through (q, q̇), interpolated so that neighbours are nearer than `NEAR`."""
    points = np.hstack([motion.q, SLOWNESS * motion.dq])
    index = np.arange(0, len(points) - 1 + 1e-9, 1.0 / per_step)
    return resampled(index, np.arange(float(len(points))), points)


def repeats(train: PreparedLog, test: PreparedLog) -> bool:
    """Whether the test log repeats the training log's trajectory."""
    return repeated_share(train, test) >= SHARE
