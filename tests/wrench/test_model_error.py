"""White noise and model error from the free part: against drawn processes and another optimiser."""

from dataclasses import replace

import numpy as np
import pytest
from drawn_blocks import B, blocks, drawn, noise
from made_runs import samples_of
from scipy.optimize import minimize

from vftcli.robots import load_robot
from vftcli.robots.friction import CREEP_SHARE, PUSHED_SHARE, REST_SHARE, STOP_SHARE, dry_torques
from vftcli.robots.run import RunSamples
from vftcli.robots.terms import Blocks
from vftcli.signals.estimation import SPIKE
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.rest import NEAR_REST
from vftcli.wrench.model_error import (
    ASSUMED_SHARE,
    LEAST_TIME,
    UNKNOWN,
    UNSEEN_SHARE,
    error_process,
    fit_spectrum,
    infer_noise,
    innovations,
    learn_noise,
    periodogram,
    spiked_white,
    torque_noise,
    without_reversals,
)

STEP = 0.01
SECONDS = 0.1
UR5 = load_robot("ur5")


def wandering(count: int, sd: float, time: float, seed: int, step: float = SECONDS) -> np.ndarray:
    """An Ornstein–Uhlenbeck process from its stationary state on. (count,)"""
    a, draws = np.exp(-step / time), np.random.default_rng(seed).standard_normal(count)
    x = [sd * draws[0]]
    for draw in draws[1:]:
        x.append(a * x[-1] + sd * np.sqrt(1.0 - a * a) * draw)
    return np.array(x)


def cost(logs: np.ndarray, f: np.ndarray, P: np.ndarray) -> float:
    """Whittle's likelihood with the prior of T, from its definition; of ln R, ln s², ln T."""
    R, s2, T = np.exp(logs)
    a = np.exp(-SECONDS / T)
    S = SECONDS * (R + s2 * (1 - a**2) / (1 - 2 * a * np.cos(2 * np.pi * f * SECONDS) + a**2))
    return float(np.sum(np.log(S) + P / S) + 0.5 * ((logs[2] - np.log(0.5)) / 1.5) ** 2)


@pytest.mark.parametrize(("sd", "time"), [(2.0, 0.5), (3.0, 4.0)])
def test_a_drawn_process_is_found_again(sd, time):
    """20 000 blocks: 2000 s of T ≤ 4 s fix s² to √(2·4/2000) = 6 % and T to about twice that."""
    d = wandering(20_000, sd, time, 1) + 0.3 * np.random.default_rng(2).standard_normal(20_000)
    f = np.fft.rfftfreq(len(d), SECONDS)[1:]
    found = fit_spectrum(f, periodogram(d[:, None], SECONDS)[:, 0], SECONDS, 2000.0)
    assert found[0] == pytest.approx(0.09, rel=0.15)
    assert np.sqrt(found[1]) == pytest.approx(sd, rel=0.1)
    assert found[2] == pytest.approx(time, rel=0.2)


@pytest.mark.parametrize("seed", range(4))
def test_no_other_optimiser_finds_a_likelier_noise(seed):
    """Nelder–Mead from the truth on 500 blocks; the grid's last step leaves under .2 nats."""
    d = wandering(500, 1.5, 1.2, seed) + 0.5 * np.random.default_rng(seed).standard_normal(500)
    f = np.fft.rfftfreq(len(d), SECONDS)[1:]
    P = periodogram(d[:, None], SECONDS)[:, 0]
    found = fit_spectrum(f, P, SECONDS, 50.0)
    start = np.log([0.25, 2.25, 1.2])
    other = minimize(cost, start, args=(f, P), method="Nelder-Mead", options={"maxiter": 2000})
    assert cost(np.log(found), f, P) <= other.fun + 0.2


def test_a_joint_without_disturbance_has_no_noise():
    f = np.fft.rfftfreq(100, SECONDS)[1:]
    found = fit_spectrum(f, np.zeros(50), SECONDS, 10.0)
    assert np.all(np.isfinite(found))
    assert found[0] > 0.0


