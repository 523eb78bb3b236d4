"""Spectra of the raw disturbance: known densities, gaps, and the error they predict."""

from dataclasses import replace

import numpy as np
import pytest
from made_runs import samples_of
from made_terms import momentum_of

from vftcli.observers.spectra import (
    ENOUGH,
    UNSEEN,
    FreeError,
    Spectra,
    error_band,
    free_error,
    looks_free,
    neighbour_mean,
    spectra_of,
)
from vftcli.robots.friction import HELD
from vftcli.robots.terms import raw_disturbance
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import DynamicsTerms

STEP = 0.008


def test_spectra_hold_the_mean_square_and_the_mean():
    """Parseval: the density summed over frequency is the power, a constant's included."""
    t = STEP * np.arange(4000)
    torque = 2.0 + np.random.default_rng(5).normal(0.0, 0.5, (4000, 2))
    terms = momentum_of(t, torque)
    half = np.arange(4000) < 2000
    found = spectra_of(samples_of(terms, ~half), [samples_of(terms, half)])
    power = found.free.sum(axis=0) * found.width
    d = raw_disturbance(terms)[: 2000 - 1]
    # the window weighs samples unevenly: 8 segments of noise of variance 0.12 on a mean of 2
    np.testing.assert_allclose(power, np.mean(d**2, axis=0), rtol=0.03)


def test_white_noise_has_a_flat_spectrum_of_the_known_height():
    """One-sided density of white d with variance s² is 2s²Ts."""
    rng = np.random.default_rng(7)
    t = STEP * np.arange(40_000)
    d = rng.normal(0.0, 0.4, (40_000, 1))
    p = np.cumsum(STEP * d, axis=0)
    terms = DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))
    half = np.arange(len(t)) < len(t) // 2
    found = spectra_of(samples_of(terms, ~half), [samples_of(terms, half)])
    # about 80 half-overlapping segments: each bin to 15 %, their mean over 240 bins to 1 %
    assert np.mean(found.free[2:-2]) == pytest.approx(2 * 0.16 * STEP, rel=0.02)
    # free and loaded are alike, so hardly anything is external
    assert found.external.sum() < 0.1 * found.loaded.sum()


def test_a_part_too_short_for_a_spectrum_is_refused():
    terms = momentum_of(STEP * np.arange(100), np.zeros((100, 1)))
    few = np.arange(100) < 20
    with pytest.raises(ParameterError, match="needs 32 samples in a row; the loaded part has 99"):
        spectra_of(samples_of(terms, ~few), [samples_of(terms, few)])


def test_no_segment_reaches_across_a_gap():
    t = np.concatenate([STEP * np.arange(60), 10.0 + STEP * np.arange(25)])
    t += np.random.default_rng(0).uniform(0, 1e-4, len(t))
    terms = momentum_of(t, np.ones((85, 1)))
    few = np.arange(85) >= 60
    with pytest.raises(ParameterError, match=r"free part 2[34]"):
        spectra_of(samples_of(terms, ~few), [samples_of(terms, few)])


def flat_spectra(free: float = 1.0, loaded: float = 3.0) -> Spectra:
    """Eleven bins of .5 Hz, of one density each: so slow that nothing is capped."""
    quiet, loud = (np.full((11, 1), density) for density in (free, loaded))
    f = np.linspace(0.0, 5.0, 11)
    return Spectra(frequency=f, free=quiet, loaded=loud, step=0.05, segments=(1, 1))


