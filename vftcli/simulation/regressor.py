"""The base regressor of an arm: what a motion can tell about its parameters, and how well."""

from typing import NamedTuple

import numpy as np

from vftcli.robots import Robot
from vftcli.signals.arrays import Array
from vftcli.simulation.motion import Reference

SIGN_WIDTH = 0.01
"""Velocity over which the sign in the dry-friction column is smoothed. [rad/s]"""
RANK_TOLERANCE = 1e-8


class Base(NamedTuple):
    """Independent columns of an arm's full regressor.

    Attributes:
        columns: Their indices.
        total: Number of columns of the full regressor, 14n.
    """

    columns: tuple[int, ...]
    total: int


def full_regressor(robot: Robot, motion: Reference) -> Array:
    """τ = Y π for inertial, rotor, viscous, dry and offset parameters. (T·n, 14n)

    Ten inertial columns a link (Pinocchio's order), then per joint q̈ (rotor inertia), q̇, the
    smoothed sign of q̇, and one: (2) of the paper with all of its parameters.
    """
    import pinocchio as pin

    model, n = robot.model, robot.joints
    data = model.createData()
    blocks = []
    for q, dq, ddq in zip(*motion, strict=True):
        rigid = pin.computeJointTorqueRegressor(model, data, q, dq, ddq)
        drive = [np.diag(ddq), np.diag(dq), np.diag(np.tanh(dq / SIGN_WIDTH)), np.eye(n)]
        blocks.append(np.hstack([rigid, *drive]))
    return np.vstack(blocks)


def base_columns(robot: Robot, seed: int = 0) -> Base:
    """Independent columns, found on random states, each kept if it adds to those before it."""
    rng = np.random.default_rng(seed)
    states = [rng.uniform(-scale, scale, (60, robot.joints)) for scale in (np.pi, 2.0, 5.0)]
    Y = full_regressor(robot, Reference(*states))
    R = triangle(Y)
    scale = float(np.max(np.linalg.norm(R, axis=0)))
    kept: list[int] = []
    basis = np.zeros((R.shape[0], 0))
    for j in range(R.shape[1]):
        rest = R[:, j] - basis @ (basis.T @ R[:, j])
        rest = rest - basis @ (basis.T @ rest)
        size = np.linalg.norm(rest)
        if size > RANK_TOLERANCE * scale:
            basis = np.column_stack([basis, rest / size])
            kept.append(j)
    return Base(tuple(kept), R.shape[1])


def triangle(Y: Array) -> Array:
    """The R of Y = QR, which has the same column dependencies in fewer rows."""
    _, R = np.linalg.qr(Y)
    return R


def condition_number(Y: Array) -> float:
    """Condition number of a regressor whose columns are scaled to unit length."""
    size = np.linalg.norm(Y, axis=0)
    if np.any(size == 0.0):
        return float("inf")
    return float(np.linalg.cond(Y / size))
