r"""The links' parameters by least squares, and the nearest physical links.

Of the stacked equations only the R factor is kept, chunk by chunk. Motion shows only base
parameters, combinations of the inertial.

A link's ten parameters belong to some mass distribution exactly if its pseudo-inertia

.. math:: P = \begin{bmatrix} \tfrac12 \mathrm{tr}(I)\,1 - I & h \\ h^T & m \end{bmatrix}

is positive definite (P. Wensing, S. Kim, J.-J. Slotine, IEEE RA-L 3(1), 2018). The
distance to the profile is the log-determinant divergence tr(P₀⁻¹P) − ln det(P₀⁻¹P) − 4
(T. Lee, P. Wensing, F. Park, IEEE T-RO 36(1), 2020): it has no units, does not depend on
the frame, is convex, and grows without bound towards the edge, so that Newton's method
stays in the physical models and finds the one optimum.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.identification.training import ParameterColumns, PreparedLog
from vftcli.robots.kernels import LINK, TENSOR, torque_regressor
from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError
from vftcli.signals.estimation import FOLDS, correlation_time, folds, huber, robust_sd

#: One row a base parameter, or a friction coefficient beside them.
BASE = pl.Schema({"parameter": str, "value": float, "sd": float, "determined": bool})
ROWS = 512  #: Samples stacked at once.
REWEIGHTINGS = 3  #: Passes of reweighting.
#: Singular values below this share of the largest stay at the start.
TRUNCATION = 1e-3
PROBES = 400  #: Random states for the structure of base parameters.
#: Entries of R's diagonal below this share of the largest are zero; rounding has 1e-15.
RANK_TOLERANCE = 1e-8
#: Least relative deviation of an undetermined parameter.
DOUBTFUL = 0.3
#: Weights of the distance to the profile, the weakest pull first.
WEIGHTS = (1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4)
MARGIN = 1.01  #: A pull is good within this factor of the best.
#: Pull of a maker's table with masses of 5 % SD: the distance of
#: P = (1 + δ) P₀ is 2 δ² for small δ.
TABLE = 100.0
STEPS = 100  #: Newton steps at most; a dozen or two are usual.
#: Decrement at which Newton's method stops: 1 is one SD of one parameter.
SETTLED = 1e-3
#: Least thickness of a profile's link, for a finite distance to it. [m]
SMALLEST_RADIUS = 1e-3


class Triangles(NamedTuple):
    """The logs' stacked, weighted equations A x ≈ y, as R factors of [A y]."""

    layout: ParameterColumns  #: The unknowns.
    parts: tuple[Array, ...]  #: R factor of each stretch. (size+1, size+1) each
    correlation: float  #: Samples that count as one: residuals correlate.

    def joined(self, leave_out: int | None = None) -> tuple[Array, Array]:
        """R (size, size), right side (size,) of all stretches but one."""
        kept = [part for k, part in enumerate(self.parts) if k != leave_out]
        whole = triangle(np.vstack(kept))
        return whole[:-1, :-1], whole[:-1, -1]

    def misfit(self, part: int, x: Array) -> float:
        """Weighted sum of squares left by x in one stretch."""
        R = self.parts[part]
        return np.sum((R[:, -1] - R[:, :-1] @ x) ** 2)


def triangle(rows: Array) -> Array:
    """R of the QR decomposition of stacked equations."""
    return np.asarray(np.linalg.qr(rows, mode="r"))


def residuals(layout: ParameterColumns, log: PreparedLog, x: Array) -> Array:
    """Drive torque of a log beyond the unknowns x (size,). (M, n) [N·m]"""
    parts = [log.tau[span] - layout.rows(log, span) @ x for span in log.chunks()]
    return np.concatenate(parts)


