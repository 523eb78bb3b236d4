"""The chain's frames and bodies: tables, payloads, poses and Jacobians."""

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import PROFILES, load_robot
from vftcli.robots.chain import (
    Payload,
    flange_jacobian,
    kinematics,
    link_poses,
    nearest_tensor,
    unphysical,
)
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import IDENTITY, Pose, rotation_about, rpy_matrix


@pytest.mark.parametrize(
    ("mass", "moments", "words"),
    [
        (-2.0, (0, 0, 0), "the payload is unphysical: mass is -2 kg"),
        (np.nan, (1, 1, 1), "mass is nan"),
        (1.0, (1, np.inf, 1), "not finite"),
    ],
)
def test_a_payload_that_no_body_can_be_is_refused(mass, moments, words):
    with pytest.raises(RobotError, match=words):
        Payload(mass=mass, com=np.zeros(3), inertia=np.diag(moments))


def test_the_nearest_tensor_is_valid_and_no_farther_than_it_must_be():
    R = rotation_about("x", 0.4) @ rotation_about("z", -1.1)
    bad = R @ np.diag([1.0, 2.0, 4.0]) @ R.T
    assert "triangle" in unphysical(1.0, bad)
    assert not unphysical(1.0, bad, triangle=False)
    near = nearest_tensor(bad)
    assert not unphysical(1.0, near)
    np.testing.assert_allclose(near, R @ np.diag([1.5, 2.5, 4.0]) @ R.T, atol=1e-14)
    # a flat plate is the limit, and tables are rounded
    plate = np.diag([1.0, 1.0, 2.000001])
    assert nearest_tensor(plate) is plate


def test_a_payload_is_merged_into_the_last_link_as_pinocchio_does():
    chain = load_robot("ur5").chain
    com, tensor = np.array([0.02, -0.03, 0.11]), np.diag([0.02, 0.03, 0.01])
    load = Payload(mass=2.5, com=com, inertia=tensor)
    model = chain.to_pinocchio()
    flange = pin.SE3(chain.flange_rotation, chain.flange_translation)
    model.inertias[6] += flange.act(pin.Inertia(load.mass, load.com, load.inertia))
    loaded, whole = chain.with_payload(load), model.inertias[6]
    assert loaded.mass[-1] == pytest.approx(whole.mass, rel=1e-12)  # rounding
    np.testing.assert_allclose(loaded.com[-1], whole.lever, atol=1e-12)
    np.testing.assert_allclose(loaded.inertia[-1], whole.inertia, atol=1e-12)
    np.testing.assert_array_equal(loaded.inertia[:-1], chain.inertia[:-1])


TABLE = [
    {"a": 0.1, "d": 0.3, "alpha": 0.7, "theta": 0.2},
    {"a": -0.4, "d": 0.05, "alpha": -1.2, "theta": -0.5},
    {"a": 0.2, "d": -0.1, "alpha": 0.4, "theta": 1.1},
]


def turned(axis: str, angle: float) -> Pose:
    return Pose(rotation_about(axis, angle), np.zeros(3))


def moved(x: float, z: float) -> Pose:
    return Pose(np.eye(3), np.array([x, 0.0, z]))


@pytest.mark.parametrize("convention", ["standard-dh", "modified-dh"])
def test_tables_are_the_textbooks(convention):
    """Distal Rz(q+θ) Tz(d) Tx(a) Rx(α), and Craig's proximal Rx(α) Tx(a) Rz(q+θ) Tz(d)."""
    document = {"flange_d": 0.15, "ee_xyz": [0.01, 0.02, 0.03], "ee_rpy": [0.1, 0.2, 0.3]}
    (*placements, tip), inertial = kinematics(convention, TABLE, document)
    found = expected = IDENTITY
    for j, placement, angle in zip(TABLE, placements, (0.3, -0.8, 1.9), strict=True):
        turn = turned("z", angle + j["theta"]) @ moved(0.0, j["d"])
        link = moved(j["a"], 0.0) @ turned("x", j["alpha"])
        expected = expected @ (turn @ link if convention == "standard-dh" else link @ turn)
        found = found @ placement @ turned("z", angle)
    hand = Pose(rpy_matrix((0.1, 0.2, 0.3)), np.array([0.01, 0.02, 0.03]))
    # the distal frame j, in which inertias are stated, lies at the far end of link j
    far = moved(-0.4, 0.05) @ turned("x", -1.2) if convention == "standard-dh" else IDENTITY
    for pose, other in ((found @ tip, expected @ moved(0.0, 0.15) @ hand), (inertial[1], far)):
        # a dozen products of numbers of order one
        np.testing.assert_allclose(pose.rotation, other.rotation, atol=1e-14)
        np.testing.assert_allclose(pose.translation, other.translation, atol=1e-14)


@pytest.mark.parametrize("name", PROFILES)
def test_poses_and_jacobian_agree_with_pinocchio(name):
    robot = load_robot(name)
    q = np.random.default_rng(0).uniform(-3, 3, (40, robot.joints))
    poses, jacobian = link_poses(robot.chain, q), flange_jacobian(robot.chain, q)
    model, data = robot.model, robot.model.createData()
    frame, axes = model.getFrameId("flange"), pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    for k in range(len(q)):
        J = pin.computeFrameJacobian(model, data, q[k], frame, axes)
        pin.framesForwardKinematics(model, data, q[k])
        flange, places = data.oMf[frame], [at.translation for at in data.oMi][1:]
        # the same products in another order: rounding of numbers of order 1
        np.testing.assert_allclose(jacobian[k], J, atol=1e-13)
        np.testing.assert_allclose(poses.rotation[k, -1], flange.rotation, atol=1e-13)
        expected = [*places, flange.translation]
        np.testing.assert_allclose(poses.translation[k], expected, atol=1e-13)
