"""Printed variants of the paper, run by `--as-printed` to show its errata.

FDO (29): k₃ has 1 + 2a in its denominator, which adds a²/(1+2a)·(pᵗ + pᵗ⁻¹) to dᵗ; and
the filter starts from Y₂⁰ = 0, τ̂⁰ = ωp⁰, without −ωe^{−ωt}p₀ of (26).

GMO (35): feeds back r^{i−1} + r^{i−2}: oscillates above K·Ts = .343, unstable from 2 on.

KFO: u = μᵗ alone (40). The zero-order hold (44) has −A_c in its lower-right block, not
−A_cᵀ: the noise Qᵗ = M₁₂M₁₁ᵀ comes out unsymmetric, with A_τ = 0

    [[Q_p Ts + (Q_τ − Q_p)Ts³/2, (Q_τ − Q_p)Ts²/2], [Q_τ Ts², Q_τ Ts]],

and so does the covariance: all four entries are carried, and the gain is its left column,
settled at the nominal sample time.
"""

import numpy as np

from vftcli.observers.kalman_model import Densities, Discrete, Gains
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import DynamicsTerms, one_sample_earlier
from vftcli.signals.steady_filter import filtered

#: Relative change of a covariance in one sample within rounding.
SETTLED = 1e-14
LONGEST = 100_000  #: Most samples until a filter settles.
#: Below this a·Ts, (e^{aTs} − 1 − aTs)/a² is its series, to a tenth of a·Ts squared.
SMALL = 1e-5


def printed_noise(model: Discrete, d: Densities) -> Array:
    """Qᵗ = M₁₂M₁₁ᵀ of (44), entry by entry. (2, 2, …)

        M₁₂ = [[Q_p Ts, Q_τ (cosh aTs − 1)/a² − Q_p (e^{aTs} − 1 − aTs)/a²], [0, Q_τ sinh(aTs)/a]]

    and M₁₁ is the model's A.
    """
    step, a = model.step, d.decay
    x, some = a * step, np.where(a > 0.0, a, 1.0)
    sinh = np.where(a > 0.0, np.sinh(x) / some, step)
    cosh = np.where(a > 0.0, 2.0 * (np.sinh(0.5 * x) / some) ** 2, 0.5 * step**2)
    rest = np.where(x > SMALL, (np.expm1(x) - x) / some**2, 0.5 * step**2 * (1.0 + x / 3.0))
    across, down = d.q_tau * cosh - d.q_p * rest, d.q_tau * sinh
    return np.array(
        [
            [d.q_p * step + model.a12 * across, model.a22 * across],
            [model.a12 * down, model.a22 * down],
        ]
    )


def predicted(P: Array, a12: Array, a22: Array, noise: Array) -> Array:
    """Covariance before the measurement, A P Aᵀ + Qᵗ. (2, 2, n)"""
    (p11, p12), (p21, p22) = P
    up, down = p12 + a12 * p22, p21 + a12 * p22
    return np.array([[p11 + a12 * (p21 + up), a22 * up], [a22 * down, a22 * a22 * p22]]) + noise


def updated(prior: Array, r: Array) -> tuple[Array, Array]:
    """The gain (2, n) for a momentum, and the covariance after it. (2, 2, n)"""
    gain = prior[:, 0] / (prior[0, 0] + r)
    return gain, prior - gain[:, None] * prior[0]


def settled_prior(model: Discrete, d: Densities) -> Array:
    """Settled covariance before a measurement, constant sample time. (2, 2, n)"""
    prior = noise = printed_noise(model, d)
    for _ in range(LONGEST):
        before = prior
        prior = predicted(updated(prior, model.r)[1], model.a12, model.a22, noise)
        if np.all(abs(prior - before) <= SETTLED * abs(prior)):
            break
    return prior


def printed_steady(model: Discrete, d: Densities) -> Gains:
    """Gains at a constant sample time, without the covariance's lower left."""
    prior = settled_prior(model, d)
    (l1, l2), ((p11, p12), (_, p22)) = updated(prior, model.r)
    return Gains(l1, l2, p11, p12, p22, prior[0, 0] + model.r)


def printed_dynamics_input(terms: DynamicsTerms, omega: float, *, begins: bool) -> Array:
    """Input of the FDO with printed k₃ and, at a log's begin, start. (T, n) [N·m·s]"""
    a = 0.5 * omega * terms.dt
    d = terms.d + a**2 / (1.0 + 2.0 * a) * (terms.p + one_sample_earlier(terms, "p"))
    if begins:
        d[0] = (1.0 + a[0]) * terms.p[0]  # which alone makes τ̂⁰ = ωp⁰
    return d


def printed_momentum(terms: DynamicsTerms, gain: Array, start: Array) -> tuple[Array, Array]:
    """rᵗ = rᵗ⁻¹ + K dᵗ − a(rᵗ⁻¹ + rᵗ⁻²): (T, n), the last two (2, n). [N·m]"""
    a = 0.5 * terms.dt * gain
    F, g = np.array([[1.0 - a, -a], [a**0, 0.0 * a]]), np.array([gain, 0.0 * gain])
    F, g = (F[:, :, 0], g) if terms.clock.uniform else (F, g[:, None])
    # It may diverge: that is the result, shown as unknown.
    with np.errstate(over="ignore", invalid="ignore"):
        (tau,), end = filtered(F, g, terms.d, start, [np.array([[1.0], [0.0]])])
    return np.where(np.isfinite(tau), tau, np.nan), end
