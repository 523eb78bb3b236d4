"""Zero-phase filters: SciPy's own on an even clock, no delay on any, the noise they let through."""

import numpy as np
import pytest
from scipy import signal
from scipy.signal import butter, sosfiltfilt

from vftcli.signals.errors import ClockError, ParameterError
from vftcli.signals.filters import (
    band_pass,
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
    band = butter(2, [0.05, 5.0], "bandpass", fs=100.0, output="sos")
    # a pole at .05 Hz settles slowly and keeps a digit less
    found = sosfiltfilt(band, x + 7.0, axis=0, padlen=15)
    np.testing.assert_allclose(band_pass(t, x + 7.0, 0.05, 5.0), found, atol=1e-9)


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
    with pytest.raises(ParameterError, match="log of 100 Hz; choose a cutoff between 0 and 50 H"):
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
    steep = low_pass(t, x, 6.0, order=4, settling=0.5)
    np.testing.assert_array_equal(zero_phase(t, x, 6.0), steep)
    np.testing.assert_array_equal(zero_phase(10.0 * t, x, 6.0), x)
    with pytest.raises(ClockError, match=r"0\.19 s of log are too short for a 6 Hz filter"):
        zero_phase(t[:20], x[:20], 6.0)


def test_differences_are_of_second_order_on_uneven_clocks_too() -> None:
    t = np.cumsum(RNG.uniform(0.5, 1.5, 50))
    # a parabola's slope is exact, at the ends too: rounding of numbers up to 2500
    np.testing.assert_allclose(derivative(t, t[:, None] ** 2)[:, 0], 2.0 * t, rtol=1e-10)


@pytest.mark.parametrize("samples", [200, 300, 1000])
def test_the_density_is_scipy_s_of_a_mirrored_stretch(samples: int) -> None:
    """Ends are mirrored by half a segment, so that first and last samples count like all others."""
    x = 2.0 + RNG.standard_normal((samples, 2))
    mirrored = np.vstack([x[99::-1], x, x[: samples - 101 : -1]])
    kind = {"window": "hann", "nperseg": 200, "noverlap": 100, "detrend": False}
    _, expected = signal.welch(mirrored, 100.0, axis=0, **kind)
    power, count = welch([x], 200, 0.01)
    np.testing.assert_allclose(power, expected, rtol=1e-9)
    assert count == samples // 100 + 1


def test_a_stretch_counts_by_its_length_and_by_what_it_fills_of_a_segment() -> None:
    """One bad sample in the longest stretch left all to the next longest, a fifth as loud."""
    stretches = [5.0 * RNG.standard_normal((n, 1)) for n in (100, 109, 205, 0)]
    alone = [welch([stretch], 200, 0.01) for stretch in stretches[:3]]
    weights = np.array([100 * 0.5, 109 * 0.545, 205])
    expected = np.tensordot(weights / weights.sum(), [power for power, _ in alone], 1)
    power, count = welch(stretches, 200, 0.01)
    np.testing.assert_allclose(power, expected, rtol=1e-12)
    assert count == sum(segments for _, segments in alone)
