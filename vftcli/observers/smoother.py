"""Rauch–Tung–Striebel smoother on the disturbance Kalman filter: `kfo-rts`.

In a complete log an estimate at t may use later samples. The smoother is the Kalman filter's
fixed-interval answer, run backwards in Bryson and Frazier's form. It needs only the innovations ν
and inverts only numbers:

    λ̃ᵗ = Aᵀ[(I − LC)ᵀ λ̃ᵗ⁺¹ − Cᵀ νᵗ⁺¹/Sᵗ⁺¹],  λ̃ = 0 at the last sample,  x̂ₛᵗ = x̂ᵗ − Pᵗ λ̃ᵗ

with P the filter's posterior and S its innovation variance. In the long run it is the two-sided
filter |H|² = Q_τ/(Q_τ + Q_p ω² + R ω⁴): no delay, but it leads before a tap: it knows the
future.

References:
    H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic systems",
    AIAA Journal 3(8), 1965; G. J. Bierman, "Fixed interval smoothing with discrete measurements",
    Int. J. Control 18(1), 1973, for the form used here.
"""

from dataclasses import dataclass

import numpy as np

from vftcli.observers.kalman_model import Covariance, Discrete, Gains, closed_loop, error_filter
from vftcli.observers.observer import Complex, Tuning
from vftcli.observers.paper import TORQUE, KalmanObserver
from vftcli.observers.uneven import gain_sequence, recursion
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array, empty_series, handed_over
from vftcli.signals.shown import Shown
from vftcli.signals.steady_filter import steady_filter
from vftcli.signals.wrench import ExternalTorque

#: Share of the settled information that may still be missing.
SETTLED = 1e-16


@dataclass(frozen=True, kw_only=True, repr=False)
class KalmanSmoother(Shown):
    """Fixed-interval smoother with a disturbance Kalman filter's parameters.

    Exact at uneven clocks; memory and time grow with the log.
    """

    filter: KalmanObserver  #: The filter to smooth.
    name: str = "kfo-rts"  #: Command-line name.

    def estimate(self, terms: DynamicsTerms) -> ExternalTorque:
        """A smoothed log; `sd` is the smoother's own √P₂₂."""
        if self.filter.is_steady(terms.clock):
            tau, sd = self._steady(terms)
        else:
            tau, sd = self._step_by_step(terms)
        return ExternalTorque(name=self.name, t=terms.t, tau=handed_over(tau), sd=handed_over(sd))

    def _steady(self, terms: DynamicsTerms) -> tuple[Array, Array]:
        """Smoothed with settled gains. (T, n) each"""
        samples, n = terms.p.shape
        settled = self.filter.steady(terms.clock.step, n)
        model = self.filter.model(terms.clock.step, n)
        gains, S = settled.gains, settled.prior.p11 + model.r
        (F, g), d = error_filter(gains, model.a12, model.a22), self.filter.unexplained(terms)
        tau, _ = steady_filter(F, g, d, np.zeros((2, n)), wanted=TORQUE)
        nu = innovations(tau, gains.l2 * S, model.a22)  # ν/S
        backward, b = backward_filter(gains, model.a12, model.a22)
        # νᵗ⁺¹ drives λ̃ᵗ: in reverse, the sample before.
        driven = np.zeros_like(nu)
        driven[1:] = nu[:0:-1]
        weights = np.stack([gains.posterior.p12, gains.posterior.p22])
        correction, _ = steady_filter(backward, b, driven, 0.0 * weights, wanted=weights)
        tau -= correction[::-1]
        deviation, sd = steady_deviation(gains, model, S, samples), empty_series(samples, n)
        sd[:] = deviation[-1]
        sd[samples - len(deviation) :] = deviation[::-1]
        return tau, sd

    def _step_by_step(self, terms: DynamicsTerms) -> tuple[Array, Array]:
        """Smoothed with gains for each step's sample time. (T, n) each"""
        samples, n = terms.p.shape
        settled = self.filter.steady(terms.clock.step, n)
        model = self.filter.model(np.broadcast_to(terms.dt, (samples, 1)), n)
        gains = gain_sequence(model, self.filter.first_prior(settled), settled.gains.posterior)
        # L₁ = P⁻₁₁/S and R = S − P⁻₁₁, so S = R/(1 − L₁).
        with np.errstate(divide="ignore"):  # after a gap of days: L₁ = 1, S = ∞
            S = model.r / (1.0 - gains.l1)
        (F, g), d = error_filter(gains, model.a12, model.a22), self.filter.unexplained(terms)
        states = recursion(F, g * d, np.zeros((2, n)))
        e, tau = np.concatenate([np.zeros((2, 1, n)), states[:, :-1]], axis=1)
        innovation = e + d - model.a12 * tau
        backward, b = backward_filter(gains, model.a12, model.a22)
        lam, P = from_the_end(backward, b * (innovation / S)), gains.posterior
        step, gain = information_step(gains, model.a12, model.a22), information_gain(model.a12, S)
        variance = smoothed_variance(P, from_the_end(step, gain))
        return states[1] - (P.p12 * lam[0] + P.p22 * lam[1]), np.sqrt(variance)

    def tuning(self, step: float, joints: int) -> Tuning:
        """Meaning of the parameters: no delay, −3 dB at |H_KFO|² = 1/√2.

        Q_τ/(Q_τ + Q_pω² + Rω⁴) = 1/√2 at the effective densities, with the filter's ω_n and ζ.
        """
        causal = self.filter.tuning(step, joints)
        # In units of ω_n: x⁴ + c x² + 1 = √2 with c = Q_p/√(Q_τR) = 4ζ² − 2.
        c = 4.0 * causal.zeta**2 - 2.0
        x = np.sqrt(0.5 * (-c + np.sqrt(c**2 + 4.0 * (np.sqrt(2.0) - 1.0))))
        return Tuning(
            omega_n=causal.omega_n,
            zeta=causal.zeta,
            delay=np.zeros(joints),
            bandwidth=causal.omega_n * x / (2.0 * np.pi),
            dc_gain=causal.dc_gain,
            parameter_count=causal.parameter_count,
        )

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Two-sided gain in the middle of a log: real, no delay. (F, n)"""
        causal = self.filter.tuning(step, joints)
        x = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64)[:, None] / causal.omega_n
        c = 4.0 * causal.zeta**2 - 2.0
        response: Complex = (1.0 / (1.0 + c * x**2 + x**4)).astype(np.complex128)
        return response


def steady_deviation(gains: Gains, model: Discrete, S: Array, samples: int) -> Array:
    """√P₂₂ from a log's last sample backwards until settled. (≤ T, n)"""
    step = information_step(gains, model.a12, model.a22)
    missing = missing_information(step, information_gain(model.a12, S), samples)
    return np.sqrt(smoothed_variance(gains.posterior, (missing[0] - missing).transpose(1, 0, 2)))


