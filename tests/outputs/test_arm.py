import numpy as np
import pytest

from vftcli.outputs.arm import MOST_POSES, arm_length, capsules, motion
from vftcli.robots import PROFILES, load_robot
from vftcli.robots.kinematics import link_poses


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
    poses = motion(chain, t, q)
    np.testing.assert_allclose(np.diff(poses.t), 0.02, atol=1e-9)
    np.testing.assert_array_equal(poses.translation, link_poses(chain, q[::20]).translation)


def test_of_a_long_log_no_more_poses_are_drawn_than_can_be_looked_at() -> None:
    t = 0.02 * np.arange(50_001)  # 1000 s at the rate that is drawn
    chain = load_robot("panda").chain
    poses = motion(chain, t, np.zeros((len(t), chain.joints)))
    assert MOST_POSES / 2 < len(poses.t) <= MOST_POSES
