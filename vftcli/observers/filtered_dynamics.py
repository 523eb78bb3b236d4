"""Filtered dynamics observer, FDO (19)–(29): the equation of motion behind one low-pass filter."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vftcli.arrays import Array, handed_over
from vftcli.dynamics.terms import DynamicsTerms
from vftcli.errors import ParameterError
from vftcli.observers.first_order import (
    first_order_response,
    first_order_tuning,
    half_steps,
    restarts,
)
from vftcli.observers.observer import Complex, Tuning
from vftcli.observers.recursion import recursion, steps_of
from vftcli.observers.steady_filter import steady_filter
from vftcli.torque import ExternalTorque


@dataclass(frozen=True, kw_only=True)
class FilteredDynamicsObserver:
    r"""Low-pass filtered :math:`\dot p - \mu`, written so that nothing is differentiated.

    τ̂ = F₁{−μ} + F₂{p} + ωp with F₁ = ω/(s+ω) and F₂ = −ω²/(s+ω), discretised by the bilinear
    transform with a = ωTs/2 (27)–(29):

        Y₁ᵗ = k₁Y₁ᵗ⁻¹ − k₂(μᵗ + μᵗ⁻¹),  Y₂ᵗ = k₁Y₂ᵗ⁻¹ + k₃(pᵗ + pᵗ⁻¹),  τ̂ = Y₁ + Y₂ + ωp

    k₁ = (1−a)/(1+a), k₂ = a/(1+a), k₃ = −ωa/(1+a), from Y₁⁰ = 0 and Y₂⁰ = −ωp⁰, so that τ̂⁰ = 0.

    Two errata of the paper are corrected by default: the printed k₃ has 1 + 2a in its denominator,
    which leaks a share of the momentum into the estimate, and the printed filter starts from
    Y₂⁰ = 0, which forgets −ωe^{−ωt}p₀ of (26).

    Attributes:
        omega: Cutoff ω, the same for all joints. [rad/s]
        as_printed: Use the printed k₃ and start.

    Raises:
        ParameterError: If the cutoff is not positive.
    """

    name: ClassVar[str] = "fdo"
    omega: float = 10.0
    as_printed: bool = False

    def __post_init__(self) -> None:
        if not (np.isfinite(self.omega) and self.omega > 0):
            raise ParameterError(f"fdo.omega is {self.omega:g} rad/s; it must be positive")

    def estimate(self, terms: DynamicsTerms) -> ExternalTorque:
        """Run over a whole log from rest at its first sample.

        Past a gap with a > 1 the filter starts afresh, and the estimate's notes say so.
        """
        n, steps = terms.joints, steps_of(terms.t)
        rate = np.full(n, self.omega)
        a = half_steps(rate, steps)
        k1, k2 = (1.0 - a) / (1.0 + a), a / (1.0 + a)
        k3 = -self.omega * a / (1.0 + (2.0 if self.as_printed else 1.0) * a)
        # Y₁ and Y₂ obey the same recursion, so their sum is run, as (29) writes it.
        p, mu = terms.p, terms.mu
        x = np.empty_like(p)
        x[0] = 0.0 if self.as_printed else -self.omega * p[0]
        np.add(p[1:], p[:-1], out=x[1:])
        x[1:] *= tail(k3)
        both = mu[1:] + mu[:-1]
        both *= tail(k2)
        x[1:] -= both
        fresh, notes = restarts(a, rate, steps)
        if notes:
            k1, x = np.where(fresh, 0.0, k1), np.where(fresh, -self.omega * p, x)
        tau = scalar_recursion(k1, x)
        tau += self.omega * p
        return ExternalTorque(name=self.name, t=terms.t, tau=handed_over(tau), notes=notes)

    def tuning(self, step: float, joints: int) -> Tuning:
        """What ω means at a sample time. [s]"""
        return first_order_tuning(np.full(joints, self.omega), step, numbers=1)

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Complex gain at `frequency` [Hz]: that of a momentum observer with K = ω. (F, n)"""
        return first_order_response(np.full(joints, self.omega), frequency, step)


def tail(coefficient: Array) -> Array:
    """The coefficients of samples 1…: all but the first row, or the one row there is."""
    return coefficient if len(coefficient) == 1 else coefficient[1:]


def scalar_recursion(decay: Array, x: Array) -> Array:
    """Run y_t = decay_t y_{t−1} + x_t from zero, for each joint. (T, n)"""
    n = x.shape[1]
    start = np.zeros((1, n))
    if len(decay) == 1:
        return steady_filter(decay.reshape(1, 1, n), np.ones((1, n)), x, start, wanted=0)
    return recursion(decay.reshape(-1, 1, 1, n), x[:, None, :], start)[:, 0]
