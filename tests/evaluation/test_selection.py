"""The selection guide: facts that follow from known observers."""

import numpy as np
import pytest

from vftcli.evaluation.selection import advice, facts, step_response
from vftcli.observers import KalmanObserver, MomentumObserver
from vftcli.robots.terms import DynamicsTerms

STEP = 0.002


def terms(sigma: float = 0.3) -> DynamicsTerms:
    rng = np.random.default_rng(0)
    t = STEP * np.arange(4000)
    return DynamicsTerms(t=t, p=np.zeros((4000, 2)), mu=sigma * rng.standard_normal((4000, 2)))


@pytest.mark.parametrize("gain", [5.0, 20.0])
def test_a_first_order_filter_reaches_nine_tenths_at_its_time(gain: float) -> None:
    """ln(10)/K, to the sample time."""
    found = step_response(MomentumObserver(gain=gain), STEP, 2)
    assert found == pytest.approx(np.full(2, np.log(10.0) / gain), abs=1.5 * STEP)


def test_noise_is_that_of_the_estimate() -> None:
    """The computed noise floor against what the observer really makes of white noise in μ."""
    log, observer = terms(), MomentumObserver(gain=20.0)
    found = facts([observer], {"gmo": observer.tuning(STEP, 2)}, log, None)[0]
    shown = float(np.mean(observer.estimate(log).tau[500:].std(axis=0)))
    # 3500 samples with a memory of 50: some 70 independent pieces tell a deviation to 10 %.
    assert found.noise == pytest.approx(shown, rel=0.15)
    assert found.numbers == 2
    assert found.time > 0
    assert np.isnan(found.rmse)


def test_advice_names_the_fastest_and_the_quietest() -> None:
    observers = [MomentumObserver(gain=50.0), KalmanObserver(q_tau_diag=50.0)]
    tunings = {o.name: o.tuning(STEP, 2) for o in observers}
    detection, response, estimation = advice(facts(observers, tunings, terms(), None))
    assert detection.best == ("gmo",)
    assert response.best == ("kfo-fe",)
    assert estimation.best == ()  # no reference, no errors
