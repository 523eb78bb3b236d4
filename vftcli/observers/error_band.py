"""Error of an estimate, sample by sample, by the log itself.

One model for every estimator, whatever its own covariance says,

    sd² = e² + ∫|1 − H|² S_τ df + c²,

with e² the mean square of what the estimator reads where nothing touches the arm, bias and model
error included, a resting joint's and a moving joint's apart; the integral what lag and bandwidth
leave out of the torque there is; and c the standard deviation of a subtracted correction.
A resting joint holds stiction that no estimator sees: there e is at least the share of the dry
friction that drives were measured to hold.
"""

from typing import NamedTuple

import numpy as np

from vftcli.robots.friction import HELD
from vftcli.signals.arrays import Array, Mask

ENOUGH = 50  #: Free samples of a resting or a moving joint that its own mean square needs.

#: Share of the dry friction by which friction in motion may be off, where no free motion shows it.
#:
#: On a UR10e the maker's friction differs by .05 to .25 of itself from what the drives show that
#: day.
UNSEEN = 0.2


class FreeError(NamedTuple):
    """Mean square of what an estimator reads where nothing touches the arm."""

    moving: Array  #: While the joint moves. (n,) [(N·m)²]
    resting: Array  #: While it rests. (n,) [(N·m)²]
    #: Joints that hardly move while nothing touches the arm, so that `moving` rests on their dry
    #: friction. (n,)
    unseen: Mask


def free_error(read: Array, resting: Mask, dry_friction: Array) -> FreeError:
    """The mean squares of an estimator's free samples, of which there is one at least.

    Where a joint rests, or moves, in fewer than `ENOUGH` of them, all of them speak for it: a
    moving joint then adds `UNSEEN` of its dry friction, because friction in motion was not seen.

    Args:
        read: What the estimator reads in them, NaN where it does not know. (S, n) [N·m]
        resting: Whether a joint rests in them. (S, n)
        dry_friction: Of each joint, 0 where nothing is known of it. (n,) [N·m]
    """
    known = np.isfinite(read)
    square = np.where(known, read, 0.0) ** 2
    whole = np.sum(square, axis=0) / np.maximum(np.count_nonzero(known, axis=0), 1)

    def mean_over(where: Mask) -> tuple[Array, Mask]:
        count = np.count_nonzero(where, axis=0)
        few = count < ENOUGH
        mean = np.sum(np.where(where, square, 0.0), axis=0) / np.maximum(count, 1)
        return np.where(few, whole, mean), few

    moving, unseen = mean_over(known & ~resting)
    still, _ = mean_over(known & resting)
    return FreeError(
        moving=np.where(unseen, moving + (UNSEEN * dry_friction) ** 2, moving),
        resting=np.maximum(still, (HELD * dry_friction) ** 2),
        unseen=unseen,
    )


def error_band(
    free: FreeError, missed: Array, resting: Mask, correction_sd: Array | None = None
) -> Array:
    """Deviation of an estimate's error, by the module's equation. (T, n) [N·m]

    Args:
        free: What the estimator reads where nothing touches the arm.
        missed: What lag and bandwidth leave out, `Spectra.missed`. (n,) [(N·m)²]
        resting: Where a joint rests. (T, n)
        correction_sd: Standard deviation of a correction of the model. (T, n) [N·m]
    """
    variance = np.where(resting, free.resting + missed, free.moving + missed)
    if correction_sd is not None:
        variance += correction_sd**2
    sd: Array = np.sqrt(variance, out=variance)
    return sd
