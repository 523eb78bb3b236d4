"""Filters without phase shift on clocks that may be uneven, the noise they pass, spectra.

The filters are SciPy's `butter` and `sosfiltfilt` to rounding, by `steady_filter`: importing
`scipy.signal` takes longer than all that a log of a minute asks of them.

References:
    A. V. Oppenheim and R. W. Schafer, Discrete-Time Signal Processing, Section 7.2, 2010 (bilinear
    transformation);
    P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra",
    IEEE Trans. Audio Electroacoust. 15(2), 1967, for the averaging of segments.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Literal

import numpy as np

from vftcli.signals.arrays import Array, is_uniform
from vftcli.signals.errors import ClockError, ParameterError
from vftcli.signals.series import median_step, resample_columns
from vftcli.signals.steady_filter import steady_filter

#: Order of the Butterworth filter; run forwards and backwards it attenuates twice as much.
ORDER = 2
#: Order of one pass where what is behind the filter is differentiated: its noise above the cutoff
#: has to be gone.
STEEP = 4
Kind = Literal["lowpass", "bandpass"]  #: What a filter lets pass.
#: Steps that differ from their median by a larger share are resampled; a clock that jitters by less
#: is filtered as an even one.
UNEVEN = 0.05
#: Zeros of a band pass' section, at 0 and at half the sample rate, as a polynomial in z⁻¹.
BAND_ZEROS = np.array([1.0, 0.0, -1.0])
FREQUENCIES = 1024  #: Frequencies at which a filter's power is summed.
#: An even clock of more than so many times the log's samples would be filled with gaps alone.
MOSTLY_GAP = 100


def low_pass(
    t: Array, x: Array, cutoff: float, order: int = ORDER, settling: float | None = None
) -> Array:
    """Low-pass each column without phase shift. (T, n)

    A Butterworth filter runs forwards and backwards. On an uneven clock the signal is brought onto
    a uniform one of the median step and back by linear interpolation. A log too short for the
    filter's start-up is returned as it is.

    Args:
        t: Clock. (T,) [s]
        x: Signals, all finite. (T, n)
        cutoff: Frequency at which one pass loses 3 dB, both together 6 dB. [Hz]
        order: Order of one pass.
        settling: Length by which the ends are continued, mirrored about their value, for the
            filter to settle; None for the least that its order needs. [s]
    """
    return filter_columns(t, x, butterworth(median_step(t), cutoff, "lowpass", order), settling)


def zero_phase(t: Array, signals: Array, cutoff: float) -> Array:
    """The signals low-passed steeply and without delay, fit to be differentiated. (T, m)

    A clock too slow for the cutoff leaves them as they are.

    Args:
        t: Time. (T,) [s]
        signals: One column a signal. (T, m)
        cutoff: Frequency at which one pass loses 3 dB. [Hz]
    """
    if t[-1] - t[0] < 2.0 / cutoff:
        raise ClockError(
            f"{t[-1] - t[0]:.2f} s of log are too short for a {cutoff:g} Hz filter; "
            f"use a longer interval than {2.0 / cutoff:g} s"
        )
    if cutoff >= 0.45 / median_step(t):
        return signals
    return low_pass(t, signals, cutoff, order=STEEP, settling=3.0 / cutoff)


def derivative(t: Array, signals: Array) -> Array:
    """Central differences on the clock as it is, second order also where it is uneven. (T, m)"""
    return np.asarray(np.gradient(signals, t, axis=0, edge_order=2))


def band_pass(t: Array, x: Array, low: float, high: float) -> Array:
    """Keep the band from `low` to `high` [Hz] of each column, without phase shift. (T, n)"""
    return filter_columns(t, x, butterworth(median_step(t), (low, high), "bandpass"))


def filter_columns(t: Array, x: Array, sections: Array, settling: float | None = None) -> Array:
    """Columns behind second-order sections that run forwards and backwards along time. (T, n)"""
    step = median_step(t)
    if settling is not None:
        padding = int(settling / step)
    elif len(t) <= 3 * (2 * len(sections) + 1):
        return x.copy()
    else:
        ends = min(np.count_nonzero(sections[:, 2] == 0), np.count_nonzero(sections[:, 5] == 0))
        padding = 3 * (2 * len(sections) + 1 - int(ends))
    # A log keeps its own samples where it can: resampling is a filter too.
    even = is_uniform(t, tolerance=UNEVEN)
    clock = t if even else even_clock(t, step)
    padding = min(len(clock) - 1, padding)
    columns = x if even else resample_columns(clock, t, x)
    smooth = there_and_back(sections, columns, padding)
    return smooth if even else resample_columns(t, clock, smooth)


def there_and_back(sections: Array, x: Array, padding: int) -> Array:
    """Columns behind the sections, forwards and backwards, the ends mirrored about their value."""
    before, after = 2.0 * x[:1] - x[padding:0:-1], 2.0 * x[-1:] - x[-2 : -padding - 2 : -1]
    padded = np.concatenate([before, x, after])
    once = cascade(sections, padded)
    both = cascade(sections, once[::-1])[::-1]
    return both[padding : len(both) - padding].copy()


def cascade(sections: Array, x: Array) -> Array:
    """Columns behind one section after the other, each settled on its first input. (T, n)"""
    for b0, b1, b2, _, a1, a2 in sections.tolist():
        # y_t = z_{t−1} + b₀x_t with the state (z, z') of the transposed direct form.
        F = np.array([[-a1, 1.0], [-a2, 0.0]])
        g = np.array([b1 - a1 * b0, b2 - a2 * b0])
        settled = np.linalg.solve(np.eye(2) - F, g)[:, None] * x[0]
        n = x.shape[1]
        turned = np.repeat(F[:, :, None], n, axis=2), np.repeat(g[:, None], n, axis=1)
        state = steady_filter(*turned, x[:-1], settled, np.array([[1.0], [0.0]]))[0]
        x = b0 * x + np.concatenate([settled[:1], state])
    return x


def even_clock(t: Array, step: float) -> Array:
    """Instants about `step` [s] apart from a clock's first sample to its last. (K,) [s]"""
    samples = max(2, round(float(t[-1] - t[0]) / step) + 1)
    refuse_mostly_gap(t, step)
    return np.linspace(t[0], t[-1], samples)


