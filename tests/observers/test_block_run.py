"""Observers in blocks: the smoother looks ahead far enough to be that of the whole log."""

from collections.abc import Iterator

import numpy as np
import pytest

from vftcli.observers.observer import Observer
from vftcli.observers.paper import KalmanObserver, MomentumObserver
from vftcli.observers.smoother import KalmanSmoother, block_run, look_ahead, runs_in_blocks
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.series import Clock, clock_of
from vftcli.signals.terms import DynamicsTerms

SMOOTHER = KalmanSmoother(filter=KalmanObserver(discretisation="zoh"))


def made_terms(samples: int) -> DynamicsTerms:
    """Noise as p and μ of two joints at 1 kHz."""
    p, mu = np.random.default_rng(4).normal(size=(2, samples, 2))
    return DynamicsTerms(t=np.arange(samples) / 1000, p=p, mu=10 * mu)


def in_blocks(observer: Observer, whole: DynamicsTerms, size: int) -> Iterator[ExternalTorque]:
    """The estimates of so many samples at a time."""
    clock = clock_of(whole.t)
    run, before = block_run(observer, clock, whole.joints), None
    for start in range(0, whole.samples, size):
        rows = slice(start, start + size)
        terms = DynamicsTerms(
            t=whole.t[rows], p=whole.p[rows], mu=whole.mu[rows], log_clock=clock, before=before
        )
        before = terms.last
        yield from run.take(terms)
    yield from run.end()


@pytest.mark.parametrize("size", [97, 1000, 5000])
@pytest.mark.parametrize("observer", [SMOOTHER, MomentumObserver(gain=30.0)])
def test_blocks_are_the_whole(observer: Observer, size: int) -> None:
    """τ̂ and sd to 1e-9 N·m: what the smoother has forgotten is ρᴸ = 1e-16 of 100 N·m."""
    terms = made_terms(5000)
    whole = observer.estimate(terms)
    parts = list(in_blocks(observer, terms, size))
    assert [len(p.t) for p in parts[:-1]] == [size] * (len(parts) - 1)
    np.testing.assert_array_equal(np.concatenate([p.t for p in parts]), terms.t)
    np.testing.assert_allclose(np.concatenate([p.tau for p in parts]), whole.tau, atol=1e-9)
    if whole.sd is not None:
        sd = np.concatenate([p.sd for p in parts if p.sd is not None])
        np.testing.assert_allclose(sd, whole.sd, atol=1e-9)


def test_one_sample_at_a_time() -> None:
    """Blocks of one sample, in a log shorter than the smoother looks ahead."""
    terms = made_terms(40)
    parts = list(in_blocks(SMOOTHER, terms, 1))
    found = np.concatenate([p.tau for p in parts])
    np.testing.assert_allclose(found, SMOOTHER.estimate(terms).tau, atol=1e-9)


def test_look_ahead_is_where_the_pole_has_gone() -> None:
    """ρᴸ = 1e-16 with ρ = exp(−ζω_n Ts) of the continuous filter, to some per cent."""
    tuning = SMOOTHER.tuning(1e-3, 1)
    zeta = SMOOTHER.filter.tuning(1e-3, 1).zeta
    expected = -np.log(1e-16) / float(zeta[0] * tuning.omega_n[0] * 1e-3)
    assert look_ahead(SMOOTHER, 1e-3, 1) == pytest.approx(expected, rel=0.05)


def test_what_runs_in_blocks() -> None:
    """Not the smoother of an uneven clock or of a user's P⁻, which need all their gains."""
    assert runs_in_blocks(SMOOTHER, Clock(True, 1e-3), 2)
    assert not runs_in_blocks(SMOOTHER, Clock(False, 1e-3), 2)
    given = KalmanObserver(initial_covariance=np.ones((3, 1)))
    assert not runs_in_blocks(KalmanSmoother(filter=given), Clock(True, 1e-3), 1)
    assert runs_in_blocks(given, Clock(False, 1e-3), 1)
