"""Disturbance Kalman filter at a sample time: A, B, Q, R, gains L (36)–(44).

For one joint: state x = [p; τ_ext], input μ, output p, ẋ = A_c x + B_c μ + w with
A_c = [[0, 1], [0, −a]].

With diagonal R and Q an n-joint filter is n independent two-state filters.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError

#: Below this a·Ts the integrals are summed as series: their closed forms cancel there.
SERIES = 1e-2


class Densities(NamedTuple):
    """The filter's parameters, one a joint."""

    r: Array  #: Measurement noise of the momentum, R. (n,)
    q_p: Array  #: Process noise of the momentum, Q_p. (n,)
    q_tau: Array  #: Process noise of the external torque, Q_τ. (n,)
    decay: Array  #: a in A_τ = −a. (n,) [1/s]


class Discrete(NamedTuple):
    """A discrete two-state model, each entry of the shape (Ts, joint) broadcast.

    A = [[1, a12], [0, a22]], B = [Ts; 0], process noise q11, q12, q22, measurement noise r.
    """

    step: Array
    a12: Array
    a22: Array
    q11: Array
    q12: Array
    q22: Array
    r: Array


def forward_euler(step: Array, d: Densities) -> Discrete:
    """Forward Euler (41): A = I + Ts·A_c, Q̂ = Ts·diag(Q_p, Q_τ); aTs ≤ 2: stable."""
    shape = np.broadcast_shapes(np.shape(step), d.r.shape)
    step = np.broadcast_to(step, shape)
    return Discrete(
        step=step,
        a12=step,
        a22=1.0 - step * d.decay,
        q11=step * d.q_p,
        q12=np.zeros(shape),
        q22=step * d.q_tau,
        r=np.broadcast_to(d.r, shape),
    )


def zero_order_hold(step: Array, d: Densities) -> Discrete:
    r"""Exact discretisation (43), (44), corrected lower-right block −A_cᵀ (Van Loan).

    Written out, with E(s) = (1 − e^{−as})/a and a → 0 in brackets:

        A₁₂ = E(Ts) [Ts],  A₂₂ = e^{−aTs} [1]
        Q̂₁₁ = Q_p Ts + Q_τ ∫E² ds [Q_τ Ts³/3],  Q̂₁₂ = Q_τ E²/2 [Q_τ Ts²/2],
        Q̂₂₂ = Q_τ (1 − e^{−2aTs})/(2a) [Q_τ Ts]
    """
    shape = np.broadcast_shapes(np.shape(step), d.r.shape)
    if not d.decay.any():
        q22 = step * d.q_tau
        q12 = 0.5 * step * q22
        q11 = step * (d.q_p + q12 / 1.5)
        held = np.broadcast_to(step, shape)
        return Discrete(
            held, held, np.broadcast_to(1.0, shape), q11, q12, q22, np.broadcast_to(d.r, shape)
        )
    step, a = np.broadcast_to(step, shape), np.broadcast_to(d.decay, shape)
    x = a * step
    some = np.where(x > 0.0, a, 1.0)
    reach = np.where(x > 0.0, -np.expm1(-x) / some, step)
    squared = np.where(x > 0.0, -np.expm1(-2.0 * x) / (2.0 * some), step)
    # ∫E² ds = (Ts − 2E + ∫e^{−2as})/a², as a series for small aTs.
    series = step**3 * (1 / 3 - x / 4 + 7 * x**2 / 60 - x**3 / 24 + 31 * x**4 / 2520)
    large = np.where(x > SERIES, a, 1.0)
    integral = np.where(x > SERIES, (step - 2.0 * reach + squared) / large**2, series)
    return Discrete(
        step=step,
        a12=reach,
        a22=np.exp(-x),
        q11=step * d.q_p + d.q_tau * integral,
        q12=0.5 * d.q_tau * reach**2,
        q22=d.q_tau * squared,
        r=np.broadcast_to(d.r, shape),
    )


Discretisation = Callable[[Array, Densities], Discrete]
DISCRETISATIONS: dict[str, Discretisation] = {"fe": forward_euler, "zoh": zero_order_hold}

