"""An observer's input and output: dynamics terms, external torque."""

from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import (
    Z_95,
    Array,
    Clock,
    Mask,
    check_clock,
    check_shape,
    clock_of,
    empty_series,
    handed_over,
    root_mean_square,
    seal,
)
from vftcli.signals.remarks import Remark
from vftcli.signals.shown import ALL, Shown, TimeSeries, joined, per_joint, record


class Instant(NamedTuple):
    """The terms of a sample, from which the next block goes on."""

    t: float  #: Time. [s]
    p: Array  #: Generalised momentum. (n,) [kg·m²/s]
    mu: Array  #: μ. (n,) [N·m]


@record
class DynamicsTerms(Shown):
    r"""Momentum form of the dynamics: :math:`\dot p = \mu + \tau_{ext}` (33)."""

    t: Array  #: Time. (T,) [s]
    p: Array  #: Generalised momentum M q̇. (T, n) [kg·m²/s]
    #: μ = τ + Cᵀq̇ − g − F_f, the torque that changes p without contact. (T, n) [N·m]
    mu: Array
    log_clock: Clock | None = None  #: The whole log's clock, of a block.
    before: Instant | None = None  #: The sample before a later block.

    def __post_init__(self) -> None:
        seal(self, "t", "p", "mu")
        check_shape(self.p, ("T", "n"), "p", called := "the dynamics terms")
        check_clock(self.t, called)
        seal(self, "p", "mu", shape=(self.samples, self.joints), called=called)

    @cached_property
    def d(self) -> Array:
        """Change of momentum unexplained by the model, every observer's one input.

        dᵗ = pᵗ − pᵗ⁻¹ − ½Tsᵗ(μᵗ + μᵗ⁻¹), zero at a log's first sample. (T, n) [N·m·s]
        """
        change = empty_series(*self.p.shape)
        half, before, explained = 0.5 * self.dt[:, 0], self.before, np.zeros(self.samples)
        # Joint by joint, so that the passes stay in the cache.
        for p, mu, d in zip(self.p.T, self.mu.T, change.T, strict=True):
            np.subtract(p[1:], p[:-1], out=d[1:])
            np.add(mu[1:], mu[:-1], out=explained[1:])
            explained *= half
            d[1:] -= explained[1:]
        change[:1] = 0.0
        if before is not None:
            change[0] = self.p[0] - before.p - half[0] * (self.mu[0] + before.mu)
        return handed_over(change)

    @cached_property
    def clock(self) -> Clock:
        """Sampling of the log behind these terms."""
        return clock_of(self.t) if self.log_clock is None else self.log_clock

    @cached_property
    def dt(self) -> Array:
        """Time since the sample before, nominal at first: (T, 1), (1, 1) if uniform [s]"""
        if self.clock.uniform:
            return np.array([[self.clock.step]])
        first = self.t[0] - self.clock.step if self.before is None else self.before.t
        return np.diff(self.t, prepend=first)[:, None]

    @property
    def last(self) -> Instant:
        """The sample before the next block's first."""
        return Instant(self.t[-1], self.p[-1], self.mu[-1])

    @cached_property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.p.shape[1])

    @cached_property
    def samples(self) -> int:
        """Number of samples T."""
        return len(self.t)


def one_sample_earlier(terms: DynamicsTerms, name: str) -> Array:
    """Series "p" or "mu" a sample earlier; the first is its own. (T, n)"""
    series = getattr(terms, name)
    first = series[:1] if terms.before is None else getattr(terms.before, name)[None]
    return np.concatenate([first, series[:-1]])


@record
class ExternalTorque(TimeSeries):
    """Torque the environment exerts on the robot, positive along each joint axis."""

    name: str  #: Name of the observer or the reference, as in tables.
    t: Array  #: Time on the recording's clock. (T,) [s]
    tau: Array  #: External torque; NaN where it is not known. (T, n) [N·m]
    #: One SD of `tau` by the estimator's own account. (T, n) [N·m]
    sd: Array | None = None
    #: RMS error that the estimate is known to have. (n,) [N·m]
    floor: Array | None = None
    #: One SD, model error and lag included; None if no part is free. (T, n) [N·m]
    error_sd: Array | None = None
    #: Whether the joint moves: at rest stiction hides torque. (T, n)
    moving: Mask | None = None
    remarks: tuple[Remark, ...] = ()  #: What a reader should know.

    def __post_init__(self) -> None:
        seal(self, "t", "tau")
        check_shape(self.tau, ("T", "n"), "tau", self.name)
        check_clock(self.t, self.name)
        shape = len(self.t), self.joints
        seal(self, "tau", "sd", shape=shape, called=self.name)
        seal(self, "error_sd", shape=shape, called=self.name, kind=np.float32)
        seal(self, "floor", shape=shape[1:], called=self.name)
        seal(self, "moving", shape=shape, called=self.name, kind=bool)

    def _headline(self) -> str:
        rms = np.sqrt(np.nanmean(np.where(self.known.any(axis=0), self.tau, 0.0) ** 2, axis=0))
        return f"of {self.name}: rms {joined(rms)} N·m over {len(self.t)} samples"

    def _rows(self) -> Iterator[Sequence[object]]:
        yield "joint", "rms [N·m]", "largest [N·m]", "95 % band [N·m]", "known"
        for j, known in enumerate(self.known.T):
            tau = self.tau[known, j]
            sd = None if self.error_sd is None else self.error_sd[known, j]
            sizes: tuple[float | None, float | None] = (None, None)
            if len(tau):
                sizes = root_mean_square(tau), abs(tau).max()
            band = None if sd is None or not len(sd) else Z_95 * root_mean_square(sd)
            yield f"J{j + 1}", *sizes, band, f"{known.mean():.0%}"

    def columns(self, rows: slice = ALL) -> Iterator[tuple[str, Array]]:
        """Name and values of every joint, as ``tau_ext/gmo/1``, and of its deviations."""
        each = {"tau_ext": self.tau, "sd": self.sd, "band": self.error_sd}
        for kind, values in each.items():
            if values is not None:
                yield from per_joint(f"{kind}/{self.name}", values[rows])

    @cached_property
    def joints(self) -> int:
        """Number of joints n."""
        return int(self.tau.shape[1])

    @property
    def known(self) -> Mask:
        """Whether a joint's torque is known, sample by sample. (T, n)"""
        return np.isfinite(self.tau)