@pytest.mark.parametrize(
    ("response", "missed", "passed"),
    [
        (0.5, 0.25, 0.25),
        (1j, 2.0, 1.0),
        (-1.0, 4.0, 1.0),
        (2.0, 1.0, 4.0),
        (0.6 + 0.8j, 0.8, 1.0),
    ],
)
def test_power_goes_with_the_square_of_the_complex_response(response, missed, passed):
    """|1 − H|² of S_τ = 2 and |H|² of S_n = 1 over 5.5 Hz; a delay turns H without changing |H|."""
    spectra, H = flat_spectra(), np.full((11, 1), response, complex)
    assert spectra.missed(H)[0] == pytest.approx(11.0 * missed)
    assert spectra.passed(H)[0] == pytest.approx(5.5 * passed)
    # less than the free part is no external torque
    assert not flat_spectra(free=3.0, loaded=1.0).external.any()


def chattering() -> Spectra:
    """S_n = 1; the loaded part has 2 more, at all frequencies up to 50 Hz."""
    f = np.linspace(0.0, 50.0, 201)[:, None]
    free = np.ones_like(f)
    return Spectra(frequency=f[:, 0], free=free, loaded=free + 2.0, step=0.01, segments=(1, 1))


def test_above_five_hertz_an_external_torque_s_spectrum_falls():
    """c = 2 · mean of f^2.5 over the twenty bins from .25 to 5 Hz; up to there nothing changes."""
    spectra, f = chattering(), np.linspace(0.0, 50.0, 201)
    np.testing.assert_allclose(spectra.external[f <= 5.0], 2.0)
    level = 2.0 * np.mean((0.25 * np.arange(1, 21)) ** 2.5)
    above = f > 5.0
    # the cap lies below the plateau from the first bin on: the mean is below the last bin's value
    np.testing.assert_allclose(spectra.external[above, 0], level / f[above] ** 2.5)
    # What is cut off is noise: what an observer that passes everything reads stays the same.
    np.testing.assert_allclose(spectra.noise + spectra.external, spectra.loaded)
    assert np.all(spectra.noise >= spectra.free)
    one = np.ones((201, 1), complex)
    # a bin is .25 Hz wide
    assert spectra.passed(one)[0] == pytest.approx(0.25 * spectra.noise.sum())


def test_a_spectrum_that_falls_by_itself_is_left_as_it_is():
    """1/f³ lies below c/f^2.5 everywhere above 5 Hz, as c is a mean over slower frequencies."""
    f = np.linspace(0.0, 50.0, 201)
    torque = (1.0 / np.maximum(f, 0.25) ** 3)[:, None]
    free = np.full((201, 1), 1e-9)
    spectra = Spectra(frequency=f, free=free, loaded=free + torque, step=0.01, segments=(1, 1))
    np.testing.assert_array_equal(spectra.external, spectra.excess)
    np.testing.assert_allclose(spectra.noise, free)


def test_neighbours_are_averaged_over_a_fifth_of_the_frequency():
    spectrum = np.arange(50.0)[:, None]
    # a straight line stays
    np.testing.assert_allclose(neighbour_mean(spectrum)[:40], spectrum[:40])
    spike = np.zeros((50, 1))
    spike[20] = 9.0
    found = neighbour_mean(spike)[:, 0]
    assert found[20] == pytest.approx(1.0)  # 4 neighbours either side
    assert found[4] == 0.0
    assert np.flatnonzero(found).tolist() == list(range(17, 26))


def test_the_floor_is_the_quietest_octave_s_level_below_it():
    """The seventh half octave above the first bin, 5.66 to 11.3 Hz, is the only quiet one."""
    f = np.arange(101) * 0.5
    free = np.where((f >= 5.5) & (f <= 11.5), 1.0, 100.0)[:, None]
    spectra = Spectra(frequency=f, free=free, loaded=free, step=0.01, segments=(1, 1))
    np.testing.assert_allclose(spectra.floor[f <= 11.0], 1.0)
    # beyond it the free part itself, averaged over a fifth of the frequency
    np.testing.assert_allclose(spectra.floor[f >= 15.0], 100.0)


