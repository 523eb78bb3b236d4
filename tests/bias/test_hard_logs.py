"""Slow, uneven, stale, quantised and constant signals: `best` is a number on every joint, silently.

Warnings of NumPy are errors here as everywhere in these tests.
"""

from dataclasses import replace

import numpy as np
import pytest
from known_errors import drawn_error, wrong_run

from vftcli.doctor.examination import Examiner
from vftcli.observers import ObserverChoice
from vftcli.observers.spectra import Spectra
from vftcli.observers.tuning import noise_level
from vftcli.pipeline import AnalysisChoice, analyse, run_of
from vftcli.robots import load_robot
from vftcli.signals.recording import Recording

BEST = AnalysisChoice(observers=ObserverChoice(names=("best",)), contacts=False)


@pytest.fixture(scope="module")
def panda():
    return load_robot("panda")


@pytest.fixture(scope="module")
def slow(panda):
    """12 s of seven joints at 33 Hz, with a wrong model and .05 N·m of noise."""
    log = wrong_run(panda, drawn_error(panda), seconds=13.0, noise=0.05).recording
    return drawn(log, np.arange(0, len(log.t), 3), log.t[::3])


def drawn(log, rows, t):
    """Samples of a log on another clock."""
    return Recording(t=t, q=log.q[rows], dq=log.dq[rows], torque=log.torque[rows])


def hardened(log, seed, *, stale=0.0, jitter=0.0, gaps=0):
    """A log with repeated rows, stamps that jitter by shares of a step, and gaps of a second."""
    rng = np.random.default_rng(seed)
    repeated = np.flatnonzero(rng.random(len(log.t)) < stale)
    rows = np.arange(len(log.t))
    for k in repeated[repeated > 0]:
        rows[k] = rows[k - 1]
    t = np.sort(log.t + rng.uniform(-jitter, jitter, len(log.t)) * log.median_step)
    there = np.ones(len(t), dtype=bool)
    for start in rng.integers(20, len(t) - 60, gaps):
        there[start : start + 33] = False
    return drawn(log, rows[there], t[there] - t[0])


def quantised(log):
    """Hundredths of a radian, twentieths of a radian a second, whole newton metres."""
    steps = {"q": 1e-2, "dq": 0.05, "torque": 1.0}
    return replace(log, **{k: np.round(getattr(log, k) / s) * s for k, s in steps.items()})


def constant(log, joints):
    """A log in which some joints hold still and their torque is one number."""
    q, dq, torque = (np.array(x) for x in (log.q, log.dq, log.torque))
    for x in (q, dq, torque):
        x[:, joints] = x[0, joints]
    dq[:, joints] = 0.0
    return replace(log, q=q, dq=dq, torque=torque)


@pytest.mark.parametrize(
    ("stale", "jitter", "gaps", "change"),
    [
        (0.0, 0.3, 0, None),
        (0.4, 0.0, 0, None),
        (0.3, 0.45, 2, None),
        (0.4, 0.3, 0, quantised),
        (0.0, 0.3, 0, lambda log: constant(log, [0, 4])),
        (0.4, 0.3, 2, lambda log: quantised(constant(log, [0, 4]))),
        (0.0, 0.3, 0, lambda log: constant(log, list(range(7)))),
    ],
)
@pytest.mark.parametrize("seed", [1, 2])
def test_every_joint_of_the_best_is_a_number(slow, panda, seed, stale, jitter, gaps, change):
    log = hardened(slow, seed, stale=stale, jitter=jitter, gaps=gaps)
    analysis = analyse(run_of(log if change is None else change(log), panda, BEST), BEST)
    (best,) = analysis.estimates
    assert np.isfinite(best.tau).all()
    assert best.error_sd is None or np.all(best.error_sd > 0.0)


def test_an_hour_without_samples_costs_no_band(slow, panda):
    t = np.where(np.arange(len(slow.t)) < 200, slow.t, slow.t + 3600.0)
    choice = replace(BEST, examiner=Examiner(anyway=True))
    (best,) = analyse(run_of(replace(slow, t=t), panda, choice), choice).estimates
    assert np.isfinite(best.tau).all()
    assert np.isfinite(best.error_sd).all()


def test_no_noise_in_the_loaded_part_still_leaves_a_filter():
    """S_d as it comes out where impacts are extrapolated, below zero, and S_n of 1 (N·m)²/Hz."""
    frequency = np.linspace(0.0, 16.0, 65)
    quiet = np.ones((65, 2)) * [1.0, 0.0]
    spectra = Spectra(frequency=frequency, free=quiet, loaded=-quiet, step=0.03, segments=(1, 1))
    r = noise_level(np.array([1.0, 1.0]), spectra)
    heard = noise_level(np.array([1.0, 1.0]), replace(spectra, loaded=quiet))
    # a thousandth of the noise's size is a millionth of its variance
    np.testing.assert_allclose(r[0], 1e-6 * heard[0], rtol=1e-12)
    # R is the variance of a sample's momentum times Ts: that of 1e-6 N·m over .03 s
    np.testing.assert_allclose(r[1], (1e-6 * 0.03) ** 2 * 0.03, rtol=1e-12)
