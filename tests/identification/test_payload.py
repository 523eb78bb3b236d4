"""A load on the flange, on equations whose answer is known."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.identification.payload import (
    REACH,
    STRETCHES,
    NotSameMotionError,
    alignment_of_pair,
    fit_all_joints,
    load_at_flange,
    load_friction,
    payload_from_pair,
    payload_from_poses,
    resting_poses,
)
from vftcli.robots import Payload, load_robot
from vftcli.robots.kernels import LINK, chain_parameters, torque_regressor
from vftcli.robots.terms import gravity_torque
from vftcli.signals.errors import IdentificationError
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import fact
from vftcli.signals.rest import held
from vftcli.simulation import load_scenario
from vftcli.simulation.experiment import simulate_pair

PANDA, UR5 = load_robot("panda"), load_robot("ur5")
SOURCE = fact("load-from-poses", poses=4)


def load(mass, com, sd=(0.01, 0.001, 0.002, 0.003)):
    """A load of this mass that was solved for at `com` in the last link's frame of a Panda."""
    x = np.array([mass, *(mass * np.array(com))])
    return load_at_flange(x, np.array(sd), np.zeros(7), PANDA, (), SOURCE)


def test_the_load_is_moved_to_flange_axes():
    chain = PANDA.chain
    com = np.array([0.02, -0.01, 0.05])
    in_link = chain.flange_rotation @ com + chain.flange_translation
    fit = load(2.0, in_link)
    np.testing.assert_allclose(fit.payload.com, com, atol=1e-12)
    assert (fit.payload.mass, fit.mass_sd) == (2.0, 0.01)
    # the Panda's flange is not turned against its last link: sd of m·c over m
    turned = np.abs(chain.flange_rotation.T) @ np.array([0.0005, 0.001, 0.0015])
    assert np.sum(fit.com_sd**2) == pytest.approx(np.sum(np.square([0.0005, 0.001, 0.0015])))
    assert np.all(fit.com_sd <= turned + 1e-12)


@pytest.mark.parametrize(
    ("mass", "sd", "com", "words"),
    [
        (-0.1, 0.01, 0.0, "no load found"),
        (0.0, 0.0, 0.0, "no load found: mass 0"),
        (1.0, 0.51, 0.0, "no load found: mass 1 ± 1 kg"),
        (1.0, 0.49, 1.2, "m from the flange"),
    ],
)
def test_what_cannot_be_a_load_is_refused(mass, sd, com, words):
    with pytest.raises(IdentificationError, match=words):
        load(mass, [0, 0, com], (sd, 0.1, 0.1, 0.1))
    # known to half, and as far away as a load may be: the Panda's flange lies along z
    far = PANDA.chain.flange_translation + np.array([REACH, 0.0, 0.0])
    assert load(1.0, far, (0.5, 0.1, 0.1, 0.1)).payload.com[0] == REACH


def test_each_joint_counts_by_its_own_residual():
    rng = np.random.default_rng(0)
    A = rng.standard_normal((400, 3, 2))
    x = np.array([1.5, -0.5])
    noise = rng.standard_normal((400, 3)) * [0.01, 0.01, 10.0]
    y = np.einsum("knp,p->kn", A, x) + noise
    # the noisy joint hardly counts: 0.01/√800 = 4e-4
    np.testing.assert_allclose(fit_all_joints(A, y, np.ones((400, 3))).x, x, atol=2e-3)
    usable = np.ones((400, 3))
    usable[:, 2] = 0.0
    spoilt = y.copy()
    spoilt[:, 2] = 1e6
    np.testing.assert_allclose(fit_all_joints(A, spoilt, usable).x, x, atol=2e-3)
    # zeros on both sides, as of a base joint with a vertical axis, leave nothing to divide by
    A[:, 0] = 0.0
    found = fit_all_joints(A, np.einsum("knp,p->kn", A, x), np.ones((400, 3)))
    np.testing.assert_allclose(found.x, x, rtol=1e-9)


