"""Filtered dynamics observer, FDO (19)–(29): the equation of motion behind one low-pass filter."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vftcli.observers.first_order import (
    FirstOrderState,
    first_order_response,
    first_order_tuning,
    run_first_order,
)
from vftcli.observers.observer import Complex, Tuning, check_terms
from vftcli.robots.terms import DynamicsTerms, one_sample_earlier
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
    Y₁ and Y₂ obey one recursion; with k₃ + ω = ω/(1+a) and k₃ − k₁ω = −ω/(1+a) they are together

        τ̂ᵗ = k₁τ̂ᵗ⁻¹ + ω/(1+a) dᵗ,  dᵗ = pᵗ − pᵗ⁻¹ − ½Ts(μᵗ + μᵗ⁻¹)

    which is what runs: the momentum observer with K = ω, for every sample time.

    Two errata of the paper are corrected by default: the printed k₃ has 1 + 2a in its denominator,
    which adds a²/(1+2a)·(pᵗ + pᵗ⁻¹) to dᵗ, a share of the momentum that leaks into the estimate;
    and the printed filter starts from Y₂⁰ = 0, τ̂⁰ = ωp⁰, which forgets −ωe^{−ωt}p₀ of (26).

    Raises:
        ParameterError: If the cutoff is not positive.
    """

    name: ClassVar[str] = "fdo"
    omega: float = 10.0  #: Cutoff ω, the same for all joints. [rad/s]
    as_printed: bool = False  #: Use the printed k₃ and start.

    def __post_init__(self) -> None:
        if np.size(number_array(self.omega, "omega", self.name)) != 1:
            raise ShapeError(f"fdo.omega is {self.omega!r}; expected one number for all joints")
        if not (np.isfinite(self.omega) and self.omega > 0):
            raise ParameterError(f"fdo.omega is {self.omega:g} rad/s; it must be positive")

    def estimate(self, terms: DynamicsTerms) -> ExternalTorque:
        """Run over a whole log from rest at its first sample.

        Past a gap with a > 1 the filter starts afresh, and the estimate's remarks say so.
        """
        return self.run(terms)[0]

    def run(
        self, terms: DynamicsTerms, state: FirstOrderState | None = None
    ) -> tuple[ExternalTorque, FirstOrderState]:
        """Run over a block of a log from where the block before ended; None where it begins."""
        check_terms(terms)
        rate = np.full(terms.joints, self.omega)
        driven = afresh = None
        if self.as_printed:
            a, afresh = 0.5 * self.omega * terms.dt, self.omega * terms.p
            driven = terms.d + a**2 / (1.0 + 2.0 * a) * (terms.p + one_sample_earlier(terms, "p"))
            if state is None:
                driven[0] = (1.0 + a[0]) * terms.p[0]  # which alone makes τ̂⁰ = ωp⁰
        tau, state = run_first_order(terms, rate, state, driven, afresh)
        estimate = ExternalTorque(
            name=self.name, t=terms.t, tau=handed_over(tau), remarks=state.remarks
        )
        return estimate, state

    def tuning(self, step: float, joints: int) -> Tuning:
        """What ω means at a sample time. [s]"""
        return first_order_tuning(np.full(joints, self.omega), step, parameter_count=1)

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Complex gain at `frequency` [Hz]: that of a momentum observer with K = ω. (F, n)"""
        return first_order_response(np.full(joints, self.omega), frequency, step)
