"""The selection guide: facts that follow from known observers."""

import numpy as np
import polars as pl
import pytest

from vftcli.evaluation.published import (
    Facts,
    advice,
    best,
    facts,
    step_response,
)
from vftcli.observers import FilteredDynamicsObserver, KalmanObserver, MomentumObserver
from vftcli.robots import load_robot
from vftcli.robots.run import Run
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.recording import Recording

STEP = 0.002


def terms(sigma: float = 0.3) -> DynamicsTerms:
    rng = np.random.default_rng(0)
    t = STEP * np.arange(4000)
    return DynamicsTerms(t=t, p=np.zeros((4000, 2)), mu=sigma * rng.standard_normal((4000, 2)))


def run_of(terms: DynamicsTerms) -> Run:
    """A recording whose terms these are."""
    recording = Recording(t=terms.t, q=np.zeros_like(terms.p))
    return Run(recording=recording, robot=load_robot("ur5")).holding(terms=terms)


@pytest.mark.parametrize("gain", [5.0, 20.0])
def test_a_first_order_filter_reaches_nine_tenths_at_its_time(gain: float) -> None:
    """ln(10)/K, to the sample time."""
    found = step_response(MomentumObserver(gain=gain), STEP, 2)
    assert found == pytest.approx(np.full(2, np.log(10.0) / gain), abs=1.5 * STEP)


def test_a_response_is_read_within_three_seconds() -> None:
    """ln(10)/K is 2.88 s and 3.29 s; of the slower one nothing is known."""
    seen, late = (step_response(MomentumObserver(gain=gain), STEP, 1)[0] for gain in (0.8, 0.7))
    assert seen == pytest.approx(2.878, abs=1.5 * STEP)
    assert np.isnan(late)


def test_noise_is_that_of_the_estimate() -> None:
    """The computed noise floor against what the observer really makes of white noise in μ."""
    log, observer = terms(), MomentumObserver(gain=20.0)
    found = facts([observer], {"gmo": observer.tuning(STEP, 2)}, run_of(log), None)[0]
    shown = float(np.mean(observer.estimate(log).tau[500:].std(axis=0)))
    # 3500 samples with a memory of 50: some 70 independent pieces tell a deviation to 10 %.
    assert found.noise == pytest.approx(shown, rel=0.15)
    assert found.parameter_count == 2
    assert np.isnan(found.rmse)


def test_advice_names_the_fastest_and_the_quietest() -> None:
    observers = [MomentumObserver(gain=50.0), KalmanObserver(q_tau_diag=50.0)]
    tunings = {o.name: o.tuning(STEP, 2) for o in observers}
    detection, response, estimation = advice(facts(observers, tunings, run_of(terms()), None))
    assert detection.best == ("gmo",)
    assert response.best == ("kfo-fe",)
    assert estimation.best == ()  # no reference, no errors


def test_an_observers_rmse_is_its_own_mean_over_joints() -> None:
    """Two observers, three joints, rows of a wrench and an unknown joint among them."""
    errors = pl.DataFrame(
        {
            "observer": ["gmo", "gmo", "gmo", "fdo", "fdo", "gmo"],
            "joint": [1, 2, 3, 1, 2, None],
            "rmse_Nm": [1.0, 3.0, None, 50.0, 70.0, 900.0],
        }
    )
    observers = [MomentumObserver(gain=5.0), FilteredDynamicsObserver(omega=5.0), KalmanObserver()]
    tunings = {o.name: o.tuning(STEP, 2) for o in observers}
    gmo, fdo, kalman = facts(observers, tunings, run_of(terms()), errors)
    assert gmo.rmse == pytest.approx(2.0)
    assert fdo.rmse == pytest.approx(60.0)
    assert np.isnan(kalman.rmse)


def test_alike_within_two_per_cent_are_both_best() -> None:
    names = ("a", "b", "c")
    found = [Facts(name, 0.1, 0.1, 0.1, 0.1, np.nan, 1) for name in names]
    assert best(found, [1.0, 1.019, 1.021]) == ("a", "b")
    assert best(found, [np.nan, 2.0, 1.0]) == ("c",)
    assert best(found, [np.nan] * 3) == ()


def test_what_passes_is_noise_above_a_persons_contacts() -> None:
    """A first-order low-pass of 50 1/s passes more of what lies above 5 Hz than one of 5 1/s."""
    observers = [MomentumObserver(gain=50.0), MomentumObserver(gain=5.0)]
    fast, slow = (
        facts([o], {"gmo": o.tuning(STEP, 2)}, run_of(terms()), None)[0].passed for o in observers
    )
    f = np.linspace(0.0, 250.0, 513)[1:]  # up to half the sample rate of 2 ms
    for gain, passed in ((50.0, fast), (5.0, slow)):
        size = 1.0 / np.sqrt(1.0 + (2.0 * np.pi * f[f > 5.0] / gain) ** 2)
        # The sampled observer's response bends down near half the sample rate.
        assert passed == pytest.approx(np.sqrt(np.mean(size**2)), rel=0.05)


def test_of_a_slow_log_what_passes_is_read_at_its_highest_frequency() -> None:
    """At 2 Hz nothing lies above 5 Hz; the mean of nothing was a NumPy warning on the terminal."""
    t = 0.5 * np.arange(100)
    log = DynamicsTerms(t=t, p=np.zeros((100, 2)), mu=np.ones((100, 2)))
    observer = MomentumObserver(gain=0.5)
    (found,) = facts([observer], {"gmo": observer.tuning(0.5, 2)}, run_of(log), None)
    highest = np.abs(observer.frequency_response(np.array([1.0]), 0.5, 2))
    assert found.passed == pytest.approx(float(np.mean(highest)), rel=1e-12)  # rounding of a mean


def test_the_slowest_joint_decides_and_noise_is_the_joints_mean() -> None:
    """Joints of 50 and 5 1/s against observers that have one of them on both joints."""
    found = []
    for gain in ([50.0, 5.0], 50.0, 5.0):
        observer = MomentumObserver(gain=np.array(gain))
        found += facts([observer], {"gmo": observer.tuning(STEP, 2)}, run_of(same_on_both()), None)
    both, fast, slow = found
    assert both.response == slow.response > fast.response
    assert both.delay == slow.delay > fast.delay
    assert both.noise == pytest.approx(0.5 * (fast.noise + slow.noise), rel=1e-12)
    assert both.passed == pytest.approx(0.5 * (fast.passed + slow.passed), rel=1e-12)


def same_on_both() -> DynamicsTerms:
    """The first joint's noise on both joints."""
    log = terms()
    return DynamicsTerms(t=log.t, p=log.p, mu=np.repeat(log.mu[:, :1], 2, axis=1))
