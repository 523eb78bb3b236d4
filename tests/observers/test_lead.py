"""Estimates that start at the first sample's static residual."""

import numpy as np
import pytest

from vftcli.observers.choice import (
    LEAD,
    LONGEST,
    ObserverChoice,
    estimate_from_rest,
    lead_samples,
    settling_samples,
)
from vftcli.observers.paper import MomentumObserver
from vftcli.robots import load_robot
from vftcli.signals.external_torque import DynamicsTerms

PANDA = load_robot("panda")


def observer(name, step):
    (built,), _ = ObserverChoice(names=(name,)).build(PANDA, step)
    return built


def terms(step, mu, samples=120):
    rng = np.random.default_rng(3)
    t = step * (np.arange(samples) + 0.02 * rng.uniform(-1, 1, samples) * (step == 1 / 15))
    return DynamicsTerms(t=t, p=rng.standard_normal((samples, 7)), mu=np.full((samples, 7), mu))


@pytest.mark.parametrize("name", ["fdo", "gmo", "kfo-fe", "kfo-zoh", "kfo-rts"])
@pytest.mark.parametrize("step", [1 / 25, 1 / 15, 1e-3])
def test_a_load_that_was_there_all_the_time_shows_at_once(name, step):
    """At rest under 3 N·m, τ_ext = −μ in every sample, on even and uneven clocks."""
    still = terms(step, -3.0)
    still = DynamicsTerms(t=still.t, p=np.zeros((120, 7)), mu=still.mu)
    found = estimate_from_rest(observer(name, step), still)
    # 60 time constants leave e⁻⁶⁰; rounding of sums of hundreds of samples
    np.testing.assert_allclose(found.tau, 3.0, atol=1e-12)
    np.testing.assert_array_equal(found.t, still.t)


@pytest.mark.parametrize("name", ["gmo", "kfo-zoh"])
def test_only_the_start_differs(name):
    """Both forget: the difference to a start at zero is that of the starts times what is left."""
    step, own = 1 / 25, terms(1 / 25, -2.0)
    one = observer(name, step)
    led, plain = estimate_from_rest(one, own), one.estimate(own)
    settled = settling_samples(one, step, 7)
    apart = np.abs(led.tau - plain.tau).max(axis=1)
    # τ̂⁰ = 2 N·m against 0, of which 1 % is left after `settled` samples
    assert apart[0] == pytest.approx(2.0, rel=0.6)
    assert apart[settled + 1 :].max() < 0.03
    assert apart[60:].max() < 1e-9
    assert (led.sd is None) == (plain.sd is None)


def test_a_first_order_observer_settles_in_the_time_of_its_gain():
    """(1−a)/(1+a) = 1/3 a sample at K = 10, Ts = .1: 3⁻⁵ = .4 % is the first below 1 %."""
    assert settling_samples(MomentumObserver(gain=10.0), 0.1, 7) in {4, 5}


def test_the_lead_is_bounded():
    assert lead_samples(MomentumObserver(gain=10.0), 0.1, 7) == LEAD
    assert lead_samples(MomentumObserver(gain=1e-6), 1e-3, 7) == LONGEST


def test_the_choice_runs_an_observer_from_where_it_is_to_start():
    own, one = terms(1 / 25, -2.0), observer("gmo", 1 / 25)
    assert ObserverChoice(names=("gmo",)).run(one, own).tau[0].tolist() == [0.0] * 7
    led = ObserverChoice(names=("gmo",), from_rest=True).run(one, own)
    np.testing.assert_allclose(led.tau[0], 2.0, atol=1e-12)
