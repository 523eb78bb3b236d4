"""Gains and filters on a jittering clock against the plain loop, however slowly they forget."""

import numpy as np
import pytest

from vftcli.observers import KalmanObserver
from vftcli.observers.kalman_model import Covariance, Gains
from vftcli.observers.smoother import gain_sequence
from vftcli.signals.external_torque import DynamicsTerms

SAMPLES = 3000


def steps(gaps: int = 0, seed: int = 4) -> np.ndarray:
    """8 ms, jittering by 5 %, with some gaps of .9 s."""
    rng = np.random.default_rng(seed)
    dt = 0.008 * (1.0 + 0.05 * rng.uniform(-1.0, 1.0, SAMPLES))
    dt[rng.choice(SAMPLES, gaps, replace=False)] = 0.9
    return dt


def looped(
    observer: KalmanObserver, dt: np.ndarray, prior: Covariance, before: Covariance | None = None
) -> Gains:
    """The covariance recursion as it is written, Joseph's form, sample by sample.

    With the covariances of another recursion `before` it, every sample is one step from these:
    rounding does not add up over the samples.
    """
    model = observer.model(dt[:, None], len(prior.p11))
    found = [joseph(prior, model.r[0])]
    for k in range(1, len(dt)):
        p11, p12, p22 = found[-1].posterior if before is None else (p[k - 1] for p in before)
        moved = p12 + model.a12[k] * p22
        prior = Covariance(
            p11 + model.a12[k] * (p12 + moved) + model.q11[k],
            model.a22[k] * moved + model.q12[k],
            model.a22[k] ** 2 * p22 + model.q22[k],
        )
        found.append(joseph(prior, model.r[k]))
    return Gains(*np.moveaxis(np.array(found), 1, 0))


def joseph(prior: Covariance, r: np.ndarray) -> Gains:
    """The update (I − LC)P(I − LC)ᵀ + LRLᵀ, written out."""
    p11, p12, p22 = prior
    S = p11 + r
    # 1 − L₁ as a quotient: the difference would lose every digit of a small r.
    l1, l2, rest = p11 / S, p12 / S, r / S
    p22 = p22 - 2.0 * l2 * p12 + l2**2 * p11 + l2**2 * r
    p12 = rest * (p12 - l2 * p11) + l1 * l2 * r
    return Gains(l1, l2, rest**2 * p11 + l1**2 * r, p12, p22, S)


SETTINGS = {
    "default": ({}, steps(), None),
    "fast": ({"q_tau_diag": 5e7}, steps(), None),
    "slow": ({"q_tau_diag": 1e-3}, steps(), None),
    "gaps": ({}, steps(20), None),
    "P0": ({}, steps(), 1e6),
    "decay": ({"decay": 2.0}, steps(20), 1e4),
    "slow decay": ({"decay": 2.0, "q_tau_diag": 1e-3}, steps(20), 1e4),
    # With kfo-fe P₁₂ is 3e-6 of √(P₁₁P₂₂) where a block starts.
    "P12 near zero": ({"decay": 2.0, "q_tau_diag": 1e-3}, steps(20, seed=12), 1e4),
}


@pytest.mark.parametrize("scheme", ["fe", "zoh"])
@pytest.mark.parametrize("setting", SETTINGS)
def test_gains_are_those_of_the_plain_loop(setting: str, scheme: str) -> None:
    more, dt, first = SETTINGS[setting]
    observer = KalmanObserver(discretisation=scheme, **more)
    settled = observer.steady(0.008, 2)
    prior = observer.first_prior(0.008, 2)
    if first is not None:
        prior = Covariance(np.full(2, first), np.zeros(2), np.full(2, first))
    found = gain_sequence(observer.model(dt[:, None], 2), prior, settled.posterior)
    expected = looped(observer, dt, prior, found.posterior)
    # P₁₂, and L₂ = P₁₂/R with it, passes zero behind a gap and keeps no digits of its own there:
    # it is held against √(P₁₁P₂₂). A block starts from other roundings: 200 eps of that were seen.
    p11, _, p22 = expected.posterior
    cross, r = np.sqrt(p11 * p22), observer.model(dt[:, None], 2).r
    scales = (expected.l1, cross / r, p11, cross, p22)
    ours, theirs = (found.l1, found.l2, *found.posterior), (expected.l1, expected.l2)
    for one, other, scale in zip(ours, (*theirs, *expected.posterior), scales, strict=True):
        np.testing.assert_allclose(one / scale, other / scale, rtol=0, atol=1e-12)


@pytest.mark.parametrize("q_tau", [1e-3, 5e3, 5e7])
@pytest.mark.parametrize("samples", [1, 2, 50, 1000])
def test_the_filter_is_the_plain_loop(samples: int, q_tau: float) -> None:
    dt, rng = steps(5)[:samples], np.random.default_rng(7)
    p = np.cumsum(rng.normal(0.0, 0.1, (samples, 2)), axis=0)
    log = DynamicsTerms(t=np.cumsum(dt), p=p, mu=rng.normal(0.0, 5.0, (samples, 2)))
    observer = KalmanObserver(q_tau_diag=q_tau, initial_covariance=np.array([1.0, 0.0, 9.0]))
    found = observer.estimate(log)
    dt = np.broadcast_to(log.dt[:, 0], samples)
    gains = looped(observer, dt, observer.first_prior(log.clock.step, 2))
    model, e, tau = observer.model(dt[:, None], 2), np.zeros(2), np.zeros(2)
    for k in range(samples):
        x = e - model.a12[k] * tau + log.d[k]
        e, tau = (1.0 - gains.l1[k]) * x, model.a22[k] * tau + gains.l2[k] * x
        # rounding over as many steps, of torques of 10
        np.testing.assert_allclose(found.tau[k], tau, rtol=1e-12, atol=1e-11)
    np.testing.assert_allclose(found.sd, np.sqrt(gains.posterior.p22), rtol=1e-12)
