"""DynamicsTerms: μ as (33) defines it, and what is said when a signal is missing."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import Payload, load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.terms import (
    RunningTerms,
    disturbance_blocks,
    disturbance_impulse,
    disturbance_stretches,
    drive_torque,
    dynamics_terms,
    effort_name,
)
from vftcli.signals.arrays import clock_of
from vftcli.signals.errors import MissingSignalError, RobotError
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.filters import welch
from vftcli.signals.recording import Recording

T = np.arange(3.0)
Q = np.linspace(0.2, 1.3, 18).reshape(3, 6)
EFFORT = np.linspace(-4.0, 5.0, 18).reshape(3, 6)
UR5E, FR3 = load_robot("ur5e"), load_robot("fr3")


def motion(joints: int, samples: int = 400, rate: float = 500.0) -> tuple[np.ndarray, ...]:
    t = np.arange(samples) / rate
    phase = np.linspace(0.0, 2.0, joints)
    angle = 2.0 * np.pi * 0.5 * t[:, None] + phase
    w = np.pi
    return t, 0.5 * np.sin(angle), 0.5 * w * np.cos(angle), -0.5 * w**2 * np.sin(angle)


def test_mu_integrates_to_the_momentum_of_free_motion():
    """On torque made by Pinocchio's inverse dynamics, ṗ = μ: nothing is left to explain."""
    robot = replace(load_robot("ur5"), friction=())
    t, q, dq, ddq = motion(6)
    data = robot.model.createData()
    tau = np.array([pin.rnea(robot.model, data, *x) for x in zip(q, dq, ddq, strict=True)])
    terms = dynamics_terms(Recording(t=t, q=q, dq=dq, torque=tau), robot)
    step = t[1] - t[0]
    change = np.diff(terms.p, axis=0) - 0.5 * step * (terms.mu[1:] + terms.mu[:-1])
    # trapezoidal rule: Ts³/12 of p''' per step, p''' below 2e3 N·m/s² on this motion
    np.testing.assert_allclose(change, 0.0, atol=step**3 / 12 * 2e3)


def test_current_becomes_torque_through_the_drive_constant():
    torque = drive_torque(Recording(t=T, q=Q, current=np.ones_like(Q)), load_robot("ur5"))
    np.testing.assert_array_equal(torque[0], [12.625, 12.625, 12.625, 9.3122, 9.3122, 9.3122])


@pytest.mark.parametrize(
    ("robot", "joints", "signals", "error", "words"),
    [
        ("ur5", 6, "current", MissingSignalError, "no joint velocities"),
        ("ur5", 6, "dq", MissingSignalError, "no motor currents"),
        ("ur5", 7, "dq torque", RobotError, "7 joints but robot 'ur5' has 6"),
        ("panda", 7, "dq current", MissingSignalError, "no torque_constant"),
    ],
)
def test_what_a_robot_s_log_lacks_is_named(robot, joints, signals, error, words):
    q = np.zeros((3, joints))
    log = Recording(t=T, q=q, **dict.fromkeys(signals.split(), q))
    with pytest.raises(error, match=words):
        dynamics_terms(log, load_robot(robot))


@pytest.mark.parametrize("size", [1, 150, 399])
def test_blocks_of_a_log_have_the_whole_log_s_terms(size):
    """To the last bit, friction that remembers the motion included."""
    robot = load_robot("ur5")
    slips = {**robot.friction[0].parameters, "presliding": 2.0, "presliding_length": 0.05}
    friction = (replace(robot.friction[0], parameters=slips), *robot.friction[1:])
    robot = replace(robot, friction=friction)
    t, q, dq, _ = motion(6)
    t = t + 1e-4 * np.random.default_rng(1).uniform(-1, 1, len(t))
    log = Recording(t=t, q=q, dq=dq, current=np.cos(q))
    whole = dynamics_terms(log, robot)
    running = RunningTerms(robot, clock_of(t))
    for first in range(0, len(t), size):
        span = slice(first, first + size)
        signals = {"q": q[span], "dq": dq[span], "current": np.cos(q[span])}
        block = running.next(Recording(t=t[span], **signals))
        for name in ("p", "mu", "d", "dt"):
            np.testing.assert_array_equal(getattr(block, name), getattr(whole, name)[span])


