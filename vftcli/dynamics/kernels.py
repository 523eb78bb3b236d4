r"""Batched recursions for the momentum form of an arm's dynamics: p, Cᵀq̇ and g over all samples.

With the Christoffel C, :math:`C^T\dot q = \tfrac12\,\partial(\dot q^T M \dot q)/\partial q`: the
rate at which the kinetic energy would change if only q moved. Turning link j and everything behind
it by dq_j turns their momenta, so each component is a cross product of the link's own velocity with
the composite momentum behind it, and no derivative of M is needed. One pass out, one pass back:

- out: ω_j = R_jᵀω_{j−1} + z q̇_j, v_j = R_jᵀ(v_{j−1} + ω_{j−1} × r_j), γ_j = R_jᵀγ_{j−1};
- link: l = m(v + ω × c), k = I_c ω + c × l, first moment h = m c;
- back, added to the parent's: l ← R_j l, k ← R_j k + r_j × (R_j l), h ← R_j h + m r_j;
- p_j = k_z + J_j q̇_j, (Cᵀq̇)_j = v_y l_x − v_x l_y + ω_y k_x − ω_x k_y, g_j = h_y γ_x − h_x γ_y.

γ₀ is the gravity vector itself, J the reflected rotor inertia. Every constant map is one small
matrix; a chunk of samples is the other factor, so the work is done by BLAS.

These are p of (8), Cᵀq̇ of (14) and G of (16), exactly rather than by differences; the tests hold
them against Pinocchio's mass matrix, Coriolis matrix and gravity.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.arrays import Array
from vftcli.robots.chain import Chain

CHUNK = 4096
"""Samples worked on at a time: small enough that a chunk's arrays stay in the cache."""


class MomentumTerms(NamedTuple):
    """The pieces of the equations of motion that need no acceleration.

    Attributes:
        p: Generalised momentum M q̇. (T, n) [kg·m²/s]
        coriolis_transpose_dq: Cᵀq̇. (T, n) [N·m]
        gravity: Gravity torque g(q). (T, n) [N·m]
    """

    p: Array
    coriolis_transpose_dq: Array
    gravity: Array


@dataclass(frozen=True)
class Maps:
    """A chain's constants as the matrices the recursion multiplies with.

    A motion state is nine rows (ωx, vx, γx, ωy, vy, γy, ωz, vz, γz), a momentum state nine rows
    (lx, kx, hx, ly, ky, hy, lz, kz, hz), so that a turn about z mixes two blocks of three rows.

    Attributes:
        outward: Motion state of frame j−1 → frame j before it turns. (n, 9, 9)
        back: Motion state of frame j beside the turned momentum state of frame j+1 → momentum
            state of frame j. (n, 9, 18)
        first_moment: What the composite masses add to a momentum state. (n, 9, 1)
        rotor_inertia: Reflected rotor inertia. (n, 1) [kg·m²]
        start: Motion state of the base: gravity alone. (9, 1)
    """

    outward: Array
    back: Array
    first_moment: Array
    rotor_inertia: Array
    start: Array


def interleave(rows: list[list[Array]]) -> Array:
    """Arrange a 3×3 grid of 3×3 blocks so that x, y and z rows and columns lie together. (9, 9)"""
    dense = np.block(rows)
    order = np.arange(9).reshape(3, 3).T.ravel()
    return np.ascontiguousarray(dense[np.ix_(order, order)])


def cross_matrix(v: Array) -> Array:
    """The matrix of v × ·. (3, 3)"""
    x, y, z = v
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])


def maps_of(chain: Chain) -> Maps:
    """Prepare a chain's constants for `momentum_terms`."""
    n, zero = chain.joints, np.zeros((3, 3))
    outward, back, first_moment = np.empty((n, 9, 9)), np.zeros((n, 9, 18)), np.zeros((n, 9, 1))
    behind = np.append(np.cumsum(chain.mass[::-1])[::-1], 0.0)
    for j in range(n):
        R, r = chain.rotation[j], cross_matrix(chain.translation[j])
        outward[j] = interleave([[R.T, zero, zero], [-R.T @ r, R.T, zero], [zero, zero, R.T]])
        m, c = chain.mass[j], cross_matrix(chain.com[j])
        about_origin = chain.inertia[j] - m * c @ c
        back[j, :, :9] = interleave(
            [[-m * c, m * np.eye(3), zero], [about_origin, m * c, zero], [zero, zero, zero]]
        )
        moment = m * chain.com[j]
        if j + 1 < n:
            R, r = chain.rotation[j + 1], cross_matrix(chain.translation[j + 1])
            back[j, :, 9:] = interleave([[R, zero, zero], [r @ R, R, zero], [zero, zero, R]])
            moment = moment + behind[j + 1] * chain.translation[j + 1]
        first_moment[j, 2::3, 0] = moment
    start = np.zeros((9, 1))
    start[2::3, 0] = chain.gravity
    return Maps(outward, back, first_moment, chain.rotor_inertia[:, None].copy(), start)