def stack(layout: ParameterColumns, logs: Sequence[PreparedLog], start: Array) -> Triangles:
    """Logs stacked; the last solution, at first `start`, weighs outliers."""
    rows = sum(np.count_nonzero(log.weights) for log in logs)
    if rows < 4 * layout.size:
        raise IdentificationError(
            f"{rows} equations for {layout.size} unknowns; record a longer log, "
            "or use --method friction"
        )
    x = start
    for _ in range(REWEIGHTINGS):
        triangles = triangulate(layout, logs, [residuals(layout, log, x) for log in logs])
        R, z = triangles.joined()
        # It leaves the start only where there are data.
        x = start + truncated_step(R, z - R @ start)[0]
    return triangles


def triangulate(
    layout: ParameterColumns, logs: Sequence[PreparedLog], left: Sequence[Array]
) -> Triangles:
    """QR updates over all chunks of all logs, a triangle per stretch."""
    weights = np.concatenate([log.weights for log in logs])
    pairs = zip(np.concatenate(left).T, weights.T, strict=True)
    # Joints are weighed by the robust deviation of their residual.
    sigma = np.array([max(robust_sd(r[w > 0]), 1e-9) for r, w in pairs])
    parts, correlation = [np.zeros((0, layout.size + 1))] * FOLDS, []
    for log, residual in zip(logs, left, strict=True):
        used = log.weights > 0
        scale = np.sqrt(log.weights * huber(residual / sigma)) / sigma
        each = (r[u] for r, u in zip(residual.T, used.T, strict=True))
        correlation += [correlation_time(r) for r in each if len(r) > 10]
        # Contiguous stretches: neighbours share noise.
        for k, fold in enumerate(folds(log.samples)):
            for start in range(fold.start, fold.stop, ROWS):
                span = slice(start, min(start + ROWS, fold.stop))
                A = np.concatenate([layout.rows(log, span), log.tau[span, :, None]], axis=2)
                rows = (A * scale[span, :, None]).reshape(-1, A.shape[2])
                parts[k] = triangle(np.vstack([parts[k], rows[scale[span].ravel() > 0]]))
    return Triangles(layout, tuple(parts), float(np.mean(correlation)) if correlation else 1.0)


def truncated_step(R: Array, rest: Array) -> tuple[Array, Array, Array]:
    """Least squares R x ≈ rest by truncated SVD: step, SD, share without data. (k,)"""
    scale = np.linalg.norm(R, axis=0)
    scale[scale == 0.0] = 1.0
    U, S, Vt = np.linalg.svd(R / scale, full_matrices=False)
    keep = TRUNCATION * S[0] < S
    step = Vt[keep].T @ ((U[:, keep].T @ rest) / S[keep]) / scale
    sd = np.sqrt(np.sum((Vt[keep].T / S[keep]) ** 2, axis=1)) / scale
    return step, sd, np.sum(Vt[~keep] ** 2, axis=0)


