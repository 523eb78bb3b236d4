"""The links' parameters by least squares, in combinations that motion shows.

One vector holds all unknowns: inertial parameters (10 a link), rotor inertias, friction
coefficients joint by joint. Of the stacked equations only the R factor of their QR decomposition
is kept, chunk by chunk: memory does not grow with the log. Base parameters are the
combinations of inertial parameters that any motion shows at all.
"""

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.identification.result import BASE
from vftcli.identification.training import Shape, TrainingLog
from vftcli.robots.chain import Chain
from vftcli.robots.regressor import INERTIAL_NAMES, LINK, torque_regressor
from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError
from vftcli.signals.least_squares import FOLDS, correlation_time, folds, huber, robust_sd

ROWS = 512  #: Samples stacked at once.
REWEIGHTINGS = 3  #: Passes of reweighting; each evaluates the regressor twice.
#: Singular values below this share of the largest stay at the start (columns scaled).
TRUNCATION = 1e-3
PROBES = 400  #: Random states for the structure of base parameters.
#: Diagonal entries of R below this share of the largest are zero: rounding is at 1e-15.
RANK_TOLERANCE = 1e-8
#: Least relative deviation of an undetermined parameter.
DOUBTFUL = 0.3


class ParameterColumns(NamedTuple):
    """Order of the unknowns in their vector."""

    chain: Chain  #: The arm's geometry.
    rotor: bool  #: Whether rotor inertias are unknown: with torque measured before the gear.
    shapes: tuple[Shape, ...]  #: Friction structure of each joint.

    @property
    def inertial(self) -> int:
        """Number of inertial unknowns: ten a link, first in the vector."""
        return LINK * self.chain.joints

    @property
    def rotors(self) -> int:
        """Number of rotor inertias, next; 0 with torque measured behind the gear."""
        return self.chain.joints if self.rotor else 0

    @property
    def rotor_places(self) -> slice:
        """Places of the rotor inertias."""
        return slice(self.inertial, self.inertial + self.rotors)

    @property
    def frictions(self) -> tuple[slice, ...]:
        """Places of each joint's friction coefficients, behind the rotors."""
        edges = np.cumsum([self.rotor_places.stop, *(len(s.terms) for s in self.shapes)])
        return tuple(slice(int(a), int(b)) for a, b in itertools.pairwise(edges))

    @property
    def size(self) -> int:
        """Length of the vector of unknowns."""
        return int(self.frictions[-1].stop)

    @property
    def names(self) -> tuple[str, ...]:
        """A name for each unknown: m2, mx3, Ixx1, J4, coulomb5 …"""
        n = self.chain.joints
        inertial = [f"{name}{j}" for j in range(1, n + 1) for name in INERTIAL_NAMES]
        rotors = [f"J{j}" for j in range(1, self.rotors + 1)]
        terms = [f"{t}{j}" for j, s in enumerate(self.shapes, start=1) for t in s.terms]
        return (*inertial, *rotors, *terms)

    def rows(self, log: TrainingLog, span: slice) -> Array:
        """Regressor A of a span: A x is every joint's drive torque. (N, n, size)"""
        n, motion = self.chain.joints, log.motion
        q, dq, ddq = motion.q[span], motion.dq[span], motion.ddq[span]
        A = np.zeros((len(q), n, self.size))
        A[:, :, : self.inertial] = torque_regressor(self.chain, q, dq, ddq)
        for j, (shape, place) in enumerate(zip(self.shapes, self.frictions, strict=True)):
            if self.rotor:
                A[:, j, self.inertial + j] = ddq[:, j]
            A[:, j, place] = log.columns.joint(j, shape)[span]
        return A


