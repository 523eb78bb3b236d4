"""Gains and covariances of n independent two-state Kalman filters, and what they settle to."""

from typing import NamedTuple

import numpy as np

from vftcli.observers.kalman_model import Discrete
from vftcli.signals.arrays import Array


class Covariance(NamedTuple):
    """Entries of a symmetric 2×2 covariance of [p; τ_ext], one a joint (and sample)."""

    p11: Array
    p12: Array
    p22: Array


class Gains(NamedTuple):
    """Filtered gains L₁ (momentum) and L₂ (torque) and the covariance after the update."""

    l1: Array
    l2: Array
    posterior: Covariance


class Steady(NamedTuple):
    """What a constant sample time settles to: the gains and the prior covariance."""

    gains: Gains
    prior: Covariance


def steady(model: Discrete, decay: Array) -> Steady:
    """The stationary filter, the stabilising solution of the discrete Riccati equation.

    For A_τ = 0 in closed form, λ = Ts√(Q₂₂/R), β = (Q₁₁ − TsQ₁₂)/R, y = ½(λ + √(λ² + 16 + 4β)),
    r = ½(y − √(y² − 4)), L₁ = 1 − r², L₂ = λr/Ts; for A_τ ≠ 0 by SciPy's solver, joint by joint.
    The prior follows from the gains: P₁₁ = R L₁/(1−L₁), P₁₂ = R L₂/(1−L₁).
    """
    if np.any(decay > 0.0):
        prior = solved_prior(model)
    else:
        lam = model.step * np.sqrt(model.q22 / model.r)
        beta = (model.q11 - model.step * model.q12) / model.r
        y = 0.5 * (lam + np.sqrt(lam**2 + 16.0 + 4.0 * beta))
        # 1 − r² and 1/r² − 1 lose digits when r is near 1: both follow from √(y² − 4) instead.
        root = np.sqrt(np.maximum((y - 2.0) * (y + 2.0), 0.0))
        r = 2.0 / (y + root)
        l1, l2 = r * root, lam * r / model.step
        p11, p12 = model.r * l1 / r**2, model.r * l2 / r**2
        p22 = (model.r * l2 * root / r - model.q12) / model.step + model.q22
        prior = Covariance(p11, p12, p22)
    return Steady(update(prior, model.r), prior)


def solved_prior(model: Discrete) -> Covariance:
    """The stationary prior from SciPy's discrete Riccati solver, one joint at a time. (n,)"""
    from scipy.linalg import solve_discrete_are

    entries = []
    for j in range(len(model.step)):
        A = np.array([[1.0, model.a12[j]], [0.0, model.a22[j]]])
        Q = np.array([[model.q11[j], model.q12[j]], [model.q12[j], model.q22[j]]])
        P = solve_discrete_are(A.T, np.array([[1.0], [0.0]]), Q, np.array([[model.r[j]]]))
        entries.append((P[0, 0], P[0, 1], P[1, 1]))
    return Covariance(*np.array(entries).T)


def update(prior: Covariance, r: Array) -> Gains:
    """Gains for a measured momentum, and the covariance after it in Joseph's form."""
    p11, p12, p22 = prior
    innovation = p11 + r
    # 1 − L₁ as a quotient: the difference would lose every digit of a small r.
    l1, l2 = p11 / innovation, p12 / innovation
    rest = r / innovation
    # Joseph's form stays positive whatever the rounding of the gains.
    posterior = Covariance(
        rest**2 * p11 + l1**2 * r,
        rest * (p12 - l2 * p11) + l1 * l2 * r,
        p22 - 2.0 * l2 * p12 + l2**2 * p11 + l2**2 * r,
    )
    return Gains(l1, l2, posterior)