def test_friction_grows_with_the_load_where_the_joint_moves():
    rng = np.random.default_rng(1)
    q, sign = rng.uniform(-1, 1, (20, 6)), np.sign(rng.standard_normal((20, 6)))
    mass = Payload(mass=2.0, com=np.zeros(3), inertia=np.zeros((3, 3)))
    loaded = UR5.with_payload(mass)
    x = (chain_parameters(loaded.loaded_chain) - chain_parameters(UR5.chain))[-LINK:][:4]
    columns = load_friction(UR5, q, sign, x)
    growth = np.abs(gravity_torque(loaded, q)) - np.abs(gravity_torque(UR5, q))
    np.testing.assert_allclose(np.einsum("kjj->kj", columns), growth * sign, atol=1e-9)
    off = columns.copy()
    off[:, range(6), range(6)] = 0.0
    assert not off.any()


def swinging(shift=0.0, bend=0.0, seconds=12.0):
    """A UR5 that swings, its clock later by `shift` [s] and its path bent by `bend` [rad]."""
    t = np.arange(0, seconds, 0.01)
    at = t + shift
    q = 0.4 * np.sin(0.8 * at)[:, None] * [1, 0.7, 0.9, 0.5, 0.6, 0.8] + [0, -1, 1, 0, 0.5, 0]
    dq = 0.32 * np.cos(0.8 * at)[:, None] * [1, 0.7, 0.9, 0.5, 0.6, 0.8]
    q[:, 1] += bend * np.sin(3.1 * at)
    return t, q, dq


def test_a_pair_that_moves_by_its_positions_alone_is_refused_in_one_line():
    """All velocities are zero, as of a driver that leaves them out: no motion is left to fit."""
    t, q, _ = swinging()
    silent = Recording(t=t, q=q, dq=0 * q, current=0 * q)
    with pytest.raises(IdentificationError, match="moves; a pair must repeat one trajectory"):
        payload_from_pair(silent, replace(silent), load_robot("ur5"))


def test_another_motion_is_no_pair():
    t, q, dq = swinging()
    log = Recording(t=t, q=q, dq=dq, torque=0 * q)
    # .03 rad in one of six joints is .03/√12 = 8.7 mrad rms: more than 5 mrad
    with pytest.raises(NotSameMotionError, match="different motions: positions differ by 8"):
        alignment_of_pair(log, replace(log, q=swinging(bend=0.03)[1]))
    near = alignment_of_pair(log, replace(log, q=swinging(bend=0.015)[1]))
    assert near.deviation == pytest.approx(4.3e-3, rel=0.05)
    # one motion 1 % slower is another
    with pytest.raises(NotSameMotionError, match="different motions"):
        alignment_of_pair(log, replace(log, t=1.01 * t))


@pytest.mark.parametrize("swap", [False, True])
def test_the_heavier_log_of_a_pair_shows_by_itself(swap):
    load = Payload(mass=1.2, com=np.array([0.03, 0.0, 0.06]), inertia=np.zeros((3, 3)))
    t, q, dq = swinging()
    ddq = -(0.8**2) * (q - [0, -1, 1, 0, 0.5, 0])
    logs = []
    for robot, begin in ((UR5, 0.25), (UR5.with_payload(load), 0.0)):
        torque = torque_regressor(UR5.chain, q, dq, ddq) @ chain_parameters(robot.loaded_chain)
        torque = torque + 5.0 * np.tanh(dq / 0.01) + 8.0 * dq
        logs.append(Recording(t=t + begin, q=q, dq=dq, current=torque / UR5.torque_constant))
    free, loaded = logs
    fit = payload_from_pair(*((loaded, free) if swap else (free, loaded)), UR5)
    assert fit.carried_by(loaded)
    assert not fit.carried_by(free)
    # no noise: what is left is the filter's (0.8/50)⁸ and the shift's 0.5 ms
    assert fit.payload.mass == pytest.approx(1.2, rel=5e-3)
    np.testing.assert_allclose(fit.payload.com, load.com, atol=3e-3)
    assert fit.origin.code == "load-from-pair"
    # of the free log's clock onto the loaded one's
    assert fit.origin.values["shift_s"] == pytest.approx(-0.25, abs=1e-3)
    assert fit.origin.values["distance_mrad"] < 0.1


def steps(poses, dwell=1.0, load=None):
    """A UR5 that jumps from pose to pose, moving fast for 0.2 s between them."""
    count, move = round(dwell / 0.01), 20
    q = np.repeat(poses, count + move, axis=0)
    for k in range(1, len(poses)):
        edge = k * (count + move)
        share = np.linspace(0, 1, move)[:, None]
        q[edge - move : edge] = (1 - share) * poses[k - 1] + share * poses[k]
    torque = gravity_torque(UR5.with_payload(load), q)
    t = 0.01 * np.arange(len(q))
    return Recording(t=t, q=q, dq=0 * q, current=torque / UR5.torque_constant)


