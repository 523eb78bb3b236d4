"""Common part of the two first-order observers: steps, restarts, gains."""

from typing import NamedTuple

import numpy as np

from vftcli.observers.observer import Complex, Tuning
from vftcli.observers.uneven import Fold, run_blocks, spans
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array, empty_series
from vftcli.signals.remarks import Remark, caution
from vftcli.signals.steady_filter import steady_filter

GAP = 3.0  #: A step of more than this many nominal ones is a gap.


class FirstOrderState(NamedTuple):
    """State of a first-order observer after a block of a log."""

    states: Array  #: Its states, the estimate first. (m, n) [N·m]
    gaps: int = 0  #: Number of gaps that it started afresh after.
    longest: float = 0.0  #: The longest of them. [s]

    @property
    def remarks(self) -> tuple[Remark, ...]:
        """That it started afresh, if it did."""
        if self.gaps == 0:
            return ()
        code = "restarted-after-gap" if self.gaps == 1 else "restarted-after-gaps"
        return (caution(code, gaps=self.gaps, longest_s=self.longest),)


def run_first_order(
    terms: DynamicsTerms,
    rate: Array,
    state: FirstOrderState | None,
    driven: Array | None = None,
    afresh: Array | None = None,
) -> tuple[Array, FirstOrderState]:
    """τ̂ᵗ = (1−a)/(1+a) τ̂ᵗ⁻¹ + rate/(1+a) dᵗ, a = rate·Ts/2, of a block. (T, n)

    Past a gap (`GAP` nominal steps) so long that a > 1 the state would change its sign: there the
    filter starts afresh, and a remark says so. Gains with a > 1 at the nominal step restart
    nothing.

    Args:
        terms: The block.
        rate: ω or K. (n,) [1/s]
        state: Where the block before ended, None where the log begins, from τ̂ = 0.
        driven: Its input, `DynamicsTerms.d` if not given. (T, n) [N·m·s]
        afresh: The estimate where it starts afresh, 0 if not given. (T, n) [N·m]
    """
    n, uniform = terms.joints, terms.clock.uniform
    before, gaps, longest = state or FirstOrderState(np.zeros((1, n)))
    d = terms.d if driven is None else driven
    if uniform:
        decay, gain = coefficients(terms.dt, rate)
        tau, before = steady_filter(decay[None], gain, d, before, wanted=np.ones((1, 1)))
        return tau, FirstOrderState(before, gaps, longest)
    tau = empty_series(*d.shape)
    nominal = terms.clock.step * rate
    for span in spans(terms.samples, begins=False):
        dt = terms.dt[span]
        fold = Fold.of(len(dt))
        decay, gain = coefficients(fold.fold(dt), rate[:, None])
        x = fold.fold(d[span])
        x *= gain
        # A few steps, if any.
        late = np.flatnonzero(dt[:, 0] > GAP * terms.clock.step)
        where = (dt[late] * rate > 2.0) & (nominal <= 2.0)
        if where.any():
            samples, joints = late[where.nonzero()[0]], where.nonzero()[1]
            at = samples % fold.length, joints, samples // fold.length
            decay[at], x[at] = 0.0, 0.0 if afresh is None else afresh[span][samples, joints]
            rows = np.unique(samples)
            gaps, longest = gaps + len(rows), max(longest, float(np.max(dt[rows])))
        tau[span] = fold.unfold(run_blocks(decay[None, None], x[None], before)[0])
        before = tau[span][-1:]
    return tau, FirstOrderState(before, gaps, longest)


def coefficients(dt: Array, rate: Array) -> tuple[Array, Array]:
    """How much of the estimate stays, and the gain on d. Like `dt` and `rate` together"""
    a = 0.5 * dt * rate
    whole = 1.0 + a
    np.subtract(1.0, a, out=a)
    a /= whole
    return a, rate / whole


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
    """Exact response of r = rate·(p − p⁻¹)/(1+a) + (1−a)/(1+a) r⁻¹. (F, n)

    For τ_ext = e^{jωt}; its momentum is the continuous integral e^{jωt}/(jω), sampled.
    """
    omega = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64)[:, None]
    # At 0 Hz the quotient is 0/0; its limit is reached to the last digit long before.
    omega = np.where(omega == 0.0, 1e-9, omega)
    back = np.exp(-1j * omega * step)
    a = 0.5 * step * rate[None, :]
    response: Complex = rate * (1.0 - back) / ((1.0 + a) - (1.0 - a) * back) / (1j * omega)
    return response
