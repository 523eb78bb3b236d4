"""Where a contact may be: Jacobians of the places that are weighed, and of points along the links.

Joints behind the place do not feel it: that, and nothing else, tells where it is.
"""

from typing import Literal, NamedTuple

import numpy as np

from vftcli.robots.chain import Chain, LinkPoses, link_poses
from vftcli.signals.arrays import Array

ArmPart = Literal["wrist", "forearm", "upper arm", "cannot tell"]  #: A part of the arm.
POINTS = 10  #: Points along each link that a force is tried at.
#: The first link that is tried: on link 1 a force loads one joint, as friction does.
FIRST_LINK = 2
#: Lever of the moment that a contact's force may have about the flange or a link's middle. [m]
LEAST_LEVER = 0.1
FORCE_PRIOR = 100.0  #: Standard deviation that a force is given beforehand. [N]
ALIKE = 4.0  #: Points with a score within this of the best one's fit as well.
#: χ² of the best point beyond which a contact is more than a force at a point.
MORE_THAN_A_FORCE = 20.0


class ContactPlace(NamedTuple):
    """A place at which a contact is weighed."""

    link: int  #: Number of the link; 0 for the flange.
    lever: float  #: Standard deviation of the moment over that of the force. [m]
    #: J of its point along the log; columns of joints that do not move it are zero. (K, 6, n)
    jacobian: Array


def places(chain: Chain, q: Array) -> list[ContactPlace]:
    """The flange, and the middle of every link from the second on, at q (K, n)."""
    poses, n = link_poses(chain, q), chain.joints
    found = [ContactPlace(0, LEAST_LEVER, point_jacobian(poses, n, poses.translation[:, n]))]
    for link in range(FIRST_LINK, n + 1):
        start, end = poses.translation[:, link - 1], poses.translation[:, link]
        half = 0.5 * float(np.linalg.norm(end[0] - start[0]))
        J = point_jacobian(poses, link, 0.5 * (start + end))
        found.append(ContactPlace(link, max(LEAST_LEVER, half), J))
    return found


def point_jacobian(poses: LinkPoses, link: int, point: Array) -> Array:
    """Jacobian of a point (K, 3) that moves with a link, from 1, in base axes. (K, 6, n)"""
    axes = poses.rotation[:, :-1, :, 2]
    arms = point[:, None, :] - poses.translation[:, :-1]
    J = np.concatenate([np.cross(axes, arms), axes], axis=2).transpose(0, 2, 1)
    J[:, :, link:] = 0.0
    return J


def link_jacobian(chain: Chain, q: Array, link: int, share: float) -> Array:
    """Jacobian of a point along a link, from its joint (0) to the next (1). (K, 6, n)"""
    poses = link_poses(chain, q)
    start, end = poses.translation[:, link - 1], poses.translation[:, link]
    return point_jacobian(poses, link, start + share * (end - start))


def arm_parts(joints: int) -> dict[int, ArmPart]:
    """Link → part of the arm, 0 the flange: what cannot be told from the flange is the wrist.

    Of six joints links 4 to 6 are the wrist and link 3 the forearm; of seven joints links 6 and 7,
    and 4 and 5. What comes before is the upper arm.
    """
    forearm, wrist = (3, 4) if joints <= 6 else (4, 6)
    found: dict[int, ArmPart] = {0: "wrist"}
    for link in range(1, joints + 1):
        found[link] = "wrist" if link >= wrist else "forearm"
        if link < forearm:
            found[link] = "upper arm"
    return found


class PointFit(NamedTuple):
    """A force at a point of a link, as it explains a torque."""

    link: int  #: The link, from 1; the last one's end is the flange.
    share: float  #: Where along the link, from its joint (0) to the next (1).
    misfit: float  #: χ² of the torque that is left.
    score: float  #: χ² and what the size of the force costs.
    force: Array  #: The force in base axes. (3,) [N]
    band: float  #: Half width of the 95 % band of its size. [N]

    @property
    def size(self) -> float:
        """|F|. [N]"""
        return float(np.linalg.norm(self.force))


def point_fits(chain: Chain, q: Array, torque: Array, sd: Array) -> list[PointFit]:
    """A force at each of the points of the links that fit within `ALIKE`, the best first.

    `POINTS` a link are tried, from `FIRST_LINK` on.

    F = (AᵀA + I/σ²)⁻¹Aᵀ(τ/sd), A the rows of the point's Jacobian over sd: joints behind the point
    count with a prediction of zero, which is what tells the place.
    """
    poses, n = link_poses(chain, q[None]), chain.joints
    links = np.repeat(np.arange(FIRST_LINK, n + 1), POINTS)
    along = np.tile(np.arange(1, POINTS + 1) / POINTS, n + 1 - FIRST_LINK)
    start, end = poses.translation[0, links - 1], poses.translation[0, links]
    points = start + along[:, None] * (end - start)
    axes, origins = poses.rotation[0, :-1, :, 2], poses.translation[0, :-1]
    rows = np.cross(axes[None], points[:, None] - origins[None])
    rows[np.arange(n)[None] >= links[:, None]] = 0.0
    A, y = rows / sd[:, None], torque / sd
    precision = A.swapaxes(1, 2) @ A + np.eye(3) / FORCE_PRIOR**2
    covariance = np.linalg.inv(precision)
    forces = (covariance @ (A.swapaxes(1, 2) @ y)[..., None])[..., 0]
    misfit = np.sum((y - (A @ forces[..., None])[..., 0]) ** 2, axis=1)
    score = misfit + np.sum(forces**2, axis=1) / FORCE_PRIOR**2
    sizes = np.maximum(np.linalg.norm(forces, axis=1), 1e-12)
    u = forces / sizes[:, None]
    bands = 1.96 * np.sqrt(np.einsum("pi,pij,pj->p", u, covariance, u))
    least = float(score.min()) + ALIKE
    order = np.argsort(score, kind="stable")[: np.count_nonzero(score <= least)]
    return [
        PointFit(
            link=int(links[i]),
            share=float(along[i]),
            misfit=float(misfit[i]),
            score=float(score[i]),
            force=forces[i],
            band=float(bands[i]),
        )
        for i in order
    ]


def from_flange(chain: Chain, q: Array, fit: PointFit) -> Array:
    """A fitted point's position from the flange point at q (n,), in base axes. (3,) [m]"""
    frames = link_poses(chain, q[None]).translation[0]
    start, end = frames[fit.link - 1], frames[fit.link]
    offset: Array = start + fit.share * (end - start) - frames[-1]
    return offset
