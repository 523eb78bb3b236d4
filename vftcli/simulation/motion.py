"""Commanded joint motions with exact first and second derivatives."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple, TypeVar

import numpy as np

from vftcli.signals.arrays import Array

Number = TypeVar("Number", float, Array)


class Reference(NamedTuple):
    """Commanded positions, velocities and accelerations. (T, n) each [rad, rad/s, rad/s²]"""

    q: Array
    dq: Array
    ddq: Array


@dataclass(frozen=True)
class Periodic:
    """Joint positions as a Fourier series in the phase 2πt/period."""

    period: float  #: Time of one round. [s]
    cycles: float  #: Rounds.
    mean: Array  #: Mean positions. (n,) [rad]
    cosine: Array  #: Cosine coefficients. (H, n) [rad]
    sine: Array  #: Sine coefficients. (H, n) [rad]

    @property
    def duration(self) -> float:
        """Time of all rounds. [s]"""
        return self.period * self.cycles

    def at(self, t: Array) -> Reference:
        """The series and its two derivatives at times `t` (T,) [s]."""
        order = 2.0 * np.pi / self.period * np.arange(1, len(self.sine) + 1)
        c, s = np.cos(np.outer(t, order)), np.sin(np.outer(t, order))
        a, b, w = self.cosine, self.sine, order[:, None]
        return Reference(
            self.mean + c @ a + s @ b,
            c @ (w * b) - s @ (w * a),
            -(c @ (w**2 * a)) - s @ (w**2 * b),
        )


@dataclass(frozen=True)
class Stretches:
    """Rest-to-rest stretches, each a path q(s) with minimum jerk, with rests between them."""

    times: Array  #: Start and end of each stretch, in order. (K, 2) [s]
    #: Chebyshev coefficients of q over s in [−1, 1], one a stretch. (D, n) [rad]
    paths: tuple[Array, ...]
    duration: float  #: Length with the rest at the end. [s]

    def at(self, t: Array) -> Reference:
        """Where the stretches lead at times `t` (T,) [s]; between them the motion rests."""
        from numpy.polynomial import chebyshev

        t = np.asarray(t, dtype=float)
        which = np.clip(np.searchsorted(self.times[:, 0], t, side="right") - 1, 0, None)
        n = self.paths[0].shape[1]
        out = Reference(*(np.zeros((len(t), n)) for _ in range(3)))
        for k, path in enumerate(self.paths):
            rows = np.flatnonzero(which == k)
            length = float(self.times[k, 1] - self.times[k, 0])
            u = np.clip((t[rows] - self.times[k, 0]) / length, 0.0, 1.0)
            s = minimum_jerk(u)
            ds = 30.0 * u**2 * (1.0 - u) ** 2 / length
            dds = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / length**2
            first, second = chebyshev.chebder(path), chebyshev.chebder(path, 2)
            x = 2.0 * s - 1.0
            slope = 2.0 * chebyshev.chebval(x, first).T
            curve = 4.0 * chebyshev.chebval(x, second).T
            out.q[rows] = chebyshev.chebval(x, path).T
            out.dq[rows] = slope * ds[:, None]
            out.ddq[rows] = slope * dds[:, None] + curve * (ds**2)[:, None]
        return out


#: A commanded motion of known length: what every ``[trajectory]`` becomes.
Command = Periodic | Stretches


def straight_paths(points: Sequence[Array]) -> tuple[Array, ...]:
    """Paths of `Stretches` that lead from each of the points (n,) [rad] to the next."""
    return tuple(np.vstack([0.5 * (a + b), 0.5 * (b - a)]) for a, b in pairwise(points))


def minimum_jerk(u: Number) -> Number:
    """The way 10u³ − 15u⁴ + 6u⁵ from 0 to 1 over u in [0, 1]."""
    return u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
