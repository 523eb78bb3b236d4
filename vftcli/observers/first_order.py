"""What the two first-order observers share: sample times, restarts, and what a gain means."""

import numpy as np

from vftcli.arrays import Array
from vftcli.observers.observer import Complex, Tuning
from vftcli.observers.recursion import Steps


def half_steps(rate: Array, steps: Steps) -> Array:
    """Return a = rate·Ts/2: constant (1, n) on a uniform clock, else one a sample. (T, n)"""
    dt = np.array([steps.median]) if steps.uniform else steps.dt
    half: Array = 0.5 * dt[:, None] * rate[None, :]
    return half


def restarts(a: Array, rate: Array, steps: Steps) -> tuple[Array, tuple[str, ...]]:
    """Where a gap is so long (a > 1) that the filter would turn its state's sign. (T, n), notes.

    There the filter starts afresh from zero. Gains that give a > 1 at the nominal sample time are
    the user's own choice and restart nothing.
    """
    nominal = 0.5 * steps.median * rate
    if steps.uniform:
        return np.zeros((0, 0)), ()
    where = (a > 1.0) & (nominal <= 1.0)[None, :]
    count = int(np.count_nonzero(where.any(axis=1)))
    if count == 0:
        return np.zeros((0, 0)), ()
    longest = float(np.max(steps.dt))
    note = (
        f"restarted from zero after {count} gap{'s' if count > 1 else ''} "
        f"(longest {longest:.3g} s), too long for its gain"
    )
    return where.astype(np.float64), (note,)


def first_order_tuning(rate: Array, step: float, numbers: int) -> Tuning:
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
        numbers=numbers,
    )


def first_order_response(rate: Array, frequency: Array, step: float) -> Complex:
    """Exact response to τ_ext = e^{jωt} of r = rate·(p − p⁻¹)/(1+a) + (1−a)/(1+a) r⁻¹. (F, n)

    The momentum is the continuous integral e^{jωt}/(jω), sampled.
    """
    omega = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64)[:, None]
    omega = np.where(omega == 0.0, 1e-9, omega)
    back = np.exp(-1j * omega * step)
    a = 0.5 * step * rate[None, :]
    response: Complex = rate * (1.0 - back) / ((1.0 + a) - (1.0 - a) * back) / (1j * omega)
    return response
