"""Zero-phase filtering on uneven clocks."""

import numpy as np
import pytest

from vftcli.identification.processing import derivative, zero_phase
from vftcli.signals.errors import ClockError


def uneven(seed, duration=20.0, step=0.01):
    """A clock of 10 ms median whose steps vary between 5 and 15 ms."""
    steps = np.random.default_rng(seed).uniform(0.5, 1.5, int(duration / step)) * step
    return np.concatenate([[0.0], np.cumsum(steps)])


@pytest.mark.parametrize("t", [np.arange(0, 20, 0.01), uneven(0)], ids=["even", "uneven"])
def test_a_slow_sine_passes_without_delay(t):
    wave = np.sin(2 * np.pi * 0.5 * t)[:, None]
    inner = (t > 1.0) & (t < t[-1] - 1.0)
    # linear interpolation between 10 ms samples errs by (ω·dt)²/8 = 1.2e-4, twice
    np.testing.assert_allclose(zero_phase(t, wave, 8.0)[inner], wave[inner], atol=5e-4)


def test_the_cutoff_halves_the_power_twice():
    t = np.arange(0, 20, 0.002)
    wave = np.sin(2 * np.pi * 8.0 * t)[:, None]
    inner = slice(1000, -1000)
    gain = np.std(zero_phase(t, wave, 8.0)[inner]) / np.std(wave[inner])
    # −3 dB forwards and −3 dB backwards; the bilinear transform is prewarped at the cutoff
    assert gain == pytest.approx(0.5, abs=2e-3)


def test_fast_noise_is_removed():
    t = uneven(1)
    noise = np.random.default_rng(2).normal(size=(len(t), 2))
    # white noise keeps the share of its band: 8 of 50 Hz, √0.16 = 0.4, less by interpolation
    assert np.all(np.std(zero_phase(t, noise, 8.0), axis=0) < 0.42)


def test_a_log_slower_than_the_cutoff_stays_as_it_is():
    t = np.arange(0, 10, 0.1)
    wave = np.sin(t)[:, None]
    assert np.array_equal(zero_phase(t, wave, 8.0), wave)


def test_too_short_a_log_is_refused():
    with pytest.raises(ClockError, match="too short for a 8 Hz filter"):
        zero_phase(np.arange(0, 0.1, 0.01), np.zeros((10, 1)), 8.0)


def test_the_derivative_of_a_parabola_is_exact_on_an_uneven_clock():
    t = uneven(3)
    # second-order differences are exact for parabolas; rounding is 1e-16·400/dt
    np.testing.assert_allclose(derivative(t, (t**2)[:, None])[:, 0], 2 * t, atol=1e-9)
