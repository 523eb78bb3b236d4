"""Generalised momentum observer, GMO (30)–(35)."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from vftcli.observers.first_order import (
    FirstOrderState,
    first_order_response,
    first_order_tuning,
    run_first_order,
)
from vftcli.observers.observer import Complex, Tuning, check_terms, numbers_of, per_joint
from vftcli.observers.recursion import recursion
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array, handed_over
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, Where, warning
from vftcli.signals.shown import Shown
from vftcli.signals.steady_filter import steady_filter


@dataclass(frozen=True, kw_only=True, repr=False)
class MomentumObserver(Shown):
    r"""First-order residual of the momentum balance, :math:`\dot r = K(\dot p - \mu - r)`.

    Discretised by the implicit trapezoidal rule with a = K·Ts/2, stable for every gain:

        rᵗ = [(1−a)rᵗ⁻¹ + K(pᵗ − pᵗ⁻¹) − a(μᵗ + μᵗ⁻¹)]/(1+a) = [(1−a)rᵗ⁻¹ + K dᵗ]/(1+a),  r⁰ = 0

    (35) as printed feeds back r^{i−1} + r^{i−2}, which oscillates above K·Ts = 0.343 and is
    unstable from 2 on; that form runs with `as_printed`.

    Raises:
        ParameterError: If a gain is not positive.
    """

    name: ClassVar[str] = "gmo"
    gain: Array | float = 10.0  #: Bandwidth K, one number or one a joint. (n,) [1/s]
    as_printed: bool = False  #: Feed back one sample late, as (35) is printed.

    def __post_init__(self) -> None:
        gain = numbers_of(self.gain, "gain", self.name)
        object.__setattr__(self, "gain", gain)
        if not (np.all(np.isfinite(gain)) and np.all(gain > 0)):
            raise ParameterError(f"gmo.gain is {gain.tolist()} 1/s; every gain must be positive")

    def estimate(self, terms: DynamicsTerms) -> ExternalTorque:
        """Run over a whole log from r = 0 at its first sample.

        Past a gap with a > 1 the filter starts afresh, and the estimate's remarks say so.
        """
        return self.run(terms)[0]

    def run(
        self, terms: DynamicsTerms, state: FirstOrderState | None = None
    ) -> tuple[ExternalTorque, FirstOrderState]:
        """Run over a block of a log from where the block before ended; None where it begins."""
        check_terms(terms)
        gain = per_joint(self.gain, terms.joints)
        remarks: tuple[Remark, ...] = ()
        if self.as_printed:
            tau, state = run_as_printed(terms, gain, state)
            unstable = np.flatnonzero(0.5 * terms.clock.step * gain >= 1.0)
            if len(unstable):
                joints = tuple(int(j) + 1 for j in unstable)
                remarks = (warning("unstable-as-printed", Where(joints=joints)),)
        else:
            tau, state = run_first_order(terms, gain, state)
            remarks = state.remarks
        estimate = ExternalTorque(name=self.name, t=terms.t, tau=handed_over(tau), remarks=remarks)
        return estimate, state

    def tuning(self, step: float, joints: int) -> Tuning:
        """What K means at a sample time. [s]"""
        return first_order_tuning(per_joint(self.gain, joints), step, parameter_count=joints)

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Complex gain at `frequency` [Hz]. (F, n)"""
        return first_order_response(per_joint(self.gain, joints), frequency, step)


def run_as_printed(
    terms: DynamicsTerms, gain: Array, state: FirstOrderState | None
) -> tuple[Array, FirstOrderState]:
    """rᵗ = rᵗ⁻¹ + K dᵗ − a(rᵗ⁻¹ + rᵗ⁻²), r⁻¹ = r⁰ = 0: two states a joint. (T, n)"""
    n, a = terms.joints, 0.5 * terms.dt * gain
    start = np.zeros((2, n)) if state is None else state.states
    F, g = np.array([[1.0 - a, -a], [a**0, 0.0 * a]]), np.array([gain, 0.0 * gain])
    # As printed it may well diverge: that is the result, and is shown as unknown.
    with np.errstate(over="ignore", invalid="ignore"):
        if terms.clock.uniform:
            first = np.array([[1.0], [0.0]])
            tau, end = steady_filter(F[:, :, 0], g, terms.d, start, wanted=first)
        else:
            states = recursion(F, g[:, None] * terms.d, start)
            tau, end = states[0], states[:, -1]
    return np.where(np.isfinite(tau), tau, np.nan), FirstOrderState(end)
