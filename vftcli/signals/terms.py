"""DynamicsTerms: all an observer ever sees of a robot and its log."""

from dataclasses import InitVar, dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import (
    Array,
    check_clock,
    check_shape,
    empty_series,
    handed_over,
    seal,
)
from vftcli.signals.errors import ShapeError
from vftcli.signals.series import Clock, clock_of
from vftcli.signals.shown import Shown


class Instant(NamedTuple):
    """The terms of one sample, from which those of the next block of a log go on."""

    t: float  #: Time. [s]
    p: Array  #: Generalised momentum. (n,) [kg·m²/s]
    mu: Array  #: μ. (n,) [N·m]


@dataclass(frozen=True, kw_only=True, repr=False)
class DynamicsTerms(Shown):
    r"""Momentum form of the equations of motion: :math:`\dot p = \mu + \tau_{ext}` (33)."""

    t: Array  #: Time. (T,) [s]
    p: Array  #: Generalised momentum M q̇. (T, n) [kg·m²/s]
    mu: Array  #: μ = τ + Cᵀq̇ − g − F_f, the torque that changes p without contact. (T, n) [N·m]
    #: The whole log's clock where these are a block of it; None for a whole log.
    log_clock: Clock | None = None
    #: The sample before the first, where these are a later block of a log.
    before: Instant | None = None
    room: InitVar[Array | None] = None  #: Memory for `d`, if it is there already. (T, n)
    #: dᵗ = pᵗ − pᵗ⁻¹ − ½Tsᵗ(μᵗ + μᵗ⁻¹), the change of momentum over a sample that the model leaves
    #: unexplained: the one input of every observer. Zero at a log's first sample. (T, n) [N·m·s]
    d: Array = field(init=False, repr=False, compare=False)

    def __post_init__(self, room: Array | None) -> None:
        seal(self, "t", "p", "mu")
        if self.p.ndim != 2:
            raise ShapeError(f"p has shape {self.p.shape}; expected (T, n)")
        check_clock(self.t, "the dynamics terms")
        check_shape(self.p, (len(self.t), self.p.shape[1]), "p", "the dynamics terms")
        check_shape(self.mu, self.p.shape, "mu", "the dynamics terms")
        d = momentum_change(self, empty_series(*self.p.shape) if room is None else room)
        object.__setattr__(self, "d", handed_over(d))

    @cached_property
    def clock(self) -> Clock:
        """How the log is sampled that these are the terms of."""
        return clock_of(self.t) if self.log_clock is None else self.log_clock

    @cached_property
    def dt(self) -> Array:
        """Time since the sample before: nominal at a log's first. (T, 1), (1, 1) if uniform [s]"""
        if self.clock.uniform:
            return np.array([[self.clock.step]])
        first = self.t[0] - self.clock.step if self.before is None else self.before.t
        return np.diff(self.t, prepend=first)[:, None]

    @property
    def last(self) -> Instant:
        """The last sample, which is the one before the next block's first."""
        return Instant(float(self.t[-1]), self.p[-1], self.mu[-1])

    @property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.p.shape[1])

    @property
    def samples(self) -> int:
        """Number of samples T."""
        return len(self.t)


def momentum_change(terms: DynamicsTerms, out: Array) -> Array:
    """Fill `out` with `DynamicsTerms.d`, joint by joint, so that the passes stay in the cache."""
    half, before = 0.5 * terms.dt[:, 0], terms.before
    explained = np.zeros(terms.samples)
    for p, mu, d in zip(terms.p.T, terms.mu.T, out.T, strict=True):
        np.subtract(p[1:], p[:-1], out=d[1:])
        np.add(mu[1:], mu[:-1], out=explained[1:])
        explained *= half
        d[1:] -= explained[1:]
    out[:1] = 0.0
    if before is not None:
        out[0] = terms.p[0] - before.p - half[0] * (terms.mu[0] + before.mu)
    return out


def one_sample_earlier(terms: DynamicsTerms, name: str) -> Array:
    """Series "p" or "mu" of each sample's predecessor; a log's first sample is its own. (T, n)"""
    series: Array = getattr(terms, name)
    first = series[:1] if terms.before is None else getattr(terms.before, name)[None]
    return np.concatenate([first, series[:-1]])
