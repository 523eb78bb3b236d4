"""The null-space channel: joint torque that no wrench at the flange explains."""

from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Mask
from vftcli.signals.remarks import Remark, Where, caution
from vftcli.signals.wrench import Wrench

MARGIN = 1.25  #: The threshold stands so far above the largest value of the free part.
#: Share of samples above the threshold up to which nothing is said: chance reaches it.
LEAST_SHARE = 0.001


class NullSpaceVerdict(NamedTuple):
    """Where the torque of an arm of more than six joints is no tip wrench's."""

    name: str  #: The observer.
    threshold: float  #: `MARGIN` times the largest norm in the free part. [N·m]
    share: float  #: Share of the samples above it: contact elsewhere on the arm, or a wrong model.

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """What it says, nothing where next to no sample lies above the threshold."""
        if not self.share > LEAST_SHARE:
            return ()
        values = {"share": self.share, "threshold_Nm": self.threshold}
        return (caution("contact-elsewhere", Where(self.name), **values),)


def contact_elsewhere(wrench: Wrench, free: Mask) -> NullSpaceVerdict | None:
    """Judge a wrench's null-space channel by its free part, None for an arm of six joints.

    None too where the channel is not known in any sample of the free part.

    Args:
        wrench: A virtual sensor's wrench.
        free: Samples of the unloaded part. (T,)
    """
    if wrench.null_space is None:
        return None
    known = wrench.null_space[free & np.isfinite(wrench.null_space)]
    if not len(known):
        return None
    # The largest, not a quantile: the free part holds no contact, so all of it is error.
    threshold = MARGIN * float(known.max())
    share = float(np.mean(np.nan_to_num(wrench.null_space) > threshold))
    return NullSpaceVerdict(wrench.name, threshold, share)
