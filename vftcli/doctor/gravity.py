"""Which way is down: the gravity vector fitted to the effort, friction beside it."""

from typing import NamedTuple

import numpy as np

from vftcli.doctor.case import Case
from vftcli.doctor.robust import RobustFit, solve, terms
from vftcli.signals.arrays import Array

TILTED = np.deg2rad(10.0)
"""Angle between the fitted "up" and the robot file's from which a base counts as tilted. [rad]"""


class Vertical(NamedTuple):
    """The direction that is up, as a log's effort says.

    Attributes:
        up: It, in axes whose third is the robot file's own; its length is 1 where the masses fit.
            (3,)
        sd: Standard deviations. (3,)
        solution: The fit.
    """

    up: Array
    sd: Array
    solution: RobustFit

    @property
    def angle(self) -> float:
        """Angle to the robot file's "up". [rad]"""
        return float(np.arctan2(np.linalg.norm(self.up[:2]), self.up[2]))

    @property
    def length(self) -> float:
        """Weight that the effort carries, relative to the robot file's."""
        return float(np.linalg.norm(self.up))


def vertical_of(case: Case) -> Vertical:
    """Fit gravity itself; no load beside it, for the two trade."""
    windows = case.windows
    fit = solve(case.given - windows.inertial, terms(windows.gravity).beside(windows.friction))
    return Vertical(fit.values[:3], fit.sd[:3], fit)