class Triangles(NamedTuple):
    """The stacked, weighted equations A x ≈ y of the logs, as R factors of [A y]."""

    layout: ParameterColumns  #: The unknowns.
    parts: tuple[Array, ...]  #: R factor of each stretch left out. (size+1, size+1) each
    correlation: float  #: Samples that count as one: residuals correlate.

    def joined(self, leave_out: int | None = None) -> tuple[Array, Array]:
        """R (size, size) and right-hand side (size,) of all stretches but one."""
        kept = [part for k, part in enumerate(self.parts) if k != leave_out]
        whole = triangle(np.vstack(kept))
        return whole[:-1, :-1], whole[:-1, -1]

    def misfit(self, part: int, x: Array) -> float:
        """Weighted sum of squares left by x in one stretch."""
        R = self.parts[part]
        return float(np.sum((R[:, -1] - R[:, :-1] @ x) ** 2))


def triangle(rows: Array) -> Array:
    """R of the QR decomposition of stacked equations."""
    R: Array = np.asarray(np.linalg.qr(rows, mode="r"))
    return R


def residuals(layout: ParameterColumns, log: TrainingLog, x: Array) -> Array:
    """Drive torque of a log beyond the unknowns x (size,). (M, n) [N·m]"""
    tau = log.motion.tau
    parts = [tau[span] - layout.rows(log, span) @ x for span in log.motion.chunks()]
    return np.concatenate(parts)


def stack(layout: ParameterColumns, logs: Sequence[TrainingLog], start: Array) -> Triangles:
    """All logs weighed and stacked; the last solution weighs outliers down.

    The first one is the profile's with fitted friction, `start`. (size,)
    """
    rows = sum(int(np.count_nonzero(log.weights)) for log in logs)
    if rows < 4 * layout.size:
        raise IdentificationError(
            f"{rows} equations for {layout.size} unknowns; record a longer log, "
            "or use --method friction"
        )
    x = start
    for _ in range(REWEIGHTINGS):
        left = [residuals(layout, log, x) for log in logs]
        triangles = triangulate(layout, logs, left, joint_sigma(logs, left))
        x = least_change(triangles, start)
    return triangles


def joint_sigma(logs: Sequence[TrainingLog], left: Sequence[Array]) -> Array:
    """Robust deviation of each joint's weighted residual. (n,) [N·m]"""
    weights = np.concatenate([log.weights for log in logs])
    pairs = zip(np.concatenate(left).T, weights.T, strict=True)
    return np.array([max(float(robust_sd(r[w > 0])), 1e-9) for r, w in pairs])


def triangulate(
    layout: ParameterColumns, logs: Sequence[TrainingLog], left: Sequence[Array], sigma: Array
) -> Triangles:
    """QR updates over all chunks of all logs, a triangle per stretch."""
    parts = [np.zeros((0, layout.size + 1)) for _ in range(FOLDS)]
    correlation = []
    for log, residual in zip(logs, left, strict=True):
        scale = np.sqrt(log.weights * huber(residual / sigma)) / sigma
        for r, w in zip(residual.T, log.weights.T, strict=True):
            if np.count_nonzero(w) > 10:
                correlation.append(correlation_time(r[w > 0]))
        # Contiguous stretches: neighbours share noise.
        for k, fold in enumerate(folds(log.motion.samples)):
            for start in range(fold.start, fold.stop, ROWS):
                span = slice(start, min(start + ROWS, fold.stop))
                A = np.concatenate([layout.rows(log, span), log.motion.tau[span, :, None]], axis=2)
                rows = (A * scale[span, :, None]).reshape(-1, A.shape[2])
                weighs = scale[span].ravel() > 0
                parts[k] = triangle(np.vstack([parts[k], rows[weighs]]))
    return Triangles(layout, tuple(parts), float(np.mean(correlation)) if correlation else 1.0)


def truncated_step(R: Array, rest: Array) -> tuple[Array, Array, Array]:
    """Least squares R x ≈ rest in directions with data (truncated SVD).

    Step, standard deviation for unit equations, share in directions without data. (k,) each
    """
    scale = np.linalg.norm(R, axis=0)
    scale[scale == 0.0] = 1.0
    U, S, Vt = np.linalg.svd(R / scale, full_matrices=False)
    keep = TRUNCATION * S[0] < S
    step = Vt[keep].T @ ((U[:, keep].T @ rest) / S[keep]) / scale
    sd = np.sqrt(np.sum((Vt[keep].T / S[keep]) ** 2, axis=1)) / scale
    return step, sd, np.sum(Vt[~keep] ** 2, axis=0)


