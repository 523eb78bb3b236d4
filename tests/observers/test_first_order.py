"""FDO and GMO: analytic answers, their identity, uneven clocks, and the printed forms."""

import numpy as np
import pytest
from made_terms import random_walk, run_in_blocks

from vftcli.observers import FilteredDynamicsObserver, KalmanObserver, MomentumObserver
from vftcli.observers.table import Setup, build_observers
from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.arrays import median_step
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.steady_filter import PIECE

RATE = 125.0


def clock(samples: int) -> np.ndarray:
    return np.arange(samples) / RATE


def with_gaps(pieces: int, samples: int = 50) -> DynamicsTerms:
    """4 N·m on so many pieces of a clock that begin every two seconds."""
    t = np.concatenate([k * 2.0 + np.arange(samples) / RATE for k in range(pieces)])
    return DynamicsTerms(t=t, p=np.outer(t, [4.0]), mu=np.zeros((len(t), 1)))


@pytest.mark.parametrize(
    "observer", [FilteredDynamicsObserver(omega=7.0), MomentumObserver(gain=7.0)]
)
@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_agrees_with_the_formula_written_as_a_loop(observer, jitter):
    terms = random_walk(700, jitter, joints=2)
    r, k = np.zeros_like(terms.p), 7.0
    for i in range(1, terms.samples):
        a = 0.5 * k * (terms.t[i] - terms.t[i - 1])
        gained = k * (terms.p[i] - terms.p[i - 1]) - a * (terms.mu[i] + terms.mu[i - 1])
        r[i] = ((1 - a) * r[i - 1] + gained) / (1 + a)
    np.testing.assert_allclose(observer.estimate(terms).tau, r, atol=1e-11)  # rounding of ωp


def test_a_long_gap_restarts_the_filter_and_says_so():
    """Two gaps of .17 s, a = 1.3 there."""
    for observer in (MomentumObserver(gain=15.0), FilteredDynamicsObserver(omega=15.0)):
        estimate = observer.estimate(with_gaps(3, samples=230))
        np.testing.assert_allclose(estimate.tau[[230, 460]], 0.0, atol=1e-12)  # afresh
        # 1.8 s of 15 1/s leave e⁻²⁷
        np.testing.assert_allclose(estimate.tau[-1], 4.0, rtol=1e-9)
        (remark,) = estimate.remarks
        assert (remark.code, remark.level) == ("restarted-after-gaps", "caution")
        assert remark.values == {"gaps": 2, "longest_s": pytest.approx(2.0 - 229 / RATE)}


@pytest.mark.parametrize(("kappa", "restarts"), [(1.5, True), (1.99, True), (2.5, False)])
def test_gains_that_already_alternate_restart_nothing(kappa, restarts):
    """From K·Ts = 2 on the user's own gain makes a > 1 in every step: no gap is to blame."""
    estimate = MomentumObserver(gain=kappa * RATE).estimate(with_gaps(2))
    assert [r.code for r in estimate.remarks] == ["restarted-after-gaps"] * restarts
    assert (estimate.tau[50, 0] == 0.0) == restarts


@pytest.mark.parametrize("episode", [0, 1])
def test_a_slow_clock_that_jitters_has_no_gaps(episode, samples):
    """DROID's 15 Hz: a = .88 to .98 at the median step, steps of 61 to 72 ms, none missed."""
    pytest.importorskip("h5py", reason="h5py, the extra hdf5, is not installed")
    pl = pytest.importorskip("polars")
    robot = load_robot("panda")
    terms = dynamics_terms(read(samples / "droid_raw", episode=episode), robot)
    setup = Setup(robot.gains, {}, 7, median_step(terms.t), as_printed=False)
    (gmo,), _ = build_observers(["gmo"], setup)
    estimate = gmo.estimate(terms)
    assert estimate.remarks == ()
    true = pl.read_parquet(samples / f"droid_raw_{episode}.truth.parquet")["tau_ext/6"]
    # Every observer has .14 to .15 N·m there; with 78 restarts it was .30.
    assert np.sqrt(np.mean((estimate.tau[:, 5] - true.to_numpy()) ** 2)) <= 0.17


