"""The disturbance averaged over a tenth of a second: what the log itself says, whoever observes it.

Which span is unloaded, how a sensor sits and what a vendor's field means are questions about the
log. Asked of an observer's estimate, their answers would change with the choice of observers, and
with their order; so they are asked of this quantity, which no option touches and no filter delays.
"""

import numpy as np

from vftcli.robots.disturbance import disturbance_impulse
from vftcli.signals.arrays import handed_over
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.series import resample_columns
from vftcli.signals.terms import DynamicsTerms

HALF = 0.05  #: Half the time it is averaged over: noise of 2 mrad/s in q̇ leaves some .05 N·m. [s]


def mean_disturbance(terms: DynamicsTerms) -> ExternalTorque:
    """The raw disturbance, its mean over `HALF` before and after each sample. (T, n) [N·m]

    The mean is a difference of its integral, so an uneven clock weighs by time; at the ends of the
    log it is over what there is. A log of one sample reads nothing.
    """
    t, joints = terms.t, terms.joints
    if len(t) < 2:
        return ExternalTorque(name="disturbance", t=t, tau=np.zeros((len(t), joints)))
    total = disturbance_impulse(terms)
    before, after = np.maximum(t - HALF, t[0]), np.minimum(t + HALF, t[-1])
    mean = resample_columns(after, t, total) - resample_columns(before, t, total)
    mean /= (after - before)[:, None]
    return ExternalTorque(name="disturbance", t=t, tau=handed_over(mean))