def least_change(triangles: Triangles, start: Array) -> Array:
    """Least squares that leaves the start only with data. (size,)"""
    R, z = triangles.joined()
    return start + truncated_step(R, z - R @ start)[0]


class Grouping(NamedTuple):
    """Independent unknowns, and their shares of the others."""

    independent: tuple[int, ...]  #: Places of the independent unknowns. (b,)
    dependent: tuple[int, ...]  #: Places of the others. (d,)
    carried: Array  #: β: each independent unknown's share of a dependent one. (b, d)

    def values(self, x: Array) -> Array:
        """Base parameters of a full parameter vector: x₁ + β x₂. (b,)"""
        base: Array = x[list(self.independent)] + self.carried @ x[list(self.dependent)]
        return base

    def sums(self, names: tuple[str, ...]) -> list[str]:
        """Base parameters as sums, such as "Izz1 + 0.25 m2 + Iyy2"."""
        out = []
        for k, row in zip(self.independent, self.carried, strict=True):
            text = names[k]
            for place, factor in zip(self.dependent, row, strict=True):
                if abs(factor) > 1e-9:
                    size = "" if abs(abs(factor) - 1.0) < 1e-9 else f"{abs(factor):.5g} "
                    text += f" {'-' if factor < 0 else '+'} {size}{names[place]}"
            out.append(text)
        return out


def group_parameters(layout: ParameterColumns) -> Grouping:
    """Base parameters of an arm's unknowns, by rank-revealing QR.

    The regressor of random states, seeded, is decomposed with column pivoting; R = [R₁ R₂] gives
    β = R₁⁻¹ R₂ (M. Gautier, "Numerical calculation of the base inertial parameters of robots",
    J. Robotic Systems 8(4), 1991). Friction coefficients stand for themselves.
    """
    from scipy.linalg import qr

    n, rng = layout.chain.joints, np.random.default_rng(0)
    q, dq, ddq = rng.uniform(-3.0, 3.0, (3, PROBES, n))
    A = torque_regressor(layout.chain, q, dq, ddq)
    if layout.rotor:
        A = np.concatenate([A, ddq[:, :, None] * np.eye(n)], axis=2)
    R, order = qr(A.reshape(-1, A.shape[2]), mode="r", pivoting=True)
    diagonal = np.abs(np.diag(R))
    rank = int(np.count_nonzero(diagonal > RANK_TOLERANCE * diagonal[0]))
    beta = np.asarray(np.linalg.solve(R[:rank, :rank], R[:rank, rank:]), dtype=np.float64)
    beta[np.abs(beta) < 1e-9] = 0.0  # rounding would enter the names
    first, friction = np.argsort(order[:rank]), range(layout.rotor_places.stop, layout.size)
    independent = (*order[:rank][first].tolist(), *friction)
    carried = np.vstack([beta[first], np.zeros((len(friction), beta.shape[1]))])
    return Grouping(independent, tuple(order[rank:].tolist()), carried)


def base_parameters(triangles: Triangles, start: Array) -> pl.DataFrame:
    """Base parameters by weighted least squares, as rows of `BASE`.

    Directions without data keep the start; a parameter mostly in them has infinite deviation.
    """
    layout = triangles.layout
    grouping = group_parameters(layout)
    R, z = triangles.joined()
    R = R[:, list(grouping.independent)]
    before = grouping.values(start)
    step, spread, lost = truncated_step(R, z - R @ before)
    values = before + step
    sd = np.where(lost > DOUBTFUL, np.inf, spread * np.sqrt(triangles.correlation))
    determined = sd <= DOUBTFUL * np.maximum(np.abs(values), np.abs(before))
    return pl.DataFrame([grouping.sums(layout.names), values, sd, determined], schema=BASE)
