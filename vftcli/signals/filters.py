"""Zero-phase filters on clocks that may be uneven, and how much white noise they let through."""

import numpy as np

from vftcli.signals.arrays import Array, is_uniform
from vftcli.signals.errors import ParameterError
from vftcli.signals.series import median_step, resampled

ORDER = 2
"""Order of the Butterworth filter; run forwards and backwards it attenuates twice as much."""


def low_pass(t: Array, x: Array, cutoff: float) -> Array:
    """Low-pass each column without phase shift. (T, n)

    On an uneven clock the signal is brought onto a uniform one of the median step and back by
    linear interpolation. A log too short for the filter's start-up is returned as it is.

    Args:
        t: Clock. (T,) [s]
        x: Signals, all finite. (T, n)
        cutoff: −6 dB frequency of the forward and backward pass together. [Hz]

    Raises:
        ParameterError: If the cutoff is not below half the sample rate.
    """
    return filtered(t, x, cutoff, "lowpass")


def band_pass(t: Array, x: Array, low: float, high: float) -> Array:
    """Keep the band from `low` to `high` [Hz] of each column, without phase shift. (T, n)"""
    return filtered(t, x, (low, high), "bandpass")


def filtered(t: Array, x: Array, cutoff: float | tuple[float, float], kind: str) -> Array:
    """Forward and backward Butterworth filter along time. (T, n)"""
    from scipy.signal import sosfiltfilt

    step = median_step(t)
    sos = design(step, cutoff, kind)
    if len(t) <= 3 * (2 * len(sos) + 1):
        return x.copy()
    if is_uniform(t, tolerance=0.05):
        result: Array = sosfiltfilt(sos, x, axis=0)
        return result
    even = np.arange(t[0], t[-1] + step, step)
    return resampled(t, even, sosfiltfilt(sos, resampled(even, t, x), axis=0))


def design(step: float, cutoff: float | tuple[float, float], kind: str) -> Array:
    """Second-order sections for a sample time. [s]

    Raises:
        ParameterError: If a cutoff is not between zero and half the sample rate.
    """
    from scipy.signal import butter

    if not (np.all(np.asarray(cutoff) > 0) and np.all(np.asarray(cutoff) < 0.5 / step)):
        raise ParameterError(
            f"a filter at {cutoff} Hz is not possible on a log of {1.0 / step:.4g} Hz; "
            f"choose a cutoff between 0 and {0.5 / step:.4g} Hz"
        )
    sos: Array = butter(ORDER, cutoff, kind, fs=1.0 / step, output="sos")
    return sos


def passed(step: float, cutoff: float | tuple[float, float], kind: str, slope: int = 0) -> float:
    """Mean square of white noise of unit variance behind the filter, differentiated `slope` times.

    Args:
        step: Sample time. [s]
        cutoff: As for the filter. [Hz]
        kind: "lowpass" or "bandpass".
        slope: 0, or 1 for the central difference (x_{k+1} − x_{k−1})/2Ts behind the filter.
    """
    from scipy.signal import sosfreqz

    omega, response = sosfreqz(design(step, cutoff, kind), 1024)
    gain = np.abs(response) ** 4
    if slope:
        gain = gain * (np.sin(omega) / step) ** 2
    return float(np.mean(gain))
