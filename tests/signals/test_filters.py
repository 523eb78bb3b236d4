"""Zero-phase filters: SciPy's own on an even clock, no delay on any, the noise they let through."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from vftcli.signals.errors import ClockError, ParameterError
from vftcli.signals.filters import (
    band_pass,
    butterworth,
    derivative,
    even_clock,
    low_pass,
    noise_passed,
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
    assert np.mean(smooth**2) == pytest.approx(
        noise_passed(step, cutoff, "lowpass", slope), rel=0.05
    )


def test_a_log_too_short_for_the_start_up_is_left_alone() -> None:
    t = 0.01 * np.arange(9)
    x = RNG.standard_normal((9, 1))
    assert np.array_equal(low_pass(t, x, 5.0), x)
    assert not np.array_equal(low_pass(0.01 * np.arange(10), np.vstack([x, x[:1]]), 5.0)[:9], x)


@pytest.mark.parametrize("cutoff", [0.0, 50.0, 70.0])
def test_a_cutoff_beyond_half_the_rate_is_refused(cutoff: float) -> None:
    t = 0.01 * np.arange(100)
    with pytest.raises(ParameterError, match="choose a cutoff between 0 and 50 Hz"):
        low_pass(t, np.zeros((100, 1)), cutoff)


def test_an_even_clock_keeps_both_ends() -> None:
    t = np.cumsum(RNG.uniform(0.5, 1.5, 50))
    clock = even_clock(t, 1.0)
    assert (clock[0], clock[-1]) == (t[0], t[-1])
    assert np.ptp(np.diff(clock)) < 1e-9
    assert abs(np.diff(clock)[0] - 1.0) < 0.5 / len(clock) * 2


def test_a_log_that_is_nearly_all_gap_is_refused_and_told_where_it_waits() -> None:
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
    np.testing.assert_array_equal(zero_phase(t, x, 6.0), low_pass(t, x, 6.0, order=4, settling=0.5))
    np.testing.assert_array_equal(zero_phase(10.0 * t, x, 6.0), x)
    with pytest.raises(ClockError, match=r"0\.19 s of log are too short for a 6 Hz filter"):
        zero_phase(t[:20], x[:20], 6.0)


def test_differences_are_of_second_order_on_uneven_clocks_too() -> None:
    t = np.cumsum(RNG.uniform(0.5, 1.5, 50))
    # a parabola's slope is exact, at the ends too: rounding of numbers up to 2500
    np.testing.assert_allclose(derivative(t, t[:, None] ** 2)[:, 0], 2.0 * t, rtol=1e-10)


def test_a_filter_that_is_designed_once_is_nobody_s_to_change() -> None:
    first = butterworth(0.01, 5.0, "lowpass")
    first[:] = 0.0
    assert butterworth(0.01, 5.0, "lowpass").any()
