"""The whole arm's regressor, reduced to a triangle chunk by chunk.

All unknowns stand in one vector: inertial parameters (10 a link), rotor inertias, friction
coefficients joint by joint. Of the stacked equations only the R factor of their QR decomposition
is kept, so that memory does not grow with the log.
"""

import itertools
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vftcli.identification.friction_shapes import FrictionColumns, Shape
from vftcli.identification.processing import PreparedLog
from vftcli.robots.chain import Chain
from vftcli.robots.regressor import INERTIAL_NAMES, LINK, torque_regressor
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.least_squares import FOLDS, correlation_time, folds, huber, robust_sd


class ParameterColumns(NamedTuple):
    """Which unknown stands where."""

    chain: Chain  #: The arm's geometry.
    rotor: bool  #: Whether rotor inertias are unknowns: where torque is measured before the gear.
    shapes: tuple[Shape, ...]  #: Friction structure of each joint.

    @property
    def inertial(self) -> int:
        """Number of inertial unknowns: ten a link, the first of the vector."""
        return LINK * self.chain.joints

    @property
    def rotors(self) -> int:
        """Number of rotor inertias, which follow; 0 where torque is measured behind the gear."""
        return self.chain.joints if self.rotor else 0

    @property
    def frictions(self) -> tuple[slice, ...]:
        """Where in the vector each joint's friction coefficients stand, behind the rotors."""
        edges = np.cumsum([self.inertial + self.rotors, *(len(s.terms) for s in self.shapes)])
        return tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(edges))

    @property
    def size(self) -> int:
        """Number of unknowns in all, the length of the vector."""
        return int(self.frictions[-1].stop)

    @property
    def names(self) -> tuple[str, ...]:
        """A name for each unknown: m2, mx3, Ixx1, J4, coulomb5 …"""
        n = self.chain.joints
        inertial = [f"{name}{j}" for j in range(1, n + 1) for name in INERTIAL_NAMES]
        rotors = [f"J{j}" for j in range(1, self.rotors + 1)]
        terms = [f"{t}{j}" for j, s in enumerate(self.shapes, start=1) for t in s.terms]
        return (*inertial, *rotors, *terms)

    def rows(self, motion: PreparedLog, columns: FrictionColumns, span: slice) -> Array:
        """The regressor A of the samples of a span: A x is the drive torque of every joint.

        Returns:
            Its rows. (N, n, size)
        """
        n = self.chain.joints
        q, dq, ddq = motion.q[span], motion.dq[span], motion.ddq[span]
        A = np.zeros((len(q), n, self.size))
        A[:, :, : self.inertial] = torque_regressor(self.chain, q, dq, ddq)
        for j, (shape, place) in enumerate(zip(self.shapes, self.frictions, strict=True)):
            if self.rotor:
                A[:, j, self.inertial + j] = ddq[:, j]
            A[:, j, place] = columns.joint(j, shape)[span]
        return A


class WeightedLog(NamedTuple):
    """One training log, ready to be stacked."""

    motion: PreparedLog  #: The prepared log.
    columns: FrictionColumns  #: Its friction columns.
    weights: Array  #: Weight of every sample and joint, 0 … 1. (M, n)


class Triangles(NamedTuple):
    """The stacked, weighted equations A x ≈ y of the whole logs, as R factors of [A y]."""

    layout: ParameterColumns  #: The unknowns.
    parts: tuple[Array, ...]  #: R factor of each cross-validation stretch. (size+1, size+1) each
    correlation: float  #: Samples that count as one, by the residual's correlation along time.

    def joined(self, leave_out: int | None = None) -> tuple[Array, Array]:
        """R (size, size) and the right-hand side (size,) of all stretches but one."""
        kept = [part for k, part in enumerate(self.parts) if k != leave_out]
        whole = triangle(np.vstack(kept))
        return whole[:-1, :-1], whole[:-1, -1]

    def misfit(self, part: int, x: Array) -> float:
        """Weighted sum of squares that x leaves in one stretch."""
        R = self.parts[part]
        return float(np.sum((R[:, -1] - R[:, :-1] @ x) ** 2))


def triangle(rows: Array) -> Array:
    """R of the QR decomposition of stacked equations."""
    R: Array = np.asarray(np.linalg.qr(rows, mode="r"))
    return R


