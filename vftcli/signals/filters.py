"""Filters without phase shift, also on uneven clocks; noise behind them; spectra.

They equal SciPy's `butter` and `sosfiltfilt` to rounding, by `steady_filter`: importing
`scipy.signal` takes longer than filtering a log of a minute.

References:
    A. V. Oppenheim, R. W. Schafer, Discrete-Time Signal Processing, 2010, Section 7.2, for
    the bilinear transformation;
    P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra",
    IEEE Trans. Audio Electroacoust. 15(2), 1967, for the averaging of segments.
"""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from vftcli.signals.arrays import Array, handed_over, is_uniform, median_step, resample_columns
from vftcli.signals.errors import ClockError, ParameterError
from vftcli.signals.steady_filter import steady_filter

#: Butterworth order; forwards and backwards it counts twice.
ORDER = 2
#: Order of a pass before differentiation: no noise may be left.
STEEP = 4
#: Clocks with steps off their median by a larger share are resampled, others count as even.
UNEVEN = 0.05
FREQUENCIES = 1024  #: Frequencies at which a filter's power is summed.
#: An even clock this many times the log would mostly be gaps.
MOSTLY_GAP = 100
#: Values that are filtered together: a filter's passes take five times their memory.
TOGETHER = 1 << 20


def low_pass(
    t: Array, x: Array, cutoff: float, order: int = ORDER, settling: float | None = None
) -> Array:
    """Low-pass each column without phase shift. (T, n)

    A Butterworth filter runs forwards and backwards; at its cutoff [Hz] each pass loses 3
    dB. The ends are continued by `settling` [s], None for the least that the order needs.
    A log too short for that is returned as it is.
    """
    return filter_columns(t, x, butterworth(median_step(t), cutoff, order), settling)


