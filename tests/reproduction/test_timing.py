"""Table II: every part is there, and the paper's way computes what the observers do; keys."""

from functools import partial
from importlib.util import find_spec
from itertools import count as counter

import numpy as np
import pytest

from vftcli.observers import KalmanObserver, MomentumObserver
from vftcli.reproduction import timing
from vftcli.reproduction.paper import AS_PRINTED, CORRECTED
from vftcli.reproduction.timing import (
    circle,
    dense_kalman_loop,
    first_order_loops,
    held_matrices,
    jittering,
    taylor_exponential,
)
from vftcli.robots import load_robot
from vftcli.robots.terms import dynamics_terms

UR5 = load_robot("ur5")
LOG = circle(UR5, 400)
TERMS = dynamics_terms(LOG, UR5)
STEP = LOG.median_step


def test_every_observer_has_its_time_with_the_dynamics_in_it(monkeypatch) -> None:
    """By a clock on which every call takes a second; the printed way runs over an eighth."""
    ticks = counter()
    monkeypatch.setattr("time.perf_counter", lambda: float(next(ticks)))
    monkeypatch.setattr(timing, "SCRIPT_SAMPLES", 50)
    monkeypatch.setattr(timing, "SAMPLES", 400)
    values = {(variant, key): value for variant, key, value in timing.computing_time(0)}
    # FDO and GMO run in one loop, each half of it
    for variant, dynamics, own in (
        (AS_PRINTED, 8.0, {"fdo": 4.0, "gmo": 4.0, "kfo-fe": 8.0, "kfo-zoh": 8.0}),
        (CORRECTED, 1.0, dict.fromkeys(timing.PAPER, 1.0)),
    ):
        for name, seconds in own.items():
            total = dynamics + seconds
            assert values[variant, f"seconds/{name}"] == total
        for name in ("fdo", "kfo-fe"):
            ratio = (dynamics + own["kfo-zoh"]) / (dynamics + own[name])
            assert values[variant, f"zoh/{name}"] == pytest.approx(ratio)
    # Three rounds; ours have another before, two cores and the loop of `rnea`.
    assert next(ticks) == 2 * (4 * 8 + 3 * 5)


def test_the_timed_motion_is_a_round_of_4_s_and_its_clock_may_jitter() -> None:
    """.4 rad to each side at 125 Hz, each joint at its own phase; the clock by half of 5 %."""
    log = circle(UR5, 2000)
    np.testing.assert_allclose(log.t, np.arange(2000) / 125.0)
    phase = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, 6) + 0.5 * np.pi * log.t[:, None]
    np.testing.assert_allclose(log.q, 0.4 * np.sin(phase), atol=1e-12)
    np.testing.assert_allclose(log.require("dq"), 0.2 * np.pi * np.cos(phase), atol=1e-12)
    strayed = (jittering(log).t - log.t) / log.median_step
    # the ends of 2000 even draws
    assert (strayed.min(), strayed.max()) == pytest.approx((-0.025, 0.025), rel=0.01)


def test_the_first_order_loop_is_the_momentum_observer() -> None:
    expected = MomentumObserver(gain=10.0).estimate(TERMS).tau
    for count in (2, 3, 400):
        fdo, gmo = first_order_loops(TERMS.p[:count], TERMS.mu[:count], STEP)
        # The same recursion in another order of sums; torques are some tens of N·m.
        np.testing.assert_allclose(gmo, expected[count - 1], atol=1e-9)
        # With K = ω they are one filter.
        np.testing.assert_allclose(fdo, expected[count - 1], atol=1e-9)


@pytest.mark.parametrize("rebuild", [False, True])
def test_the_dense_loop_is_the_steady_kalman_observer(rebuild: bool) -> None:
    kalman = KalmanObserver(discretisation="zoh", r_diag=0.5, q_p_diag=0.01, q_tau_diag=5000.0)
    found = dense_kalman_loop(TERMS.p, TERMS.mu, STEP, kalman, rebuild=rebuild)
    expected = kalman.estimate(TERMS).tau[-1]
    # Started at the steady covariance the two agree to the Riccati equation's accuracy.
    np.testing.assert_allclose(found[6:], expected, rtol=1e-6, atol=1e-6)


def test_the_series_is_the_exponential() -> None:
    from scipy.linalg import expm

    A = 0.05 * np.random.default_rng(0).normal(size=(4, 4))
    # The first term left out is ‖A‖⁶/6! with ‖A‖ of about 0.2.
    np.testing.assert_allclose(taylor_exponential(A), expm(A), atol=1e-6)
    to_the_fifth = 1 + 1 + 1 / 2 + 1 / 6 + 1 / 24 + 1 / 120
    assert taylor_exponential(np.ones((1, 1)))[0, 0] == pytest.approx(to_the_fifth, rel=1e-14)


def test_the_held_matrices_are_those_of_an_integrator_pair() -> None:
    h, q_p, q_tau = 0.008, np.array([0.01]), np.array([5000.0])
    A, B, Q = held_matrices(h, q_p, q_tau)
    np.testing.assert_allclose(A, [[1, h], [0, 1]], atol=1e-15)
    np.testing.assert_allclose(B, [[h], [0]], atol=1e-15)
    across = q_tau[0] * h**2 / 2
    exact = [[q_p[0] * h + q_tau[0] * h**3 / 3, across], [across, q_tau[0] * h]]
    np.testing.assert_allclose(Q, exact, rtol=1e-12)


def test_the_median_of_interleaved_rounds_counts(monkeypatch: pytest.MonkeyPatch) -> None:
    clock = iter([0.0, 30.0, 0.0, 4.0, 0.0, 1.0, 0.0, 5.0, 0.0, 2.0, 0.0, 6.0])
    monkeypatch.setattr("time.perf_counter", lambda: next(clock))
    called: list[str] = []
    work = {name: partial(called.append, name) for name in "ab"}
    assert timing.median_times(work, rounds=3) == {"a": 2.0, "b": 5.0}
    assert called == list("ababab")


@pytest.mark.slow
def test_the_keys_that_scripts_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """By a clock on which every call takes a second."""
    ticks = counter()
    monkeypatch.setattr("time.perf_counter", lambda: float(next(ticks)))
    found = timing.benchmark("ur5", samples=1200, rounds=2)
    assert [row["name"] for row in found["observers"]] == ["fdo", "gmo", "kfo-fe", "kfo-zoh"]
    assert [row["paper_s"] for row in found["observers"]] == [10.869, 10.541, 17.578, 58.363]
    once = {"total_s": 1.0, "per_sample_us": pytest.approx(1e6 / 1200)}
    for row in (*found["observers"], found["dynamics"]):
        assert {key: row[key] for key in once} == once
    assert found["simd"] == timing.simd()
    names = ["core_over_rnea_loop", "core_over_rnea_loop_jittering"]
    assert found["ratios"] == (dict.fromkeys(names, 1.0) if find_spec("pinocchio") else {})
    assert (found["samples"], found["rounds"], found["robot"]) == (1200, 2, "ur5")