def innovations(tau: Array, l2: Array, a22: Array) -> Array:
    """ν of the steady filter from its estimate: τ̂ᵗ = A₂₂τ̂ᵗ⁻¹ + L₂νᵗ. (T, n)

    Args:
        tau: τ̂. (T, n)
        l2: Its gain L₂. (n,)
        a22: A₂₂ of its model. (n,)
    """
    nu = tau.copy(order="K")
    nu[1:] -= a22 * tau[:-1]
    nu /= l2
    return nu


def backward_filter(gains: Gains, a12: Array, a22: Array) -> tuple[Array, Array]:
    """Transition ((I − LC)A)ᵀ and input −AᵀCᵀ, backwards. (2, 2, …), (2, …)"""
    return closed_loop(gains, a12, a22).swapaxes(0, 1), np.array([-np.ones_like(a12), -a12])


def information_step(gains: Gains, a12: Array, a22: Array) -> Array:
    """Λ̃ ← FᵀΛ̃F with F = (I − LC)A, as a matrix on (Λ₁₁, Λ₁₂, Λ₂₂). (3, 3, …)"""
    (f11, f12), (f21, f22) = closed_loop(gains, a12, a22)
    return np.array(
        [
            [f11 * f11, 2.0 * f11 * f21, f21 * f21],
            [f11 * f12, f11 * f22 + f12 * f21, f21 * f22],
            [f12 * f12, 2.0 * f12 * f22, f22 * f22],
        ]
    )


def information_gain(a12: Array, S: Array) -> Array:
    """AᵀCᵀCA/S, a sample's information on the one before. (3, …)"""
    return np.array([1.0 / S, a12 / S, a12**2 / S])


def smoothed_variance(P: Covariance, information: Array) -> Array:
    """Smoothed torque's variance P₂₂ − [P₁₂ P₂₂] Λ̃ [P₁₂ P₂₂]ᵀ, like P₂₂. [(N·m)²]"""
    l11, l12, l22 = information
    gained = P.p12**2 * l11 + 2.0 * P.p12 * P.p22 * l12 + P.p22**2 * l22
    variance: Array = P.p22 - gained
    return variance


def missing_information(step: Array, gain: Array, samples: int) -> Array:
    """Λ̃ less its settled value, 0, 1, 2 … samples from a log's end. (N, 3, n)

    Λ̃ ← SΛ̃ + g settles at Λ̃∞ = (I − S)⁻¹g; k samples later Sᵏ Λ̃∞ is missing. The powers
    come by doubling, until nothing is missing or the log ends.
    """
    S, g = np.moveaxis(step, -1, 0), np.moveaxis(gain, -1, 0)
    settled = np.linalg.solve(np.eye(3) - S, g[..., None])[..., 0]
    missing, power = settled.T[None], S
    while len(missing) < samples:
        missing = np.concatenate([missing, np.einsum("jab,kbj->kaj", power, missing)])
        power = power @ power
        if np.all(np.abs(missing[-1]) <= SETTLED * np.abs(settled.T)):
            break
    kept: Array = np.asarray(missing[:samples], dtype=np.float64)
    return kept


def from_the_end(F: Array, x: Array) -> Array:
    """y_t = F_t y_{t+1} + x_t from a log's end, at each sample."""
    y = recursion(F[:, :, ::-1], x[:, ::-1], np.zeros_like(x[:, 0]))[:, ::-1]
    return np.concatenate([y[:, 1:], np.zeros_like(y[:, :1])], axis=1)
