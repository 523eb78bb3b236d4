"""Warm-up: whether the friction of one log drifts while it runs."""

from collections.abc import Sequence

import numpy as np

from vftcli.identification.training import JointFit, Training
from vftcli.robots.friction import SMOOTHING, dry_friction
from vftcli.robots.robot import JointFriction
from vftcli.signals.arrays import Array
from vftcli.signals.least_squares import folds
from vftcli.signals.remarks import Remark, Where, caution

THIRDS = 3  #: Stretches in which a log's friction is compared.
#: Fall of the dry friction from the first to the last stretch that is remarked on, as a share.
DRIFT = 0.05
LEAST = 0.1  #: Smallest fall that is. [N·m]


def warm_up_remarks(
    data: Training, left: Sequence[Array], weights: Sequence[Array], fits: Sequence[JointFit | None]
) -> list[Remark]:
    """A remark on each log whose friction falls from third to third, with the joints that show it.

    Of what the fit leaves, the part that goes with the direction is the dry friction that a third
    has beyond the whole log's. A gear that warms up rubs less and less.

    Args:
        data: The training logs.
        left: What the fits leave of each log. (M, n) each [N·m]
        weights: Weight of every sample. (M, n) each
        fits: The friction fits.
    """
    models = [JointFriction() if fit is None else fit.friction for fit in fits]
    dry = dry_friction(models, data.robot.joints)
    remarks = []
    for motion, residual, w in zip(data.motions, left, weights, strict=True):
        sign = np.tanh(motion.dq / SMOOTHING) * w
        more = np.array(
            [
                np.sum(sign[part] * residual[part], axis=0)
                / np.maximum(np.sum(sign[part] * np.sign(sign[part]), axis=0), 1e-9)
                for part in folds(motion.samples, THIRDS)
            ]
        )
        fall = more[0] - more[-1]
        told = np.all(np.diff(more, axis=0) < 0.0, axis=0) & data.excited.moves
        joints = np.flatnonzero(told & (fall > np.maximum(DRIFT * dry, LEAST)))
        if joints.size:
            where = Where(motion.recording.name, tuple(int(j) + 1 for j in joints))
            values = {"first_Nm": more[0, joints].tolist(), "last_Nm": more[-1, joints].tolist()}
            remarks.append(caution("warm-up", where, **values))
    return remarks
