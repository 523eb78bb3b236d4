"""Poses and rotations: round trips, the identities of the group, agreement with Pinocchio."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from vftcli.signals.pose import (
    Pose,
    adjoint,
    cross,
    exp_matrix,
    exp_quaternion,
    inverse,
    log_matrix,
    log_quaternion,
    matrix_quaternion,
    quaternion_product,
    rotation_onto,
    rpy_angles,
    rpy_matrix,
    skew,
)

ROUNDING = 1e-14
"""A few ulp of numbers of order one."""

ANGLES = st.one_of(
    st.floats(0.0, 3.14), st.sampled_from([0.0, 1e-300, 1e-12, 1e-7, 1e-6, 2e-6, 3.0, 3.1415])
)
COMPONENT = st.floats(-1.0, 1.0)
SEEDS = st.integers(0, 2**32 - 1)


def pose(rng: np.random.Generator) -> Pose:
    return Pose(rpy_matrix(rng.uniform(-3.0, 3.0, 3).tolist()), rng.uniform(-1.0, 1.0, 3))


@given(ANGLES, COMPONENT, COMPONENT, COMPONENT)
def test_round_trips(angle: float, x: float, y: float, z: float) -> None:
    axis = np.array([x, y, z])
    length = float(np.linalg.norm(axis))
    vector = angle * (axis / length if length > 1e-3 else np.array([0.0, 0.0, 1.0]))
    # a few ulp of values up to π, through two logarithms
    np.testing.assert_allclose(log_quaternion(exp_quaternion(vector)), vector, atol=1e-12)
    np.testing.assert_allclose(log_matrix(exp_matrix(vector)), vector, atol=1e-12)
    np.testing.assert_allclose(exp_matrix(vector), pin.exp3(vector), atol=ROUNDING)


def test_product_is_that_of_matrices() -> None:
    a, b = np.random.default_rng(2).normal(0.0, 1.0, (2, 50, 3))
    vector = log_quaternion(quaternion_product(exp_quaternion(a), exp_quaternion(b)))
    np.testing.assert_allclose(exp_matrix(vector), exp_matrix(a) @ exp_matrix(b), atol=ROUNDING)


def test_quaternions_against_scipy() -> None:
    """Random turns, and half turns, where three of the four ways divide by zero."""
    axes = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.8, 0]])
    half = Rotation.from_rotvec(np.pi * axes)
    turns = Rotation.concatenate([Rotation.random(500, rng=np.random.default_rng(5)), half])
    found, expected = matrix_quaternion(turns.as_matrix()), turns.as_quat(scalar_first=True)
    agreement = np.abs(np.sum(found * expected, axis=1))  # q and −q are the same turn
    np.testing.assert_allclose(agreement, 1.0, atol=ROUNDING)


@given(SEEDS)
def test_the_adjoint_is_pinocchio_s_action_on_forces(seed: int) -> None:
    rng = np.random.default_rng(seed)
    first, second, wrench = pose(rng), pose(rng), rng.standard_normal(6)
    moved = pin.SE3(first.rotation, first.translation).act(pin.Force(wrench)).vector
    np.testing.assert_allclose(adjoint(first) @ wrench, moved, atol=ROUNDING)
    each = adjoint(Pose(*map(np.stack, zip(first, second, strict=True))))
    np.testing.assert_allclose(adjoint(first @ second), each[0] @ each[1], atol=ROUNDING)
    there_and_back = inverse(first) @ first
    np.testing.assert_allclose(there_and_back.rotation, np.eye(3), atol=ROUNDING)
    np.testing.assert_allclose(there_and_back.translation, 0.0, atol=ROUNDING)


@given(SEEDS)
def test_the_cross_product_is_numpy_s(seed: int) -> None:
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((2, 3, 4, 5))
    expected = np.cross(a, b, axis=0)
    np.testing.assert_allclose(cross(a, b), expected, atol=ROUNDING)
    np.testing.assert_allclose(skew(a[:, 0, 0]) @ b[:, 0, 0], expected[:, 0, 0], atol=ROUNDING)


@given(SEEDS)
def test_angles_are_those_of_the_matrix(seed: int) -> None:
    angles = np.random.default_rng(seed).uniform([-3.1, -1.5, -3.1], [3.1, 1.5, 3.1])
    R = rpy_matrix(angles.tolist())
    np.testing.assert_allclose(R, pin.rpy.rpyToMatrix(*angles), atol=ROUNDING)
    # near ±π/2 of pitch, where cos is .07, the angles lose two digits
    np.testing.assert_allclose(rpy_angles(R), angles, atol=1e-12)


@pytest.mark.parametrize("pitch", [np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-8])
def test_angles_make_the_rotation_again(pitch: float) -> None:
    R = rpy_matrix([0.3, pitch, -1.1])
    # at ±90° of pitch a 1e-9 threshold decides; half the digits are lost beside it
    np.testing.assert_allclose(rpy_matrix(rpy_angles(R)), R, atol=1e-8)


@given(COMPONENT, COMPONENT, COMPONENT)
def test_z_is_turned_onto_a_direction(x: float, y: float, z: float) -> None:
    direction = np.array([x, y, z + 2.0])
    R = rotation_onto(direction)
    np.testing.assert_allclose(R[:, 2], direction / np.linalg.norm(direction), atol=ROUNDING)
    np.testing.assert_allclose(R.T @ R, np.eye(3), atol=ROUNDING)
    assert np.linalg.det(R) > 0.0
    np.testing.assert_array_equal(rotation_onto(np.array([0.0, 0.0, 2.0])), np.eye(3))