class Workspace:
    """Buffers of one chunk, made once and used for every chunk of a log."""

    def __init__(self, joints: int, samples: int) -> None:
        self.state = np.empty((joints, 18, samples))
        self.turned = np.empty((9, samples))
        self.momentum = np.empty((9, samples))
        self.product = np.empty((3, samples))


def momentum_chunk(
    maps: Maps, space: Workspace, q: Array, dq: Array, p: Array, coriolis: Array, gravity: Array
) -> None:
    """Fill `p`, `coriolis` and `gravity`, all (n, N), for one chunk of `q` and `dq`. (n, N)"""
    n, count = q.shape
    cosine, sine = np.cos(q), np.sin(q)
    product, turned = space.product[:, :count], space.turned[:, :count]
    parent = np.broadcast_to(maps.start, (9, count))
    for j in range(n):
        state = space.state[j, :9, :count]
        if j == 0:
            turned[:] = maps.outward[0] @ maps.start
        else:
            np.matmul(maps.outward[j], parent, out=turned)
        turn(turned, cosine[j], -sine[j], state, product)
        state[6] += dq[j]
        parent = state
    momentum = space.momentum[:, :count]
    for j in range(n - 1, -1, -1):
        state = space.state[j, :, :count]
        if j == n - 1:
            np.matmul(maps.back[j, :, :9], state[:9], out=momentum)
        else:
            turn(momentum, cosine[j + 1], sine[j + 1], state[9:], product)
            np.matmul(maps.back[j], state, out=momentum)
        momentum += maps.first_moment[j]
        np.multiply(dq[j], maps.rotor_inertia[j], out=p[j])
        p[j] += momentum[7]
        cross_z(state, momentum, coriolis[j], product)
        np.multiply(momentum[5], state[2], out=gravity[j])
        np.multiply(momentum[2], state[5], out=product[0])
        gravity[j] -= product[0]


def turn(vectors: Array, cosine: Array, sine: Array, out: Array, product: Array) -> None:
    """Rotate three vectors at a time about z: x' = c·x − s·y, y' = s·x + c·y, z' = z. (9, N)"""
    x, y = vectors[:3], vectors[3:6]
    np.multiply(x, cosine, out=out[:3])
    np.multiply(y, sine, out=product)
    out[:3] -= product
    np.multiply(x, sine, out=out[3:6])
    np.multiply(y, cosine, out=product)
    out[3:6] += product
    out[6:] = vectors[6:]


def cross_z(state: Array, momentum: Array, out: Array, product: Array) -> None:
    """(Cᵀq̇)_j = v_y l_x − v_x l_y + ω_y k_x − ω_x k_y. (N,)"""
    np.multiply(state[4], momentum[0], out=out)
    np.multiply(state[3], momentum[1], out=product[0])
    out += product[0]
    np.multiply(state[1], momentum[3], out=product[0])
    out -= product[0]
    np.multiply(state[0], momentum[4], out=product[0])
    out -= product[0]


def momentum_terms(chain: Chain, q: Array, dq: Array) -> MomentumTerms:
    """Evaluate p = M q̇, Cᵀq̇ and g for every sample.

    Args:
        chain: The arm, its payload merged in.
        q: Joint positions. (T, n) [rad]
        dq: Joint velocities. (T, n) [rad/s]
    """
    samples, n = q.shape
    maps = maps_of(chain)
    out = [np.empty((samples, n)) for _ in range(3)]
    space = Workspace(n, min(CHUNK, samples))
    rows = np.empty((3, n, min(CHUNK, samples)))
    for start in range(0, samples, CHUNK):
        stop = min(start + CHUNK, samples)
        p, coriolis, gravity = rows[:, :, : stop - start]
        columns = np.ascontiguousarray(q[start:stop].T), np.ascontiguousarray(dq[start:stop].T)
        momentum_chunk(maps, space, *columns, p, coriolis, gravity)
        for array, values in zip(out, (p, coriolis, gravity), strict=True):
            array[start:stop] = values.T
    return MomentumTerms(*out)