def zero_phase(t: Array, signals: Array, cutoff: float) -> Array:
    """The signals low-passed steeply, without delay, to be differentiated. (T, m)

    At the cutoff [Hz] each pass loses 3 dB. A clock too slow for it leaves them as they are.
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
    """Central differences, of second order also on uneven clocks. (T, m)"""
    return np.gradient(signals, t, axis=0, edge_order=2 if len(t) > 2 else 1)


def band_pass(t: Array, x: Array, low: float, high: float) -> Array:
    """The band from `low` to `high` [Hz] of each column, without delay. (T, n)"""
    return filter_columns(t, x, butterworth(median_step(t), (low, high)))


def filter_columns(t: Array, x: Array, sections: Array, settling: float | None = None) -> Array:
    """Columns behind sections that run forwards and backwards. (T, n)"""
    step, least = median_step(t), 3 * (2 * len(sections) + 1)
    if settling is None and len(t) <= least:
        return x.copy()
    padding = least if settling is None else int(settling / step)
    # A log keeps its own samples where it can: resampling is a filter too.
    even = is_uniform(t, tolerance=UNEVEN)
    if not even:
        refuse_mostly_gap(t, step)
        clock = np.linspace(t[0], t[-1], max(2, round((t[-1] - t[0]) / step) + 1))
        x = resample_columns(clock, t, x)
    padding, smooth = min(len(x) - 1, padding), np.empty(x.shape)
    together = max(1, TOGETHER // len(x))
    for first in range(0, x.shape[1], together):
        own = x[:, first : first + together]
        # The ends are mirrored about their value.
        ends = ((padding, padding), (0, 0))
        once = cascade(sections, np.pad(own, ends, mode="reflect", reflect_type="odd"))
        both = cascade(sections, once[::-1])[::-1]
        smooth[:, first : first + together] = both[padding : len(both) - padding]
    return smooth if even else resample_columns(t, clock, smooth)


def cascade(sections: Array, x: Array) -> Array:
    """Columns behind all sections, settled on their first input. (T, n)"""
    # y_t = c·z_{t−1} + b x_t, z_t = F z_{t−1} + g x_t: transposed direct forms in series.
    F, g, c, b = np.zeros((0, 0)), np.zeros(0), np.zeros(0), 1.0
    for b0, b1, b2, _, a1, a2 in sections.tolist():
        own, into = np.array([[-a1, 1.0], [-a2, 0.0]]), np.array([b1 - a1 * b0, b2 - a2 * b0])
        F = np.block([[F, np.zeros((len(c), 2))], [np.outer(into, c), own]])
        g, c, b = np.append(g, into * b), np.append(b0 * c, [1.0, 0.0]), b0 * b
    settled = np.linalg.solve(np.eye(len(g)) - F, g)[:, None] * x[0]
    n = x.shape[1]
    each = F[:, :, None].repeat(n, axis=2), g[:, None].repeat(n, axis=1)
    states = steady_filter(*each, x[:-1], settled, c[:, None])[0]
    y: Array = b * x
    y[:1] += c @ settled
    y[1:] += states
    return y


def refuse_mostly_gap(t: Array, step: float) -> None:
    """Raise a ClockError if a clock of some step [s] is nearly all gap."""
    if (t[-1] - t[0]) > MOSTLY_GAP * len(t) * step:
        after = int(np.diff(t).argmax())
        raise ClockError(
            f"the log waits {t[after + 1] - t[after]:.4g} s after t = {t[after]:.3f} s, over "
            f"{MOSTLY_GAP} times what it holds; take the part before or behind with --interval"
        )


@lru_cache
def butterworth(step: float, cutoff: float | tuple[float, float], order: int = ORDER) -> Array:
    """Sections of a Butterworth low pass, or of a band pass' two edges [Hz]. (S, 6)"""
    if not (np.all(np.asarray(cutoff) > 0) and np.all(np.asarray(cutoff) < 0.5 / step)):
        raise ParameterError(
            f"a filter at {cutoff} Hz is not possible on a log of {1.0 / step:.4g} Hz; "
            f"choose a cutoff between 0 and {0.5 / step:.4g} Hz"
        )
    edges = np.tan(np.pi * step * np.atleast_1d(cutoff))
    angles = np.pi * (np.arange(order // 2) + 0.5) / order
    poles = -np.sin(angles) + 1j * np.cos(angles)
    if len(edges) == 1:
        poles, zeros, gain = poles * edges[0], np.array([1.0, 2.0, 1.0]), edges[0] ** 2
    else:
        low, high = edges
        half = 0.5 * (high - low) * poles
        root = np.sqrt(half**2 - low * high)
        poles = np.concatenate([half + root, half - root])
        zeros, gain = np.array([1.0, 0.0, -1.0]), high - low  # zeros at 0 and half the rate
    # (s − p)(s − p*) with s = (1 − z⁻¹)/(1 + z⁻¹)
    power, double = abs(poles) ** 2, 2.0 * poles.real
    a = np.stack([1.0 - double + power, 2.0 * (power - 1.0), 1.0 + double + power], axis=1)
    return handed_over(np.concatenate([gain * zeros / a[:, :1], a / a[:, :1]], axis=1))


@lru_cache
def noise_passed(step: float, cutoff: float | tuple[float, float], slope: int = 0) -> float:
    """Mean square of white noise of unit variance behind `butterworth`, run both ways.

    With `slope` = 1 the central difference (x_{k+1} − x_{k−1})/2Ts follows the filter.
    """
    omega = np.pi * np.arange(FREQUENCIES) / FREQUENCIES
    delays = np.exp(-1j * np.outer(np.arange(3), omega))
    sections = butterworth(step, cutoff)
    response = np.prod((sections[:, :3] @ delays) / (sections[:, 3:] @ delays), axis=0)
    # |H|² of one pass is the amplitude of both, so |H|⁴ is their power.
    gain = abs(response) ** 4
    if slope:
        gain = gain * (np.sin(omega) / step) ** 2
    return float(gain.mean())


def welch(stretches: Sequence[Array], size: int, step: float) -> tuple[Array, int]:
    """One-sided density, the mean over Hann-windowed segments, and their number.

    Nothing is detrended. Each unbroken stretch (N, n) is mirrored at its ends by half a
    segment of `size` samples (even), so that its first and last samples count like all
    others. It counts by its length, one shorter than a
    segment also by its share that is no mirror image. The density at
    ``numpy.fft.rfftfreq(size, step)`` is by Hz. (size/2 + 1, n)
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
    power *= 2.0 * step / np.sum(window**2)
    # One-sided: every frequency but 0 and Nyquist's counts twice.
    power[:, [0, -1]] *= 0.5
    return np.ascontiguousarray(power.T), count