def test_torque_without_gravity_gets_that_of_the_arm_and_its_payload():
    load = Payload(mass=2.0, com=np.array([0.0, 0.0, 0.1]), inertia=np.zeros((3, 3)))
    arm = UR5E.with_payload(load)
    log = Recording(t=T, q=Q, torque_without_gravity=EFFORT)
    held = momentum_terms(arm.loaded_chain, Q, np.zeros_like(Q)).gravity
    assert effort_name(log, arm) == "torque_without_gravity"
    assert drive_torque(log, arm) == pytest.approx(EFFORT + held, abs=1e-12)  # rounding
    assert np.abs(drive_torque(log, arm) - drive_torque(log, UR5E)).max() > 2.0  # 2 kg on an arm


@pytest.mark.parametrize(
    ("signals", "of_ur", "of_franka"),
    [
        (("current", "torque", "torque_without_gravity"), "current", "torque"),
        (("torque", "torque_without_gravity"), "torque", "torque"),
        (("current", "torque_without_gravity"), "current", "torque_without_gravity"),
        (("current",), "current", "current"),
    ],
)
def test_an_arm_takes_what_its_makers_logs_hold(signals, of_ur, of_franka):
    """UR measures currents, Franka torques; what is not there is made up for by the other."""
    log = Recording(t=T, q=Q, **dict.fromkeys(signals, EFFORT))
    assert effort_name(log, UR5E) == of_ur
    assert effort_name(log, FR3) == of_franka


STEP = 0.004


def terms_of(t: np.ndarray, torque: np.ndarray) -> DynamicsTerms:
    """Terms of an arm on which `torque` (T−1, n) acts between the samples, and μ of its own."""
    mu = np.column_stack([np.sin(t), np.cos(2.0 * t)])[:, : torque.shape[1]]
    gained = (torque + 0.5 * (mu[1:] + mu[:-1])) * np.diff(t)[:, None]
    p = np.vstack([np.zeros((1, torque.shape[1])), np.cumsum(gained, axis=0)])
    return DynamicsTerms(t=t, p=p, mu=mu)


def test_an_even_clock_is_only_cut():
    t = STEP * np.arange(50)
    torque = np.random.default_rng(2).standard_normal((49, 1))
    inside = np.ones(50, dtype=bool)
    inside[[0, 20, 21, 40]] = False
    found = disturbance_stretches(terms_of(t, torque), inside, STEP)
    # a step counts if the samples at both its ends do
    assert [len(d) for d in found] == [18, 17, 8]
    np.testing.assert_allclose(found[1], torque[22:39], atol=1e-11)


def test_an_uneven_clock_keeps_the_impulse():
    """The integral of d over a stretch does not change with the clock."""
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.6 * STEP, 1.4 * STEP, 300))
    torque = rng.standard_normal((299, 2))
    terms = terms_of(t, torque)
    (found,) = disturbance_stretches(terms, np.ones(300, dtype=bool), STEP)
    gained = np.cumsum(torque * np.diff(t)[:, None], axis=0)
    cut = np.abs(torque).max() * STEP  # the last, incomplete step
    assert np.all(np.abs(np.sum(found, axis=0) * STEP - gained[-1]) <= cut)
    impulse = disturbance_impulse(terms)
    assert not impulse[0].any()
    # sums of 300 numbers up to 1 N·m·s
    np.testing.assert_allclose(impulse[1:], gained, atol=1e-12)


