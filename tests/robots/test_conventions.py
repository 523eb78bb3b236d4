"""The three conventions of a robot file: the same arm in each is the same chain."""

import numpy as np
import pytest

from vftcli.robots.conventions import Kinematics, kinematics
from vftcli.signals.pose import IDENTITY, Pose, rotation_about, rpy_angles

TABLE = [
    {"a": 0.1, "d": 0.3, "alpha": 0.7, "theta": 0.2},
    {"a": -0.4, "d": 0.05, "alpha": -1.2, "theta": -0.5},
    {"a": 0.2, "d": -0.1, "alpha": 0.4, "theta": 1.1},
]
ANGLES = (0.3, -0.8, 1.9)
DOCUMENT = {"flange_d": 0.15, "ee_xyz": [0.01, 0.02, 0.03], "ee_rpy": [0.1, 0.2, 0.3]}


def flange(found: Kinematics, angles: tuple[float, ...]) -> Pose:
    """The tip's pose in the base at joint angles [rad], frame by frame."""
    pose = IDENTITY
    for placement, angle in zip(found.placements, angles, strict=True):
        pose = pose @ placement @ Pose(rotation_about("z", angle), np.zeros(3))
    return pose @ found.tip


def along(d: float) -> Pose:
    return Pose(np.eye(3), np.array([0.0, 0.0, d]))


def across(a: float, alpha: float) -> Pose:
    return Pose(rotation_about("x", alpha), np.array([a, 0.0, 0.0]))


def tip() -> Pose:
    from vftcli.signals.pose import rpy_matrix

    return along(0.15) @ Pose(rpy_matrix((0.1, 0.2, 0.3)), np.array([0.01, 0.02, 0.03]))


def same(found: Pose, expected: Pose) -> None:
    # a dozen products of numbers of order one
    np.testing.assert_allclose(found.rotation, expected.rotation, atol=1e-14)
    np.testing.assert_allclose(found.translation, expected.translation, atol=1e-14)


def test_standard_dh_turns_first_and_moves_the_inertials_out() -> None:
    """T_j = Rz(q+θ) Tz(d) Tx(a) Rx(α), the textbook's distal table."""
    found = kinematics("standard-dh", TABLE, DOCUMENT)
    pose = IDENTITY
    for j, angle in zip(TABLE, ANGLES, strict=True):
        pose = pose @ Pose(rotation_about("z", angle + j["theta"]), np.zeros(3)) @ along(j["d"])
        pose = pose @ across(j["a"], j["alpha"])
    same(flange(found, ANGLES), pose @ tip())
    # the table's frame j lies at the far end of link j
    same(found.inertial_frames[1], along(0.05) @ across(-0.4, -1.2))


def test_modified_dh_moves_first() -> None:
    """T_j = Rx(α) Tx(a) Rz(q+θ) Tz(d), Craig's proximal table."""
    found = kinematics("modified-dh", TABLE, DOCUMENT)
    pose = IDENTITY
    for j, angle in zip(TABLE, ANGLES, strict=True):
        pose = pose @ across(j["a"], j["alpha"])
        pose = pose @ Pose(rotation_about("z", angle + j["theta"]), np.zeros(3)) @ along(j["d"])
    same(flange(found, ANGLES), pose @ tip())
    same(found.inertial_frames[1], IDENTITY)


@pytest.mark.parametrize("name", ["standard-dh", "modified-dh"])
def test_xyz_rpy_states_any_other_s_placements(name: str) -> None:
    given = kinematics(name, TABLE, {})
    joints = [
        {"xyz": p.translation.tolist(), "rpy": list(rpy_angles(p.rotation))}
        for p in given.placements
    ]
    end = {"ee_xyz": given.tip.translation, "ee_rpy": rpy_angles(given.tip.rotation)}
    same(flange(kinematics("xyz-rpy", joints, end), ANGLES), flange(given, ANGLES))
