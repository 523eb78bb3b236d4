r"""Physical links nearest to least squares: a barrier bounds each body.

A link's ten parameters belong to some mass distribution exactly if its pseudo-inertia

.. math:: P = \begin{bmatrix} \tfrac12 \mathrm{tr}(I)\,1 - I & h \\ h^T & m \end{bmatrix}

is positive definite (P. Wensing, S. Kim, J.-J. Slotine, IEEE RA-L 3(1), 2018). The distance to the
profile is the log-determinant divergence tr(P₀⁻¹P) − ln det(P₀⁻¹P) − 4 (T. Lee, P. Wensing,
F. Park, IEEE T-RO 36(1), 2020): it has no units, does not depend on the frame, is convex in the
parameters, and grows without bound towards the edge, so that Newton's method never leaves the
physical models and finds the one optimum.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vftcli.identification.links import ParameterColumns, Triangles
from vftcli.robots.regressor import LINK, TENSOR
from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError

#: Weights of the distance to the profile, from hardly any pull to the profile itself.
WEIGHTS = (1e-2, 1e-1, 1.0, 1e1, 1e2, 1e3, 1e4)
MARGIN = 1.01  #: Factor of the least misfit within which a pull counts as good.
#: Pull of a maker's table with masses of 5 % standard deviation: the distance of
#: P = (1 + δ) P₀ is 2 δ² for small δ.
TABLE = 100.0
STEPS = 100  #: Newton steps at most; a dozen or two are usual.
#: Decrement at which Newton's method stops: the cost is a log-likelihood, where 1 is one standard
#: deviation of one parameter, so that the rest to go is nothing.
SETTLED = 1e-3
#: A profile's link is made at least this thick, so that a distance to it exists. [m]
SMALLEST_RADIUS = 1e-3


def basis() -> Array:
    """∂P/∂φ_k of the pseudo-inertia P by each of a link's ten parameters. (10, 4, 4)"""
    out = np.zeros((LINK, 4, 4))
    out[0, 3, 3] = 1.0
    for k in range(3):
        out[1 + k, k, 3] = out[1 + k, 3, k] = 1.0
    for k, (r, c) in enumerate(TENSOR, start=4):
        if r == c:
            out[k, :3, :3] = 0.5 * np.eye(3)
        out[k, r, c] -= 1.0
        if r != c:
            out[k, c, r] -= 1.0
    return out


BASIS = basis()


def pseudo_inertias(phi: Array) -> Array:
    """Pseudo-inertia P of each link from all inertial parameters (10n,). (n, 4, 4)"""
    P: Array = np.einsum("jk,krc->jrc", phi.reshape(-1, LINK), BASIS)
    return P


def is_physical(phi: Array) -> bool:
    """Whether every link's pseudo-inertia is positive definite."""
    try:
        np.linalg.cholesky(pseudo_inertias(phi))
    except np.linalg.LinAlgError:
        return False
    return True


def thicken_links(phi: Array) -> Array:
    """The nearest parameters with some mass and some thickness in every link. (10n,)

    Rounded tables and point masses touch the edge of what is physical.
    """
    out = phi.reshape(-1, LINK).copy()
    for row in out:
        row[0] = max(row[0], 1e-3)
        com = row[1:4] / row[0]
        P = pseudo_inertias(row)[0]
        about = P[:3, :3] - row[0] * np.outer(com, com)
        values, vectors = np.linalg.eigh(about)
        values = np.maximum(values, row[0] * SMALLEST_RADIUS**2)
        second = (vectors * values) @ vectors.T + row[0] * np.outer(com, com)
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
            return float("inf")
        P, P0 = pseudo_inertias(x[:n]), pseudo_inertias(self.start[:n])
        ratio = np.linalg.solve(P0, P)
        distance = float(np.sum(np.trace(ratio, axis1=1, axis2=2)) - 4 * len(P))
        distance -= float(np.sum(np.linalg.slogdet(ratio)[1]))
        distance += float(np.sum(J / J0 - np.log(J / J0) - 1.0))
        misfit = self.R @ x - self.z
        return 0.5 * float(misfit @ misfit) + self.weight * distance

    def step(self, x: Array) -> tuple[Array, float]:
        """Newton's step and the square of its decrement."""
        n, places = self.layout.inertial, self.layout.rotor_places
        gradient = self.R.T @ (self.R @ x - self.z)
        hessian = self.R.T @ self.R
        inverse = np.linalg.inv(pseudo_inertias(x[:n]))
        before = np.linalg.inv(pseudo_inertias(self.start[:n]))
        for j, (now, then) in enumerate(zip(inverse, before, strict=True)):
            place = slice(LINK * j, LINK * (j + 1))
            gradient[place] += self.weight * np.einsum("rc,kcr->k", then - now, BASIS)
            turned = now @ BASIS
            hessian[place, place] += self.weight * np.einsum("krc,lcr->kl", turned, turned)
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


def starting_point(layout: ParameterColumns, x: Array) -> Array:
    """Physical parameters near x to measure the distance from. (size,)"""
    start = x.copy()
    start[: layout.inertial] = thicken_links(x[: layout.inertial])
    start[layout.rotor_places] = np.maximum(x[layout.rotor_places], 1e-3)
    return start


def pulled_links(
    triangles: Triangles, profile: Array, leave_out: int | None = None
) -> Iterator[tuple[float, Array]]:
    """Weights and their physical parameters (size,), strongest pull first."""
    start = x = starting_point(triangles.layout, profile)
    R, z = triangles.joined(leave_out)
    # Correlated rows repeat each other; dividing them makes the misfit a log-likelihood
    # that can be weighed against the distance.
    shrink = 1.0 / np.sqrt(triangles.correlation)
    for weight in WEIGHTS[::-1]:
        # Each optimum is a good start for the next, weaker pull.
        x = solve(Problem(R * shrink, z * shrink, start, triangles.layout, weight), x)
        yield weight, x


def nearest_physical_links(
    triangles: Triangles, profile: Array, weight: float = WEIGHTS[0]
) -> Array:
    """Physical parameters pulled to the profile by one of `WEIGHTS`. (size,)"""
    return next(x for pull, x in pulled_links(triangles, profile) if pull <= weight)


def predicts_best_unpulled(triangles: Triangles, profile: Array) -> bool:
    """Whether all pulls but the weakest predict left-out stretches worse."""
    misfits = dict.fromkeys(WEIGHTS, 0.0)
    for part in range(len(triangles.parts)):
        for weight, x in pulled_links(triangles, profile, leave_out=part):
            misfits[weight] += triangles.misfit(part, x)
    near = MARGIN**2 * min(misfits.values())  # of squares
    return all(misfits[weight] > near for weight in WEIGHTS[1:])
