"""The model's error from a whole log: normal equations, robust fit, fold tests.

All columns are times their SDs: the prior is the unit matrix, the
solution minimises Σ w (d + A u)² + Σ u². A joint's row has its own columns, a slow load
only its two knots about a sample: sums go block by block.

A hand that always leans on the arm looks like mass. So there are columns of slow external
loads too: a wrench at the flange, forces at elbow and wrist. By the lever rule these make
a force anywhere along the arm. The estimate keeps their torque: in doubt it is a push.

The first fit weighs samples down for all joints together: several feel a contact. The second
fits the samples below a threshold, with the loads. Each fold of the free samples is predicted
from the others, at several degrees of freedom; samples in motion judge a joint.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from vftcli.bias.model_error import column_numbers
from vftcli.robots.chain import Chain, link_jacobian, link_poses
from vftcli.signals.arrays import Array, Indices, Mask, covered, runs_of, summed
from vftcli.signals.estimation import FOLDS, SD_PER_MEDIAN, NormalEquations, huber, robust_sd
from vftcli.signals.rest import faster

FORCE = 50.0  #: SD of an external force. [N]
MOMENT = 10.0  #: SD of an external moment. [N·m]
KNOTS = 10.0  #: Time between two knots of a load, straight between. [s]
CONSTANT = 15.0  #: In a shorter log a load is constant. [s]
MOST_KNOTS = 61  #: Knots of ten minutes; a longer log spreads them.
WRENCH = 6  #: Components of the flange's wrench, the first loads.


class SlowLoads(NamedTuple):
    """Columns of slow external loads along the samples of a fit."""

    #: −τ_ext of one SD of the flange's wrench, then of forces along the arm. (S, n, m) [N·m]
    torque: Array
    knot: Indices  #: The knot before each sample. (S,)
    share: Array  #: A sample's way to the next one, 0 … 1. (S,)
    knots: int  #: Number of knots.

    @property
    def sizes(self) -> tuple[int, ...]:
        """Columns without loads, with the wrench, and with the forces."""
        every = self.numbers.size
        return tuple(sorted({0, min(WRENCH * self.knots, every), every}))

    @property
    def numbers(self) -> Indices:
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
    """Columns of slow loads at times t (S,) [s], positions q (S, n) [rad]."""
    n, poses = chain.joints, link_poses(chain, q)
    # At the flange, before the elbow's joint, before the wrist's.
    links = n, *sorted({j for j in ((n + 1) // 2 - 1, n - 3) if j > 0})
    flange, *along = (link_jacobian(poses, link).transpose(0, 2, 1) for link in links)
    wrench = flange * np.repeat([FORCE, MOMENT], 3)
    torque = -np.concatenate([wrench, *(FORCE * J[:, :, :3] for J in along)], axis=2)
    length = t[-1] - t[0]
    knots = 1 if length < CONSTANT else min(round(length / KNOTS) + 1, MOST_KNOTS)
    place = (t - t[0]) / length * (knots - 1)
    knot = np.minimum(place.astype(int), max(knots - 2, 0))
    return SlowLoads(torque, knot, place - knot, knots)


BLOCK = 64  #: Rows to substitute at once.
PENALTY = 2.0  #: Least gain of a load's column (Akaike's criterion).


class FittedError(NamedTuple):
    """Solution of the rows."""

    model: Array  #: The model's error, in SDs. (P,)
    loads: Array  #: Slow loads in use, in SDs. (L,)
    scale: float  #: Factor on the model's SDs.
    factor: Array  #: Lower Cholesky factor of both's matrix. (P + L, P + L)

    @property
    def covariance(self) -> Array:
        """Covariance of the model's error, in squared SDs. (P, P)"""
        half = forward_solved(self.factor, np.eye(len(self.factor), len(self.model)))
        return self.scale**2 * (half.T @ half)