REWEIGHTINGS = 3  #: Passes of reweighting; each evaluates the regressor twice.


def residuals(layout: ParameterColumns, data: WeightedLog, x: Array) -> Array:
    """Drive torque of a log that the unknowns x (size,) do not explain. (M, n) [N·m]"""
    motion = data.motion
    out = np.empty(motion.q.shape)
    for span in motion.chunks():
        out[span] = motion.tau[span] - layout.rows(motion, data.columns, span) @ x
    return out


def stack(layout: ParameterColumns, logs: Sequence[WeightedLog], start: Array) -> Triangles:
    """Weigh and stack all logs, down-weighting outliers by what the last solution leaves.

    Args:
        layout: The unknowns.
        logs: The training logs.
        start: A solution to start from: the profile with its fitted friction. (size,)
    """
    x = start
    for _ in range(REWEIGHTINGS):
        left = [residuals(layout, data, x) for data in logs]
        sigma = joint_sigma(logs, left)
        triangles = triangulate(layout, logs, left, sigma)
        x = least_change(triangles, start)
    return triangles


def joint_sigma(logs: Sequence[WeightedLog], left: Sequence[Array]) -> Array:
    """Robust standard deviation of each joint's residual where it tells anything. (n,) [N·m]"""
    n = left[0].shape[1]
    sigma = np.empty(n)
    for j in range(n):
        parts = [r[d.weights[:, j] > 0, j] for d, r in zip(logs, left, strict=True)]
        sigma[j] = np.maximum(robust_sd(np.concatenate(parts)), 1e-9)
    return sigma


def triangulate(
    layout: ParameterColumns, logs: Sequence[WeightedLog], left: Sequence[Array], sigma: Array
) -> Triangles:
    """QR updates over all chunks of all logs, one triangle a cross-validation stretch."""
    parts = [np.zeros((0, layout.size + 1)) for _ in range(FOLDS)]
    correlation = []
    for data, residual in zip(logs, left, strict=True):
        weights = data.weights * huber(residual / sigma)
        for r, w in zip(residual.T, data.weights.T, strict=True):
            if np.count_nonzero(w) > 10:
                correlation.append(correlation_time(r[w > 0]))
        # Stretches are contiguous: neighbouring samples would tell each other's noise.
        for k, fold in enumerate(folds(data.motion.samples)):
            for rows in weighted_rows(layout, data, np.sqrt(weights) / sigma, fold):
                parts[k] = triangle(np.vstack([parts[k], rows]))
    return Triangles(layout, tuple(parts), float(np.mean(correlation)) if correlation else 1.0)


def weighted_rows(
    layout: ParameterColumns, data: WeightedLog, scale: Array, fold: slice, size: int = 512
) -> Iterator[Array]:
    """Rows [A y] times their weights, a chunk at a time; rows of no weight are dropped."""
    for start in range(fold.start, fold.stop, size):
        span = slice(start, min(start + size, fold.stop))
        A = layout.rows(data.motion, data.columns, span)
        rows = np.concatenate([A, data.motion.tau[span, :, None]], axis=2) * scale[span, :, None]
        flat = rows.reshape(-1, rows.shape[2])
        told: Mask = scale[span].ravel() > 0
        yield flat[told]


#: Singular values below this share of the largest are left at the start (columns scaled).
TRUNCATION = 1e-3


def truncated_step(R: Array, rest: Array) -> tuple[Array, Array, Array]:
    """Least squares R x ≈ rest in the directions that the data tells (truncated SVD).

    Returns:
        The step (k,), its standard deviations for equations of one each (k,), and the share of
        each unknown that lies in directions without data (k,).
    """
    scale = np.linalg.norm(R, axis=0)
    scale[scale == 0.0] = 1.0
    U, S, Vt = np.linalg.svd(R / scale, full_matrices=False)
    keep = TRUNCATION * S[0] < S
    step = Vt[keep].T @ ((U[:, keep].T @ rest) / S[keep]) / scale
    sd = np.sqrt(np.sum((Vt[keep].T / S[keep]) ** 2, axis=1)) / scale
    return step, sd, np.sum(Vt[~keep] ** 2, axis=0)


def least_change(triangles: Triangles, start: Array) -> Array:
    """Least squares that leaves the start only where the data says so. (size,)"""
    R, z = triangles.joined()
    return start + truncated_step(R, z - R @ start)[0]
