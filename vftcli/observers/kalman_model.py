"""The disturbance Kalman filter's discrete model: A, B, Q and R at a sample time (36)–(44).

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
    """A discretised two-state model, each entry with the shape of the broadcast (Ts, joint).

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
    """Forward Euler (41): A = I + Ts·A_c, Q̂ = Ts·diag(Q_p, Q_τ), which is stable for aTs ≤ 2."""
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
    r"""Exact discretisation (43), (44) with the corrected lower-right block −A_cᵀ (Van Loan).

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
    return Discrete(
        step=step,
        a12=reach,
        a22=np.exp(-x),
        q11=step * d.q_p + d.q_tau * integral_of_reach_squared(step, a, reach, squared),
        q12=0.5 * d.q_tau * reach**2,
        q22=d.q_tau * squared,
        r=np.broadcast_to(d.r, shape),
    )


def integral_of_reach_squared(step: Array, a: Array, reach: Array, squared: Array) -> Array:
    """∫₀^Ts ((1 − e^{−as})/a)² ds = (Ts − 2E + ∫e^{−2as})/a², as a series for small aTs."""
    x = a * step
    series = step**3 * (1 / 3 - x / 4 + 7 * x**2 / 60 - x**3 / 24 + 31 * x**4 / 2520)
    large = np.where(x > SERIES, a, 1.0)
    result: Array = np.where(x > SERIES, (step - 2.0 * reach + squared) / large**2, series)
    return result


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