def free_run(moving: np.ndarray, seconds: float = 60.0) -> RunSamples:
    """An arm whose joints move or rest throughout: offset .5 N·m, error sd 1 N·m, T .5 s."""
    t = np.arange(0.0, seconds, STEP)
    torque = np.column_stack([wandering(len(t), 1.0, 0.5, j, STEP) for j in range(6)]) + 0.5
    q = 0.5 * np.cos(0.4 * t)[:, None] * moving
    p = np.cumsum(torque, axis=0) * STEP
    terms = DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))
    return samples_of(terms, np.ones(len(t), dtype=bool), q)


def blocks_at(velocity: np.ndarray) -> Blocks:
    """Blocks of .1 s in which the joints are as fast as given. (K, 6)"""
    nothing = np.zeros_like(velocity)
    t = SECONDS * (np.arange(len(velocity)) + 0.5)
    return Blocks(t, np.full_like(t, SECONDS), nothing, nothing, velocity, t > 0.0)


LOG = blocks_at(np.ones((50, 6)))


def test_rest_and_joints_that_never_moved_have_the_drives_share():
    moving = np.array([1.0, 1, 1, 0, 0, 0])
    dry = dry_torques(UR5)
    found = torque_noise(LOG, [free_run(moving)], UR5, SECONDS)
    # error of sd 1 and offset .5; 60 s of T = .5 s leave s² uncertain by √(2·.5/60) = 13 %
    np.testing.assert_allclose(found.moving[:3], 1.25, rtol=0.4)
    np.testing.assert_array_less((UNSEEN_SHARE * dry[3:]) ** 2 + 0.8, found.moving[3:])
    assert np.all(found.moving_time[3:] >= 1.0)
    variance, time = found.stationary(blocks_at(np.zeros((1, 6))))
    np.testing.assert_array_less((REST_SHARE * dry) ** 2 - 1e-12, variance[0])
    assert np.all(time >= 2.0)
    assert found.free_seconds == pytest.approx(60.0, abs=2.0)  # from first to last motion


def test_rests_before_and_after_the_motion_teach_nothing():
    """20 s at rest under 5 N·m beside 60 s of motion leave the motion's noise as it is."""
    piece = free_run(np.ones(6))
    run = piece.run
    t = np.concatenate([run.terms.t, run.terms.t[-1] + STEP * np.arange(1, 2001)])
    p = np.concatenate([run.terms.p, run.terms.p[-1] + 5.0 * (t[-2000:, None] - run.terms.t[-1])])
    q = np.concatenate([run.q, np.repeat(run.q[-1:], 2000, axis=0)])
    terms = DynamicsTerms(t=t, p=p, mu=np.zeros_like(p))
    longer = samples_of(terms, np.ones(len(t), dtype=bool), q)
    alone, both = (torque_noise(LOG, [each], UR5, SECONDS) for each in (piece, longer))
    # the block in which motion ends may fall on either side
    np.testing.assert_allclose(both.moving, alone.moving, rtol=0.05)


def test_without_free_motion_the_dry_friction_is_taken_and_said():
    rng = np.random.default_rng(3)
    noisy = LOG._replace(d=0.2 * rng.standard_normal((50, 6)))
    for free in ([], [free_run(np.ones(6), seconds=1.0)]):  # ten blocks are no spectrum
        found = torque_noise(noisy, free, UR5, SECONDS)
        assert found.free_seconds == 0.0
        dry = dry_torques(UR5)
        np.testing.assert_allclose(found.moving, np.maximum(ASSUMED_SHARE * dry, 0.3) ** 2)
        still = blocks_at(np.zeros((1, 6)))
        resting = found.stationary(still)[0][0]
        np.testing.assert_allclose(resting, np.maximum(REST_SHARE * dry, 0.3) ** 2)
        held = found.stationary(still, np.ones(1, bool))[0][0]
        settled = np.maximum(REST_SHARE * dry, 0.3) * PUSHED_SHARE / REST_SHARE
        np.testing.assert_allclose(held, found.moving + settled**2)
        # a bend has 1.5 R; the median of χ² of one degree is .455
        bend = noisy.d[1:-1] - 0.5 * (noisy.d[2:] + noisy.d[:-2])
        np.testing.assert_allclose(found.white * 1.5 * 0.455, np.median(bend**2, axis=0))


