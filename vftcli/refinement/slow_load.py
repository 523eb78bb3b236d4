"""Slow external loads, fitted beside the model's error so that they are not taken for it.

A hand that leans on the arm all the time looks like mass. Beside the model's columns therefore
stand those of external loads that change slowly: a wrench at the flange, and forces at the elbow
and the wrist on the links before them, which by the lever rule make up a force anywhere along the
arm. What falls to them is left in the estimate: in doubt a torque is a push.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.robots.chain import Chain
from vftcli.robots.kinematics import flange_jacobian, link_poses
from vftcli.signals.arrays import Array

FORCE = 50.0  #: Standard deviation of an external force. [N]
MOMENT = 10.0  #: Standard deviation of an external moment. [N·m]
KNOTS = 10.0  #: Time between two knots of a load, which runs straight from one to the next. [s]
CONSTANT = 15.0  #: In a log shorter than this a load is one constant. [s]
MOST_KNOTS = 61  #: Knots of a log of ten minutes; in a longer one they lie farther apart.
WRENCH = 6  #: Components of the wrench at the flange, the first group of loads.


class SlowLoads(NamedTuple):
    """Columns of slow external loads along the samples of a fit."""

    #: External torque, with its sign turned, of one standard deviation of every component: the
    #: wrench at the flange, then the forces along the arm. (S, n, m) [N·m]
    torque: Array
    knot: NDArray[np.intp]  #: The knot before each sample. (S,)
    share: Array  #: How far a sample is on the way to the next one, 0 … 1. (S,)
    knots: int  #: Number of knots.

    @property
    def components(self) -> int:
        """Number of components m."""
        return int(self.torque.shape[2])

    @property
    def sizes(self) -> tuple[int, ...]:
        """Columns of no load, of the wrench at the flange, and with the forces along the arm."""
        return tuple(sorted({0, WRENCH * self.knots, self.components * self.knots}))

    @property
    def numbers(self) -> NDArray[np.intp]:
        """Column of each knot's and component's load, the flange's wrench first. (knots, m)"""
        flange = np.arange(WRENCH * self.knots).reshape(self.knots, WRENCH)
        along = np.arange(WRENCH * self.knots, self.components * self.knots)
        return np.hstack([flange, along.reshape(self.knots, -1)])

    def made_by(self, values: Array) -> Array:
        """The columns times their values, in the order of `numbers`. (S, n) [N·m]"""
        levels = np.zeros((self.knots, self.components))
        given = self.numbers < len(values)
        levels[given] = values[self.numbers[given]]
        following = np.minimum(self.knot + 1, self.knots - 1)
        share = self.share[:, None]
        level = (1.0 - share) * levels[self.knot] + share * levels[following]
        return np.asarray(np.einsum("tnm,tm->tn", self.torque, level))


def slow_loads(chain: Chain, t: Array, q: Array) -> SlowLoads:
    """The columns of slow external loads on an arm in motion.

    Args:
        chain: The arm.
        t: Times of the samples. (S,) [s]
        q: Positions there. (S, n) [rad]
    """
    wrench = flange_jacobian(chain, q).transpose(0, 2, 1) * np.repeat([FORCE, MOMENT], 3)
    along = [FORCE * force_torque(chain, q, joint) for joint in points_along(chain.joints)]
    length = float(t[-1] - t[0])
    knots = 1 if length < CONSTANT else min(round(length / KNOTS) + 1, MOST_KNOTS)
    place = (t - t[0]) / length * (knots - 1)
    knot = np.minimum(place.astype(np.intp), max(knots - 2, 0))
    return SlowLoads(-np.concatenate([wrench, *along], axis=2), knot, place - knot, knots)


def points_along(joints: int) -> tuple[int, ...]:
    """The joints, from 0, at whose origins a force acts on the link before: elbow and wrist."""
    return tuple(sorted({j for j in ((joints + 1) // 2 - 1, joints - 3) if j > 0}))


def force_torque(chain: Chain, q: Array, joint: int) -> Array:
    """Joint torques of a force, in base axes, at a joint's origin on the link before it. (S, n, 3)

    Args:
        chain: The arm.
        q: Positions. (S, n) [rad]
        joint: The joint, from 0: those from it on feel nothing.
    """
    poses = link_poses(chain, q)
    torque = np.zeros((*q.shape, 3))
    lever = poses.translation[:, joint, None] - poses.translation[:, :joint]
    torque[:, :joint] = np.cross(poses.rotation[:, :joint, :, 2], lever)
    return torque