POSES = np.random.default_rng(3).uniform(-1, 1, (5, 6)) + np.array([0, -1, 1, 0, 0, 0])


def test_rests_are_averaged_without_their_edges():
    recording = steps(POSES)
    settling = recording.current.copy()
    for k in range(5):  # 0.2 s after each arrival, of which the window takes 0.1 s
        settling[120 * k : 120 * k + 20] += 1.0
    q, torque = resting_poses(replace(recording, current=settling), UR5)
    np.testing.assert_allclose(q, POSES, atol=1e-12)
    np.testing.assert_allclose(torque, gravity_torque(UR5, POSES), atol=1e-9)
    assert len(resting_poses(steps(POSES, dwell=0.45), UR5)[0]) < 5  # shorter than a dwell
    moving = ~held(recording.q, recording.median_step)
    assert moving[100:120].all()
    assert not moving[130:209].any()  # half a window of 0.2 s inside the rest


def test_a_load_is_found_from_poses_and_too_few_are_refused():
    load = Payload(mass=0.8, com=np.array([0.0, 0.04, 0.07]), inertia=np.zeros((3, 3)))
    fit = payload_from_poses([steps(POSES, load=load)], UR5)
    # gravity alone, no noise: exact
    assert fit.payload.mass == pytest.approx(0.8, abs=1e-6)
    np.testing.assert_allclose(fit.payload.com, load.com, atol=1e-6)
    assert fit.origin.values["poses"] == 5
    for few in (POSES[:3], np.repeat(POSES[:1], 5, axis=0) + 0.01 * np.arange(5)[:, None]):
        refused = r"recording and 2 more: \d+ poses .* a load needs 4 different ones"
        with pytest.raises(IdentificationError, match=refused):
            payload_from_poses([steps(few, load=load)] * 6, UR5)


def test_poses_seen_again_narrow_the_mass_as_of_independent_torques():
    """Each pose once, twice, three times with the same 0.1 N·m of stiction.

    The unbiased variance of m times 30 torques with 4 unknowns is K/(30 m − 4), beside what the
    drive constants add to all three: (K/26 − K/56) / (K/56 − K/86) = 86/26.
    """
    load = Payload(mass=0.8, com=np.array([0.0, 0.04, 0.07]), inertia=np.zeros((3, 3)))
    stiction = np.random.default_rng(8).normal(0, 0.1, (5, 6)) / UR5.torque_constant
    variances = []
    for times in (1, 2, 3):
        log = steps(np.tile(POSES, (times, 1)), load=load)
        current = log.current + np.repeat(np.tile(stiction, (times, 1)), 120, axis=0)
        variances.append(payload_from_poses([replace(log, current=current)], UR5).mass_sd ** 2)
    one, two, three = variances
    # differences of variances: rounding
    assert (one - two) / (two - three) == pytest.approx(86 / 26, rel=1e-6)


def test_the_spread_of_a_solution_counts_what_lasts():
    """200 fits under noise that holds for 100 of 1200 rows and is shared by both joints.

    Of independent rows the spread would be 1/10 of it.
    """
    rng = np.random.default_rng(6)
    A = np.repeat(rng.standard_normal((STRETCHES, 2, 2)), 100, axis=0)
    usable, found, reported = np.ones(A.shape[:2]), [], []
    for _ in range(200):
        noise = np.repeat(rng.standard_normal((STRETCHES, 1)), 100, axis=0) * [1.0, 1.0]
        fit = fit_all_joints(A, noise, usable)
        found.append(fit.x)
        reported.append(np.diag(fit.motion_covariance(noise, 0.0)))
    spread, expected = np.std(found, axis=0), np.sqrt(np.mean(reported, axis=0))
    # twelve stretches for two unknowns: some 20 % too small; 200 fits: 5 %
    np.testing.assert_allclose(expected, spread, rtol=0.35)


