"""Poses: matrices, fixed-axis angles, rotation vectors, quaternions, the adjoint.

Rotation vectors and quaternions (w, x, y, z) are for many orientations at once. The
deviation of an orientation is the rotation vector x̃ = log(R R_dᵀ), updated by R ← exp(ω
Ts) R. Under multiplication alone a quaternion and its logarithm change continuously: the
logarithm grows through π without a jump, up to a full turn.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, handed_over


class Pose(NamedTuple):
    """Orientation (3, 3) and origin (3,) [m] of one frame in another."""

    rotation: Array
    translation: Array = handed_over(np.zeros(3))

    def __matmul__(self, other: "Pose") -> "Pose":
        return Pose(
            self.rotation @ other.rotation, self.rotation @ other.translation + self.translation
        )


IDENTITY = Pose(np.eye(3))  #: The pose of a frame in itself.


def inverse(pose: Pose) -> Pose:
    """The pose of F in S, from the pose of S in F; many at once too."""
    turned = pose.rotation.swapaxes(-1, -2)
    return Pose(turned, -np.squeeze(turned @ pose.translation[..., None], axis=-1))


def adjoint(pose: Pose) -> Array:
    """The matrix that takes a wrench in S to F, for the pose of S in F. (..., 6, 6)

    R, p of S in F: [[R, 0], [[p]×R, R]], Pinocchio's ``SE3(R, p).act(Force)``.
    """
    R, p = pose.rotation, pose.translation
    X = np.zeros((*R.shape[:-2], 6, 6))
    X[..., :3, :3] = X[..., 3:, 3:] = R
    X[..., 3:, :3] = skew(p) @ R
    return X


def skew(p: Array) -> Array:
    """[p]×, so that [p]× f = p × f. (..., 3, 3) of (..., 3)"""
    zero = np.zeros(p.shape[:-1])
    x, y, z = p[..., 0], p[..., 1], p[..., 2]
    rows = [zero, -z, y, z, zero, -x, -y, x, zero]
    return np.stack(rows, axis=-1).reshape(*p.shape[:-1], 3, 3)


def cross(a: Array, b: Array) -> Array:
    """Cross product along the first axis, (3, ...): a tenth of NumPy's time."""
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def rotation_about(axis: Literal["x", "y", "z"], angle: float) -> Array:
    """The matrix that turns a vector about one axis by an angle [rad]. (3, 3)"""
    # The two other axes in the order in which the turn takes the first to the second.
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    R = np.eye(3)
    R[i, i] = R[j, j] = np.cos(angle)
    R[j, i] = np.sin(angle)
    R[i, j] = -R[j, i]
    return R


def rpy_matrix(angles: Sequence[float] | Array) -> Array:
    """Rz(yaw) Ry(pitch) Rx(roll), the URDF's fixed-axis angles [rad]. (3, 3)"""
    roll, pitch, yaw = angles
    return rotation_about("z", yaw) @ rotation_about("y", pitch) @ rotation_about("x", roll)


def rpy_angles(rotation: Array) -> tuple[float, float, float]:
    """Roll, pitch and yaw of a rotation, as `rpy_matrix` takes them. [rad]

    At a pitch of ±π/2 roll and yaw turn about one axis; all of it is called roll there.
    """
    R = rotation
    level = np.hypot(R[0, 0], R[1, 0])
    pitch = float(np.arctan2(-R[2, 0], level))
    # Above it the angles have nine digits.
    if level < 1e-9:
        return float(np.arctan2(-R[1, 2], R[1, 1])), pitch, 0.0
    return float(np.arctan2(R[2, 1], R[2, 2])), pitch, float(np.arctan2(R[1, 0], R[0, 0]))


def rotation_onto(direction: Array) -> Array:
    """A rotation with its z axis along `direction` (3,). (3, 3)"""
    z = direction / np.linalg.norm(direction)
    if np.allclose(z, (0.0, 0.0, 1.0), atol=1e-15):
        return np.eye(3)
    # The axis farthest from z gives the best conditioned cross product.
    start = np.eye(3)[abs(z).argmin()]
    x = np.cross(start, z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def exp_quaternion(vector: Array) -> Array:
    """The unit quaternion of a rotation vector. (…, 3) [rad] → (…, 4)"""
    half = 0.5 * np.sqrt(np.sum(vector**2, axis=-1, keepdims=True))
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * vector], axis=-1)


def log_quaternion(quaternion: Array) -> Array:
    """The rotation vector of a unit quaternion, up to 2π long. (…, 3) [rad]"""
    w, vector = quaternion[..., :1], quaternion[..., 1:]
    sine = np.sqrt(np.sum(vector**2, axis=-1, keepdims=True))
    angle = 2.0 * np.arctan2(sine, w)
    # At rest the quotient is 0/0.
    share = np.full_like(sine, 2.0)
    np.divide(angle, sine, out=share, where=sine > 0.0)
    return np.asarray(share * vector)


def quaternion_product(a: Array, b: Array) -> Array:
    """Product a·b: first b's rotation, then a's, about fixed axes. (…, 4)"""
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
    """Rotations of rotation vectors (Rodrigues). (…, 3) [rad] → (…, 3, 3)"""
    v = np.asarray(vector, float)
    angle, K = np.sqrt(np.sum(v**2, axis=-1))[..., None, None], skew(v)
    # sin θ/θ, and (1 − cos θ)/θ² = ½ (sin(θ/2)/(θ/2))²
    once = np.sinc(angle / np.pi)
    twice = 0.5 * np.sinc(0.5 * angle / np.pi) ** 2
    return np.asarray(np.eye(3) + once * K + twice * (K @ K))


def log_matrix(matrix: Array) -> Array:
    """Rotation vector, at most π long, of a rotation matrix. (…, 3, 3) → (…, 3) [rad]"""
    quaternion = matrix_quaternion(np.asarray(matrix, float))
    # Of the two quaternions of a rotation the one with w ≥ 0 has the shorter logarithm.
    return log_quaternion(np.where(quaternion[..., :1] < 0.0, -quaternion, quaternion))


def matrix_quaternion(matrix: Array) -> Array:
    """A unit quaternion x of each rotation matrix. (…, 3, 3) → (…, 4)

    A matrix gives 4 x xᵀ. The row with its largest diagonal entry is as exact near a turn
    of π as near 0.

    References:
        S. W. Shepperd, "Quaternion from rotation matrix", J. Guidance and Control 1(3), 1978.
    """
    back = matrix.swapaxes(-1, -2)
    trace = np.trace(matrix, axis1=-2, axis2=-1)[..., None, None]
    turn = (matrix - back)[..., (2, 0, 1), (1, 2, 0)]
    product = np.empty((*matrix.shape[:-2], 4, 4))
    product[..., :1, :1] = 1.0 + trace
    product[..., 1:, 1:] = matrix + back + (1.0 - trace) * np.eye(3)
    product[..., 0, 1:] = turn
    product[..., 1:, 0] = turn
    best = np.diagonal(product, axis1=-2, axis2=-1).argmax(axis=-1)
    longest = np.take_along_axis(product, best[..., None, None], axis=-2)[..., 0, :]
    return np.asarray(longest / np.linalg.norm(longest, axis=-1, keepdims=True))
