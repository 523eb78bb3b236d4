"""Base parameters: the combinations of inertial parameters that any motion can tell at all."""

from typing import NamedTuple

import numpy as np

from vftcli.identification.stacking import ParameterColumns, Triangles, truncated_step
from vftcli.robots.chain import Chain
from vftcli.robots.regressor import torque_regressor
from vftcli.signals.arrays import Array

PROBES = 400  #: Random states at which the structure is found.
#: Diagonal entries of R below this share of the largest are zero: rounding is at 1e-15.
RANK_TOLERANCE = 1e-8
#: A parameter whose standard deviation is more than this share of its size is not determined.
DOUBTFUL = 0.3


class Grouping(NamedTuple):
    """Which unknowns stand for themselves, and what each carries along."""

    independent: tuple[int, ...]  #: Places of the independent unknowns. (b,)
    dependent: tuple[int, ...]  #: Places of the others. (d,)
    carried: Array  #: β: how much of each dependent unknown an independent one carries. (b, d)

    def values(self, x: Array) -> Array:
        """Base parameters of a full parameter vector: x₁ + β x₂. (b,)"""
        base: Array = x[list(self.independent)] + self.carried @ x[list(self.dependent)]
        return base

    def sums(self, names: tuple[str, ...]) -> list[str]:
        """Each base parameter written out as a sum, as "Izz1 + 0.25 m2 + Iyy2"."""
        out = []
        for k, row in zip(self.independent, self.carried, strict=True):
            text = names[k]
            for place, factor in zip(self.dependent, row, strict=True):
                if abs(factor) > 1e-9:
                    size = "" if abs(abs(factor) - 1.0) < 1e-9 else f"{abs(factor):.5g} "
                    text += f" {'-' if factor < 0 else '+'} {size}{names[place]}"
            out.append(text)
        return out


def group_parameters(chain: Chain, rotor: bool) -> Grouping:
    """Group an arm's inertial parameters and rotor inertias by rank-revealing QR.

    The regressor of random states, seeded, is decomposed with column pivoting; R = [R₁ R₂] gives
    β = R₁⁻¹ R₂ (M. Gautier, "Numerical calculation of the base inertial parameters of robots",
    J. Robotic Systems 8(4), 1991).
    """
    from scipy.linalg import qr

    n, rng = chain.joints, np.random.default_rng(0)
    q, dq, ddq = rng.uniform(-3.0, 3.0, (3, PROBES, n))
    A = torque_regressor(chain, q, dq, ddq)
    if rotor:
        A = np.concatenate([A, ddq[:, :, None] * np.eye(n)], axis=2)
    flat = A.reshape(-1, A.shape[2])
    R, order = qr(flat, mode="r", pivoting=True)
    diagonal = np.abs(np.diag(R))
    rank = int(np.count_nonzero(diagonal > RANK_TOLERANCE * diagonal[0]))
    beta = np.asarray(np.linalg.solve(R[:rank, :rank], R[:rank, rank:]), dtype=np.float64)
    beta[np.abs(beta) < 1e-9] = 0.0  # rounding, which would otherwise enter the names
    first = np.argsort(order[:rank])
    return Grouping(tuple(order[:rank][first].tolist()), tuple(order[rank:].tolist()), beta[first])


def with_friction(grouping: Grouping, layout: ParameterColumns) -> Grouping:
    """The grouping of all unknowns: friction coefficients stand for themselves."""
    own = tuple(range(layout.inertial + layout.rotors, layout.size))
    carried = np.vstack([grouping.carried, np.zeros((len(own), grouping.carried.shape[1]))])
    return Grouping((*grouping.independent, *own), grouping.dependent, carried)


class BaseParameters(NamedTuple):
    """Estimated base parameters."""

    names: tuple[str, ...]  #: What each is the sum of.
    values: Array  #: Estimates. (b,)
    sd: Array  #: Standard deviations; infinite where the data says nothing. (b,)
    determined: tuple[bool, ...]  #: Whether the data determines it, by `DOUBTFUL`. (b,)

    def rows(self) -> list[tuple[str, float, float, bool]]:
        """Name, estimate, standard deviation and whether it is determined, one row each."""
        columns = (self.names, self.values.tolist(), self.sd.tolist(), self.determined)
        return list(zip(*columns, strict=True))


def base_parameters(triangles: Triangles, start: Array) -> BaseParameters:
    """Weighted least squares of the base parameters; directions without data keep the start.

    Args:
        triangles: The stacked equations.
        start: The profile's parameters. (size,)
    """
    layout = triangles.layout
    grouping = with_friction(group_parameters(layout.chain, layout.rotor), layout)
    R, z = triangles.joined()
    R = R[:, list(grouping.independent)]
    before = grouping.values(start)
    step, spread, lost = truncated_step(R, z - R @ before)
    values = before + step
    # A parameter that lies mostly in directions without data has no spread to speak of.
    sd = np.where(lost > DOUBTFUL, np.inf, spread * np.sqrt(triangles.correlation))
    size = np.maximum(np.abs(values), np.abs(before))
    return BaseParameters(
        names=tuple(grouping.sums(layout.names)),
        values=values,
        sd=sd,
        determined=tuple((sd <= DOUBTFUL * size).tolist()),
    )
