"""Rauch–Tung–Striebel smoother on the disturbance Kalman filter: `kfo-rts`.

In a complete log an estimate at t may use later samples. The smoother is the Kalman
filter's fixed-interval answer, backwards in Bryson and Frazier's form. It needs only the
innovations ν and inverts only numbers:

    λ̃ᵗ = Aᵀ[(I − LC)ᵀ λ̃ᵗ⁺¹ − Cᵀ νᵗ⁺¹/Sᵗ⁺¹],  λ̃ = 0 at the last sample,  x̂ₛᵗ = x̂ᵗ − Pᵗ λ̃ᵗ

with P the filter's posterior and S its innovation variance. In the long run it is the
two-sided filter |H|² = Q_τ/(Q_τ + Q_p ω² + R ω⁴): no delay, but it leads before a tap.
The forward filter starts at rest, but nothing is known before the first sample: the start
is estimated too, x̂ₛ⁰ = x̂⁰ − M⁻¹λ̃⁰.

References:
    H. E. Rauch, F. Tung, C. T. Striebel, "Maximum likelihood estimates of linear dynamic systems",
    AIAA Journal 3(8), 1965; G. J. Bierman, "Fixed interval smoothing with discrete measurements",
    Int. J. Control 18(1), 1973, for the form used here.
"""

from dataclasses import replace

import numpy as np

from vftcli.observers.kalman_model import (
    Covariance,
    Discrete,
    Gains,
    closed_loop,
    error_filter,
    settle,
    update,
)
from vftcli.observers.observer import Complex, Tuning
from vftcli.observers.paper import TORQUE, KalmanObserver
from vftcli.signals.arrays import Array, handed_over
from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque
from vftcli.signals.shown import Shown, record
from vftcli.signals.steady_filter import Fold, filtered, spans