@dataclass(frozen=True, kw_only=True)
class Rows:
    """The rows of a fit: one a sample and joint."""

    #: The model's columns of every joint, as in `column_numbers`. (S, p) each
    columns: Sequence[Array]
    loads: SlowLoads  #: The columns of slow loads.
    d: Array  #: The fitted torque. (S, n) [N·m]
    moves: Mask  #: Samples in motion; at rest no error shows. (S,)

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return len(self.columns)

    @cached_property
    def share(self) -> Array:
        """Weight of each sample: all rest counts at most as the motion. (S, 1)"""
        moving = int(np.count_nonzero(self.moves))
        weight = max(moving, FEWEST) / max(len(self.moves) - moving, 1)
        return np.where(self.moves, 1.0, min(weight, 1.0))[:, None]

    def moving(self, free: Mask) -> Mask:
        """The free samples in motion, all free ones if too few move. (S,)"""
        inside = free & self.moves
        return inside if np.count_nonzero(inside) >= FEWEST else free

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
        """SD of A u. (S, n) [N·m]"""
        variance = []
        for j, column in enumerate(self.columns):
            numbers = column_numbers(j, self.joints)
            part = column @ covariance[np.ix_(numbers, numbers)]
            variance.append(np.einsum("ij,ij->i", part, column))
        return np.asarray(np.sqrt(np.maximum(np.column_stack(variance), 0.0)))

    def sums(
        self, weight: Array, chosen: Mask | None = None, parts: Sequence[Mask] = ()
    ) -> list[NormalEquations]:
        """Sums of all columns over some samples, then over parts.

        The rows have weights (S, n); no samples (S,) means all. Parts (S,) may overlap.
        """
        size = self.unknowns + self.loads.numbers.size + 1
        totals = np.zeros((1 + len(parts), size, size))
        # Blocks of samples between two knots and in one set of parts.
        where = np.arange(len(self.d)) if chosen is None else np.flatnonzero(chosen)
        kind = np.column_stack([self.loads.knot, *parts])[where]
        edges = np.flatnonzero(np.any(np.diff(kind, axis=0) != 0, axis=1)) + 1
        for block in np.split(where, edges) if len(where) else []:
            knot = int(self.loads.knot[block[0]])
            following = self.loads.numbers[knot : knot + 2].ravel() + self.unknowns
            share = self.loads.share[block, None]
            inside = [0, *(k for k, part in enumerate(parts, start=1) if part[block[0]])]
            for j, column in enumerate(self.columns):
                torque = self.loads.torque[block, j]
                hats = [(1.0 - share) * torque, share * torque][: self.loads.knots]
                X = np.hstack([column[block], *hats, self.d[block, j, None]])
                X *= np.sqrt(weight[block, j, None])
                product = X.T @ X
                places = [*column_numbers(j, self.joints), *following, size - 1]
                for k in inside:
                    totals[k][np.ix_(places, places)] += product
        return [
            NormalEquations(total[:-1, :-1], total[:-1, -1], total[-1, -1]) for total in totals
        ]

    def solution(self, sums: NormalEquations, scale: float = 1.0) -> FittedError:
        """The most likely model error, with loads that make the rows likely.

        The loads' groups are nested, so one Cholesky factor gives every group's
        objective, c − Σ z² over its columns, z = L⁻¹AᵀWd.
        """
        unknowns, scales = self.unknowns, np.ones(len(sums.right))
        scales[:unknowns] = scale
        matrix = sums.gram * scales * scales[:, None]
        matrix.flat[:: len(matrix) + 1] += 1.0
        factor = np.asarray(np.linalg.cholesky(matrix), float)
        z = forward_solved(factor, scales * sums.right)
        gained = summed(z**2)
        loads = min(self.loads.sizes, key=lambda size: PENALTY * size - gained[unknowns + size])
        size = unknowns + loads
        factor, z = factor[:size, :size], z[:size]
        values = -forward_solved(factor.T[::-1, ::-1], z[::-1])[::-1]
        return FittedError(scale * values[:unknowns], values[unknowns:], scale, factor)

    def residual(self, found: FittedError) -> Array:
        """Torque less model and loads. (S, n) [N·m]"""
        return self.d + self.modelled(found.model) + self.loads.torque_of(found.loads)


