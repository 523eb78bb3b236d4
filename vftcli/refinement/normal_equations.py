"""Weighted normal equations of a model's error and slow loads; solution.

All columns are times their standard deviations: the prior is the unit matrix and the solution
minimises Σ w (d + A u)² + Σ u². A joint's row has its own columns, a slow load only its two
knots about a sample: sums go block by block.

A hand that leans on the arm all the time looks like mass. So beside the model's columns there
are those of external loads that change slowly: a wrench at the flange, forces at elbow and
wrist on the links before them. By the lever rule these make a force anywhere along the arm.
The estimate keeps their torque: in doubt a torque is a push.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.refinement.model_error import column_numbers
from vftcli.robots.chain import Chain, flange_jacobian, link_poses
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.least_squares import NormalEquations

FORCE = 50.0  #: Standard deviation of an external force. [N]
MOMENT = 10.0  #: Standard deviation of an external moment. [N·m]
KNOTS = 10.0  #: Time between two knots of a load, straight between. [s]
CONSTANT = 15.0  #: In a shorter log a load is constant. [s]
MOST_KNOTS = 61  #: Knots of ten minutes; a longer log spreads them.
WRENCH = 6  #: Components of the flange's wrench, the first loads.


class SlowLoads(NamedTuple):
    """Columns of slow external loads along the samples of a fit."""

    #: External torque, sign reversed, of one standard deviation of every component: the flange's
    #: wrench, then forces along the arm. (S, n, m) [N·m]
    torque: Array
    knot: NDArray[np.intp]  #: The knot before each sample. (S,)
    share: Array  #: A sample's way to the next one, 0 … 1. (S,)
    knots: int  #: Number of knots.

    @property
    def sizes(self) -> tuple[int, ...]:
        """Columns without loads, with the wrench, and with the forces."""
        return tuple(sorted({0, WRENCH * self.knots, self.numbers.size}))

    @property
    def numbers(self) -> NDArray[np.intp]:
        """Columns of each knot's components, the wrench first. (knots, m)"""
        numbers = np.arange(self.torque.shape[2] * self.knots)
        flange, along = np.split(numbers, [WRENCH * self.knots])
        return np.hstack([flange.reshape(self.knots, -1), along.reshape(self.knots, -1)])

    def torque_of(self, values: Array) -> Array:
        """Columns times values in the order of `numbers`. (S, n) [N·m]"""
        numbers = self.numbers
        levels = np.zeros(numbers.shape)
        levels[numbers < len(values)] = values[numbers[numbers < len(values)]]
        following = np.minimum(self.knot + 1, self.knots - 1)
        share = self.share[:, None]
        level = (1.0 - share) * levels[self.knot] + share * levels[following]
        return np.asarray(np.einsum("tnm,tm->tn", self.torque, level))


def slow_loads(chain: Chain, t: Array, q: Array) -> SlowLoads:
    """Columns of slow external loads on a moving arm at times t (S,) [s] and positions q (S, n)."""
    wrench = flange_jacobian(chain, q).transpose(0, 2, 1) * np.repeat([FORCE, MOMENT], 3)
    along = [FORCE * force_torque(chain, q, joint) for joint in points_along(chain.joints)]
    length = float(t[-1] - t[0])
    knots = 1 if length < CONSTANT else min(round(length / KNOTS) + 1, MOST_KNOTS)
    place = (t - t[0]) / length * (knots - 1)
    knot = np.minimum(place.astype(np.intp), max(knots - 2, 0))
    return SlowLoads(-np.concatenate([wrench, *along], axis=2), knot, place - knot, knots)