#: How R and Q are read; (42) as printed counts Ts twice, (44) does not.
NOISE_CONVENTIONS = {
    "density": "Q = Q̂, R = R/Ts: densities, the same filter at every rate",
    "discrete": "Q = Q̂, R = R: R is the variance of one sample (default of a file's gains)",
    "literal": "fe: Q = Ts·Q̂, R = R/Ts as (42) prints it; zoh: as density",
}


def discretise(scheme: str, convention: str, step: Array, d: Densities) -> Discrete:
    """Discretise with a scheme ("fe", "zoh") under a noise convention.

    Args:
        scheme: A key of `DISCRETISATIONS`.
        convention: A key of `NOISE_CONVENTIONS`.
        step: Sample time, one or one a sample as a column (T, 1). [s]
        d: Parameters, one a joint.
    """
    if scheme == "fe" and np.any(np.asarray(step) * d.decay > 2.0):
        worst = float(np.max(np.asarray(step) * d.decay))
        raise ParameterError(
            f"kfo-fe is unstable: decay·Ts = {worst:.3g} is above 2; "
            "choose a smaller kfo.decay or the observer kfo-zoh"
        )
    model = DISCRETISATIONS[scheme](np.asarray(step, dtype=np.float64), d)
    if convention == "discrete":
        return model
    model = model._replace(r=model.r / model.step)
    if convention == "literal" and scheme == "fe":
        step = model.step
        return model._replace(q11=step * model.q11, q12=step * model.q12, q22=step * model.q22)
    return model


class Covariance(NamedTuple):
    """Entries of a symmetric 2×2 covariance of [p; τ_ext], one a joint (and sample)."""

    p11: Array
    p12: Array
    p22: Array


class Gains(NamedTuple):
    """Filtered gains L₁ (momentum), L₂ (torque), covariance after the update."""

    l1: Array
    l2: Array
    posterior: Covariance


class Steady(NamedTuple):
    """Settled gains and prior covariance at a constant sample time."""

    gains: Gains
    prior: Covariance


def steady(model: Discrete, decay: Array) -> Steady:
    """Stationary filter: stabilising solution of the discrete Riccati equation.

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
    """Stationary prior by SciPy's discrete Riccati solver, each joint. (n,)"""
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


def closed_loop(gains: Gains, a12: Array, a22: Array) -> Array:
    """Transition F = (I − LC)A of the filtered state, entry by entry. (2, 2, …)"""
    rest = 1.0 - gains.l1
    return np.array([[rest, rest * a12], [-gains.l2, a22 - gains.l2 * a12]])


def error_filter(gains: Gains, a12: Array, a22: Array) -> tuple[Array, Array]:
    """Transition (2, 2, …) and input (2, …) of the filter on its error e = p − p̂.

    Subtracting p from x̂ᵗ = (I−LC)(A x̂ᵗ⁻¹ + B u) + L pᵗ leaves one input, `DynamicsTerms.d`:

        eᵗ = (1−L₁)(eᵗ⁻¹ + dᵗ − A₁₂τ̂ᵗ⁻¹),  τ̂ᵗ = A₂₂τ̂ᵗ⁻¹ + L₂(eᵗ⁻¹ + dᵗ − A₁₂τ̂ᵗ⁻¹)

    from e⁰ = 0, τ̂⁰ = 0, which is x̂⁰ = [p⁰; 0]. It is the same filter without the cancellation of
    two large momenta.
    """
    (f11, f12), (f21, f22) = closed_loop(gains, a12, a22)
    return np.array([[f11, -f12], [-f21, f22]]), np.array([f11, gains.l2])


class KalmanState(NamedTuple):
    """State of a Kalman observer after a block of a log."""

    error: Array  #: e = p − p̂ [kg·m²/s] and τ̂ [N·m]. (2, n)
    posterior: Covariance  #: Their covariance. (n,) each
    #: Its lower-left entry less its upper-right one, which only (44) as printed has. (n,)
    skew: Array | float = 0.0
