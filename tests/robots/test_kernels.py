"""The batched kernels against Pinocchio, which shares no code with them."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import PROFILES, Payload, Robot, kernels, load_robot
from vftcli.robots.chain import Chain
from vftcli.robots.kernels import (
    chain_parameters,
    load_regressor,
    momentum_terms,
    torque_regressor,
)
from vftcli.robots.tape import Program, Tape, Value
from vftcli.robots.terms import literal_momentum_terms

TILTED = np.array([3.1, -4.2, -8.3])  # a base on a wall bracket, |g| = 9.81 to 1 %
LOAD = Payload(mass=2.0, com=np.array([0.02, 0.03, 0.08]), inertia=np.diag([0.01, 0.02, 0.015]))

# Both sides round at 1e-16 of terms up to a few hundred N·m, over some hundred operations.
ROUNDING = 1e-10

PER_JOINT = ("names", "rotation", "translation", "mass", "com", "inertia", "rotor_inertia")


def tilted(robot: Robot, gravity: Sequence[float] | np.ndarray) -> Robot:
    """The robot on a base whose gravity vector, in base axes, is `gravity`. [m/s²]"""
    return replace(robot, chain=replace(robot.chain, gravity=np.array(gravity)))


def loaded(name: str) -> Robot:
    return tilted(load_robot(name).with_payload(LOAD), TILTED)


def states(robot: Robot, seed: int, samples: int = 300) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    shape = (samples, robot.joints)
    return rng.uniform(-np.pi, np.pi, shape), rng.uniform(-2.0, 2.0, shape)


def agrees_with_pinocchio(chain: Chain, q: np.ndarray, dq: np.ndarray) -> None:
    terms, model = momentum_terms(chain, q, dq), chain.to_pinocchio()
    data = model.createData()
    for k in range(len(q)):
        M = pin.crba(model, data, q[k])
        C = pin.computeCoriolisMatrix(model, data, q[k], dq[k])
        g = pin.computeGeneralizedGravity(model, data, q[k])
        expected = [M @ dq[k], C.T @ dq[k], g]
        np.testing.assert_allclose([term[k] for term in terms], expected, atol=ROUNDING, rtol=0)


@pytest.mark.parametrize("name", PROFILES)
def test_agrees_with_pinocchio_under_payload_and_tilted_base(name):
    robot = loaded(name)
    agrees_with_pinocchio(robot.loaded_chain, *states(robot, seed=1))


@pytest.mark.parametrize("name", PROFILES)
def test_the_papers_literal_method_agrees_within_its_own_step(name):
    robot = loaded(name)
    q, dq = states(robot, seed=2, samples=60)
    exact = momentum_terms(robot.loaded_chain, q, dq)
    literal = literal_momentum_terms(robot.model, q, dq)
    np.testing.assert_allclose(literal.p, exact.p, atol=ROUNDING, rtol=0)
    np.testing.assert_allclose(literal.gravity, exact.gravity, atol=ROUNDING, rtol=0)
    # Forward differences with Δq = 1e-7 of terms of order 10: rounding 1e-16·10/1e-7 ≈ 1e-8 a term
    # and truncation ½Δq·∂²(Mq̇) q̇², together below 5e-6 N·m at these speeds. The heaviest arms
    # (UR20, UR30) have terms of 40 and 80, and so is what is cut off.
    size = max(1.0, float(np.abs(exact.coriolis_transpose_dq).max()) / 30.0)
    np.testing.assert_allclose(
        literal.coriolis_transpose_dq, exact.coriolis_transpose_dq, atol=5e-6 * size, rtol=0
    )


def test_chunks_leave_no_seam_and_logs_may_be_short(monkeypatch):
    robot = load_robot("panda")
    q, dq = states(robot, seed=4, samples=1000)
    whole = momentum_terms(robot.loaded_chain, q, dq)
    monkeypatch.setattr(kernels, "CHUNK", 77)
    for samples in (0, 1, 2, 1000):
        part = momentum_terms(robot.loaded_chain, q[:samples], dq[:samples])
        for one, other in zip(whole, part, strict=True):
            np.testing.assert_array_equal(other, one[:samples])


def dense(robot: Robot, seed: int) -> Chain:
    """The arm with every frame turned and shifted at random: no angle or offset is special."""
    rng = np.random.default_rng(seed)
    n = robot.joints
    R = np.array([np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(n)])
    R *= np.sign(np.linalg.det(R))[:, None, None]
    r = rng.normal(0.0, 0.3, (n, 3))
    return replace(robot.chain, rotation=R, translation=r, gravity=TILTED)


@pytest.mark.parametrize("joints", [1, 6, 7])
def test_general_rotations_agree_with_pinocchio(joints):
    chain = dense(load_robot("panda" if joints == 7 else "ur5"), seed=9)
    if joints == 1:
        cut = {k: v[:1] for k, v in vars(chain).items() if k in PER_JOINT}
        chain = replace(chain, **cut)
    agrees_with_pinocchio(chain, *np.random.default_rng(10).normal(0.0, 3.0, (2, 50, joints)))


def test_what_is_zero_or_one_or_asked_by_nobody_costs_nothing():
    """Right angles and zeros of a table make no operations, and few rows are in use at once."""
    program = kernels.program_of(load_robot("ur5").chain, ("p", "bias"))
    assert len(program._operations) <= 321
    assert program._rows <= 65


def test_a_constant_that_equals_the_number_of_a_row_is_a_constant():
    """4.0 is no row 4, though the two are equal."""
    tape = Tape(5)
    program = Program(tape, [tape.plus(tape.times(Value(1.0, 0), Value(4.0)), Value(1.0, 4))])
    inputs, results = program.bind(3)
    # Each row begins with a cache line.
    assert not any(row.ctypes.data % 64 for row in (*inputs, *results))
    inputs[:] = np.arange(15.0).reshape(5, 3)
    program.run()
    np.testing.assert_array_equal(results, [[12.0, 17.0, 22.0]])


def test_threads_do_not_share_what_they_work_in():
    robot = load_robot("ur5")
    logs = [states(robot, seed=20 + k, samples=4000) for k in range(4)]
    alone = [momentum_terms(robot.chain, *log).p for log in logs]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda log: momentum_terms(robot.chain, *log).p, logs * 5))
    for one, other in zip(alone * 5, together, strict=True):
        np.testing.assert_array_equal(other, one)


@pytest.mark.parametrize("name", ["ur5", "ur10e", "panda", "fr3"])
def test_equals_pinocchios_regressor(name):
    """On a tilted base; times the chain's parameters it is inverse dynamics without rotors."""
    robot = tilted(load_robot(name), TILTED)
    q, dq, ddq = np.random.default_rng(1).uniform(-2.5, 2.5, (3, 40, robot.joints))
    model, data = robot.model, robot.model.createData()
    expected, torque = [], []
    for state in zip(q, dq, ddq, strict=True):
        expected.append(pin.computeJointTorqueRegressor(model, data, *state).copy())
        torque.append(pin.rnea(model, data, *state).copy())
    found = torque_regressor(robot.chain, q, dq, ddq)
    # both are sums of some hundred products of numbers of order 10: rounding at 1e-13
    np.testing.assert_allclose(found, expected, atol=1e-12)
    # Pinocchio's rnea includes the rotors' armature
    rigid = found @ chain_parameters(robot.chain)
    np.testing.assert_allclose(rigid + robot.chain.rotor_inertia * ddq, torque, atol=1e-11)


@pytest.mark.parametrize("name", PROFILES)
def test_a_load_on_the_flange_weighs_as_pinocchio_s_last_body(name):
    """The last link's columns for mass and first moment, moved from the flange; on a tilted base,
    so that all three components of gravity count."""
    robot = tilted(load_robot(name), [4.0, -3.0, -8.0])
    chain = robot.chain
    model, data = robot.model, robot.model.createData()
    rng, zero = np.random.default_rng(5), np.zeros(robot.joints)
    q = rng.uniform(-2.5, 2.5, (40, robot.joints))
    mass, com = 3.0, rng.uniform(-0.2, 0.2, 3)
    moved = chain.flange_rotation @ com + chain.flange_translation
    link = np.array([mass, *(mass * moved)])
    expected = [
        # what the drives bear, as a torque from outside
        -pin.computeJointTorqueRegressor(model, data, x, zero, zero)[:, -10:-6] @ link
        for x in q
    ]
    found = load_regressor(chain, q) @ np.array([mass, *(mass * com)])
    # sums of some hundred products of numbers of order 10
    np.testing.assert_allclose(found, expected, atol=1e-12)