def refuse_mostly_gap(t: Array, step: float) -> None:
    """Raise a ClockError if a clock of steps of about `step` [s] is nearly all gap. (T,) [s]"""
    if float(t[-1] - t[0]) > MOSTLY_GAP * len(t) * step:
        after = int(np.argmax(np.diff(t)))
        raise ClockError(
            f"the log waits {t[after + 1] - t[after]:.4g} s after t = {t[after]:.3f} s, over "
            f"{MOSTLY_GAP} times what it holds; take the part before or behind with --interval"
        )


def butterworth(
    step: float, cutoff: float | tuple[float, float], kind: Kind, order: int = ORDER
) -> Array:
    """Second-order sections of a Butterworth filter for a sample time. [s]"""
    if not (np.all(np.asarray(cutoff) > 0) and np.all(np.asarray(cutoff) < 0.5 / step)):
        raise ParameterError(
            f"a filter at {cutoff} Hz is not possible on a log of {1.0 / step:.4g} Hz; "
            f"choose a cutoff between 0 and {0.5 / step:.4g} Hz"
        )
    return designed(step, cutoff, kind, order).copy()


@lru_cache
def designed(step: float, cutoff: float | tuple[float, float], kind: Kind, order: int) -> Array:
    """Sections of a Butterworth filter of even order, by the bilinear transformation. (S, 6)

    Args:
        step: Sample time. [s]
        cutoff: One edge, or two of a band. [Hz]
        kind: "lowpass" or "bandpass".
        order: Order of the low pass, or of either side of the band.
    """
    edges = np.tan(np.pi * step * np.atleast_1d(cutoff))
    angles = np.pi * (np.arange(order // 2) + 0.5) / order
    poles = -np.sin(angles) + 1j * np.cos(angles)
    if kind == "lowpass":
        poles, zeros, gain = poles * edges[0], np.array([1.0, 2.0, 1.0]), edges[0] ** 2
    else:
        low, high = edges
        half = 0.5 * (high - low) * poles
        root = np.sqrt(half**2 - low * high)
        poles, zeros, gain = np.concatenate([half + root, half - root]), BAND_ZEROS, high - low
    # (s − p)(s − p*) with s = (1 − z⁻¹)/(1 + z⁻¹)
    power, double = np.abs(poles) ** 2, 2.0 * poles.real
    a = np.stack([1.0 - double + power, 2.0 * (power - 1.0), 1.0 + double + power], axis=1)
    return np.concatenate([gain * zeros / a[:, :1], a / a[:, :1]], axis=1)


@lru_cache
def noise_passed(
    step: float, cutoff: float | tuple[float, float], kind: Kind, slope: int = 0
) -> float:
    """Mean square of white noise of unit variance behind the filter, differentiated `slope` times.

    Args:
        step: Sample time. [s]
        cutoff: As for the filter. [Hz]
        kind: "lowpass" or "bandpass".
        slope: 0, or 1 for the central difference (x_{k+1} − x_{k−1})/2Ts behind the filter.
    """
    omega = np.pi * np.arange(FREQUENCIES) / FREQUENCIES
    delays = np.exp(-1j * np.outer(np.arange(3), omega))
    sections = butterworth(step, cutoff, kind)
    response = np.prod((sections[:, :3] @ delays) / (sections[:, 3:] @ delays), axis=0)
    # |H|² of one pass is the amplitude of both, so |H|⁴ is their power.
    gain = np.abs(response) ** 4
    if slope:
        gain = gain * (np.sin(omega) / step) ** 2
    return float(np.mean(gain))


def welch(stretches: Sequence[Array], size: int, step: float) -> tuple[Array, int]:
    """One-sided density, the mean over Hann-windowed, half overlapping segments, and their number.

    Nothing is detrended; the density at 0 Hz holds the square of the mean. Each stretch is
    mirrored at its ends by half a segment, so that its first and last samples count like all
    others: a free part is often no longer than a segment. A stretch counts by its length, one
    shorter than a segment also by how much of it is no mirror image: no sample that breaks a long
    one in two leaves others to speak for all.

    Args:
        stretches: Unbroken pieces on one uniform clock. (N, n) each
        size: Samples of a segment, even.
        step: Sample time. [s]

    Returns:
        The density at ``numpy.fft.rfftfreq(size, step)`` (size/2 + 1, n), in the square of the
        series' unit by Hz, and the number of segments.
    """
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(size) / size)
    joints = stretches[0].shape[1]
    power, count = np.zeros((joints, size // 2 + 1)), 0
    weights = [len(stretch) * min(1.0, len(stretch) / size) for stretch in stretches]
    for stretch, weight in zip(stretches, weights, strict=True):
        if not len(stretch):
            continue
        columns = np.pad(stretch, ((size // 2, size // 2), (0, 0)), mode="symmetric").T
        last = columns.shape[1] - size
        starts = np.linspace(0, last, 1 + -(-last // (size // 2))).astype(int)
        share = weight / (sum(weights) * len(starts))
        for first in starts:
            spectrum = np.fft.rfft(columns[:, first : first + size] * window)
            power += share * (spectrum.real**2 + spectrum.imag**2)
        count += len(starts)
    power *= 2.0 * step / float(np.sum(window**2))
    # The density is one-sided: every frequency stands for its negative too, but 0 and Nyquist's.
    power[:, [0, -1]] *= 0.5
    return np.ascontiguousarray(power.T), count