def test_a_part_of_impacts_alone_has_the_spectrum_of_the_impacts():
    """Taps of .1 s, 20 N·m: their power over their own time is what S_τ adds up to.

    White noise of .1 N·m is nothing beside it; windows that overlap the taps unevenly move it by
    a tenth or two.
    """
    step = 0.008
    t = np.arange(0.0, 40.0, step)
    phase = np.mod(t, 2.0)
    tap = (t > 10.0) & (phase < 0.1)
    tau = np.where(tap, 20.0 * np.sin(np.pi * phase / 0.1), 0.0)
    tau += 0.1 * np.random.default_rng(2).standard_normal(len(t))
    gained = np.cumsum(np.concatenate([[0.0], 0.5 * (tau[1:] + tau[:-1]) * step]))
    terms = DynamicsTerms(t=t, p=gained[:, None], mu=np.zeros((len(t), 1)))
    found = spectra_of(samples_of(terms, tap), [samples_of(terms, t < 10.0)])
    power = float(np.sum(found.loaded - found.free) * found.width)
    assert power == pytest.approx(np.mean(tau[tap] ** 2), rel=0.25)


def spectra(contact: float) -> Spectra:
    """White noise, and in the loaded part a contact a thousand times louder about one frequency."""
    f = np.linspace(0.0, 62.5, 251)
    quiet = np.ones((251, 3))
    louder = 1000.0 * np.exp(-(((f - contact) / 0.5) ** 2))[:, None] * np.ones(3)
    return Spectra(frequency=f, free=quiet, loaded=quiet + louder, step=0.008, segments=(4, 4))


@pytest.mark.parametrize(("contact", "free"), [(2.0, True), (3.0, True), (7.0, False)])
def test_contacts_are_reported_below_five_hertz(contact, free):
    """Above, drives ripple louder in some cycles than in others: that says nothing of contact."""
    assert looks_free(spectra(contact)) is free


def test_most_joints_decide():
    one = spectra(2.0)
    quiet = one.loaded.copy()
    quiet[:, 0] = one.free[:, 0]
    assert looks_free(replace(one, loaded=quiet))
    quiet[:, 1] = one.free[:, 1]
    assert not looks_free(replace(one, loaded=quiet))


FRICTION = np.array([4.0, 0.0])


def test_rest_and_motion_are_learned_apart():
    """Columns of 1 N·m at rest and 3 N·m in motion; the dry friction of J1 is the larger."""
    resting = np.zeros((200, 2), dtype=bool)
    resting[:100] = True
    read = np.where(resting, 1.0, -3.0)
    found = free_error(read, resting, FRICTION)
    np.testing.assert_allclose(found.moving, [9.0, 9.0])
    np.testing.assert_allclose(found.resting, [(HELD * 4.0) ** 2, 1.0])
    assert not found.unseen.any()


def test_few_samples_are_spoken_for_by_all():
    """With 49 moving samples of 200 the mean square is over all of them, friction beside it."""
    resting = np.ones((200, 2), dtype=bool)
    resting[: ENOUGH - 1, 0] = False
    read = np.where(resting, 1.0, 3.0)
    found = free_error(read, resting, FRICTION)
    whole = np.mean(read**2, axis=0)
    np.testing.assert_allclose(found.moving, whole + (UNSEEN * FRICTION) ** 2)
    np.testing.assert_array_equal(found.unseen, [True, True])


def test_variances_add_sample_by_sample():
    free = FreeError(np.array([4.0, 1.0]), np.array([9.0, 2.0]), np.zeros(2, dtype=bool))
    resting = np.array([[True, False], [False, True], [False, False]])
    correction = np.array([[1.0, 0.0], [0.0, 2.0], [3.0, 3.0]])
    sd = error_band(free, np.array([0.5, 0.25]), resting, correction)
    expected = [[9 + 0.5 + 1, 1 + 0.25], [4 + 0.5, 2 + 0.25 + 4], [4 + 0.5 + 9, 1 + 0.25 + 9]]
    np.testing.assert_allclose(sd**2, expected)
