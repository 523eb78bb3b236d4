"""White noise and model error from the free part: against drawn processes and another optimiser."""

from dataclasses import replace

import numpy as np
import pytest
from made_runs import samples_of
from scipy.optimize import minimize

from vftcli.robots import load_robot
from vftcli.robots.friction import PUSHED_SHARE, REST_SHARE, dry_torques
from vftcli.robots.run import RunSamples
from vftcli.robots.terms import Blocks
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.rest import NEAR_REST
from vftcli.wrench.model_error import (
    ASSUMED_SHARE,
    UNSEEN_SHARE,
    fit_spectrum,
    periodogram,
    torque_noise,
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
def test_a_drawn_process_is_found_again(sd: float, time: float) -> None:
    """20 000 blocks: 2000 s of T ≤ 4 s fix s² to √(2·4/2000) = 6 % and T to about twice that."""
    d = wandering(20_000, sd, time, 1) + 0.3 * np.random.default_rng(2).standard_normal(20_000)
    f = np.fft.rfftfreq(len(d), SECONDS)[1:]
    found = fit_spectrum(f, periodogram(d[:, None], SECONDS)[:, 0], SECONDS, 2000.0)
    assert found[0] == pytest.approx(0.09, rel=0.15)
    assert np.sqrt(found[1]) == pytest.approx(sd, rel=0.1)
    assert found[2] == pytest.approx(time, rel=0.2)


@pytest.mark.parametrize("seed", range(4))
def test_no_other_optimiser_finds_a_likelier_noise(seed: int) -> None:
    """Nelder–Mead from the truth on 500 blocks; the grid's last step leaves under .2 nats."""
    d = wandering(500, 1.5, 1.2, seed) + 0.5 * np.random.default_rng(seed).standard_normal(500)
    f = np.fft.rfftfreq(len(d), SECONDS)[1:]
    P = periodogram(d[:, None], SECONDS)[:, 0]
    found = fit_spectrum(f, P, SECONDS, 50.0)
    start = np.log([0.25, 2.25, 1.2])
    other = minimize(cost, start, args=(f, P), method="Nelder-Mead", options={"maxiter": 2000})
    assert cost(np.log(found), f, P) <= other.fun + 0.2


def test_a_joint_without_disturbance_has_no_noise() -> None:
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


def blocks(velocity: np.ndarray) -> Blocks:
    """Blocks of .1 s in which the joints are as fast as given. (K, 6)"""
    count = len(velocity)
    nothing = np.zeros((count, 6))
    t = SECONDS * (np.arange(count) + 0.5)
    return Blocks(
        t, np.full(count, SECONDS), nothing, nothing, velocity, np.ones(count, dtype=bool)
    )


LOG = blocks(np.ones((50, 6)))


def test_rest_and_joints_that_never_moved_have_the_drives_share() -> None:
    moving = np.array([1.0, 1, 1, 0, 0, 0])
    dry = dry_torques(UR5)
    found = torque_noise(LOG, [free_run(moving)], UR5, SECONDS)
    # error of sd 1 and offset .5; 60 s of T = .5 s leave s² uncertain by √(2·.5/60) = 13 %
    np.testing.assert_allclose(found.moving[:3], 1.25, rtol=0.4)
    np.testing.assert_array_less((UNSEEN_SHARE * dry[3:]) ** 2 + 0.8, found.moving[3:])
    assert np.all(found.moving_time[3:] >= 1.0)
    variance, time = found.stationary(blocks(np.zeros((1, 6))))
    np.testing.assert_array_less((REST_SHARE * dry) ** 2 - 1e-12, variance[0])
    assert np.all(time >= 2.0)
    assert found.free_seconds == pytest.approx(60.0, abs=2.0)  # from first to last motion


def test_rests_before_and_after_the_motion_teach_nothing() -> None:
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


def test_without_free_motion_the_dry_friction_is_taken_and_said() -> None:
    rng = np.random.default_rng(3)
    noisy = LOG._replace(d=0.2 * rng.standard_normal((50, 6)))
    for free in ([], [free_run(np.ones(6), seconds=1.0)]):  # ten blocks are no spectrum
        found = torque_noise(noisy, free, UR5, SECONDS)
        assert found.free_seconds == 0.0
        dry = dry_torques(UR5)
        np.testing.assert_allclose(found.moving, np.maximum(ASSUMED_SHARE * dry, 0.3) ** 2)
        still = blocks(np.zeros((1, 6)))
        resting = found.stationary(still)[0][0]
        np.testing.assert_allclose(resting, np.maximum(REST_SHARE * dry, 0.3) ** 2)
        held = found.stationary(still, np.ones(1, bool))[0][0]
        settled = np.maximum(REST_SHARE * dry, 0.3) * PUSHED_SHARE / REST_SHARE
        np.testing.assert_allclose(held, found.moving + settled**2)
        # a bend has 1.5 R; the median of χ² of one degree is .455
        bend = noisy.d[1:-1] - 0.5 * (noisy.d[2:] + noisy.d[:-2])
        np.testing.assert_allclose(found.white * 1.5 * 0.455, np.median(bend**2, axis=0))


def test_near_a_rest_stiction_counts_where_it_is_assumed() -> None:
    velocity = np.ones((50, 6))
    velocity[20:25, 2] = 0.0
    log = blocks(velocity)
    assumed = torque_noise(log, [], UR5, SECONDS)
    assert assumed.near == NEAR_REST
    for near, expected in ((2.5 * SECONDS, range(18, 27)), (0.0, range(20, 25))):
        variance = assumed._replace(near=near).stationary(log)[0][:, 2]
        assert np.flatnonzero(variance > variance[0]).tolist() == list(expected)


def test_a_sigmoids_dry_torque_is_its_amplitude() -> None:
    panda = load_robot("panda")
    amplitudes = [joint.parameters["amplitude"] for joint in panda.friction]
    np.testing.assert_allclose(dry_torques(panda), np.abs(amplitudes))
    assert not dry_torques(replace(UR5, friction=())).any()
