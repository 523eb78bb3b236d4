"""A log against an arm: its effort read as a torque, and what the arm's model leaves over."""

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from vftcli.doctor.windows import RobustFit, Windows, solve
from vftcli.signals.arrays import Array

MAX_MASS, MAX_ARM = 12.0, 0.35  #: Loads beyond these are no loads but another arm. [kg, m]
TELLING = 0.9  #: Share of the misfit that a load must leave at most, or it only adds freedom.
#: Range of gravity's torque, relative to the effort, from which the poses tell a load.
VARIED = 0.3
#: A cause shows in a window where it makes this many times what the fit leaves over; it is refuted
#: there where the log without it leaves less than this share of what is left with it.
FELT, REFUTED = 4.0, 0.6
LASTING = 0.95  #: Share of the windows in which a cause that lasts must not be refuted.
UPRIGHT = np.array([0.0, 0.0, 1.0])  #: The robot file's own "up".


@dataclass(frozen=True, kw_only=True)
class Case:
    """A log against an arm."""

    windows: Windows  #: The log's windows with the arm's model.
    given: Array  #: Mean of the effort, as torque, over each window. (W, n) [N·m]
    size: float  #: Root mean square of the column that was logged. [N·m]
    constant: Array  #: Torque per unit of the column that was logged, joint by joint. (n,)
    #: Direction of "up" in axes of which the third is the robot file's own. (3,)
    up: Array = field(default_factory=lambda: UPRIGHT)

    @cached_property
    def gravity(self) -> Array:
        """Torque that holds the arm. (W, n) [N·m]"""
        return np.asarray(self.windows.gravity @ self.up)

    @cached_property
    def needed(self) -> Array:
        """Torque that inertia, rotors and gravity need. (W, n) [N·m]"""
        return self.windows.inertial + self.gravity

    @cached_property
    def bare(self) -> RobustFit:
        """Fit by friction alone."""
        return solve(self.given - self.needed, self.windows.friction)

    @cached_property
    def loaded(self) -> RobustFit:
        """Fit by a load on the flange, its four coefficients first, and friction."""
        return solve(self.given - self.needed, self.windows.load.beside(self.windows.friction))

    @property
    def carries_load(self) -> bool:
        """Whether a load explains a part of what friction leaves."""
        mass, moment = self.loaded.values[0], self.loaded.values[1:4]
        if self.gravity_range < VARIED * self.size:
            return False  # in one pose any residual passes for a load
        plausible = 0.05 < mass < MAX_MASS and np.linalg.norm(moment) < MAX_ARM * mass + 0.3
        return bool(plausible and self.loaded.size < TELLING * self.bare.size)

    @property
    def best(self) -> RobustFit:
        """The fit with a load where one explains something, else without."""
        return self.loaded if self.carries_load else self.bare

    @property
    def misfit(self) -> float:
        """Share of the logged effort left unexplained; loads and contacts are not."""
        return self.best.size / self.size

    @cached_property
    def effort_sizes(self) -> Array:
        """Root mean square of each joint's effort, contact set aside. (n,) [N·m]"""
        sizes = np.sqrt(np.mean(self.given[self.bare.kept] ** 2, axis=0))
        return np.asarray(np.maximum(sizes, 1e-9 * self.size))

    @cached_property
    def by_joint(self) -> Array:
        """Share of each joint's effort that friction leaves over. (n,)"""
        return self.bare.by_joint / self.effort_sizes

    @property
    def gravity_range(self) -> float:
        """Range of gravity's torque on the joint where it varies most. [N·m]"""
        return float(np.ptp(self.gravity, axis=0).max())

    def lasts(self, cause: RobustFit, change: Array) -> bool:
        """Whether a cause is there all the time, as no push and no carried object is.

        Args:
            cause: The fit with it.
            change: What it changes of the torque. (W, n) [N·m]
        """
        size = np.linalg.norm(change, axis=1)
        felt = size > FELT * cause.size * np.sqrt(change.shape[1])
        without = np.linalg.norm(cause.rest + change, axis=1)
        refuted = felt & (without < REFUTED * np.linalg.norm(cause.rest, axis=1))
        return bool(refuted.sum() <= (1 - LASTING) * max(felt.sum(), 1))

    def exchanged(self, i: int, j: int) -> "Case":
        """The log with the logged efforts of two joints exchanged."""
        order = np.arange(len(self.constant))
        order[[i, j]] = j, i
        logged = self.given / self.constant
        return replace(self, given=logged[:, order] * self.constant)


def size_of(given: Array) -> float:
    """Root mean square of a torque. [N·m]"""
    return float(np.sqrt(np.mean(given**2)))
