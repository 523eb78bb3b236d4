"""Kalman observers against a dense textbook filter, SciPy's Riccati and matrix exponential."""

from typing import Any

import numpy as np
import pytest
from made_terms import dense_filter, random_walk, run_in_blocks
from scipy.linalg import expm, solve_discrete_are

from vftcli.observers import KalmanObserver
from vftcli.observers.kalman_model import (
    NOISE_CONVENTIONS,
    Covariance,
    Densities,
    Gains,
    zero_order_hold,
)
from vftcli.observers.smoother import gain_sequence
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.steady_filter import PIECE

R = np.array([0.5, 0.5, 0.5, 1.3, 1.3, 1.3])  # the paper's UR5 values, Sec. IV-A
Q_P = np.array([0.01, 0.01, 0.01, 0.02, 0.02, 0.02])
Q_TAU = np.full(6, 5000.0)
STEP = 0.008


def dense_torque(steps: list[Any]) -> tuple[np.ndarray, np.ndarray]:
    """τ̂ and its standard deviation of a dense filter. (T, n) each"""
    tau = [x[len(x) // 2 :] for _, (x, _) in steps]
    sd = [np.sqrt(np.diag(P)[len(x) // 2 :]) for _, (x, P) in steps]
    return np.array(tau), np.array(sd)


def paper(scheme: str, convention: str = "density", **more: object) -> KalmanObserver:
    own = {"r_diag": R, "q_p_diag": Q_P, "q_tau_diag": Q_TAU, "noise_convention": convention}
    return KalmanObserver(discretisation=scheme, **own, **more)


@pytest.mark.slow
@pytest.mark.parametrize("convention", NOISE_CONVENTIONS)
@pytest.mark.parametrize("scheme", ["fe", "zoh"])
@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_agrees_with_the_dense_textbook_filter(scheme, convention, jitter):
    observer, log = paper(scheme, convention), random_walk(jitter=jitter)
    tau, sd = dense_torque(dense_filter(observer, log))
    estimate = observer.estimate(log)
    # the decoupled filter is the same filter; 1500 steps of rounding at values of 100 N·m
    np.testing.assert_allclose(estimate.tau, tau, atol=1e-10, rtol=0)
    np.testing.assert_allclose(estimate.sd, sd, rtol=1e-10)


@pytest.mark.parametrize(
    ("scheme", "more"),
    [("fe", {"decay": 3.0}), ("zoh", {"decay": 3.0}), ("fe", {"as_printed": True})],
)
def test_decay_and_printed_euler_agree_with_the_dense_textbook_filter(scheme, more):
    """The print is on μ alone, of the literal noise."""
    observer, log = paper(scheme, **more), random_walk(samples=600)
    tau, _ = dense_torque(dense_filter(observer, log))
    np.testing.assert_allclose(observer.estimate(log).tau, tau, atol=1e-10)
    printed, named = (one.model(STEP, 6) for one in (observer, paper("fe", "literal")))
    assert observer.as_printed is np.array_equal(printed.q22, named.q22)


def printed_loop(log: DynamicsTerms, joint: int, decay: float) -> tuple[np.ndarray, np.ndarray]:
    """The textbook filter of one joint on (44) as printed, P₀ settled; τ̂ and √P₂₂."""
    x, step = np.array([log.p[0, joint], 0.0]), log.clock.step
    P, C = np.diag([4.0, 100.0]), np.array([[1.0, 0.0]])
    A_c, Q_c = np.array([[0.0, 1.0], [0.0, -decay]]), np.diag([Q_P[joint], Q_TAU[joint]])
    tau, sd = np.empty((2, log.samples))
    # 600 steps before the log's first, 34 times what the filter needs to forget
    for k in range(-600, log.samples):
        M = expm(np.block([[A_c, Q_c], [np.zeros((2, 2)), -A_c]]) * step)
        if k > 0:
            x = M[:2, :2] @ x + np.array([step, 0.0]) * log.mu[k, joint]
        P = M[:2, :2] @ P @ M[:2, :2].T + M[:2, 2:] @ M[:2, :2].T
        L = P @ C.T / (P[0, 0] + R[joint] / step)
        P = P - L @ C @ P
        if k >= 0:
            x = x + L[:, 0] * (log.p[k, joint] - x[0])
            tau[k], sd[k] = x[1], np.sqrt(P[1, 1])
    return tau, sd


@pytest.mark.parametrize("decay", [0.0, 2.0])
def test_as_printed_hold_runs_the_printed_block(decay):
    log = random_walk(samples=300)
    found = paper("zoh", as_printed=True, decay=decay).estimate(log)
    for joint in (0, 3):
        tau, sd = printed_loop(log, joint, decay)
        # 300 steps of rounding at values of 100 N·m; with expm's, some 1e-13 of its largest entry.
        np.testing.assert_allclose(found.tau[:, joint], tau, atol=1e-9, rtol=0)
        np.testing.assert_allclose(found.sd[:, joint], sd, rtol=1e-9)


def test_as_printed_hold_goes_on_where_a_block_ends():
    observer, log = paper("zoh", as_printed=True), random_walk(PIECE + 900, jitter=0.2)
    whole = observer.estimate(log).tau
    np.testing.assert_array_equal(run_in_blocks(observer, log, PIECE)[0], whole)


def test_as_printed_hold_is_faster_than_the_corrected_one_by_a_quarter_of_a_sample():
    """Its unsymmetric part (Q_τ + Q_p)Ts²/2 pulls: 137.506 → 135.506 ms on J1, to first order."""
    corrected, printed = (paper("zoh", as_printed=x).tuning(STEP, 6) for x in (False, True))
    np.testing.assert_allclose(corrected.delay - printed.delay, STEP / 4, rtol=0.05)
    assert 1e3 * printed.delay[0] == pytest.approx(135.506, abs=0.001)


@pytest.mark.parametrize("decay", [0.0, 1e-3, 0.5, 1.0, 10.0, 50.0])
@pytest.mark.parametrize("step", [0.001, 0.008, 0.1])
def test_hold_is_van_loans_matrix_exponential(decay, step):
    """(43) and (44) with the lower-right block −A_cᵀ, by SciPy's expm."""
    one = Densities(*(np.array([v]) for v in (0.5, 0.01, 5000.0, decay)))
    model = zero_order_hold(np.array(step), one)
    A_c, B_c = np.array([[0.0, 1.0], [0.0, -decay]]), np.array([[1.0], [0.0]])
    Q_c = np.diag([0.01, 5000.0])
    both = expm(np.block([[A_c, B_c], [np.zeros((1, 3))]]) * step)
    M = expm(np.block([[A_c, Q_c], [np.zeros((2, 2)), -A_c.T]]) * step)
    Q = M[:2, 2:] @ M[:2, :2].T
    np.testing.assert_allclose([model.a12[0], model.a22[0]], both[:2, 1], rtol=1e-12)
    np.testing.assert_allclose(both[0, 2], model.step[0], rtol=1e-14)
    # expm itself is good to about 1e-13 of the largest entry
    found = [model.q11[0], model.q12[0], model.q22[0]]
    np.testing.assert_allclose(found, Q[[0, 0, 1], [0, 1, 1]], rtol=1e-9, atol=1e-13 * 5000)


@pytest.mark.parametrize("convention", NOISE_CONVENTIONS)
@pytest.mark.parametrize("scheme", ["fe", "zoh"])
@pytest.mark.parametrize("step", [0.001, 0.008])
def test_closed_form_gains_are_scipys_riccati(scheme, convention, step):
    observer = paper(scheme, convention)
    settled, m = observer.steady(step, 6), observer.model(step, 6)
    prior = observer.first_prior(step, 6)
    for j in (0, 3):
        A = np.array([[1.0, m.a12[j]], [0.0, m.a22[j]]])
        Q = np.array([[m.q11[j], m.q12[j]], [m.q12[j], m.q22[j]]])
        P = solve_discrete_are(A.T, np.array([[1.0], [0.0]]), Q, np.array([[m.r[j]]]))
        found = [getattr(prior, name)[j] for name in ("p11", "p12", "p22")]
        # SciPy's solver is good to about 1e-9 on these ill-scaled problems
        np.testing.assert_allclose(found, [P[0, 0], P[0, 1], P[1, 1]], rtol=1e-8)
        L = P[:, 0] / (P[0, 0] + m.r[j])
        np.testing.assert_allclose([settled.l1[j], settled.l2[j]], L, rtol=1e-8)


@pytest.mark.parametrize(
    ("convention", "omega", "delay"),
    [  # science of the observers: ω_n [rad/s] and delay [ms] of kfo-fe at 125 Hz, J1 and J4
        ("density", (10.00, 7.88), (137.5, 175.7)),
        ("discrete", (33.44, 26.33), (38.7, 50.0)),
        ("literal", (2.99, 2.36), (468.9, 596.5)),
    ],
)
def test_what_the_papers_parameters_mean(convention, omega, delay):
    tuning = paper("fe", convention).tuning(STEP, 6)
    # the table's last printed digit
    np.testing.assert_allclose(tuning.omega_n[[0, 3]], omega, atol=0.005)
    np.testing.assert_allclose(1e3 * tuning.delay[[0, 3]], delay, atol=0.051)


@pytest.mark.parametrize(("decay", "gain"), [(1.0, 0.872), (10.0, 0.278)])
def test_a_decaying_model_loses_gain_at_rest(decay, gain):
    """DC gain of kfo-zoh with A_τ = −a, UR5 J1, as worked out and as the filter really answers."""
    observer = paper("zoh", decay=decay)
    t = np.arange(6000) * STEP
    p = t[:, None] * np.ones(6)
    answer = observer.estimate(DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))).tau[-1]
    tuning = observer.tuning(STEP, 6)
    np.testing.assert_allclose(answer, tuning.dc_gain, rtol=1e-6)
    assert tuning.dc_gain[0] == pytest.approx(gain, abs=1e-3)  # printed digits


def test_forward_euler_refuses_a_decay_it_cannot_hold():
    with pytest.raises(ParameterError, match=r"unstable: decay·Ts = 2\.4"):
        paper("fe", decay=300.0).estimate(random_walk(samples=50))


@pytest.mark.parametrize(
    ("field", "value"),
    [("r_diag", 0.0), ("q_tau_diag", -1.0), ("q_p_diag", -0.1), ("decay", np.nan)],
)
def test_impossible_variances_are_refused(field, value):
    with pytest.raises(ParameterError, match=f"kfo.{field}"):
        KalmanObserver(**{field: value})


@pytest.mark.parametrize("scheme", ["fe", "zoh"])
def test_half_the_power_passes_at_the_bandwidth(scheme):
    """The continuous filter is ω²/(s² + 2ζωs + ω²): solved for |H|² = ½ where it is tuned."""
    tuning = paper(scheme).tuning(STEP, 6)
    s, omega = 2j * np.pi * tuning.bandwidth, tuning.omega_n
    response = omega**2 / (s**2 + 2.0 * tuning.zeta * omega * s + omega**2)
    np.testing.assert_allclose(np.abs(response) ** 2, 0.5, rtol=1e-12)  # rounding


SAMPLES = 3000


def steps(gaps: int = 0, seed: int = 4) -> np.ndarray:
    """8 ms, jittering by 5 %, with some gaps of .9 s."""
    rng = np.random.default_rng(seed)
    dt = 0.008 * (1.0 + 0.05 * rng.uniform(-1.0, 1.0, SAMPLES))
    dt[rng.choice(SAMPLES, gaps, replace=False)] = 0.9
    return dt


def looped(observer, dt: np.ndarray, prior: Covariance, before: Covariance) -> Gains:
    """The covariance recursion as it is written, Joseph's form: each sample a step from `before`.

    Rounding does not add up over the samples.
    """
    model = observer.model(dt[:, None], len(prior.p11))
    found = [joseph(prior, model.r[0])]
    for k in range(1, len(dt)):
        p11, p12, p22 = (p[k - 1] for p in before)
        moved = p12 + model.a12[k] * p22
        p11 = p11 + model.a12[k] * (p12 + moved) + model.q11[k]
        p12, p22 = model.a22[k] * moved + model.q12[k], model.a22[k] ** 2 * p22 + model.q22[k]
        prior = Covariance(p11, p12, p22)
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
    # A nearly constant torque: the blocks need many rounds.
    "constant": ({"q_tau_diag": 1e-6, "q_p_diag": 1e-8}, np.full(900, 0.008), 1e3),
    # With kfo-fe P₁₂ is 3e-6 of √(P₁₁P₂₂) where a block starts.
    "P12 near zero": ({"decay": 2.0, "q_tau_diag": 1e-3}, steps(20, seed=12), 1e4),
}


@pytest.mark.parametrize("scheme", ["fe", "zoh"])
@pytest.mark.parametrize("setting", SETTINGS)
def test_gains_are_those_of_the_plain_loop(setting, scheme):
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
