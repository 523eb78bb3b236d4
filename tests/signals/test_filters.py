"""Zero-phase filters: SciPy's own on an even clock, no delay on any, the noise they let through."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from vftcli.signals.errors import ClockError, ParameterError
from vftcli.signals.filters import (
    band_pass,
    butterworth,
    derivative,
    low_pass,
    noise_passed,
    welch,
    zero_phase,
)

RNG = np.random.default_rng(4)


def test_an_even_clock_is_filtered_as_it_is() -> None:
    t = 0.01 * np.arange(500)
    x = RNG.standard_normal((500, 2))
    expected = sosfiltfilt(butter(2, 5.0, fs=100.0, output="sos"), x, axis=0)
    # the median of rounded steps is the step to 1e-14 of it
    np.testing.assert_allclose(low_pass(t, x, 5.0), expected, atol=1e-10)
    steep = sosfiltfilt(butter(4, 5.0, fs=100.0, output="sos"), x, axis=0, padlen=60)
    np.testing.assert_allclose(low_pass(t, x, 5.0, order=4, settling=0.6001), steep, atol=1e-10)
    # Of a log shorter than what it settles in, all but one sample are mirrored.
    short = sosfiltfilt(butter(4, 5.0, fs=100.0, output="sos"), x[:50], axis=0, padlen=49)
    np.testing.assert_allclose(low_pass(t[:50], x[:50], 5.0, 4, 0.6001), short, atol=1e-10)


def test_a_slow_wave_passes_without_delay_on_an_uneven_clock() -> None:
    t = np.cumsum(RNG.uniform(0.004, 0.012, 2000))
    wave = np.sin(2.0 * np.pi * 0.5 * t)[:, None]
    inner = slice(200, -200)  # away from the ends
    # (0.5/5)⁴ of the amplitude is what two second-order passes take; interpolation less
    np.testing.assert_allclose(low_pass(t, wave, 5.0)[inner], wave[inner], atol=1e-3)
    # Two passes of the band's lower edge take its level away and leave 1/(1 + (0.05/0.5)⁴) of it;
    # its start-up of 1/0.05 s reaches beyond the ends, so all of it is looked at in the mean.
    band = band_pass(t, wave + 7.0, 0.05, 5.0)
    assert np.sum(band * wave) / np.sum(wave**2) == pytest.approx(1.0, abs=0.05)
    assert abs(np.mean(band)) < 0.1


def test_a_ramp_keeps_its_ends_on_an_uneven_clock() -> None:
    """The clock it is filtered on ends with the log; one sample more held the last value."""
    t = np.cumsum(RNG.uniform(0.004, 0.012, 1001))
    ramp = 100.0 * t[:, None]
    # Mirrored about its end a straight line goes on straight, long enough for the filter to settle:
    # e^(−2π·5·0.7·1) of the slope is left.
    np.testing.assert_allclose(low_pass(t, ramp, 5.0, settling=1.0), ramp, atol=1e-6)
    # A clock may begin anywhere: its stamps round to 1e-13 s there, by which noise moves less.
    noise = RNG.standard_normal(ramp.shape)
    np.testing.assert_allclose(low_pass(t + 512, noise, 5.0), low_pass(t, noise, 5.0), atol=1e-9)


def test_both_passes_together_lose_six_decibels_at_the_cutoff() -> None:
    t = 0.002 * np.arange(20_000)
    wave = np.sin(2.0 * np.pi * 5.0 * t)[:, None]
    inner = slice(2000, -2000)
    gain = np.std(low_pass(t, wave, 5.0)[inner]) / np.std(wave[inner])
    assert gain == pytest.approx(0.5, rel=1e-3)  # 160 periods


@pytest.mark.parametrize("slope", [0, 1])
def test_white_noise_behind_the_filter(slope: int) -> None:
    step, cutoff = 0.01, 10.0
    t = step * np.arange(40_000)
    smooth = low_pass(t, RNG.standard_normal((len(t), 4)), cutoff)
    if slope:
        smooth = (smooth[2:] - smooth[:-2]) / (2.0 * step)
    # 4 × 40 000 samples at a fifth of the band: some 10⁴ independent ones, 1 % of their square
    assert np.mean(smooth**2) == pytest.approx(noise_passed(step, cutoff, slope), rel=0.05)


def test_a_log_too_short_for_the_start_up_is_left_alone() -> None:
    t = 0.01 * np.arange(9)
    x = RNG.standard_normal((9, 1))
    assert np.array_equal(low_pass(t, x, 5.0), x)
    assert not np.array_equal(low_pass(0.01 * np.arange(10), np.vstack([x, x[:1]]), 5.0)[:9], x)


@pytest.mark.parametrize("cutoff", [0.0, 50.0, 70.0])
def test_a_cutoff_beyond_half_the_rate_is_refused(cutoff: float) -> None:
    t = 0.01 * np.arange(100)
    with pytest.raises(
        ParameterError, match="log of 100 Hz; choose a cutoff between 0 and 50 Hz"
    ):
        low_pass(t, np.zeros((100, 1)), cutoff)


def test_a_log_that_is_nearly_all_gap_is_refused_and_reported_where_it_waits() -> None:
    t = 0.01 * np.arange(200)
    t[100:] += 1e6
    with pytest.raises(ClockError, match=r"waits 1e\+06 s after t = 0.990 s"):
        low_pass(t, np.zeros((200, 1)), 5.0)
    t[100:] -= 1e6 - 10.0  # a pause of five times the log is filled
    assert low_pass(t, np.ones((200, 1)), 5.0) == pytest.approx(np.ones((200, 1)))


def test_what_is_differentiated_goes_through_a_steep_filter() -> None:
    """Order 4 a pass, three periods of the cutoff to settle; a slow clock leaves it as it is."""
    t = 0.01 * np.arange(500)
    x = RNG.standard_normal((500, 2))
    np.testing.assert_array_equal(
        zero_phase(t, x, 6.0), low_pass(t, x, 6.0, order=4, settling=0.5)
    )
    np.testing.assert_array_equal(zero_phase(10.0 * t, x, 6.0), x)
    with pytest.raises(ClockError, match=r"0\.19 s of log are too short for a 6 Hz filter"):
        zero_phase(t[:20], x[:20], 6.0)


def test_differences_are_of_second_order_on_uneven_clocks_too() -> None:
    t = np.cumsum(RNG.uniform(0.5, 1.5, 50))
    # a parabola's slope is exact, at the ends too: rounding of numbers up to 2500
    np.testing.assert_allclose(derivative(t, t[:, None] ** 2)[:, 0], 2.0 * t, rtol=1e-10)


def test_a_filter_that_is_designed_once_is_nobody_s_to_change() -> None:
    with pytest.raises(ValueError, match="read-only"):
        butterworth(0.01, 5.0)[:] = 0.0


STEP = 0.01
SIZE = 200


def density(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    power, _ = welch([x[:, None]], SIZE, STEP)
    return np.fft.rfftfreq(SIZE, STEP), power[:, 0]


def test_white_noise_has_twice_its_variance_by_the_rate() -> None:
    sigma = 3.0
    x = sigma * np.random.default_rng(1).standard_normal(100_000)
    _, power = density(x)
    inner, ends = power[1:-1], power[[0, -1]]
    # 1000 segments, half overlapping: each bin to 4 %, the mean over 97 bins to .5 %
    assert np.mean(inner) == pytest.approx(2.0 * sigma**2 * STEP, rel=0.02)
    assert inner == pytest.approx(2.0 * sigma**2 * STEP, rel=0.25)  # six of those 4 %
    assert ends == pytest.approx(sigma**2 * STEP, rel=0.35)  # counted once; √2 times the scatter


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