def points_along(joints: int) -> tuple[int, ...]:
    """Joints, from 0, with a force on the link before: elbow and wrist."""
    return tuple(sorted({j for j in ((joints + 1) // 2 - 1, joints - 3) if j > 0}))


def force_torque(chain: Chain, q: Array, joint: int) -> Array:
    """Torques of a base-axes force at a joint, from 0, on the link before. (S, n, 3)"""
    poses = link_poses(chain, q)
    torque = np.zeros((*q.shape, 3))
    lever = poses.translation[:, joint, None] - poses.translation[:, :joint]
    torque[:, :joint] = np.cross(poses.rotation[:, :joint, :, 2], lever)
    return torque


BLOCK = 64  #: Rows to substitute at once.
PENALTY = 2.0  #: Least gain of a load's column (Akaike's criterion).


class FittedError(NamedTuple):
    """Solution of the rows."""

    model: Array  #: The model's error, in standard deviations. (P,)
    loads: Array  #: Slow loads in use, in standard deviations. (L,)
    scale: float  #: Factor on the model's standard deviations.
    factor: Array  #: Lower Cholesky factor of both's matrix. (P + L, P + L)

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
    d: Array  #: The fitted torque. (S, n) [N·m]

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
        """Sums over all rows, by their weights (S, n), model's columns only."""
        total = np.zeros((self.unknowns + 1, self.unknowns + 1))
        for j, column in enumerate(self.columns):
            X = np.column_stack([column, self.d[:, j]])
            add([total], X * np.sqrt(weight[:, j, None]), column_numbers(j, self.joints))
        return finished(total)

    def all_sums(self, weight: Array, taken: Mask, parts: Sequence[Mask]) -> list[NormalEquations]:
        """Sums of all columns, model's and loads', over some samples, then over parts of them.

        Args:
            weight: Of every row. (S, n)
            taken: The samples. (S,)
            parts: Some of them, which may overlap. (S,) each
        """
        size = self.unknowns + self.loads.sizes[-1] + 1
        sums = np.zeros((1 + len(parts), size, size))
        # Blocks of samples between two knots and in one set of parts.
        where = np.flatnonzero(taken)
        kind = np.column_stack([self.loads.knot, *parts])[where]
        edges = np.flatnonzero(np.any(np.diff(kind, axis=0) != 0, axis=1)) + 1
        for block in np.split(where, edges) if len(where) else []:
            knot = int(self.loads.knot[block[0]])
            following = self.loads.numbers[knot : knot + 2].ravel() + self.unknowns
            share = self.loads.share[block, None]
            inside = [sums[0], *(s for s, p in zip(sums[1:], parts, strict=True) if p[block[0]])]
            for j, column in enumerate(self.columns):
                torque = self.loads.torque[block, j]
                hats = [(1.0 - share) * torque, share * torque][: self.loads.knots]
                X = np.hstack([column[block], *hats, self.d[block, j, None]])
                X *= np.sqrt(weight[block, j, None])
                add(inside, X, np.concatenate([column_numbers(j, self.joints), following]))
        return [finished(one) for one in sums]


def add(sums: Sequence[Array], X: Array, numbers: NDArray[np.intp]) -> None:
    """Add products of rows' columns, d the last, to sums at these places."""
    places = np.append(numbers, len(sums[0]) - 1)
    product = X.T @ X
    for total in sums:
        total[np.ix_(places, places)] += product


def finished(total: Array) -> NormalEquations:
    """The sums in a matrix with d's in the last row and column."""
    return NormalEquations(total[:-1, :-1], total[:-1, -1], float(total[-1, -1]))


def solve(
    sums: NormalEquations, unknowns: int, sizes: Sequence[int], scale: float = 1.0
) -> FittedError:
    """The most likely model error, with loads that make the rows likely.

    The loads' groups are nested, and so are their Cholesky factors: one factor gives every
    group's objective, c − Σ z² over its columns, z = L⁻¹AᵀWd.
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
    """L⁻¹ times right-hand sides, forward substitution in blocks. (N,) or (N, k)"""
    found = right.astype(np.float64)
    for first in range(0, len(found), BLOCK):
        own = slice(first, first + BLOCK)
        rest = found[own] - factor[own, :first] @ found[:first]
        found[own] = np.linalg.solve(factor[own, own], rest)
    return found
