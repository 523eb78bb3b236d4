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
    felt_bodies,
    load_regressor,
    momentum_chunks,
    momentum_terms,
    torque_regressor,
    with_parameters,
)
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


@pytest.mark.parametrize("name", PROFILES)
def test_agrees_with_pinocchio_under_payload_and_tilted_base(name: str) -> None:
    robot = loaded(name)
    q, dq = states(robot, seed=1)
    terms = momentum_terms(robot.loaded_chain, q, dq)
    model, data = robot.model, robot.model.createData()
    for k in range(len(q)):
        M = pin.crba(model, data, q[k])
        C = pin.computeCoriolisMatrix(model, data, q[k], dq[k])
        g = pin.computeGeneralizedGravity(model, data, q[k])
        np.testing.assert_allclose(terms.p[k], M @ dq[k], atol=ROUNDING, rtol=0)
        np.testing.assert_allclose(
            terms.coriolis_transpose_dq[k], C.T @ dq[k], atol=ROUNDING, rtol=0
        )
        np.testing.assert_allclose(terms.gravity[k], g, atol=ROUNDING, rtol=0)


@pytest.mark.parametrize("name", PROFILES)
def test_the_papers_literal_method_agrees_within_its_own_step(name: str) -> None:
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


def test_momentum_rate_splits_as_the_paper_says() -> None:
    """Ṁq̇ = Cq̇ + Cᵀq̇ (13), with Ṁq̇ by central differences along the motion."""
    robot = loaded("ur5")
    q, dq = states(robot, seed=3, samples=50)
    h = 1e-5
    ahead = momentum_terms(robot.loaded_chain, q + h * dq, dq).p
    behind = momentum_terms(robot.loaded_chain, q - h * dq, dq).p
    weightless = tilted(robot, np.zeros(3)).model
    data = weightless.createData()
    coriolis = np.array(
        [pin.rnea(weightless, data, a, v, np.zeros(6)) for a, v in zip(q, dq, strict=True)]
    )
    transpose = momentum_terms(robot.loaded_chain, q, dq).coriolis_transpose_dq
    # central differences: error of order h² = 1e-10 times third derivatives of order 100
    np.testing.assert_allclose((ahead - behind) / (2 * h), coriolis + transpose, atol=1e-7)


def test_chunks_leave_no_seam(monkeypatch: pytest.MonkeyPatch) -> None:
    robot = load_robot("panda")
    q, dq = states(robot, seed=4, samples=1000)
    whole = momentum_terms(robot.loaded_chain, q, dq)
    monkeypatch.setattr(kernels, "CHUNK", 77)
    parts = momentum_terms(robot.loaded_chain, q, dq)
    for one, other in zip(whole, parts, strict=True):
        np.testing.assert_array_equal(other, one)


def test_arm_at_rest_without_gravity_has_no_torque() -> None:
    robot = tilted(load_robot("ur10e"), np.zeros(3))
    q, dq = states(robot, seed=5, samples=20)
    terms = momentum_terms(robot.loaded_chain, q, np.zeros_like(dq))
    assert not np.any(terms.p)
    assert not np.any(terms.coriolis_transpose_dq)
    np.testing.assert_allclose(terms.gravity, 0.0, atol=1e-15)


def test_rotor_inertia_counts_in_the_momentum() -> None:
    """One joint turning alone: p_j − (arm without rotors) = J_j q̇_j."""
    from dataclasses import replace

    robot = load_robot("ur5")
    bare = replace(robot.chain, rotor_inertia=np.zeros(6))
    q, dq = states(robot, seed=6, samples=20)
    with_rotor = momentum_terms(robot.chain, q, dq).p
    without = momentum_terms(bare, q, dq).p
    np.testing.assert_allclose(with_rotor - without, dq * robot.chain.rotor_inertia, atol=1e-13)


def dense(robot: Robot, seed: int) -> Chain:
    """The arm with every frame turned and shifted at random: no angle or offset is special."""
    rng = np.random.default_rng(seed)
    n = robot.joints
    R = np.array([np.linalg.qr(rng.normal(size=(3, 3)))[0] for _ in range(n)])
    R *= np.sign(np.linalg.det(R))[:, None, None]
    r = rng.normal(0.0, 0.3, (n, 3))
    return replace(robot.chain, rotation=R, translation=r, gravity=TILTED)


@pytest.mark.parametrize("joints", [1, 6, 7])
def test_general_rotations_agree_with_pinocchio(joints: int) -> None:
    chain = dense(load_robot("panda" if joints == 7 else "ur5"), seed=9)
    if joints == 1:
        cut = {k: v[:1] for k, v in vars(chain).items() if k in PER_JOINT}
        chain = replace(chain, **cut)
    rng = np.random.default_rng(10)
    q, dq = rng.normal(0.0, 3.0, (2, 50, joints))
    terms = momentum_terms(chain, q, dq)
    model = chain.to_pinocchio()
    data = model.createData()
    for k in range(len(q)):
        M = pin.crba(model, data, q[k])
        C = pin.computeCoriolisMatrix(model, data, q[k], dq[k])
        g = pin.computeGeneralizedGravity(model, data, q[k])
        np.testing.assert_allclose(terms.p[k], M @ dq[k], atol=ROUNDING, rtol=0)
        np.testing.assert_allclose(
            terms.coriolis_transpose_dq[k], C.T @ dq[k], atol=ROUNDING, rtol=0
        )
        np.testing.assert_allclose(terms.gravity[k], g, atol=ROUNDING, rtol=0)


