"""Rotations as unit quaternions, many at once: exponential, logarithm, product.

The deviation of an orientation is the rotation vector x̃ = log(R R_dᵀ), updated by R ← exp(ω Ts) R.
A quaternion that is only ever multiplied changes continuously, and so does the logarithm taken of
it: it grows through π without a jump, up to a full turn. Quaternions are (w, x, y, z).
"""

import numpy as np

from vftcli.signals.arrays import Array

SMALL = 1e-6
"""Angle below which the series replaces the quotient; the next term is below 1e-25. [rad]"""


def exp_quaternion(vector: Array) -> Array:
    """The unit quaternion of a rotation vector. (…, 3) [rad] → (…, 4)"""
    angle = np.sqrt(np.sum(vector**2, axis=-1, keepdims=True))
    half = 0.5 * angle
    share = np.where(angle < SMALL, 0.5 - angle**2 / 48.0, np.sin(half) / np.maximum(angle, SMALL))
    return np.concatenate([np.cos(half), share * vector], axis=-1)


def log_quaternion(quaternion: Array) -> Array:
    """The rotation vector of a unit quaternion, its angle from 0 to 2π. (…, 4) → (…, 3) [rad]"""
    w, vector = quaternion[..., :1], quaternion[..., 1:]
    sine = np.sqrt(np.sum(vector**2, axis=-1, keepdims=True))
    angle = 2.0 * np.arctan2(sine, w)
    # For a tiny sine the quotient is 2/w − (2/3) sine²/w³; at w < 0 (a full turn) it is undefined.
    near = (sine < SMALL) & (w > 0.0)
    share = np.where(near, 2.0 - 2.0 / 3.0 * sine**2, angle / np.maximum(sine, 1e-300))
    result: Array = share * vector
    return result


def product(a: Array, b: Array) -> Array:
    """Quaternion product a·b: first b's rotation, then a's, both about fixed axes. (…, 4)"""
    aw, ax, ay, az = np.moveaxis(a, -1, 0)
    bw, bx, by, bz = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        ],
        axis=-1,
    )


def exp_matrix(vector: Array) -> Array:
    """Rotation matrices of rotation vectors, by Rodrigues' formula. (…, 3) [rad] → (…, 3, 3)"""
    w, x, y, z = np.moveaxis(exp_quaternion(np.asarray(vector, dtype=np.float64)), -1, 0)
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def log_matrix(matrix: Array) -> Array:
    """Rotation vector, at most π long, of a rotation matrix. (…, 3, 3) → (…, 3) [rad]

    Through the quaternion whose largest component is taken first (Shepperd), so that it is as exact
    near π as near 0.
    """
    R = np.asarray(matrix, dtype=np.float64)
    d = np.diagonal(R, axis1=-2, axis2=-1)
    trace = d.sum(axis=-1)
    candidates = np.stack([trace, *np.moveaxis(2.0 * d - trace[..., None], -1, 0)], axis=-1)
    xy, xz, yz = (
        R[..., 0, 1] + R[..., 1, 0],
        R[..., 0, 2] + R[..., 2, 0],
        R[..., 1, 2] + R[..., 2, 1],
    )
    wx, wy, wz = (
        R[..., 2, 1] - R[..., 1, 2],
        R[..., 0, 2] - R[..., 2, 0],
        R[..., 1, 0] - R[..., 0, 1],
    )
    first = 1.0 + candidates
    rows = np.stack(
        [
            np.stack([first[..., 0], wx, wy, wz], axis=-1),
            np.stack([wx, first[..., 1], xy, xz], axis=-1),
            np.stack([wy, xy, first[..., 2], yz], axis=-1),
            np.stack([wz, xz, yz, first[..., 3]], axis=-1),
        ],
        axis=-2,
    )
    best = np.argmax(candidates, axis=-1)
    quaternion = np.take_along_axis(rows, best[..., None, None], axis=-2)[..., 0, :]
    quaternion = quaternion / np.linalg.norm(quaternion, axis=-1, keepdims=True)
    return log_quaternion(np.where(quaternion[..., :1] < 0.0, -quaternion, quaternion))