def forward_solved(factor: Array, right: Array) -> Array:
    """L⁻¹ times right-hand sides, in blocks. (N,) or (N, k)"""
    found = right.astype(float)
    for first in range(0, len(found), BLOCK):
        own = slice(first, first + BLOCK)
        rest = found[own] - factor[own, :first] @ found[:first]
        found[own] = np.linalg.solve(factor[own, own], rest)
    return found


CORRELATED = 0.3  #: Residuals so close in time are one. [s]
LEAST_SCALE = 0.08  #: Least scale of the residual, by dry friction. [1]
LEAST_TORQUE = 0.02  #: And by torque. [N·m]
#: Quietest share of the samples for the first scale, …
QUIET_SHARE = 0.35
#: … its largest is this share of the median in normal noise.
QUIET_QUANTILE = 0.66
REACH = 0.15  #: Samples share the worst suspicion within this time. [s]
PASSES = 8  #: Passes of the first fit.
FIRST = 0.6  #: Its first threshold: this quantile of suspicion, …
NARROWED = 1.6  #: … divided by this after a pass, …
NARROWEST = 3.0  #: … down to this many scales.
TRUSTED = 0.25  #: Least weight of samples that set the scale.
FREE_PASSES = 3  #: Passes of the second fit.
CONTACT = 5.0  #: Scales of a joint's residual in contact, …
LASTS = 0.08  #: … for at least this time. [s]
GROWN = 0.25  #: Time of a contact before and after. [s]
FEWEST = 30  #: Fewest free samples, and samples, of a fit.


@dataclass(frozen=True, kw_only=True)
class WholeLogFit:
    """A log's fit of the model's error."""

    rows: Rows  #: What was fitted.
    step: float  #: Its sample time. [s]
    free: Mask  #: Samples free of contact. (S,)
    scale: Array  #: Residual beside model and loads. (n,) [N·m]
    weight: Array  #: Weight of every row, by scale and correlation. (S, n)


def fit_robustly(rows: Rows, step: float, dry: Array) -> WholeLogFit:
    """The fit of a model's error at a step [s], with dry friction (n,) [N·m]."""
    counted = max(1.0, CORRELATED / step)
    least = np.maximum(LEAST_SCALE * dry, LEAST_TORQUE)
    residual, scale = first_fit(rows, step, counted, least)
    for _ in range(FREE_PASSES):
        free = free_samples(np.max(abs(residual) / scale, axis=1), step)
        weight = rows.share * huber(residual / scale) / (counted * scale**2)
        residual = rows.residual(rows.solution(rows.sums(weight, free)[0]))
        scale = np.maximum(robust_sd(residual[rows.moving(free)]), least)
    return WholeLogFit(rows=rows, step=step, free=free, scale=scale, weight=weight)


def first_fit(rows: Rows, step: float, counted: float, least: Array) -> tuple[Array, Array]:
    """Residual (S, n) without loads, and its scale, at `least` (n,). [N·m]"""
    held = SlowLoads(rows.loads.torque[:, :, :0], 0 * rows.loads.knot, rows.loads.share, 1)
    rows, residual = replace(rows, loads=held), rows.d
    moves = rows.moving(np.ones(len(rows.d), bool))
    quiet = np.quantile(abs(residual[moves]), QUIET_SHARE, axis=0)
    scale = np.maximum(SD_PER_MEDIAN * quiet / QUIET_QUANTILE, least)
    threshold, reach = np.inf, round(REACH / step)
    for _ in range(PASSES):
        # A sample shares the worst suspicion of its neighbours.
        padded = np.pad(np.max(abs(residual) / scale, axis=1), reach, mode="edge")
        worst = sliding_window_view(padded, 2 * reach + 1).max(axis=1)
        first = np.isinf(threshold)
        threshold = np.quantile(worst[moves], FIRST) if first else threshold / NARROWED
        threshold = max(threshold, NARROWEST)
        share = (1.0 + (worst / threshold) ** 2) ** -2
        residual = rows.residual(
            rows.solution(rows.sums(rows.share * share[:, None] / (counted * scale**2))[0])
        )
        trusted = residual[moves][share[moves] > TRUSTED]
        if len(trusted):
            scale = np.maximum(robust_sd(trusted), least)
    return residual, scale


