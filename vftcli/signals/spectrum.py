"""Power spectral density of what is known in pieces, by Welch's method.

References:
    P. D. Welch, "The use of fast Fourier transform for the estimation of power spectra",
    IEEE Trans. Audio Electroacoust. 15(2), 1967, for the averaging of segments.
"""

from collections.abc import Sequence

import numpy as np

from vftcli.signals.arrays import Array


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
