"""Spectra of the raw disturbance, and gains tuned on them."""

import numpy as np
import pytest

from vftcli.observers import OBSERVERS, Setup, build_observers
from vftcli.observers.auto_tuning import (
    KINDS,
    curve,
    expected_error,
    kalman_filter,
    kalman_smoother,
    noise_level,
    tuned,
)
from vftcli.observers.spectra import Part, Spectra, spectra_of
from vftcli.robots.disturbance import raw_disturbance
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.errors import ParameterError

STEP = 0.008


def terms_of(t: np.ndarray, external: np.ndarray, noise: float = 0.0) -> DynamicsTerms:
    """A body whose momentum integrates a torque that is linear between samples, plus white noise.

    Seed 3.
    """
    dt = np.diff(t, prepend=t[0])[:, None]
    middle = 0.5 * (external + np.vstack([external[:1], external[:-1]]))
    white = np.random.default_rng(3).normal(0.0, noise, external.shape)
    p = np.cumsum(dt * (middle + white), axis=0)
    return DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))


def low_passed_noise(samples: int, corner: float, seed: int) -> np.ndarray:
    """A first-order random torque with a corner frequency [rad/s], standard deviation 1."""
    from scipy.signal import lfilter

    a = np.exp(-corner * STEP)
    white = np.random.default_rng(seed).normal(0.0, np.sqrt(1 - a * a), (samples, 2))
    return lfilter([1.0], [1.0, -a], white, axis=0)


def pushed(samples: int = 8000, scale: float = 5.0, noise: float = 2.0) -> tuple[Part, Part]:
    """Half free, half with a random torque; white torque noise everywhere. Seed 1."""
    t = STEP * np.arange(samples)
    free = np.arange(samples) < samples // 2
    torque = scale * low_passed_noise(samples, 6.0, 1) * ~free[:, None]
    terms = terms_of(t, torque, noise)
    return Part(terms, ~free), Part(terms, free)


def test_the_raw_disturbance_of_a_constant_torque_is_that_torque() -> None:
    t = STEP * np.arange(100)
    d = raw_disturbance(terms_of(t, np.full((100, 2), 3.0)))
    # differences of a sum of a hundred terms: rounding only
    np.testing.assert_allclose(d, 3.0, rtol=1e-12)


def test_spectra_hold_the_mean_square_and_the_mean() -> None:
    """Parseval: the density summed over frequency is the power, a constant's included."""
    t = STEP * np.arange(4000)
    torque = 2.0 + np.random.default_rng(5).normal(0.0, 0.5, (4000, 2))
    terms = terms_of(t, torque)
    half = np.arange(4000) < 2000
    found = spectra_of(Part(terms, ~half), [Part(terms, half)])
    power = found.free.sum(axis=0) * found.width
    d = raw_disturbance(terms)[: 2000 - 1]
    # the window weighs samples unevenly: 8 segments of noise of variance 0.12 on a mean of 2
    np.testing.assert_allclose(power, np.mean(d**2, axis=0), rtol=0.03)


def test_white_noise_has_a_flat_spectrum_of_the_known_height() -> None:
    """One-sided density of white d with variance s² is 2s²Ts."""
    rng = np.random.default_rng(7)
    t = STEP * np.arange(40_000)
    d = rng.normal(0.0, 0.4, (40_000, 1))
    p = np.cumsum(STEP * d, axis=0)
    terms = DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))
    half = np.arange(len(t)) < len(t) // 2
    found = spectra_of(Part(terms, ~half), [Part(terms, half)])
    # about 80 half-overlapping segments: each bin to 15 %, their mean over 240 bins to 1 %
    assert np.mean(found.free[2:-2]) == pytest.approx(2 * 0.16 * STEP, rel=0.02)
    # free and loaded are alike, so hardly anything is external
    assert found.external.sum() < 0.1 * found.loaded.sum()


def test_an_uneven_clock_has_the_spectrum_of_its_median_step() -> None:
    rng = np.random.default_rng(11)
    t = np.cumsum(STEP * rng.uniform(0.9, 1.1, 6000))
    torque = 3.0 * np.sin(2 * np.pi * 2.0 * t)[:, None]
    terms = terms_of(t, torque)
    half = np.arange(len(t)) < 3000
    found = spectra_of(Part(terms, ~half), [Part(terms, half)])
    peak = found.frequency[np.argmax(found.loaded[:, 0])]
    assert peak == pytest.approx(2.0, abs=found.width)
    # 4.5 by Parseval; the resampling averages over a step, sinc²(2 Hz · 8 ms) = 0.999
    assert found.loaded.sum() * found.width == pytest.approx(4.5, rel=0.03)


def test_a_part_too_short_for_a_spectrum_is_refused() -> None:
    terms = terms_of(STEP * np.arange(100), np.zeros((100, 1)))
    few = np.arange(100) < 20
    with pytest.raises(ParameterError, match="needs 32 samples in a row; the loaded part has 79"):
        spectra_of(Part(terms, ~few), [Part(terms, few)])


