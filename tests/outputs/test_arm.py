import numpy as np
import pytest

from vftcli.outputs.arm import arm_length, capsules, flange_force, motion
from vftcli.robots import PROFILES, load_robot
from vftcli.robots.kinematics import flange_jacobian, link_poses


@pytest.mark.parametrize("name", PROFILES)
def test_capsules_join_the_joints(name: str) -> None:
    """In every link the capsule ends where the next frame begins, if they are apart at all."""
    chain = load_robot(name).chain
    offsets = np.vstack([chain.translation, chain.flange_translation])
    for shapes, offset in zip(capsules(chain), offsets, strict=True):
        for shape in shapes:
            if not shape.joint:
                np.testing.assert_array_equal(shape.start + shape.direction, offset)
        links = [shape for shape in shapes if not shape.joint]
        assert bool(links) == (np.linalg.norm(offset) > 0.02 * arm_length(chain))


def test_motion_follows_the_log_at_its_rate() -> None:
    chain = load_robot("panda").chain
    t = 0.001 * np.arange(5000)
    q = np.sin(t[:, None] * np.arange(1, 8))
    poses = motion(chain, t, q, 50.0)
    np.testing.assert_allclose(np.diff(poses.t), 0.02, atol=1e-9)
    np.testing.assert_array_equal(poses.translation, link_poses(chain, q[::20]).translation)


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_a_push_at_the_flange_is_found(name: str) -> None:
    robot = load_robot(name)
    q = np.random.default_rng(2).uniform(-1.5, -0.5, (50, robot.joints))
    wrench = np.array([10.0, -20.0, 5.0, 0.5, 0.2, -0.1])
    tau = np.einsum("sij,i->sj", flange_jacobian(robot.chain, q), wrench)
    force = flange_force(robot.chain, q, tau)
    told = np.all(np.isfinite(force), axis=1)
    assert told.any()
    # 1/σ_min ≤ 20 times rounding of torques of some 10 N·m
    np.testing.assert_allclose(force[told], np.tile(wrench[:3], (told.sum(), 1)), atol=1e-10)


def test_a_singular_pose_has_no_force() -> None:
    """A UR5 stretched out straight (q₃ = 0) cannot feel a push along the arm."""
    chain = load_robot("ur5").chain
    q = np.array([[0.0, -1.0, 0.0, 0.3, 1.2, 0.0], [0.0, -1.0, 1.0, 0.3, 1.2, 0.0]])
    force = flange_force(chain, q, np.ones((2, 6)))
    assert np.all(np.isnan(force[0]))
    assert np.all(np.isfinite(force[1]))
