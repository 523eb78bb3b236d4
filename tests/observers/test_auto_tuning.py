"""Gains tuned on a log's own spectra: the error they promise is the one that is then measured."""

from collections.abc import Callable

import numpy as np
import pytest
from made_runs import samples_of

from vftcli.observers.auto_tuning import (
    KINDS,
    bound_remarks,
    error_curve,
    expected_error,
    kalman_filter,
    kalman_smoother,
    noise_level,
    tune_to_spectra,
)
from vftcli.observers.spectra import Spectra, spectra_of
from vftcli.observers.table import OBSERVERS, LogSpectra, Setup, build_observers
from vftcli.robots.run import RunSamples
from vftcli.signals.external_torque import DynamicsTerms

STEP = 0.008

MakesTerms = Callable[..., DynamicsTerms]
Pushed = Callable[..., tuple[RunSamples, RunSamples]]


def low_passed_noise(samples: int, corner: float, seed: int) -> np.ndarray:
    """A random torque without jumps, two poles at a corner [rad/s], standard deviation 1."""
    from scipy.signal import lfilter

    a = np.exp(-corner * STEP)
    # variance of white noise behind 1/(1 − a z⁻¹)²
    gain = np.sqrt((1 - a * a) ** 3 / (1 + a * a))
    white = np.random.default_rng(seed).normal(0.0, gain, (samples, 2))
    return lfilter([1.0], [1.0, -2.0 * a, a * a], white, axis=0)


@pytest.fixture
def pushed(terms_of: MakesTerms) -> Pushed:
    """Makes a log that is half free, half under a random torque."""
    return lambda **how: half_pushed(terms_of, **how)


def half_pushed(
    terms_of: MakesTerms, samples: int = 8000, scale: float = 5.0, noise: float = 2.0
) -> tuple[RunSamples, RunSamples]:
    """Half free, half with a random torque; white torque noise everywhere. Seed 1."""
    t = STEP * np.arange(samples)
    free = np.arange(samples) < samples // 2
    torque = scale * low_passed_noise(samples, 6.0, 1) * ~free[:, None]
    terms = terms_of(t, torque, noise)
    return samples_of(terms, ~free), samples_of(terms, free)


@pytest.mark.parametrize("name", KINDS)
def test_the_expected_error_is_the_measured_one(name: str, pushed: Pushed) -> None:
    """The spectra predict the rmse that the tuned observer then has against the truth."""
    loaded, free = pushed()
    observer = tune_to_spectra(name, spectra_of(loaded, [free]))
    assert observer.curve is not None
    tau = observer.estimate(loaded.run.terms).tau
    truth = 5.0 * low_passed_noise(8000, 6.0, 1) * loaded.inside[:, None]
    inner = loaded.inside.copy()
    inner[:4200] = False
    rmse = np.sqrt(np.mean((tau - truth)[inner] ** 2, axis=0))
    # power of 30 s of a torque with a correlation time of 0.17 s: known to 10 %; the tail of its
    # spectrum lies under the noise, where (S_d − S_n)₊ sees only a part: the smoother's 10 % more
    np.testing.assert_allclose(rmse, observer.curve.least, rtol=0.2)


def test_tuning_finds_the_best_of_all_natural_frequencies(pushed: Pushed) -> None:
    loaded, free = pushed()
    spectra = spectra_of(loaded, [free])
    found = error_curve(kalman_filter, spectra)
    near = [expected_error(kalman_filter, found.best * f, spectra) for f in (0.7, 1.4)]
    for error in near:
        assert np.all(np.diag(error) >= found.least)


def test_more_noise_calls_for_slower_filters(pushed: Pushed) -> None:
    best = []
    for noise in (0.5, 4.0):
        loaded, free = pushed(noise=noise)
        best.append(error_curve(kalman_smoother, spectra_of(loaded, [free])).best)
    assert np.all(best[1] < best[0])


def test_the_noise_level_gives_innovations_their_expected_variance(pushed: Pushed) -> None:
    """NIS = 1 on the loaded part, which is what R is scaled for."""
    loaded, free = pushed()
    spectra = spectra_of(loaded, [free])
    omega_n = np.array([20.0, 40.0])
    observer = kalman_filter(omega_n, noise_level(omega_n, spectra))
    settled, model = observer.steady(STEP, 2), observer.model(STEP, 2)
    tau = observer.estimate(loaded.run.terms).tau
    nu = ((tau[1:] - model.a22 * tau[:-1]) / settled.l2)[4199:]
    nis = np.mean(nu**2, axis=0) / settled.S
    # variance of the same samples, windowed and not: the rest is the spectrum's own scatter
    np.testing.assert_allclose(nis, 1.0, rtol=0.1)


