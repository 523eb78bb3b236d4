"""Where the links are: poses and the flange Jacobian of every sample at once."""

from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import Chain
from vftcli.signals.arrays import Array, check_series
from vftcli.signals.parsing import check_kind


class LinkPoses(NamedTuple):
    """Poses of the chain's frames in the base frame, the flange last."""

    rotation: Array  #: Orientations. (T, n+1, 3, 3)
    translation: Array  #: Origins. (T, n+1, 3) [m]


def link_poses(chain: Chain, q: Array) -> LinkPoses:
    """Poses of every joint's frame, and of the flange, in the base frame.

    Args:
        chain: The arm.
        q: Joint positions. (T, n) [rad]

    Raises:
        ShapeError: If q is not one column a joint of the arm.
    """
    check_kind(chain, Chain, "the chain", "robot.chain")
    check_series(q, chain.joints, "q", "the poses")
    samples, n = np.shape(q)
    rotation, translation = np.empty((samples, n + 1, 3, 3)), np.empty((samples, n + 1, 3))
    R: Array = np.broadcast_to(np.eye(3), (samples, 3, 3))
    o: Array = np.zeros((samples, 3))
    cosine, sine = np.cos(q), np.sin(q)
    for j in range(n):
        o = o + R @ chain.translation[j]
        R = R @ chain.rotation[j]
        c, s = cosine[:, j, None], sine[:, j, None]
        x, y = R[:, :, 0], R[:, :, 1]
        R = np.stack([c * x + s * y, c * y - s * x, R[:, :, 2]], axis=2)
        rotation[:, j], translation[:, j] = R, o
    translation[:, n] = o + R @ chain.flange_translation
    rotation[:, n] = R @ chain.flange_rotation
    return LinkPoses(rotation, translation)


def flange_jacobian(chain: Chain, q: Array) -> Array:
    """Jacobian of the flange point in base axes (Pinocchio's LOCAL_WORLD_ALIGNED). (T, 6, n)

    Its first three rows give the flange's velocity [m], the last three its angular velocity; its
    transpose takes a force and moment ON the robot, in base axes at the flange point, to joint
    torques.

    Args:
        chain: The arm.
        q: Joint positions. (T, n) [rad]
    """
    poses = link_poses(chain, q)
    axes = poses.rotation[:, :-1, :, 2]
    arms = poses.translation[:, -1:, :] - poses.translation[:, :-1, :]
    return np.concatenate([np.cross(axes, arms), axes], axis=2).transpose(0, 2, 1)
