"""Weighted normal equations of a model's error and slow external loads, and their solution.

All columns are times their standard deviations, so the prior is the unit matrix: the solution
minimises Σ w (d + A u)² + Σ u². Each joint's row has columns of its own, and a slow load only those
of the two knots about a sample, so the matrix is summed block by block.

A hand that leans on the arm all the time looks like mass. Beside the model's columns therefore
stand those of external loads that change slowly: a wrench at the flange, and forces at the elbow
and the wrist on the links before them, which by the lever rule make up a force anywhere along the
arm. What falls to them is left in the estimate: in doubt a torque is a push.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.refinement.model_error import column_numbers
from vftcli.robots.chain import Chain
from vftcli.robots.kinematics import flange_jacobian, link_poses
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.least_squares import NormalEquations

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


BLOCK = 64  #: Rows that are substituted at a time.
PENALTY = 2.0  #: What a column of a load has to gain before it is believed (Akaike's criterion).


class FittedError(NamedTuple):
    """What the rows say of the unknowns."""

    model: Array  #: Of the model's error, in standard deviations. (P,)
    loads: Array  #: Of the slow loads that are believed, in standard deviations. (L,)
    scale: float  #: What the model's standard deviations were multiplied with.
    factor: Array  #: Lower Cholesky factor of the matrix of both. (P + L, P + L)

    @property
    def covariance(self) -> Array:
        """Covariance of the model's error, in squared standard deviations. (P, P)"""
        half = forward_solved(self.factor, np.eye(len(self.factor), len(self.model)))
        return np.asarray(self.scale**2 * (half.T @ half))


@dataclass(frozen=True, kw_only=True)
class Rows:
    """The rows of a fit: one a sample and joint."""

    #: The model's columns of every joint, as in `column_numbers`. (S, p) each
    columns: Sequence[Array]
    loads: SlowLoads  #: The columns of slow loads.
    d: Array  #: What is fitted. (S, n) [N·m]

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.columns)

    @property
    def unknowns(self) -> int:
        """Number P of columns of the model's error."""
        return int(column_numbers(self.joints - 1, self.joints)[-1]) + 1

    def modelled(self, values: Array, span: slice = slice(None)) -> Array:
        """A u of the model's columns. (S, n) [N·m]"""
        n = self.joints
        torque = [c[span] @ values[column_numbers(j, n)] for j, c in enumerate(self.columns)]
        return np.column_stack(torque)

    def spread(self, covariance: Array) -> Array:
        """Standard deviation of A u. (S, n) [N·m]"""
        variance = []
        for j, column in enumerate(self.columns):
            numbers = column_numbers(j, self.joints)
            part = column @ covariance[np.ix_(numbers, numbers)]
            variance.append(np.einsum("ij,ij->i", part, column))
        return np.asarray(np.sqrt(np.maximum(np.column_stack(variance), 0.0)))

    def model_sums(self, weight: Array) -> NormalEquations:
        """Sums over all rows of the model's columns alone.

        Args:
            weight: Of every row. (S, n)
        """
        sums = self._empty(0)
        for j, column in enumerate(self.columns):
            X = np.column_stack([column, self.d[:, j]])
            add(sums, X * np.sqrt(weight[:, j, None]), column_numbers(j, self.joints))
        return finished(sums)

    def all_sums(self, weight: Array, taken: Mask, parts: Sequence[Mask]) -> list[NormalEquations]:
        """Sums of all columns, of the model's and of the loads', over some samples.

        Args:
            weight: Of every row. (S, n)
            taken: The samples. (S,)
            parts: Some of them, which may overlap. (S,) each

        Returns:
            The sums over all that are taken, then over each part.
        """
        sums = [self._empty(self.loads.sizes[-1]) for _ in range(1 + len(parts))]
        for block, member in self._blocks(taken, parts):
            knot = int(self.loads.knot[block[0]])
            following = self.loads.numbers[knot : knot + 2].ravel() + self.unknowns
            share = self.loads.share[block, None]
            for j, column in enumerate(self.columns):
                torque = self.loads.torque[block, j]
                hats = [(1.0 - share) * torque, share * torque][: self.loads.knots]
                X = np.hstack([column[block], *hats, self.d[block, j, None]])
                X *= np.sqrt(weight[block, j, None])
                numbers = np.concatenate([column_numbers(j, self.joints), following])
                add(sums[0], X, numbers, [s for s, m in zip(sums[1:], member, strict=True) if m])
        return [finished(one) for one in sums]

    def _blocks(
        self, taken: Mask, parts: Sequence[Mask]
    ) -> Iterator[tuple[NDArray[np.intp], NDArray[np.bool_]]]:
        """The samples in blocks that lie between two knots and in the same parts, and in which."""
        kind = np.column_stack([self.loads.knot, *parts])[taken]
        where = np.flatnonzero(taken)
        edges = np.flatnonzero(np.any(np.diff(kind, axis=0) != 0, axis=1)) + 1
        for block in np.split(where, edges):
            if len(block):
                yield block, np.array([part[block[0]] for part in parts], dtype=bool)

    def _empty(self, loads: int) -> Array:
        """Room for the sums, those with d in the last row and column."""
        size = self.unknowns + loads + 1
        return np.zeros((size, size))


def add(total: Array, X: Array, numbers: NDArray[np.intp], also: Sequence[Array] = ()) -> None:
    """Add the products of some rows' columns, d the last, to sums at these columns' places."""
    product = X.T @ X
    places = np.append(numbers, len(total) - 1)
    for sums in (total, *also):
        sums[np.ix_(places, places)] += product


def finished(total: Array) -> NormalEquations:
    """The sums in a matrix that has those with d in its last row and column."""
    return NormalEquations(total[:-1, :-1], total[:-1, -1], float(total[-1, -1]))


def solve(
    sums: NormalEquations, unknowns: int, sizes: Sequence[int], scale: float = 1.0
) -> FittedError:
    """The most likely model error, with the slow loads that make the rows likely enough.

    The loads' groups are nested, and so are the Cholesky factors with and without them: one factor
    gives the objective of every group, c − Σ z² over its columns, z = L⁻¹AᵀWd.
    """
    scales = np.ones(len(sums.right))
    scales[:unknowns] = scale
    matrix = sums.gram * scales * scales[:, None]
    matrix.flat[:: len(matrix) + 1] += 1.0
    factor = np.asarray(np.linalg.cholesky(matrix), dtype=np.float64)
    z = forward_solved(factor, scales * sums.right)
    gained = np.concatenate([[0.0], np.cumsum(z**2)])
    loads = min(sizes, key=lambda size: PENALTY * size - gained[unknowns + size])
    size = unknowns + loads
    factor, z = factor[:size, :size], z[:size]
    values = -forward_solved(factor.T[::-1, ::-1], z[::-1])[::-1]
    return FittedError(scale * values[:unknowns], values[unknowns:], scale, factor)


def forward_solved(factor: Array, right: Array) -> Array:
    """L⁻¹ times the right-hand sides, by forward substitution in blocks. (N,) or (N, k)

    Args:
        factor: Lower triangular L. (N, N)
        right: Right-hand sides. (N,) or (N, k)
    """
    found = right.astype(np.float64)
    for first in range(0, len(found), BLOCK):
        own = slice(first, first + BLOCK)
        rest = found[own] - factor[own, :first] @ found[:first]
        found[own] = np.linalg.solve(factor[own, own], rest)
    return found
