"""Welch's density: white noise, a sine and a constant of known power."""

import numpy as np
import pytest

from vftcli.signals.spectrum import welch

STEP = 0.01
SIZE = 200


def density(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    power, _ = welch([x[:, None]], SIZE, STEP)
    return np.fft.rfftfreq(SIZE, STEP), power[:, 0]


def test_white_noise_has_twice_its_variance_by_the_rate() -> None:
    sigma = 3.0
    x = sigma * np.random.default_rng(1).standard_normal(100_000)
    _, power = density(x)
    inner = power[2:-2]  # Hann spreads the bins at the ends, which are counted once
    # 1000 segments, half overlapping: each bin to 4 %, the mean over 97 bins to .5 %
    assert np.mean(inner) == pytest.approx(2.0 * sigma**2 * STEP, rel=0.02)
    assert inner == pytest.approx(2.0 * sigma**2 * STEP, rel=0.25)  # six of those 4 %


def test_the_integral_is_the_mean_square() -> None:
    """Parseval over the one-sided density, DC and Nyquist counted once: of noise and of a mean."""
    x = 2.0 + np.random.default_rng(2).standard_normal(50_000)
    frequency, power = density(x)
    # the sampling error of a mean square of 50 000 samples is .6 %
    assert np.sum(power) * frequency[1] == pytest.approx(np.mean(x**2), rel=0.02)


def test_a_constant_stays_at_the_two_lowest_frequencies() -> None:
    frequency, power = density(np.full(5000, 2.0))
    assert np.sum(power[:2]) * frequency[1] == pytest.approx(4.0, rel=1e-9)
    assert np.all(power[2:] < 1e-20)


def test_a_sine_has_half_its_squared_amplitude() -> None:
    t = STEP * np.arange(20_000)
    frequency, power = density(3.0 * np.sin(2.0 * np.pi * 10.0 * t))
    assert frequency[np.argmax(power)] == pytest.approx(10.0)
    # the mirrored ends put a kink into one segment of two hundred
    assert np.sum(power) * frequency[1] == pytest.approx(4.5, rel=0.01)


def test_the_first_and_last_samples_count_like_all_others() -> None:
    """An impulse weighs the same wherever it stands; Hann alone would lose it at the ends."""
    sizes = []
    for place in (0, 1, 250, 499):
        x = np.zeros(500)
        x[place] = 1.0
        sizes.append(np.sum(density(x)[1]))
    # a mirrored end doubles the sample but halves its segment's share of the window
    assert max(sizes) / min(sizes) < 4.0
    assert min(sizes) > 0.0


def test_a_stretch_counts_by_its_length_and_by_what_it_fills_of_a_segment() -> None:
    """White noise of 1 and of 3: 1000 samples, and five times 100 that fill half a segment."""
    rng = np.random.default_rng(3)
    quiet, loud = rng.standard_normal((1000, 1)), 3.0 * rng.standard_normal((5, SIZE // 2, 1))
    power, count = welch([quiet, *loud], SIZE, STEP)
    mean = (1000 * np.mean(quiet**2) + 250 * np.mean(loud**2)) / 1250
    # Hann's window weighs chance: a tenth of the variance of some hundred samples
    assert np.sum(power) / (SIZE * STEP) == pytest.approx(mean, rel=0.1)
    # mirrored by half a segment at either end, in steps of 100: 11 segments of 1200 samples, and
    # two of each 300
    assert count == 11 + 5 * 2


def test_a_stretch_that_breaks_in_two_still_speaks() -> None:
    """One bad sample in the longest stretch left all to the next longest, a fifth as loud."""
    rng = np.random.default_rng(3)
    loud, quiet = 5.0 * rng.standard_normal((SIZE + 10, 1)), rng.standard_normal((SIZE + 5, 1))
    broken, _ = welch([loud[:100], loud[101:], quiet], SIZE, STEP)
    halves = 100 * 0.5 + 109 * 0.545
    mean = (halves * np.mean(loud**2) + len(quiet) * np.mean(quiet**2)) / (halves + len(quiet))
    # Hann's window weighs chance: a tenth of the variance of some hundred samples
    assert np.sum(broken) / (SIZE * STEP) == pytest.approx(mean, rel=0.1)