def test_no_segment_reaches_across_a_gap() -> None:
    t = np.concatenate([STEP * np.arange(60), 10.0 + STEP * np.arange(25)])
    t += np.random.default_rng(0).uniform(0, 1e-4, len(t))
    terms = terms_of(t, np.ones((85, 1)))
    few = np.arange(85) >= 60
    with pytest.raises(ParameterError, match=r"free part 2[34]"):
        spectra_of(Part(terms, ~few), [Part(terms, few)])


@pytest.mark.parametrize("name", KINDS)
def test_the_expected_error_is_the_measured_one(name: str) -> None:
    """The spectra predict the rmse that the tuned observer then has against the truth."""
    loaded, free = pushed()
    observer = tuned(name, spectra_of(loaded, [free]))
    assert observer.curve is not None
    tau = observer.estimate(loaded.terms).tau
    truth = 5.0 * low_passed_noise(8000, 6.0, 1) * loaded.inside[:, None]
    inner = loaded.inside.copy()
    inner[:4200] = False
    rmse = np.sqrt(np.mean((tau - truth)[inner] ** 2, axis=0))
    # power of 30 s of a torque with a correlation time of 0.17 s: known to 10 %; the tail of its
    # spectrum lies under the noise, where (S_d − S_n)₊ sees only a part: the smoother's 10 % more
    np.testing.assert_allclose(rmse, observer.curve.least, rtol=0.2)


def test_tuning_finds_the_best_of_all_natural_frequencies() -> None:
    loaded, free = pushed()
    spectra = spectra_of(loaded, [free])
    found = curve(kalman_filter, spectra)
    near = [expected_error(kalman_filter, found.best * f, spectra) for f in (0.7, 1.4)]
    for error in near:
        assert np.all(np.diag(error) >= found.least)


def test_more_noise_calls_for_slower_filters() -> None:
    best = []
    for noise in (0.5, 4.0):
        loaded, free = pushed(noise=noise)
        best.append(curve(kalman_smoother, spectra_of(loaded, [free])).best)
    assert np.all(best[1] < best[0])


def test_the_noise_level_gives_innovations_their_expected_variance() -> None:
    """NIS = 1 on the loaded part, which is what R is scaled for."""
    from vftcli.observers.smoother import innovations

    loaded, free = pushed()
    spectra = spectra_of(loaded, [free])
    omega_n = np.array([20.0, 40.0])
    observer = kalman_filter(omega_n, noise_level(omega_n, spectra))
    settled, model = observer.steady(STEP, 2), observer.model(STEP, 2)
    tau = observer.estimate(loaded.terms).tau
    nu = innovations(tau, settled.gains.l2, model.a22)[4200:]
    nis = np.mean(nu**2, axis=0) / (settled.prior.p11 + model.r)
    # variance of the same samples, windowed and not: the rest is the spectrum's own scatter
    np.testing.assert_allclose(nis, 1.0, rtol=0.1)


def test_without_spectra_auto_falls_back_and_says_so() -> None:
    setup = Setup(gains={}, settings={}, joints=2, step=STEP, as_printed=False)
    observers, remarks = build_observers(("kfo-auto", "rts-auto", "kfo-zoh", "kfo-rts"), setup)
    untuned = [r for r in remarks if r.code == "tuning-without-free-part"]
    assert [r.where.about for r in untuned] == ["kfo-auto", "rts-auto"]
    assert str(untuned[0]).startswith("kfo-auto: no free part to tune on")
    loaded, _ = pushed(samples=400)
    filtered, smoothed, by_hand, rts = (o.estimate(loaded.terms) for o in observers)
    assert filtered.name == "kfo-auto"
    np.testing.assert_array_equal(filtered.tau, by_hand.tau)
    np.testing.assert_array_equal(smoothed.tau, rts.tau)


def test_tuned_observers_have_nothing_left_to_tune() -> None:
    loaded, free = pushed()
    setup = Setup(gains={}, settings={}, joints=2, step=STEP, as_printed=False)
    setup = setup._replace(spectra=spectra_of(loaded, [free]))
    observer, remarks = OBSERVERS["rts-auto"].build(setup)
    assert remarks == ()
    assert observer.tuning(STEP, 2).parameter_count == 0
    np.testing.assert_allclose(observer.tuning(STEP, 2).zeta, np.sqrt(0.5))


def test_the_spectra_predict_the_error_of_a_perfect_and_of_a_dead_observer() -> None:
    f = np.linspace(0.0, 10.0, 11)
    noise, both = np.ones((11, 1)), np.full((11, 1), 3.0)
    spectra = Spectra(frequency=f, free=noise, loaded=both, step=0.05, segments=(1, 1))
    one, none = np.ones((11, 1), complex), np.zeros((11, 1), complex)
    assert spectra.missed(one)[0] == 0.0
    assert spectra.passed(none)[0] == 0.0
    # 11 bins of 1 Hz, S_τ = 2 and S_n = 1
    assert spectra.missed(none)[0] == pytest.approx(22.0)
    assert spectra.passed(one)[0] == pytest.approx(11.0)