def test_bodies_hand_on_what_their_joint_cannot_feel() -> None:
    """No mass, no first moment along the axis and no J_yy is left, so that little is computed."""
    inertia, moment = felt_bodies(load_robot("ur5").with_payload(LOAD).loaded_chain)
    assert not moment[:, 2].any()
    assert not inertia[:, 1, 1].any()


@pytest.mark.parametrize("samples", [0, 1, 2])
def test_short_logs(samples: int) -> None:
    robot = load_robot("ur5")
    q, dq = states(robot, seed=11, samples=3)
    whole, part = (
        momentum_terms(robot.chain, x, y) for x, y in ((q, dq), (q[:samples], dq[:samples]))
    )
    for one, other in zip(whole, part, strict=True):
        np.testing.assert_array_equal(other, one[:samples])


def test_bias_is_coriolis_less_gravity_and_programs_of_several_arms_do_not_mix() -> None:
    q, dq = states(load_robot("ur5"), seed=12)
    arms = [load_robot(name).chain for name in ("ur3", "ur5", "ur10", "ur3e", "ur5e", "ur10e")]
    expected = [momentum_terms(chain, q, dq) for chain in arms]
    for chain, terms in zip(arms, expected, strict=True):
        ((_, velocity, (p, bias)),) = momentum_chunks(chain, q, dq, ("p", "bias"))
        np.testing.assert_array_equal(velocity, dq)
        np.testing.assert_array_equal(p, terms.p)
        # one sum in another order, of torques of 10²
        np.testing.assert_allclose(bias, terms.coriolis_transpose_dq - terms.gravity, atol=1e-12)


def test_threads_do_not_share_what_they_work_in() -> None:
    robot = load_robot("ur5")
    logs = [states(robot, seed=20 + k, samples=4000) for k in range(4)]
    alone = [momentum_terms(robot.chain, *log).p for log in logs]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda log: momentum_terms(robot.chain, *log).p, logs * 5))
    for one, other in zip(alone * 5, together, strict=True):
        np.testing.assert_array_equal(other, one)


def moving_states(joints, seed, count=40):
    return np.random.default_rng(seed).uniform(-2.5, 2.5, (3, count, joints))


@pytest.mark.parametrize("name", ["ur5", "ur10e", "panda", "fr3"])
def test_equals_pinocchios_regressor(name):
    robot = load_robot(name)
    q, dq, ddq = moving_states(robot.joints, 1)
    model, data = robot.model, robot.model.createData()
    expected = [
        pin.computeJointTorqueRegressor(model, data, *state).copy()
        for state in zip(q, dq, ddq, strict=True)
    ]
    # both are sums of some hundred products of numbers of order 10: rounding at 1e-13
    np.testing.assert_allclose(torque_regressor(robot.chain, q, dq, ddq), expected, atol=1e-12)


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_times_parameters_is_inverse_dynamics_without_rotors(name):
    robot = load_robot(name)
    q, dq, ddq = moving_states(robot.joints, 2)
    model, data = robot.model, robot.model.createData()
    torque = [pin.rnea(model, data, *state).copy() for state in zip(q, dq, ddq, strict=True)]
    rigid = torque_regressor(robot.chain, q, dq, ddq) @ chain_parameters(robot.chain)
    # Pinocchio's rnea includes the rotors' armature
    np.testing.assert_allclose(rigid + robot.chain.rotor_inertia * ddq, torque, atol=1e-11)


def test_a_tilted_base_turns_gravity():
    robot = tilted(load_robot("ur5"), [4.0, -3.0, -8.0])
    q, zero = moving_states(6, 3)[0], np.zeros((40, 6))
    model, data = robot.model, robot.model.createData()
    expected = [pin.computeGeneralizedGravity(model, data, x).copy() for x in q]
    gravity = torque_regressor(robot.chain, q, zero, zero) @ chain_parameters(robot.chain)
    np.testing.assert_allclose(gravity, expected, atol=1e-12)


@pytest.mark.parametrize("name", ["ur10e", "panda"])
def test_parameters_make_the_chain_again(name):
    chain = load_robot(name).chain
    again = with_parameters(chain, chain_parameters(chain))
    for key in ("mass", "com", "inertia", "rotor_inertia"):
        # moving a tensor to the origin and back loses digits of m·c², here below 10 kg·m²
        np.testing.assert_allclose(getattr(again, key), getattr(chain, key), atol=1e-14)


@pytest.mark.parametrize("name", PROFILES)
def test_a_load_on_the_flange_weighs_as_pinocchio_s_last_body(name):
    """The last link's columns for mass and first moment, moved from the flange; on a tilted base,
    so that all three components of gravity count."""
    robot = tilted(load_robot(name), [4.0, -3.0, -8.0])
    chain = robot.chain
    model, data = robot.model, robot.model.createData()
    q, zero = moving_states(robot.joints, 4)[0], np.zeros(robot.joints)
    rng = np.random.default_rng(5)
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
