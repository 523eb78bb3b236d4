"""Slow, uneven, stale, quantised and constant signals: `best` is a number on every joint, silently.

Warnings of NumPy are errors here as everywhere in these tests.
"""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from known_errors import drawn_error, wrong_run
from sound_logs import UR10E

from vftcli.doctor.examination import Examiner
from vftcli.observers import ObserverChoice
from vftcli.observers.spectra import Spectra
from vftcli.observers.tuning import noise_level
from vftcli.pipeline import AnalysisChoice, analyse, prepared, run_of
from vftcli.readers.reader import ReadChoice
from vftcli.robots import RobotChoice, load_robot
from vftcli.robots.run import Run
from vftcli.signals.recording import Recording

PANDA = load_robot("panda")
BEST = AnalysisChoice(observers=ObserverChoice(names=("best",)), contacts=False)


@pytest.fixture(scope="module")
def slow():
    """12 s of seven joints at 33 Hz, with a wrong model and .05 N·m of noise."""
    log = wrong_run(PANDA, drawn_error(PANDA), seconds=13.0, noise=0.05).recording
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
def test_every_joint_of_the_best_is_a_number(slow, seed, stale, jitter, gaps, change):
    log = hardened(slow, seed, stale=stale, jitter=jitter, gaps=gaps)
    analysis = analyse(run_of(log if change is None else change(log), PANDA, BEST), BEST)
    (best,) = analysis.estimates
    assert np.isfinite(best.tau).all()
    assert best.error_sd is None or np.all(best.error_sd > 0.0)


def test_an_hour_without_samples_costs_no_band(slow):
    t = np.where(np.arange(len(slow.t)) < 200, slow.t, slow.t + 3600.0)
    choice = replace(BEST, examiner=Examiner(anyway=True))
    (best,) = analyse(run_of(replace(slow, t=t), PANDA, choice), choice).estimates
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


FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
NEAR = 0.5  # Around a bad sample its own joint may say anything. [s]


@cache
def sound(path: Path, robot: str, columns: str | None = None):
    """A log, its robot, how it is analysed, and its `best`."""
    asked = {"read": ReadChoice.parsed(columns=columns), "robot": RobotChoice(name=robot)}
    choice = replace(BEST, **asked, examiner=Examiner(anyway=True))
    (log,) = choice.library.open_each([path], choice.read)
    run = prepared(log.between(0.0, 30.0), choice)  # what a test has time for
    return run.recording, run.robot, choice, analyse(run, choice).estimates[0]


def changed(path: Path, robot: str, columns: str | None = None, **values):
    """How far `best` of a log with other values is from its own, in bands. (T, n)"""
    log, arm, choice, own = sound(path, robot, columns)
    (best,) = analyse(Run(recording=replace(log, **values), robot=arm), choice).estimates
    assert np.isfinite(best.error_sd).all()
    return np.abs(best.tau - own.tau) / (1.96 * own.error_sd)


def with_sample(log, signal, row, joint, value):
    """A signal with another value in one sample, added or, where it says so, put there."""
    values = np.array(getattr(log, signal))
    values[row, joint] = value(values[row, joint])
    return {signal: values}


FAULTS = {
    "q3 + 2π": ("q", 2, lambda q: q + 2.0 * np.pi),
    "q3 + .05 rad": ("q", 2, lambda q: q + 0.05),
    "20 A": ("current", 1, lambda _: 20.0),
    "3 A more": ("current", 1, lambda i: i + 3.0),
    "no current": ("current", 1, lambda _: 0.0),
    "5 rad/s": ("dq", 1, lambda _: 5.0),
    ".3 rad/s more": ("dq", 1, lambda dq: dq + 0.3),
}


@pytest.mark.slow
@pytest.mark.parametrize("row", [925, 1700])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_bad_sample_stays_within_the_band(fault, row):
    """Elsewhere; and on the other joints there too."""
    signal, joint, value = FAULTS[fault]
    log = sound(FIXTURE, "ur5")[0]
    ratio = changed(FIXTURE, "ur5", **with_sample(log, signal, row, joint, value))
    far = np.abs(log.t - log.t[row]) > NEAR
    assert ratio[far].max() <= 1.0
    assert np.delete(ratio, joint, axis=1).max() <= 1.0


@pytest.mark.slow
def test_a_bad_sample_is_said():
    log, arm, choice, _ = sound(FIXTURE, "ur5")
    bad = replace(log, **with_sample(log, "dq", 925, 1, lambda _: 5.0))
    remarks = analyse(Run(recording=bad, robot=arm), choice).remarks
    said = [r for r in remarks if r.code == "isolated-samples-evened"]
    assert [r.where.joints for r in said] == [(2,)]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["free_12harm", "free_14harm"])
def test_an_hour_without_samples_stays_within_the_band(logs, name):
    """No free motion is given or repeats: the model's error comes from all of the log."""
    path = logs / "ur10e" / f"{name}.csv"
    log = sound(path, "ur10e", UR10E)[0]
    half = log.samples // 2
    later = np.where(np.arange(log.samples) < half, log.t, log.t + 3600.0)
    ratio = changed(path, "ur10e", UR10E, t=later)
    far = np.abs(log.t - log.t[half]) > NEAR
    assert ratio[far].max() <= 1.0
