"""What the two first-order observers share: sample times, restarts, and what a gain means."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from vftcli.observers.observer import Complex, Tuning
from vftcli.observers.recursion import PIECE, Steps, recursion, steps_of
from vftcli.observers.steady_filter import steady_filter
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array, Mask, empty_series
from vftcli.signals.remarks import Remark, caution

GAP = 3.0
"""A step of more than this many nominal ones is a gap."""


@dataclass(frozen=True)
class Piece:
    """A stretch of a log with the sample before it, as a first-order observer works on it.

    Attributes:
        p: Momentum, the sample before first. (N+1, n) [kg·m²/s]
        mu: μ, the sample before first. (N+1, n) [N·m]
        a: rate·Ts/2, constant (1, n) on a uniform clock, else one a sample. (N, n)
    """

    p: Array
    mu: Array
    a: Array


Coefficients = Callable[[Piece], tuple[Array, Array]]
"""A piece → how much of the state stays (1 or N, n), and what is added to it (N, n)."""


def run_first_order(
    terms: DynamicsTerms, rate: Array, coefficients: Coefficients, start: Callable[[Array], Array]
) -> tuple[Array, tuple[Remark, ...]]:
    """Run y_t = decay_t y_{t−1} + x_t over a log, a piece at a time. (T, n), and remarks

    Past a gap so long that a > 1 the state would change its sign: there the filter starts afresh,
    and a remark says so. A gap is a step of more than `GAP` nominal ones: on a slow clock that
    jitters, a passes 1 in many a step that misses nothing. Gains that give a > 1 at the nominal
    sample time are the user's own choice and restart nothing.

    Args:
        terms: p and μ.
        rate: ω or K. (n,) [1/s]
        coefficients: The observer's formula.
        start: Momentum where the filter starts (…, n) → the state it starts from.
    """
    steps = steps_of(terms.t)
    y = empty_series(terms.samples, terms.joints)
    y[0] = start(terms.p[0])
    gaps = 0
    for first in range(1, terms.samples, PIECE):
        span, with_before = slice(first, first + PIECE), slice(first - 1, first + PIECE)
        dt = np.array([steps.median]) if steps.uniform else steps.dt[span]
        piece = Piece(terms.p[with_before], terms.mu[with_before], 0.5 * dt[:, None] * rate)
        decay, x = coefficients(piece)
        afresh = restarts(piece.a, rate, steps)
        if afresh is not None:
            gaps += int(np.count_nonzero(afresh.any(axis=1)))
            decay = np.where(afresh, 0.0, decay)
            x = np.where(afresh, start(piece.p[1:]), x)
        y[span] = scalar_recursion(decay, x, y[first - 1])
    if gaps == 0:
        return y, ()
    code = "restarted-after-gap" if gaps == 1 else "restarted-after-gaps"
    return y, (caution(code, gaps=gaps, longest_s=float(np.max(steps.dt))),)


def restarts(a: Array, rate: Array, steps: Steps) -> Mask | None:
    """Where a gap makes the filter start afresh (N, n), or None where nothing does."""
    if steps.uniform:
        return None
    nominal = 0.5 * steps.median * rate
    where: Mask = (a > np.maximum(GAP * nominal, 1.0)) & (nominal <= 1.0)
    return where if where.any() else None


def scalar_recursion(decay: Array, x: Array, before: Array) -> Array:
    """Run y_t = decay_t y_{t−1} + x_t from `before`, for each joint. (N, n)"""
    n = x.shape[1]
    start = before[None]
    if len(decay) == 1:
        one = np.ones((1, n))
        return steady_filter(decay.reshape(1, 1, n), one, x, start, wanted=one)
    return recursion(decay.reshape(-1, 1, 1, n), x[:, None, :], start)[:, 0]


def first_order_tuning(rate: Array, step: float, parameter_count: int) -> Tuning:
    """Cutoff, delay 1/rate and −3 dB frequency of a bilinear first-order observer.

    The bilinear transform warps frequency: tan(ωTs/2) = rate·Ts/2 at the −3 dB point of the filter
    alone; the exact response of sampled momentum is in `first_order_response`.
    """
    n = len(rate)
    return Tuning(
        omega_n=rate,
        zeta=np.full(n, np.nan),
        delay=1.0 / rate,
        bandwidth=np.arctan(rate * step / 2.0) / (np.pi * step),
        dc_gain=np.ones(n),
        parameter_count=parameter_count,
    )


def first_order_response(rate: Array, frequency: Array, step: float) -> Complex:
    """Exact response to τ_ext = e^{jωt} of r = rate·(p − p⁻¹)/(1+a) + (1−a)/(1+a) r⁻¹. (F, n)

    The momentum is the continuous integral e^{jωt}/(jω), sampled.
    """
    omega = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64)[:, None]
    # At 0 Hz the quotient is 0/0; its limit is reached to the last digit long before.
    omega = np.where(omega == 0.0, 1e-9, omega)
    back = np.exp(-1j * omega * step)
    a = 0.5 * step * rate[None, :]
    response: Complex = rate * (1.0 - back) / ((1.0 + a) - (1.0 - a) * back) / (1j * omega)
    return response