def test_as_printed_fdo_leaks_momentum():
    """The printed k₃ leaves ωa/(1+2a)·p of a constant momentum, the corrected one nothing."""
    t = clock(2000)
    terms = DynamicsTerms(t=t, p=np.full((2000, 1), 2.4), mu=np.zeros((2000, 1)))
    printed = FilteredDynamicsObserver(omega=10.0, as_printed=True).estimate(terms).tau[-1, 0]
    a = 10.0 / RATE / 2
    np.testing.assert_allclose(printed, 10.0 * a / (1 + 2 * a) * 2.4, rtol=1e-9)
    corrected = FilteredDynamicsObserver(omega=10.0).estimate(terms).tau[-1, 0]
    np.testing.assert_allclose(corrected, 0.0, atol=1e-12)


@pytest.mark.parametrize(("kappa", "stable"), [(0.3, True), (1.9, True), (2.1, False)])
def test_as_printed_gmo_is_unstable_from_two_on(kappa, stable):
    """z² − (1−κ/2)z + κ/2 = 0 has its roots on the unit circle at κ = 2."""
    terms = random_walk(2000, joints=1)
    printed = MomentumObserver(gain=kappa * RATE, as_printed=True).estimate(terms)
    peak = np.nanmax(np.abs(printed.tau))
    assert (peak < 1e6) == stable
    assert bool(printed.remarks) != stable


def test_as_printed_gmo_agrees_with_its_formula_as_a_loop():
    terms = random_walk(400, joints=2)
    printed = MomentumObserver(gain=10.0, as_printed=True).estimate(terms).tau
    r = np.zeros((401, 2))
    half = 0.5 * 10.0 / RATE
    for i in range(1, 400):
        total = terms.mu[i] + terms.mu[i - 1] + r[i - 1] + (r[i - 2] if i > 1 else 0.0)
        r[i] = r[i - 1] + 10.0 * (terms.p[i] - terms.p[i - 1]) - half * total
    np.testing.assert_allclose(printed, r[:400], atol=1e-11)


@pytest.mark.parametrize("gain", [0.0, -1.0, np.nan, np.inf])
def test_a_gain_that_is_not_positive_is_refused(gain):
    with pytest.raises(ParameterError, match="must be positive"):
        MomentumObserver(gain=gain)
    with pytest.raises(ParameterError, match="must be positive"):
        FilteredDynamicsObserver(omega=gain)


def kalman(as_printed):
    # (44) as printed has no pieces.
    return KalmanObserver(discretisation="fe" if as_printed else "zoh", as_printed=as_printed)


@pytest.mark.parametrize("as_printed", [False, True])
@pytest.mark.parametrize("jitter", [0.0, 0.3])
@pytest.mark.parametrize("observer", [FilteredDynamicsObserver, MomentumObserver, kalman])
def test_blocks_of_a_log_give_the_whole_log_s_estimate(observer, jitter, as_printed):
    log, fdo = random_walk(PIECE + 900, jitter, joints=2), observer(as_printed=as_printed)
    whole = fdo.estimate(log).tau
    np.testing.assert_array_equal(run_in_blocks(fdo, log, PIECE)[0], whole)
    for size in (1, 37, 5000):
        short = slice(0, 300 if size == 1 else None)
        some = {name: getattr(log, name)[short] for name in ("t", "p", "mu")}
        part = DynamicsTerms(**some, log_clock=log.clock)
        # the same sums in another order; momenta of 10 times ω
        found = run_in_blocks(fdo, part, size)[0]
        np.testing.assert_allclose(found, whole[short], rtol=0, atol=1e-11)


def test_gaps_are_counted_over_all_blocks():
    log, gmo = with_gaps(3), MomentumObserver(gain=10.0)
    (tau, remarks), whole = run_in_blocks(gmo, log, 25), gmo.estimate(log)
    assert remarks == whole.remarks
    np.testing.assert_allclose(tau, whole.tau, atol=1e-12)


def test_the_filter_loses_three_decibels_at_its_bandwidth():
    """The bilinear transform warps it: tan(π f Ts) = K·Ts/2; for short steps it is K/2π."""
    slow, fine = (MomentumObserver(gain=10.0).tuning(step, 2) for step in (0.008, 1e-6))
    np.testing.assert_allclose(np.tan(np.pi * slow.bandwidth * 0.008), 0.04, rtol=1e-12)
    np.testing.assert_allclose(fine.bandwidth, 10.0 / (2.0 * np.pi), rtol=1e-9)
    np.testing.assert_allclose(slow.delay, 0.1, rtol=1e-15)
