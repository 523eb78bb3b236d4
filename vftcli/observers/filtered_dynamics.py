"""Filtered dynamics observer, FDO (19)–(29): the equation of motion behind one low-pass filter."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vftcli.observers.first_order import (
    Piece,
    first_order_response,
    first_order_tuning,
    run_first_order,
)
from vftcli.observers.observer import Complex, Tuning, check_terms
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array, handed_over, number_array
from vftcli.signals.errors import ParameterError, ShapeError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.shown import Shown


@dataclass(frozen=True, kw_only=True, repr=False)
class FilteredDynamicsObserver(Shown):
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
        if np.size(number_array(self.omega, "omega", self.name)) != 1:
            raise ShapeError(f"fdo.omega is {self.omega!r}; expected one number for all joints")
        if not (np.isfinite(self.omega) and self.omega > 0):
            raise ParameterError(f"fdo.omega is {self.omega:g} rad/s; it must be positive")

    def estimate(self, terms: DynamicsTerms) -> ExternalTorque:
        """Run over a whole log from rest at its first sample.

        Past a gap with a > 1 the filter starts afresh, and the estimate's remarks say so.
        """
        check_terms(terms)
        rate = np.full(terms.joints, self.omega)
        tau, remarks = run_first_order(terms, rate, self._coefficients, self._start)
        tau += self.omega * terms.p
        return ExternalTorque(name=self.name, t=terms.t, tau=handed_over(tau), remarks=remarks)

    def _coefficients(self, piece: Piece) -> tuple[Array, Array]:
        """(29): Y₁ and Y₂ obey the same recursion, so it is their sum that is run."""
        a, p, mu = piece.a, piece.p, piece.mu
        k1, k2 = (1.0 - a) / (1.0 + a), a / (1.0 + a)
        k3 = -self.omega * a / (1.0 + (2.0 if self.as_printed else 1.0) * a)
        x = p[1:] + p[:-1]
        x *= k3
        both = mu[1:] + mu[:-1]
        both *= k2
        x -= both
        return k1, x

    def _start(self, p: Array) -> Array:
        """Y₁ + Y₂ = −ωp, so that τ̂ = 0; zero as printed."""
        return np.zeros_like(p) if self.as_printed else -self.omega * p

    def tuning(self, step: float, joints: int) -> Tuning:
        """What ω means at a sample time. [s]"""
        return first_order_tuning(np.full(joints, self.omega), step, parameter_count=1)

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Complex gain at `frequency` [Hz]: that of a momentum observer with K = ω. (F, n)"""
        return first_order_response(np.full(joints, self.omega), frequency, step)