class Grouping(NamedTuple):
    """Independent unknowns, and their shares of the others."""

    independent: tuple[int, ...]  #: Places of the independent unknowns. (b,)
    dependent: tuple[int, ...]  #: Places of the others. (d,)
    carried: Array  #: β: shares of the dependent ones. (b, d)

    def values(self, x: Array) -> Array:
        """Base parameters of a full parameter vector: x₁ + β x₂. (b,)"""
        return x[list(self.independent)] + self.carried @ x[list(self.dependent)]

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

    The regressor of seeded random states is decomposed with column pivoting; R = [R₁ R₂] gives
    β = R₁⁻¹ R₂ (M. Gautier, "Numerical calculation of the base inertial parameters of robots",
    J. Robotic Systems 8(4), 1991).
    """
    from scipy.linalg import qr

    n, rng = layout.chain.joints, np.random.default_rng(0)
    q, dq, ddq = rng.uniform(-3.0, 3.0, (3, PROBES, n))
    A = torque_regressor(layout.chain, q, dq, ddq)
    if layout.rotor:
        A = np.concatenate([A, ddq[:, :, None] * np.eye(n)], axis=2)
    R, order = qr(A.reshape(-1, A.shape[2]), mode="r", pivoting=True)
    diagonal = abs(np.diag(R))
    rank = np.count_nonzero(diagonal > RANK_TOLERANCE * diagonal[0])
    beta = np.asarray(np.linalg.solve(R[:rank, :rank], R[:rank, rank:]), float)
    beta[abs(beta) < 1e-9] = 0.0  # rounding would enter the names
    first, friction = order[:rank].argsort(), range(layout.rotor_places.stop, layout.size)
    independent = (*order[:rank][first].tolist(), *friction)
    carried = np.vstack([beta[first], np.zeros((len(friction), beta.shape[1]))])
    return Grouping(independent, tuple(order[rank:].tolist()), carried)


def base_parameters(triangles: Triangles, start: Array) -> pl.DataFrame:
    """Base parameters by weighted least squares, as rows of `BASE`."""
    layout = triangles.layout
    grouping, (R, z) = group_parameters(layout), triangles.joined()
    R, before = R[:, grouping.independent], grouping.values(start)
    step, spread, lost = truncated_step(R, z - R @ before)
    values = before + step
    sd = np.where(lost > DOUBTFUL, np.inf, spread * np.sqrt(triangles.correlation))
    determined = sd <= DOUBTFUL * np.maximum(abs(values), abs(before))
    return pl.DataFrame([grouping.sums(layout.names), values, sd, determined], schema=BASE)


def pseudo_inertias(phi: Array) -> Array:
    """Pseudo-inertia P of each link by all parameters (10n,). (n, 4, 4)"""
    rows = phi.reshape(-1, LINK)
    P, tensor = np.zeros((len(rows), 4, 4)), np.zeros((len(rows), 3, 3))
    for (r, c), values in zip(TENSOR, rows[:, 4:].T, strict=True):
        tensor[:, r, c] = tensor[:, c, r] = values
    half = 0.5 * np.trace(tensor, axis1=1, axis2=2)
    P[:, :3, :3] = half[:, None, None] * np.eye(3) - tensor
    P[:, :3, 3] = P[:, 3, :3] = rows[:, 1:4]
    P[:, 3, 3] = rows[:, 0]
    return P


BASIS = pseudo_inertias(np.eye(LINK))  #: ∂P/∂φ_k of one link. (10, 4, 4)


def is_physical(phi: Array) -> bool:
    """Whether every link's pseudo-inertia is positive definite."""
    try:
        np.linalg.cholesky(pseudo_inertias(phi))
    except np.linalg.LinAlgError:
        return False
    return True


def thicken_links(phi: Array) -> Array:
    """The nearest parameters with mass and thickness in every link. (10n,)"""
    # Rounded tables and point masses touch the edge of what is physical.
    out = phi.reshape(-1, LINK).copy()
    for row in out:
        mass = row[0] = max(row[0], 1e-3)
        shift = np.outer(row[1:4], row[1:4]) / mass
        values, vectors = np.linalg.eigh(pseudo_inertias(row)[0, :3, :3] - shift)
        values = np.maximum(values, mass * SMALLEST_RADIUS**2)
        second = (vectors * values) @ vectors.T + shift
        tensor = np.trace(second) * np.eye(3) - second
        row[4:] = [tensor[r, c] for r, c in TENSOR]
    return out.ravel()


