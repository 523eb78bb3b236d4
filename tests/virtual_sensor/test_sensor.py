"""A real sensor: its pose, weight and lag found again; conventions of vendors told apart."""

import numpy as np
import pytest

from vftcli.signals.errors import ParameterError
from vftcli.signals.pose import Pose, adjoint, inverse, rpy_matrix
from vftcli.virtual_sensor.sensor import fit_pose, weigh_tool

POSE = Pose(rpy_matrix((0.1, -0.2, 0.8)), np.array([0.01, -0.02, 0.04]))
GRAVITY = np.array([0.0, 0.0, -9.81])


def pushes(samples: int = 400, seed: int = 1) -> np.ndarray:
    """Smooth wrenches in all directions, flange axes. (T, 6)"""
    t = np.linspace(0, 10, samples)[:, None]
    rng = np.random.default_rng(seed)
    phase, speed = rng.uniform(0, 6, 6), rng.uniform(0.5, 3, 6)
    return np.sin(speed * t + phase) * np.array([20, 15, 25, 2, 2, 1.5])


def test_a_sensors_pose_is_found_again_whatever_its_zero() -> None:
    flange = pushes()
    reading = flange @ adjoint(inverse(POSE)).T + np.array([1.0, -2.0, 3.0, 0.1, 0.0, -0.2])
    fit = fit_pose(flange, reading)
    np.testing.assert_allclose(fit.pose.rotation, POSE.rotation, atol=1e-9)
    np.testing.assert_allclose(fit.pose.translation, POSE.translation, atol=1e-9)


def test_under_noise_the_pose_is_found_within_its_own_deviation() -> None:
    flange = pushes()
    rng = np.random.default_rng(2)
    reading = flange @ adjoint(inverse(POSE)).T
    noisy = flange + rng.standard_normal(flange.shape) * np.repeat([0.5, 0.05], 3)
    fit = fit_pose(noisy, reading)
    error = np.abs(fit.pose.translation - POSE.translation)
    assert np.all(error < 5 * fit.position_sd)
    assert np.all(fit.position_sd < 1e-3)  # m: 0.05 N·m over √400 samples of 20 N


def test_pushes_along_one_line_tell_no_pose() -> None:
    line = np.outer(np.sin(np.linspace(0, 6, 50)), [10.0, 0, 0, 0, 1, 0])
    with pytest.raises(ParameterError, match=r"forces lie on one line.*--sensor-pose"):
        fit_pose(line, line)


def test_a_tool_is_weighed_from_poses() -> None:
    rng = np.random.default_rng(3)
    rotation = np.array([rpy_matrix(a) for a in rng.uniform(-2, 2, (30, 3))])
    com, zero = np.array([0.01, 0.0, 0.05]), np.array([0.5, -1.0, 2.0, 0.02, 0.03, -0.01])
    weight = 0.35 * np.einsum("tji,j->ti", rotation, GRAVITY)
    reading = np.concatenate([weight, np.cross(com, weight)], axis=1) + zero
    tool = weigh_tool(reading, rotation, GRAVITY)
    assert tool.mass == pytest.approx(0.35, rel=1e-9)
    np.testing.assert_allclose(tool.com, com, atol=1e-9)
    np.testing.assert_allclose(tool.zero, zero, atol=1e-9)
    np.testing.assert_allclose(tool.reading(rotation, GRAVITY), reading, atol=1e-9)


def test_one_orientation_weighs_nothing() -> None:
    rotation = np.tile(np.eye(3), (20, 1, 1))
    with pytest.raises(ParameterError, match="all in one orientation"):
        weigh_tool(np.zeros((20, 6)), rotation, GRAVITY)
