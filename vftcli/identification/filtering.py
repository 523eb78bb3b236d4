"""Zero-phase filtering and differentiation on a log's own, uneven clock."""

import numpy as np

from vftcli.signals.arrays import Array, is_uniform
from vftcli.signals.errors import ClockError
from vftcli.signals.series import median_step, resampled

ORDER = 4
"""Order of the Butterworth low-pass, run forwards and backwards (so its roll-off counts twice)."""


def even_clock(t: Array) -> Array:
    """Instants at the clock's median step, from its first sample to its last. (K,) [s]"""
    step = median_step(t)
    count = max(2, round(float(t[-1] - t[0]) / step) + 1)
    return np.linspace(t[0], t[-1], count)


def zero_phase(t: Array, signals: Array, cutoff: float) -> Array:
    """Low-pass without delay: Butterworth forwards and backwards. Like `signals`

    On an uneven clock the signal is interpolated to its median step, filtered there, and read off
    at its own instants again. A clock too slow for the cutoff leaves the signal as it is.

    Args:
        t: Time. (T,) [s]
        signals: One column a signal. (T, m)
        cutoff: Frequency at which one pass loses 3 dB. [Hz]

    Raises:
        ClockError: If the log is shorter than two periods of the cutoff.
    """
    from scipy.signal import butter, sosfiltfilt

    if t[-1] - t[0] < 2.0 / cutoff:
        raise ClockError(
            f"{t[-1] - t[0]:.2f} s of log are too short for a {cutoff:g} Hz filter; "
            f"use a longer interval than {2.0 / cutoff:g} s"
        )
    rate = 1.0 / median_step(t)
    if cutoff >= 0.45 * rate:
        return signals
    sections = butter(ORDER, cutoff, fs=rate, output="sos")
    even = is_uniform(t, 1e-3)
    grid = t if even else even_clock(t)
    columns = signals if even else resampled(grid, t, signals)
    padding = min(len(grid) - 1, int(3 * rate / cutoff))
    smooth = sosfiltfilt(sections, columns, axis=0, padlen=padding)
    return np.asarray(smooth if even else resampled(t, grid, smooth))


def derivative(t: Array, signals: Array) -> Array:
    """Central differences on the clock as it is, second order also where it is uneven. (T, m)"""
    return np.asarray(np.gradient(signals, t, axis=0, edge_order=2))
