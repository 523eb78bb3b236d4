"""Drives of another size: the torque that the model needs, fitted with a factor of its own.

A wrong drive constant scales a joint's whole effort, its gravity and its inertia alike. Friction is
fitted beside it and takes any size.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.doctor.case import Case
from vftcli.doctor.robust import RobustFit, solve, terms

#: Deviation of a factor from 1 that is named; sound logs, real and simulated, stay within .06.
OFF = 0.08
ALONE = 0.1  #: The same of one joint, which a load or a wrong forearm moves as well.
OTHERS = 0.05  #: By which the factors of the other joints may be off for one to be the cause.
LEAST, MOST = 0.6, 1.7  #: Factors beyond these are of another unit or of another arm.
SURE = 4.0  #: Standard deviations that a factor has to be off beyond that.
KNOWN = 0.05  #: Standard deviation of a factor that the motion determines.
CLEARER = 1.5  #: How much better than a load a factor must explain a log that some load explains.


class DriveScale(NamedTuple):
    """A factor that an effort has."""

    joints: tuple[int, ...]  #: The joints that have it, from zero.
    factor: float  #: It: .8 where 80 % of the torque is logged.
    sd: float  #: Its standard deviation.
    healed: Case  #: The log with it put right.


def scales(case: Case) -> list[DriveScale]:
    """The factors that may explain a log: one of all joints, one of a single joint."""
    each = np.zeros((*case.needed.shape, case.needed.shape[1]))
    joints = np.arange(case.needed.shape[1])
    each[:, joints, joints] = case.needed
    together = solve(case.given, terms(case.needed[:, :, None]).beside(case.friction))
    apart = solve(case.given, terms(each).beside(case.friction))
    return [*of_all(case, together), *of_one(case, apart, len(joints))]


def of_all(case: Case, fit: RobustFit) -> list[DriveScale]:
    """The factor of all joints, none where it is 1 or a load explains as much."""
    factor, sd = float(fit.values[0]), float(fit.sd[0])
    if not abs(factor - 1) > OFF + SURE * sd or not LEAST < factor < MOST:
        return []
    # No load lightens an arm; one that weighs something explains a factor above 1 as well.
    worth = CLEARER if case.loaded.values[0] > 0 else 1 / CLEARER
    if worth * fit.size > case.loaded.size:
        return []
    # What is left stays relative to the effort as it was logged.
    healed = replace(case, given=case.given / factor, size=case.size / factor)
    return [DriveScale(tuple(range(len(case.constant))), factor, sd, healed)]


def of_one(case: Case, fit: RobustFit, count: int) -> list[DriveScale]:
    """The factor of the one joint that is off alone, none where there is no such joint."""
    off, sd = np.abs(fit.values[:count] - 1), fit.sd[:count]
    wrong = np.flatnonzero((off > ALONE + SURE * sd) & (sd < KNOWN))
    if wrong.size != 1:
        return []
    j = int(wrong[0])
    others = np.delete(off, j) < np.maximum(OTHERS, SURE * np.delete(sd, j))
    if not others.all() or not LEAST < fit.values[j] < MOST:
        return []
    factor = np.ones(count)
    factor[j] = fit.values[j]
    return [DriveScale((j,), float(factor[j]), float(sd[j]), case.with_effort(case.given / factor))]
