"""The zero-order hold as (44) is printed, its lower-right block −A_c in place of −A_cᵀ.

The noise Qᵗ = M₁₂M₁₁ᵀ comes out unsymmetric, with A_τ = 0

    [[Q_p Ts + (Q_τ − Q_p)Ts³/2, (Q_τ − Q_p)Ts²/2], [Q_τ Ts², Q_τ Ts]],

and so does the covariance: all four entries are carried, and the gain is its left column.
"""

import numpy as np

from vftcli.observers.kalman_gains import Covariance, Gains, Steady
from vftcli.observers.kalman_model import Densities, Discrete
from vftcli.signals.arrays import Array

#: Relative change of a covariance in one sample from which on rounding moves it alone.
SETTLED = 1e-14
LONGEST = 100_000  #: Samples within which a filter settles; the paper's need some hundred.
#: Below this a·Ts (e^{aTs} − 1 − aTs)/a² is its series, good to a tenth of a·Ts squared.
SMALL = 1e-5


def printed_noise(model: Discrete, d: Densities) -> Array:
    """Qᵗ = M₁₂M₁₁ᵀ of (44), entry by entry, written out. (2, 2, …)

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
    """The gain (2, n) for a measured momentum, and the covariance after it. (2, 2, n)"""
    gain = prior[:, 0] / (prior[0, 0] + r)
    return gain, prior - gain[:, None] * prior[0]


def settled_prior(model: Discrete, noise: Array) -> Array:
    """The covariance before a measurement that a constant sample time settles to. (2, 2, n)"""
    prior = noise
    for _ in range(LONGEST):
        before = prior
        prior = predicted(updated(prior, model.r)[1], model.a12, model.a22, noise)
        if np.all(np.abs(prior - before) <= SETTLED * np.abs(prior)):
            break
    return prior


def as_covariance(P: Array) -> Covariance:
    """A covariance without its lower-left entry, as the symmetric ones are kept."""
    return Covariance(P[0, 0], P[0, 1], P[1, 1])


def printed_steady(model: Discrete, d: Densities) -> Steady:
    """The gains and covariances that a constant sample time settles to; one a joint."""
    prior = settled_prior(model, printed_noise(model, d))
    (l1, l2), posterior = updated(prior, model.r)
    return Steady(Gains(l1, l2, as_covariance(posterior)), as_covariance(prior))