def test_drive_constants_scale_a_load():
    """One joint: y = A x times 1.03 is x times 1.03; two joints that share it half and half."""
    rng = np.random.default_rng(7)
    x = np.array([2.0, -0.3])
    A = rng.standard_normal((300, 1, 2))
    y = np.einsum("knp,p->kn", A, x)
    sd = np.sqrt(np.diag(fit_all_joints(A, y, np.ones_like(y)).gain_covariance(y, 0.03)))
    np.testing.assert_allclose(sd, 0.03 * np.abs(x), rtol=1e-9)
    both, torque = np.repeat(A, 2, axis=1), np.repeat(y, 2, axis=1)
    fit = fit_all_joints(both, torque, np.ones_like(torque))
    sd = np.sqrt(np.diag(fit.gain_covariance(torque, 0.03)))
    # half the variance is common, of the other half each joint's own quarter remains
    np.testing.assert_allclose(sd, 0.03 * np.abs(x) * np.sqrt(0.5 * (1 + 0.5)), rtol=1e-9)


@pytest.mark.statistical
def test_the_mass_of_simulated_pairs_lies_within_its_deviation():
    """Four arms that differ from the profile by the scenario's mismatch, 2 kg each."""
    errors = []
    for seed in (1, 2, 3, 4):
        loaded, free = simulate_pair(load_scenario("payload-pair"), seed)
        fit = payload_from_pair(loaded.recording, free.recording, UR5)
        errors.append((fit.payload.mass - 2.0) / fit.mass_sd)
    # eight seeds, run by hand: -.6 to .2; the drive constants' 1.5 % are half of what is assumed
    assert np.all(np.abs(errors) < 1.96)


def rests(chain, robot, load, rng):
    """Twelve poses of an arm whose links are `chain`'s and that carries a load, as a log."""
    true = rng.uniform(-0.7, 0.7, (12, 7)) + np.array([0, -0.4, 0, -2.0, 0, 1.6, 0.8])
    own, loaded = robot.chain, robot.with_payload(load).loaded_chain
    flange = chain_parameters(loaded) - chain_parameters(own)
    q = np.repeat(true, 120, axis=0)
    # a step between two rests, so that they are two
    q[::120] += 0.05
    zero = np.zeros_like(q)
    torque = torque_regressor(robot.chain, q, zero, zero) @ (chain_parameters(chain) + flange)
    torque += np.repeat(rng.normal(0, 0.1, (12, 7)), 120, axis=0)  # stiction
    return Recording(t=0.01 * np.arange(len(q)), q=q, dq=zero, torque=torque)


@pytest.mark.parametrize("seed", range(3))
def test_how_logs_differ_belongs_in_the_standard_deviation(seed):
    """Twenty Pandas whose links weigh 3 % more or less each, 1 kg on the flange: the mass lies
    within 5 % and in its own 95 % interval, of which a single log's would be a few times too
    narrow. Seeds of the drawn links and stiction: 100, 101, 102."""
    rng = np.random.default_rng(100 + seed)
    kilo = Payload(mass=1.0, com=np.array([0.0, 0.0, 0.05]), inertia=np.zeros((3, 3)))
    bare = PANDA.with_payload(None)
    logs = []
    for _ in range(20):
        scale = 1 + 0.03 * np.clip(rng.standard_normal(7), -2, 2)
        chain = replace(bare.chain, mass=bare.chain.mass * scale)
        logs.append(rests(chain, bare, kilo, rng))
    fit = payload_from_poses(logs, bare)
    assert fit.payload.mass == pytest.approx(1.0, rel=0.05)
    assert abs(fit.payload.mass - 1.0) < 1.96 * fit.mass_sd
    assert fit.origin.values == {"poses": 240, "different": 240, "logs": 20}
    each = [payload_from_poses([log], bare).payload.mass for log in logs]
    # the mean's standard deviation by the spread alone; poses differ, so half or twice of it
    spread = np.std(each, ddof=1) / np.sqrt(20)
    assert 0.5 * spread < fit.mass_sd < 2.5 * spread


@pytest.mark.slow
def test_links_that_are_a_little_wrong_count_in_a_mass_from_poses():
    """A Panda with masses 2 % off in a dozen poses: of its own scatter it was off by 4.5."""
    for kg, seed in ((0.74, 702), (1.28, 704)):
        carried = [f"payload.mass={kg}", "payload.com=[0.02,-0.01,0.06]"]
        log = simulate_pair(load_scenario("panda-static-poses", carried), seed)[0].recording
        fit = payload_from_poses([log], PANDA)
        assert abs(fit.payload.mass - kg) < 1.96 * fit.mass_sd < 0.2