def free_samples(worst: Array, step: float) -> Mask:
    """Samples without contact by scaled residuals; all if too few. (S,)"""
    # rounding of a step must not shorten such a run
    runs = [run for run in runs_of(worst > CONTACT) if (run[1] - run[0]) * step >= LASTS - 1e-9]
    free = ~covered(runs, len(worst), margin=round(GROWN / step))
    return free if np.count_nonzero(free) >= FEWEST else np.ones_like(free)


MARGIN = 0.5  #: Cut at both ends of a fold: neighbours know each other. [s]
SCALES = (0.0, 0.1, 0.3, 1.0)  #: Freedom of the model: factors on its SDs.
LARGEST = 6.0  #: Most scales of a residual.
#: A joint with less motion than this share is judged by all free samples.
SELDOM = 0.2
WORTH = 0.9  #: Most of the unseen error left for a full correction, …
#: … and least for none. An inseparable load of 2.8 kg leaves .95.
WORTHLESS = 0.95


class Guarded(NamedTuple):
    """A model error tested on unseen samples."""

    #: From all free samples, as free as the best prediction, or None.
    solution: FittedError | None
    share: Array  #: Unseen error with over without it, in motion. (n,)
    #: Each joint's part: 0 if not worth having, 1 if clearly worth it. (n,)
    weight: Array
    loads: Array  #: Slow loads that are believed too, in SDs. (L,)


def guarded(fit: WholeLogFit, dq: Array) -> Guarded:
    """A fit tested on folds of its free samples; dq is (S, n). [rad/s]"""
    moves, used = faster(dq), fit.rows.moving(fit.free)
    judged = moves | (moves[used].mean(axis=0) < SELDOM)
    folds = [(int(f[0]), int(f[-1]) + 1) for f in np.array_split(np.flatnonzero(used), FOLDS)]
    left_out = [covered([f], len(fit.free), margin=round(MARGIN / fit.step)) for f in folds]
    whole, *parts = fit.rows.sums(fit.weight, fit.free, left_out)
    squares = np.zeros((len(SCALES), fit.rows.joints))
    for fold, part in zip(folds, parts, strict=True):
        inner = slice(*fold)
        free = used[inner]
        rest = whole.minus(part)
        for k, scale in enumerate(SCALES):
            residual = fit.rows.d[inner]
            if scale:
                found = fit.rows.solution(rest, scale).model
                residual = residual + fit.rows.modelled(found, inner)
            held = np.minimum(abs(residual[free]) / fit.scale, LARGEST)
            squares[k] += np.sum(held**2 * judged[inner][free], axis=0)
    best = int(squares.mean(axis=1).argmin())
    share = np.sqrt(squares[best] / np.maximum(squares[0], np.finfo(float).tiny))
    if not SCALES[best]:
        return Guarded(None, share, np.zeros_like(share), fit.rows.solution(whole).loads)
    solution = fit.rows.solution(whole, SCALES[best])
    return Guarded(solution, share, faded(share, WORTH, WORTHLESS), solution.loads)


def faded(value: Array, full: float, none: float) -> Array:
    """Part in use: 1 up to a value, 0 from another on, straight between."""
    return np.clip((none - value) / (none - full), 0.0, 1.0)