def test_without_spectra_auto_falls_back_and_says_so(pushed: Pushed) -> None:
    setup = Setup(gains={}, settings={}, joints=2, step=STEP, as_printed=False)
    observers, remarks = build_observers(("kfo-auto", "rts-auto", "kfo-zoh", "kfo-rts"), setup)
    untuned = [r for r in remarks if r.code == "tuning-without-free-part"]
    assert [r.where.about for r in untuned] == ["kfo-auto", "rts-auto"]
    assert str(untuned[0]).startswith("kfo-auto: no free part to tune on")
    loaded, _ = pushed(samples=400)
    filtered, smoothed, by_hand, rts = (o.estimate(loaded.run.terms) for o in observers)
    assert filtered.name == "kfo-auto"
    np.testing.assert_array_equal(filtered.tau, by_hand.tau)
    np.testing.assert_array_equal(smoothed.tau, rts.tau)


def test_tuned_observers_have_nothing_left_to_tune(pushed: Pushed) -> None:
    loaded, free = pushed()
    setup = Setup(gains={}, settings={}, joints=2, step=STEP, as_printed=False)
    setup = setup._replace(shown=LogSpectra(plain=spectra_of(loaded, [free])))
    observer, remarks = OBSERVERS["rts-auto"].build(setup, "rts-auto")
    assert remarks == ()
    assert observer.tuning(STEP, 2).parameter_count == 0
    np.testing.assert_allclose(observer.tuning(STEP, 2).zeta, np.sqrt(0.5))


def with_chatter(level: float) -> Spectra:
    """A push that fades above 1 Hz and white noise; the drives chatter at 10 to 50 Hz under it."""
    f = np.linspace(0.0, 62.5, 251)
    noise = np.full((251, 1), 0.01)
    push = (10.0 / (1.0 + (f / 1.0) ** 4))[:, None]
    chatter = np.where((f > 10.0) & (f < 50.0), level, 0.0)[:, None]
    return Spectra(
        frequency=f, free=noise, loaded=noise + push + chatter, step=STEP, segments=(9, 9)
    )


def test_chatter_under_load_does_not_run_the_gains_up() -> None:
    """Without the cap the smoother follows a chatter of ten times the noise up to its bound."""
    quiet, loud = (error_curve(kalman_smoother, with_chatter(level)) for level in (0.0, 0.1))
    # it is noise: the gains become slower, not faster
    assert loud.best[0] <= quiet.best[0]
    assert bound_remarks("rts-auto", loud.best, loud.omega_n) == ()


def test_a_bound_is_never_reached_in_silence() -> None:
    grid = np.array([1.0, 10.0, 250.0])
    slow, fast = bound_remarks("kfo-auto", np.array([1.0, 10.0, 250.0, 1.0]), grid)
    assert [(r.code, r.level) for r in (slow, fast)] == [
        ("gain-at-slowest", "warning"),
        ("gain-at-fastest", "warning"),
    ]
    assert (slow.where.joints, fast.where.joints) == ((1, 4), (3,))
    assert (slow.values["rate_rad_s"], fast.values["rate_rad_s"]) == (1.0, 250.0)
    assert str(fast).startswith("kfo-auto: J3: noise missing from the free part")


def test_best_keeps_a_push_where_the_log_shows_none(pushed: Pushed) -> None:
    """Tuned on noise alone it keeps what 1/(1 + (ω/9)⁴) leaves of a half sine of .6 s."""
    _, free = pushed()
    t = free.run.terms.t
    begin = t[len(t) // 2]
    inside = (t >= begin) & (t < begin + 0.6)
    push = np.where(inside, np.sin(np.pi * (t - begin) / 0.6), 0.0)
    omega = 2.0 * np.pi * np.fft.rfftfreq(len(t), STEP)
    left = np.fft.irfft(np.fft.rfft(push) / (1.0 + (omega / 9.0) ** 4), len(t)).max()
    p = np.cumsum(push[:, None] * np.ones(2), axis=0) * STEP
    quiet = DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))
    kept = {}
    for name in ("best", "rts-auto"):
        observer = tune_to_spectra(name, spectra_of(free, [free]))
        kept[name] = float(observer.estimate(quiet).tau[:, 0].max())
    # The grid of natural frequencies is 7 % fine, of which the peak moves by a third.
    assert kept["best"] == pytest.approx(left, rel=0.025)
    assert kept["rts-auto"] < kept["best"]