def test_near_a_rest_stiction_counts_where_it_is_assumed():
    velocity = np.ones((50, 6))
    velocity[20:25, 2] = 0.0
    log = blocks_at(velocity)
    assumed = torque_noise(log, [], UR5, SECONDS)
    assert assumed.near == NEAR_REST
    for near, expected in ((2.5 * SECONDS, range(18, 27)), (0.0, range(20, 25))):
        variance = assumed._replace(near=near).stationary(log)[0][:, 2]
        assert np.flatnonzero(variance > variance[0]).tolist() == list(expected)


def test_a_sigmoids_dry_torque_is_its_amplitude():
    panda = load_robot("panda")
    amplitudes = [joint.parameters["amplitude"] for joint in panda.friction]
    np.testing.assert_allclose(dry_torques(panda), np.abs(amplitudes))
    assert not dry_torques(replace(UR5, friction=())).any()


def test_what_was_drawn_is_learned():
    d = drawn(4000, np.random.default_rng(1))
    found = learn_noise([blocks(d, np.full_like(d, 0.5))], np.array([10.0]))
    # 96 s hold 120 correlation times: the variance is known to some 13 %, two of its deviations.
    np.testing.assert_allclose(found.variance, 0.25, rtol=0.3)
    np.testing.assert_allclose(found.white, 0.01, rtol=0.15)
    np.testing.assert_allclose(found.time, 0.4, rtol=0.35)
    assert found.seen[0]
    # an offset is an error too
    shifted = learn_noise([blocks(d + 3.0, np.full_like(d, 0.5))], np.array([10.0]))
    assert shifted.variance[0] > found.variance[0] + 8.0
    # ten blocks are no spectrum
    assert learn_noise([blocks(d[:10], d[:10])], np.array([10.0])) is None


def test_the_noise_of_a_log_itself_is_no_less_than_what_was_learned():
    """A joint that moves: as wide as where it is quietest, and at least .2 of its friction."""
    log = blocks(drawn(8000, np.random.default_rng(7)), np.full((8000, 1), 0.5))
    dry = np.array([0.1])
    alone = infer_noise(log, dry, None)
    # Second differences of b are noise too, γ₀(6 − 8f + 2f²); robust, of 8000: 1.5 %.
    f = np.exp(-B / 0.4)
    np.testing.assert_allclose(alone.white, 0.01 + 0.25 * (1 - 4 * f / 3 + f * f / 3), rtol=0.05)
    # b of .5 N·m and the white noise of .1: the quantile of 480 correlation times: 7 %.
    np.testing.assert_allclose(alone.variance, 0.26, rtol=0.2)
    assert alone.time[0] == LEAST_TIME
    for variance, time, found in ((9.0, 0.1, 0.1), (1e-4, 0.1, LEAST_TIME), (1e-4, 2.0, 2.0)):
        fitted = {"white": [4.0], "variance": [variance], "time": [time]}
        learned = noise()._replace(**{name: np.array(x) for name, x in fitted.items()})
        both = infer_noise(log, dry, learned)
        assert (both.white[0], both.time[0], both.free_seconds) == (4.0, found, 4.0)
        assert both.variance[0] == max(variance, alone.variance[0])
    # its friction says more than the quietest
    strong = infer_noise(log, np.array([10.0]), noise())
    assert strong.variance[0] == pytest.approx((0.2 * 10.0) ** 2)
    assert (strong.at_rest[0], strong.pushed[0]) == (noise().at_rest[0], noise().pushed[0])
    assert infer_noise(blocks(np.zeros((2, 1)), np.zeros((2, 1))), dry, None) is None


