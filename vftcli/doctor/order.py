"""Joints whose effort is turned, and joints that changed places."""

import numpy as np

from vftcli.doctor.case import Case
from vftcli.doctor.robust import KEPT
from vftcli.signals.arrays import Array

SUSPECT = 0.35  #: Misfit of a joint from which its sign and its place are tried.


def crossed_rests(case: Case) -> Array:
    """What joint j's model leaves over of joint i's effort, as it is and turned. (2, n, n) [N·m]"""
    direction, speed = case.windows.motion
    n = case.given.shape[1]
    rests = np.empty((2, n, n))
    logged = case.given / case.constant
    for j in range(n):
        for k, sign in enumerate((1.0, -1.0)):
            target = sign * case.constant[j] * logged - case.needed[:, j : j + 1]
            rests[k, :, j] = one_joint_rests(target, direction[:, j], speed[:, j])
    return rests


def one_joint_rests(target: Array, direction: Array, speed: Array) -> Array:
    """What one joint's friction leaves over of several torques, contact set aside. (m,) [N·m]

    Args:
        target: The torques. (W, m) [N·m]
        direction: Mean direction of the joint's motion. (W,)
        speed: Its mean speed. (W,) [rad/s]
    """
    kept = np.ones(target.shape)
    rest = target
    for _ in range(3):
        aa, bb, ab = (kept.T @ x for x in (direction**2, speed**2, direction * speed))
        a, b = (np.einsum("wm,wm,w->m", kept, target, x) for x in (direction, speed))
        determinant = aa * bb - ab**2
        sound = determinant > 1e-9 * aa * bb
        inverse = np.where(sound, 1 / np.where(sound, determinant, 1.0), 0.0)
        coulomb, viscous = (bb * a - ab * b) * inverse, (aa * b - ab * a) * inverse
        # One of them below zero: the other alone, if it takes energy.
        only_a = np.maximum(a / np.maximum(aa, 1e-12), 0.0)
        only_b = np.maximum(b / np.maximum(bb, 1e-12), 0.0)
        both = (coulomb >= 0) & (viscous >= 0) & sound
        first = ~both & (only_a**2 * aa >= only_b**2 * bb)
        coulomb = np.where(both, coulomb, np.where(first, only_a, 0.0))
        viscous = np.where(both, viscous, np.where(~both & ~first, only_b, 0.0))
        rest = target - direction[:, None] * coulomb - speed[:, None] * viscous
        kept = (np.abs(rest) <= np.quantile(np.abs(rest), KEPT, axis=0)).astype(float)
    return np.asarray(np.sqrt(np.sum(kept * rest**2, axis=0) / np.sum(kept, axis=0)))
