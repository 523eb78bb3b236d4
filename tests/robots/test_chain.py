"""The chain's bodies: what is merged, and what no body can be."""

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import PROFILES, load_robot
from vftcli.robots.chain import (
    Body,
    Payload,
    flange_jacobian,
    kinematics,
    link_poses,
    merge_bodies,
    symmetric,
    unphysical,
)
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import IDENTITY, Pose, rotation_about, rpy_angles

RNG = np.random.default_rng(8)


def cloud() -> tuple[float, np.ndarray, np.ndarray]:
    """Mass, centre and tensor about the centre of ten random points of mass."""
    masses, points = RNG.uniform(0.1, 1.0, 10), RNG.uniform(-0.3, 0.3, (10, 3))
    return body(masses, points)


def body(masses: np.ndarray, points: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    mass = float(masses.sum())
    com = masses @ points / mass
    arms = points - com
    tensor = sum(
        m * (d @ d * np.eye(3) - np.outer(d, d)) for m, d in zip(masses, arms, strict=True)
    )
    return mass, com, np.asarray(tensor)


def test_merged_bodies_are_the_body_of_all_their_points() -> None:
    masses, points = RNG.uniform(0.1, 1.0, 12), RNG.uniform(-0.3, 0.3, (12, 3))
    parts = [body(masses[k::3], points[k::3]) for k in range(3)]
    found = merge_bodies([Body(*part) for part in parts])
    for got, expected in zip(found, body(masses, points), strict=True):
        # sums of a dozen numbers of order one in another order
        np.testing.assert_allclose(got, expected, atol=1e-14)


def test_nothing_weighs_nothing() -> None:
    mass, com, tensor = merge_bodies([Body(0.0, np.ones(3), np.zeros((3, 3)))] * 2)
    assert mass == 0.0
    assert not com.any()
    assert not tensor.any()


def test_six_entries_make_a_tensor() -> None:
    tensor = symmetric([1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    assert np.array_equal(tensor, [[1, 2, 3], [2, 4, 5], [3, 5, 6]])


def test_every_cloud_of_points_is_a_body() -> None:
    for _ in range(50):
        mass, _, tensor = cloud()
        assert unphysical(mass, tensor) == ""


@pytest.mark.parametrize(
    ("mass", "moments", "words"),
    [
        (-1.0, (1, 1, 1), "mass is -1 kg"),
        (np.nan, (1, 1, 1), "mass is nan"),
        (1.0, (1, np.inf, 1), "not finite"),
        (1.0, (-0.1, 1, 1), "negative principal moment -0.1"),
        (1.0, (1, 1, 2.1), "triangle inequality: principal moment 2.1"),
        # a flat plate is the limit, and tables are rounded
        (1.0, (1, 1, 2.000001), ""),
    ],
)
def test_what_no_body_can_be_is_named(
    mass: float, moments: tuple[float, float, float], words: str
) -> None:
    found = unphysical(mass, np.diag(moments))
    assert (words in found) if words else found == ""


def test_a_payload_that_no_body_can_be_is_refused() -> None:
    with pytest.raises(RobotError, match="the payload is unphysical: mass is -2 kg"):
        Payload(mass=-2.0, com=np.zeros(3), inertia=np.zeros((3, 3)))


def test_a_payload_is_merged_into_the_last_link_as_pinocchio_does() -> None:
    chain = load_robot("ur5").chain
    load = Payload(
        mass=2.5, com=np.array([0.02, -0.03, 0.11]), inertia=np.diag([0.02, 0.03, 0.01])
    )
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
ANGLES = (0.3, -0.8, 1.9)
DOCUMENT = {"flange_d": 0.15, "ee_xyz": [0.01, 0.02, 0.03], "ee_rpy": [0.1, 0.2, 0.3]}


def flange(found: tuple[list[Pose], list[Pose]], angles: tuple[float, ...]) -> Pose:
    """The tip's pose in the base at joint angles [rad], frame by frame."""
    pose, (*placements, tip) = IDENTITY, found[0]
    for placement, angle in zip(placements, angles, strict=True):
        pose = pose @ placement @ Pose(rotation_about("z", angle), np.zeros(3))
    return pose @ tip


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
    same(found[1][1], along(0.05) @ across(-0.4, -1.2))


def test_modified_dh_moves_first() -> None:
    """T_j = Rx(α) Tx(a) Rz(q+θ) Tz(d), Craig's proximal table."""
    found = kinematics("modified-dh", TABLE, DOCUMENT)
    pose = IDENTITY
    for j, angle in zip(TABLE, ANGLES, strict=True):
        pose = pose @ across(j["a"], j["alpha"])
        pose = pose @ Pose(rotation_about("z", angle + j["theta"]), np.zeros(3)) @ along(j["d"])
    same(flange(found, ANGLES), pose @ tip())
    same(found[1][1], IDENTITY)
    same(kinematics("modified-dh", TABLE, {})[0][-1], IDENTITY)  # no tip is stated


@pytest.mark.parametrize("name", ["standard-dh", "modified-dh"])
def test_xyz_rpy_states_any_other_s_placements(name: str) -> None:
    given = kinematics(name, TABLE, {})
    *placements, tip = given[0]
    joints = [
        {"xyz": p.translation.tolist(), "rpy": list(rpy_angles(p.rotation))} for p in placements
    ]
    end = {"ee_xyz": tip.translation, "ee_rpy": rpy_angles(tip.rotation)}
    same(flange(kinematics("xyz-rpy", joints, end), ANGLES), flange(given, ANGLES))


@pytest.mark.parametrize("name", PROFILES)
def test_poses_and_jacobian_agree_with_pinocchio(name: str) -> None:
    robot = load_robot(name)
    q = np.random.default_rng(0).uniform(-3, 3, (40, robot.joints))
    poses, jacobian = link_poses(robot.chain, q), flange_jacobian(robot.chain, q)
    model, data = robot.model, robot.model.createData()
    flange = model.getFrameId("flange")
    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    for k in range(len(q)):
        J = pin.computeFrameJacobian(model, data, q[k], flange, frame)
        pin.framesForwardKinematics(model, data, q[k])
        # the same products in another order: rounding of numbers of order 1
        np.testing.assert_allclose(jacobian[k], J, atol=1e-13)
        np.testing.assert_allclose(poses.rotation[k, -1], data.oMf[flange].rotation, atol=1e-13)
        np.testing.assert_allclose(
            poses.translation[k, -1], data.oMf[flange].translation, atol=1e-13
        )
        for j in range(robot.joints):
            np.testing.assert_allclose(
                poses.translation[k, j], data.oMi[j + 1].translation, atol=1e-13
            )


def test_power_is_the_same_in_joint_and_flange_space() -> None:
    """q̇ᵀ(Jᵀf) = (J q̇)ᵀf for any wrench."""
    robot = load_robot("panda")
    rng = np.random.default_rng(1)
    q, dq = rng.uniform(-2, 2, (2, 30, 7))
    wrench = rng.normal(0, 10, (30, 6))
    J = flange_jacobian(robot.chain, q)
    joint = np.einsum("ti,ti->t", dq, np.einsum("tij,ti->tj", J, wrench))
    flange = np.einsum("ti,ti->t", np.einsum("tij,tj->ti", J, dq), wrench)
    np.testing.assert_allclose(joint, flange, atol=1e-12)  # rounding of sums of order 100