def test_reversals_are_bridged_in_a_straight_line():
    d = np.arange(6.0)[:, None]
    d[3] = 50.0
    velocity = np.array([0.3, 0.2, 0.1, 0.0, -0.1, -0.2])[:, None]
    bridged = without_reversals(blocks(d, velocity), np.array([True])).d
    np.testing.assert_allclose(bridged[:, 0], np.arange(6.0))


def test_the_filter_of_the_error_agrees_with_a_dense_solve():
    """Σ ν²/S is dᵀ C⁻¹ d with the dense covariance of the model."""
    log = blocks(drawn(40, np.random.default_rng(3)), np.full((40, 1), 0.5))
    process = error_process(noise(), log)._replace(spikes=np.full((40, 1), 1e-300))
    squares = innovations(log.d, process)[0]
    lag = np.abs(log.t[:, None] - log.t)
    covariance = 0.25 * np.exp(-lag / 0.4) + 0.01 * np.eye(40)
    # Rounding of a 40×40 solve.
    exact = log.d[:, 0] @ np.linalg.solve(covariance, log.d[:, 0])
    np.testing.assert_allclose(squares.sum(), exact, rtol=1e-9)


def test_a_bad_sample_is_a_spike():
    d = np.zeros((50, 1))
    d[25] = 20.0
    log = blocks(d, np.full((50, 1), 0.5))
    course = error_process(noise(), log)
    white = spiked_white(d, course)
    assert white[25, 0] > (SPIKE - 1.0) * course.white[25, 0]
    assert np.all(np.delete(white, 25) == np.delete(course.white, 25))


def test_a_joint_that_stops_draws_its_stiction():
    velocity = np.concatenate([np.full(20, 0.5), np.zeros(20)])[:, None]
    course = error_process(noise(), blocks(np.zeros((40, 1)), velocity))
    assert course.added[20, 0] == (STOP_SHARE * 10.0) ** 2
    assert course.decay[20, 0] < 0.01
    # It moves away again: b may change at once.
    back = error_process(noise(), blocks(np.zeros((40, 1)), velocity[::-1]))
    assert back.decay[20, 0] < course.decay[30, 0]


def test_a_joint_that_turns_round_may_show_any_friction_for_a_moment():
    """In the blocks beside the turn, and only if it moves: noise at rest turns nothing."""
    velocity = np.column_stack([np.linspace(0.5, -0.5, 20), 0.005 * (-1.0) ** np.arange(20)])
    course = error_process(noise(2), blocks(np.zeros((20, 2)), velocity))
    turned = np.isin(np.arange(20), [9, 10])
    np.testing.assert_allclose(course.white[:, 0], 0.01 + turned * (CREEP_SHARE * 10.0) ** 2)
    np.testing.assert_allclose(course.white[:, 1], 0.01)
    # a gap says nothing
    known = np.arange(20) != 7
    gap = error_process(noise(2), blocks(np.zeros((20, 2)), velocity, known))
    assert gap.white[7].tolist() == [UNKNOWN, UNKNOWN]


def test_a_push_frees_the_stiction_of_joints_at_rest_only():
    log = blocks(np.zeros((20, 2)), np.tile([0.0, 0.5], (20, 1)))
    strict = error_process(noise(2), log)
    free = error_process(noise(2), log, np.arange(20) >= 10)
    stationary = free.added[15] / (1.0 - free.decay[15] ** 2)
    np.testing.assert_allclose(stationary, [0.25 + (PUSHED_SHARE * 10.0) ** 2, 0.25])
    np.testing.assert_array_equal(free.added[5], strict.added[5])


def test_a_joint_that_the_free_part_never_moved_errs_by_its_friction():
    log = blocks(np.zeros((20, 1)), np.full((20, 1), 0.5))
    course = error_process(noise(seen=False), log)
    stationary = course.added[10, 0] / (1.0 - course.decay[10, 0] ** 2)
    np.testing.assert_allclose(stationary, 0.25 + 4.0)