class Problem(NamedTuple):
    """½‖R x − z‖² + weight · distance(x, start), over physical x."""

    R: Array  #: Triangle of the stacked equations. (size, size)
    z: Array  #: Its right-hand side. (size,)
    start: Array  #: The profile, physical. (size,)
    layout: ParameterColumns  #: The unknowns.
    weight: float  #: Weight of the distance.

    def value(self, x: Array) -> float:
        """The cost; infinite outside the physical models."""
        n, places = self.layout.inertial, self.layout.rotor_places
        J, J0 = x[places], self.start[places]
        if not is_physical(x[:n]) or np.any(J <= 0):
            return np.inf
        P, P0 = pseudo_inertias(x[:n]), pseudo_inertias(self.start[:n])
        ratio = np.linalg.solve(P0, P)
        distance = np.trace(ratio, axis1=1, axis2=2).sum() - 4 * len(P)
        distance -= np.linalg.slogdet(ratio)[1].sum()
        distance += np.sum(J / J0 - np.log(J / J0) - 1.0)
        misfit = self.R @ x - self.z
        return float(0.5 * (misfit @ misfit) + self.weight * distance)

    def step(self, x: Array) -> tuple[Array, float]:
        """Newton's step and the square of its decrement."""
        from scipy.linalg import block_diag

        n, places = self.layout.inertial, self.layout.rotor_places
        gradient = self.R.T @ (self.R @ x - self.z)
        hessian = self.R.T @ self.R
        now, then = (np.linalg.inv(pseudo_inertias(y[:n])) for y in (x, self.start))
        turned = now[:, None] @ BASIS
        gradient[:n] += self.weight * np.einsum("jrc,kcr->jk", then - now, BASIS).ravel()
        blocks = np.einsum("jkrc,jlcr->jkl", turned, turned)
        hessian[:n, :n] += self.weight * block_diag(*blocks)
        J, J0 = x[places], self.start[places]
        gradient[places] += self.weight * (1.0 / J0 - 1.0 / J)
        hessian[places, places] += np.diag(self.weight / J**2)
        scale = np.sqrt(np.maximum(np.diag(hessian), 1e-12))
        scaled = hessian / np.outer(scale, scale) + 1e-12 * np.eye(len(x))
        step = -np.linalg.solve(scaled, gradient / scale) / scale
        return step, float(-gradient @ step)


def solve(problem: Problem, x: Array) -> Array:
    """Damped Newton from a physical x; every iterate is physical. (size,)"""
    cost = problem.value(x)
    for _ in range(STEPS):
        step, decrement = problem.step(x)
        if decrement < SETTLED:
            return x
        # Backtracking keeps every iterate physical: outside, the cost is infinite.
        length, low = 1.0, 1e-12
        while (new := problem.value(x + length * step)) > cost - 1e-4 * length * decrement:
            length *= 0.5
            if length < low:
                return x
        x, cost = x + length * step, new
    if decrement < 1.0:
        return x
    raise IdentificationError(
        "the fit of physical links did not settle; the log contradicts the profile too much. "
        "Use --method friction, or a profile closer to the arm"
    )


def pulled_links(
    triangles: Triangles, profile: Array, leave_out: int | None = None
) -> Iterator[tuple[float, Array]]:
    """Weights and their physical parameters (size,), strongest pull first."""
    layout, x = triangles.layout, profile.copy()
    x[: layout.inertial] = thicken_links(x[: layout.inertial])
    x[layout.rotor_places] = np.maximum(x[layout.rotor_places], 1e-3)
    R, z = triangles.joined(leave_out)
    # Correlated rows repeat each other: divided, the misfit is a log-likelihood.
    shrink = 1.0 / np.sqrt(triangles.correlation)
    problem = Problem(R * shrink, z * shrink, x, layout, np.inf)
    for weight in WEIGHTS[::-1]:
        # Each optimum is a good start for the next, weaker pull.
        x = solve(problem._replace(weight=weight), x)
        yield weight, x


def nearest_physical_links(
    triangles: Triangles, profile: Array, weight: float = WEIGHTS[0]
) -> Array:
    """Physical parameters pulled by one of `WEIGHTS`. (size,)"""
    return next(x for pull, x in pulled_links(triangles, profile) if pull <= weight)


def predicts_best_unpulled(triangles: Triangles, profile: Array) -> bool:
    """Whether all pulls but the weakest predict left-out stretches worse."""
    misfits = dict.fromkeys(WEIGHTS, 0.0)
    for part in range(len(triangles.parts)):
        for weight, x in pulled_links(triangles, profile, leave_out=part):
            misfits[weight] += triangles.misfit(part, x)
    near = MARGIN**2 * min(misfits.values())  # of squares
    return all(misfits[weight] > near for weight in WEIGHTS[1:])
