"""The batched kernels against Pinocchio, which shares no code with them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import PROFILES, Payload, Robot, kernels, load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.literal import literal_momentum_terms

TILTED = np.array([3.1, -4.2, -8.3])  # a base on a wall bracket, |g| = 9.81 to 1 %
LOAD = Payload(mass=2.0, com=np.array([0.02, 0.03, 0.08]), inertia=np.diag([0.01, 0.02, 0.015]))

# Both sides round at 1e-16 of terms up to a few hundred N·m, over some hundred operations.
ROUNDING = 1e-10


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
        np.testing.assert_allclose(other, one, atol=1e-13, rtol=0)  # BLAS blocks sums differently


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
