"""The arm as something to look at: capsules from the chain's own geometry, and where they are."""

from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import Chain
from vftcli.robots.kinematics import link_poses
from vftcli.signals.arrays import Array
from vftcli.signals.pose import matrix_quaternion

#: Radius of the first and of the last link, as a share of the arm's length.
THICKNESS = (0.048, 0.030)
RATE = 50.0  #: Poses a second that are drawn. [Hz]
MOST_POSES = 20_000  #: Poses that are drawn, however long the log is.
SHORTEST = 0.02  #: A link shorter than this share of the arm's length is not drawn: its joints are.


class Capsule(NamedTuple):
    """A cylinder with round ends, in the axes of the frame it moves with."""

    start: Array  #: Centre of one end. (3,) [m]
    direction: Array  #: From one end's centre to the other's. (3,) [m]
    radius: float  #: Radius. [m]
    joint: bool  #: Whether it stands for a joint rather than for a link.


class ArmPoses(NamedTuple):
    """Poses of the links over time."""

    t: Array  #: Time. (S,) [s]
    translation: Array  #: Origins in the base frame, the flange last. (S, n+1, 3) [m]
    quat_xyzw: Array  #: Orientations as unit quaternions. (S, n+1, 4)
    q: Array  #: Joint positions. (S, n) [rad]


def arm_length(chain: Chain) -> float:
    """Length of the stretched arm, base to flange. [m]"""
    offsets = np.vstack([chain.translation, chain.flange_translation])
    return float(np.linalg.norm(offsets, axis=1).sum())


def capsules(chain: Chain) -> list[list[Capsule]]:
    """What moves with the base and with each link: n + 1 lists, base first."""
    n, length = chain.joints, arm_length(chain)
    offsets = np.vstack([chain.translation, chain.flange_translation])
    radii = length * np.linspace(*THICKNESS, n + 1)
    shapes: list[list[Capsule]] = []
    for j in range(n + 1):
        shapes.append([])
        # A joint is a short thick cylinder about its axis, which is z of the link that it moves.
        if j > 0:
            half = 1.1 * radii[j]
            axis = np.array([0.0, 0.0, 2.0 * half])
            shapes[j].append(Capsule(-0.5 * axis, axis, 1.18 * radii[j], joint=True))
        if np.linalg.norm(offsets[j]) > SHORTEST * length:
            shapes[j].append(Capsule(np.zeros(3), offsets[j], radii[j], joint=False))
    return shapes


def motion(chain: Chain, t: Array, q: Array) -> ArmPoses:
    """Poses of all links at about `RATE` samples a second, `MOST_POSES` of them at most."""
    # At least each sample: a slow log is drawn as it is.
    every = max(1, int(len(t) / max(float(t[-1] - t[0]) * RATE, 1.0)), -(-len(t) // MOST_POSES))
    t, q = t[::every], np.ascontiguousarray(q[::every])
    poses = link_poses(chain, q)
    scalar_last = np.roll(matrix_quaternion(poses.rotation), -1, axis=-1)
    return ArmPoses(t, poses.translation, scalar_last, q)