@record
class KalmanSmoother(Shown):
    """Fixed-interval smoother with a disturbance Kalman filter's parameters.

    Exact at uneven clocks; memory and time grow with the log.
    """

    filter: KalmanObserver  #: The filter to smooth.
    name: str = "kfo-rts"  #: Command-line name.

    def estimate(self, terms: DynamicsTerms) -> ExternalTorque:
        """A smoothed log; `sd` is the smoother's own √P₂₂."""
        kalman, step, n = self.filter, terms.clock.step, terms.joints
        model, gains, d = kalman.model(step, n), kalman.steady(step, n), kalman.unexplained(terms)
        if not (even := terms.clock.uniform):
            model = kalman.model(terms.dt, n)
            gains = gain_sequence(model, kalman.first_prior(step, n), gains.posterior)
        (_, p12, p22), a12, S = gains.posterior, model.a12, gains.S
        # νᵗ = dᵗ + eᵗ⁻¹ − A₁₂ᵗτ̂ᵗ⁻¹
        ahead = a12 if even else np.roll(a12, -1, axis=0)
        wanted = [TORQUE, np.array([np.ones_like(a12), -ahead])]
        F, (of_error, g) = closed_loop(gains, model), error_filter(gains, model)
        b = -np.array([np.ones_like(a12), a12])

        def smoothed(d: Array, start: Array) -> tuple[Array, Array]:
            """Torque (T, n) after e, τ̂ before the first sample; λ̃ there. (2, n) each"""
            (tau, late), _ = filtered(of_error, g, d, start, wanted)
            nu = d.copy(order="K")
            nu[1:] += late[:-1]
            del late  # a long log's series are large
            nu /= S
            later, first = from_the_end(F.swapaxes(0, 1), b, nu, np.array([p12, p22]))
            return np.subtract(tau, later, out=tau), first

        tau, score = smoothed(d, np.zeros((2, n)))
        # Λ̃ᵗ = Fᵀ(Λ̃ᵗ⁺¹)F + AᵀCᵀCA/S; P₂₂ less [P₁₂ P₂₂] Λ̃ [P₁₂ P₂₂]ᵀ
        (f11, f12), (f21, f22) = F
        information = np.array(
            [
                [f11 * f11, 2.0 * f11 * f21, f21 * f21],
                [f11 * f12, f11 * f22 + f12 * f21, f21 * f22],
                [f12 * f12, 2.0 * f12 * f22, f22 * f22],
            ]
        )
        shown = np.array([np.ones_like(a12), a12, a12**2]) / S
        weights = np.array([p12**2, 2.0 * p12 * p22, p22**2])
        variance, known = from_the_end(information, shown, np.ones_like(tau), weights)
        np.subtract(p22, variance, out=variance)
        if len(d) > 1 and model.a22.all():
            # Unknown before the log: x̂⁰ − M⁻¹λ̃⁰ ± M⁻¹, M = Λ̃⁰ + S/R² of p⁰.
            first = np.s_[...] if even else np.s_[..., 0, :]
            known[0] += (S / model.r**2)[first]
            spread = np.linalg.inv(known[[[0, 1], [1, 2]]].T)
            # e = p − p̂
            start = np.linalg.inv(of_error[first].T).T * np.array([[[-1.0], [1.0]]])
            units = np.array([smoothed(np.zeros_like(d), start[:, k])[0] for k in range(2)])
            tau -= np.einsum("itn,nij,jn->tn", units, spread, score)
            variance += np.einsum("itn,nij,jtn->tn", units, spread, units)
        sd = handed_over(np.sqrt(variance))
        return ExternalTorque(name=self.name, t=terms.t, tau=handed_over(tau), sd=sd)

    def tuning(self, step: float, joints: int) -> Tuning:
        """No delay; −3 dB at |H_KFO|² = Q_τ/(Q_τ + Q_pω² + Rω⁴) = 1/√2."""
        causal = self.filter.tuning(step, joints)
        # In units of ω_n: x⁴ + c x² + 1 = √2 with c = Q_p/√(Q_τR) = 4ζ² − 2.
        c = 4.0 * causal.zeta**2 - 2.0
        x = np.sqrt(0.5 * (-c + np.sqrt(c**2 + 4.0 * (np.sqrt(2.0) - 1.0))))
        bandwidth = causal.omega_n * x / (2.0 * np.pi)
        return replace(causal, delay=np.zeros(joints), bandwidth=bandwidth)

    def frequency_response(self, frequency: Array, step: float, joints: int) -> Complex:
        """Two-sided gain in the middle of a log: real, no delay. (F, n)"""
        causal = self.filter.tuning(step, joints)
        x = 2.0 * np.pi * np.asarray(frequency, float)[:, None] / causal.omega_n
        c = 4.0 * causal.zeta**2 - 2.0
        return (1.0 / (1.0 + c * x**2 + x**4)).astype(np.complex128)


def from_the_end(F: Array, g: Array, d: Array, weights: Array) -> tuple[Array, Array]:
    """weights·y_{t+1} (T, n) of y_t = F_t y_{t+1} + g_t d_t, 0 at the end; y_1. (m, n)"""
    if F.ndim == 4:
        F, g, weights = F[:, :, :0:-1], g[:, :0:-1], weights[:, -2::-1]
    start = np.zeros((len(F), d.shape[1]))
    if len(d) < 2:
        return np.zeros_like(d), start
    (found,), first = filtered(F, g, d[:0:-1], start, [weights])
    return np.concatenate([found[::-1], start[:1]]), first


def gain_sequence(model: Discrete, prior: Covariance, guess: Covariance) -> Gains:
    """Gains of a log by its samples' models, a prior and a guess. (T, n)"""
    first = update(prior, model.r[0])
    rows = [np.array(first)[:, None]]
    entering = first.posterior
    for span in spans(len(model.r), begins=True):
        fold = Fold.of(span.stop - span.start)
        gains = settle(Discrete(*(fold.fold(entry[span]) for entry in model)), entering, guess)
        entering = Covariance(*map(fold.last, gains.posterior))
        rows.append(fold.unfold(np.array(gains)))
    return Gains(*np.concatenate(rows, axis=1))