@pytest.mark.parametrize("clock", ["even", "gapped", "uneven"])
def test_white_noise_has_the_density_of_white_noise_on_any_clock(clock):
    """σ²·2Ts: the second Welch took raw samples of an uneven clock at its median step."""
    rng = np.random.default_rng(4)
    sigma, count = 2.0, 60_000
    steps = np.full(count - 1, STEP)
    spread = 0.0
    if clock == "gapped":
        steps[rng.choice(count - 1, 30, replace=False)] = 0.5
    elif clock == "uneven":
        steps = STEP * rng.uniform(0.5, 1.5, count - 1)
        spread = 1.0 / 12.0  # variance of the steps by their squared mean
    t = np.concatenate([[0.0], np.cumsum(steps)])
    torque = sigma * rng.standard_normal((count - 1, 1))
    stretches = disturbance_stretches(terms_of(t, torque), np.ones(count, dtype=bool), STEP)
    size = 200
    power, segments = welch(stretches, size, STEP)
    # Linear interpolation of the integral averages over a step, so above a tenth of the rate an
    # uneven clock's density falls; what acts on an arm lies below.
    low = power[2 : size // 10, 0]
    expected = 2.0 * sigma**2 * STEP * (1.0 + spread)
    assert segments > 500
    # 600 segments and 18 bins, half of them overlapping: 1.5 %
    assert np.mean(low) == pytest.approx(expected, rel=0.05)


def test_blocks_follow_one_another_and_hold_the_mean_torque():
    """On an uneven clock too a block holds whole samples, and d is the impulse over its time."""
    rng = np.random.default_rng(7)
    t = np.cumsum(rng.uniform(0.8 * STEP, 1.2 * STEP, 103))
    torque, q = rng.standard_normal((102, 2)), np.column_stack([t, 2.0 * t])
    blocks = disturbance_blocks(terms_of(t, torque), q, 10.2 * STEP)
    # 102 steps make ten blocks of ten; the two that are left over join the last
    edges = np.array([*range(0, 100, 10), 102])
    np.testing.assert_allclose(blocks.length, np.diff(t[edges]))
    np.testing.assert_allclose(blocks.t, 0.5 * (t[edges[1:]] + t[edges[:-1]]))
    expected = [
        np.average(torque[a:b], axis=0, weights=np.diff(t)[a:b]) for a, b in pairwise(edges)
    ]
    np.testing.assert_allclose(blocks.d, expected, atol=1e-11)  # as of the raw disturbance
    np.testing.assert_allclose(blocks.q, np.column_stack([blocks.t, 2.0 * blocks.t]))
    np.testing.assert_allclose(blocks.velocity, np.tile([1.0, 2.0], (10, 1)))
    assert blocks.known.all()
    few = blocks.part(slice(2, 5))
    np.testing.assert_array_equal(few.d, blocks.d[2:5])
    np.testing.assert_array_equal(few.t, blocks.t[2:5])


def test_a_gap_and_what_is_left_out_are_blocks_of_which_nothing_is_known():
    t = STEP * np.arange(100.0)
    t[60:] += 1.0
    terms, q = terms_of(t, np.ones((99, 1))), np.zeros((100, 1))
    gap = disturbance_blocks(terms, q, 20 * STEP)
    np.testing.assert_array_equal(gap.known, [True, True, True, False, True, True])
    assert gap.length[3] == pytest.approx(1.0 + STEP)
    assert gap.length.sum() == pytest.approx(t[-1] - t[0])
    inside = np.ones(100, dtype=bool)
    inside[[0, 30, 99]] = False
    part = disturbance_blocks(terms, q, 20 * STEP, inside)
    # 0 and 99 leave a step each at the ends, 30 the two beside it
    np.testing.assert_array_equal(part.known, [0, 1, 0, 1, 0, 1, 1, 0])
    np.testing.assert_allclose(part.d[part.known], 1.0, atol=1e-11)


@pytest.mark.parametrize("inside", [None, np.zeros(1, dtype=bool)])
def test_one_sample_is_a_block_of_which_nothing_is_known(inside):
    one = DynamicsTerms(t=np.zeros(1), p=np.ones((1, 2)), mu=np.ones((1, 2)))
    found = disturbance_blocks(one, np.ones((1, 2)), 0.1, inside)
    assert (len(found.t), found.length.tolist(), found.known.tolist()) == (1, [0.0], [False])
    np.testing.assert_array_equal(found.q, [[1.0, 1.0]])
