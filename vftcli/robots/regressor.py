"""The torque regressor: rigid-body torque as a matrix times the inertial parameters, batched.

τ = Y(q, q̇, q̈) φ with ten numbers a link, in the chain's own frames and Pinocchio's order:
m, m·c (3), then xx, xy, yy, xz, yz, zz of the tensor about the frame's origin. Reflected rotor
inertia is not part of it (Pinocchio's regressor leaves it out too): it is a column q̈_j of its own.
"""

from dataclasses import replace

import numpy as np

from vftcli.robots.chain import Chain, flange_jacobian, link_poses, point_tensor
from vftcli.signals.arrays import Array
from vftcli.signals.pose import cross, skew

LINK = 10  #: Inertial parameters a link.
#: Their names, in order.
INERTIAL_NAMES = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
#: Row and column of the six tensor entries, in order.
TENSOR = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))


def link_columns(
    axis: Array, lever: Array, omega: Array, alpha: Array, acceleration: Array, out: Array
) -> None:
    """Fill the ten columns of one link for the joints up to its own. (j+1, 10, N)

    The link's force is f = m a + (α̂ + ω̂²) h with a less gravity, its moment about the frame's
    origin n = I α + ω × I ω + h × a; a joint feels axis·n + lever·f, all in the link's axes. A
    lever is axis × (origin of the link − origin of the joint). (3, j+1, N)
    """
    out[:, 0] = np.sum(lever * acceleration[:, None], axis=0)
    first_moment = cross(lever, alpha) + cross(omega, cross(omega, lever))
    out[:, 1:4] = (first_moment + cross(acceleration, axis)).swapaxes(0, 1)
    turned = cross(axis, omega)
    for k, (r, c) in enumerate(TENSOR, start=4):
        out[:, k] = axis[r] * alpha[c] + turned[r] * omega[c]
        if r != c:
            out[:, k] += axis[c] * alpha[r] + turned[c] * omega[r]


def torque_regressor(chain: Chain, q: Array, dq: Array, ddq: Array) -> Array:
    """The inertial regressor of every sample. (N, n, 10n)

    Only the chain's geometry and gravity are used. Memory is 80 n² bytes a sample: call it on a
    chunk of a long log.
    """
    samples, n = q.shape
    out = np.zeros((n, n, LINK, samples))
    cosine, sine = np.cos(q.T), np.sin(q.T)
    omega, alpha = np.zeros((3, samples)), np.zeros((3, samples))
    acceleration, axis = -chain.gravity[:, None], np.zeros((3, 1, samples))
    axis[2] = 1.0
    axes, levers = np.zeros((3, 0, samples)), np.zeros((3, 0, samples))
    for j in range(n):
        shift = chain.translation[j][:, None]
        acceleration = acceleration + cross(alpha, shift) + cross(omega, cross(omega, shift))
        levers = levers + cross(axes, shift)
        turned = (
            np.tensordot(chain.rotation[j].T, v, axes=1)
            for v in (omega, alpha, acceleration, axes, levers)
        )
        c, s = cosine[j], sine[j]
        omega, alpha, acceleration, axes, levers = (
            np.stack([c * x + s * y, c * y - s * x, z]) for x, y, z in turned
        )
        alpha = alpha + np.stack([omega[1] * dq[:, j], -omega[0] * dq[:, j], ddq[:, j]])
        omega[2] += dq[:, j]
        axes = np.concatenate([axes, axis], axis=1)
        levers = np.concatenate([levers, np.zeros_like(axis)], axis=1)
        link_columns(axes, levers, omega, alpha, acceleration, out[: j + 1, j])
    return np.ascontiguousarray(out.transpose(3, 0, 1, 2)).reshape(samples, n, n * LINK)


def load_wrench(chain: Chain, q: Array) -> Array:
    """Wrench of a load's weight, by its mass and moment m·c. (N, 6, 4)

    A mass m at c in flange axes pulls with m g₀, and turns by R m c × g₀ about the flange point.
    """
    gravity = np.asarray(chain.gravity)
    wrench = np.zeros((len(q), 6, 4))
    wrench[:, :3, 0] = gravity
    # v × g₀ = −[g₀]× v
    wrench[:, 3:, 1:] = -skew(gravity) @ link_poses(chain, q).rotation[:, -1]
    return wrench


def load_regressor(chain: Chain, q: Array) -> Array:
    """External joint torque of `load_wrench`, by the same four numbers. (N, n, 4)"""
    torque: Array = flange_jacobian(chain, q).transpose(0, 2, 1) @ load_wrench(chain, q)
    return torque


def chain_parameters(chain: Chain) -> Array:
    """The inertial parameters φ of a chain. (10n,)"""
    phi = np.empty((chain.joints, LINK))
    for j in range(chain.joints):
        m, c = chain.mass[j], chain.com[j]
        about_origin = chain.inertia[j] + m * point_tensor(c)
        phi[j] = [m, *(m * c), *(about_origin[r, s] for r, s in TENSOR)]
    return phi.ravel()


def with_parameters(chain: Chain, phi: Array, rotor_inertia: Array | None = None) -> Chain:
    """The chain with other parameters φ (10n,) and rotor inertias. (n,)"""
    bodies = []
    for row in phi.reshape(chain.joints, LINK):
        mass = float(row[0])
        com = row[1:4] / mass if mass > 0 else np.zeros(3)
        tensor = np.empty((3, 3))
        for value, (r, c) in zip(row[4:], TENSOR, strict=True):
            tensor[r, c] = tensor[c, r] = value
        bodies.append((mass, com, tensor - mass * point_tensor(com)))
    masses, coms, inertias = map(np.array, zip(*bodies, strict=True))
    rotors = chain.rotor_inertia if rotor_inertia is None else rotor_inertia
    return replace(chain, mass=masses, com=coms, inertia=inertias, rotor_inertia=rotors)
