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

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import Chain
from vftcli.signals.arrays import Array, empty_series
from vftcli.signals.pose import skew

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
        first_moment: What the composite masses add to the rows of h. (n, 3, 1)
        rotor_inertia: Reflected rotor inertia. (n, 1) [kg·m²]
        rotor_coupling: Inertia of rotors driven through other joints, or None. (n, n) [kg·m²]
        start: Motion state of the base: gravity alone. (9, 1)
    """

    outward: Array
    back: Array
    first_moment: Array
    rotor_inertia: Array
    rotor_coupling: Array | None
    start: Array


def interleave(rows: list[list[Array]]) -> Array:
    """Arrange a 3×3 grid of 3×3 blocks so that x, y and z rows and columns lie together. (9, 9)"""
    dense = np.block(rows)
    order = np.arange(9).reshape(3, 3).T.ravel()
    return np.ascontiguousarray(dense[np.ix_(order, order)])


def maps_of(chain: Chain) -> Maps:
    """Prepare a chain's constants for `momentum_terms`."""
    n, zero = chain.joints, np.zeros((3, 3))
    outward, back, first_moment = np.empty((n, 9, 9)), np.zeros((n, 9, 18)), np.zeros((n, 3, 1))
    behind = np.append(np.cumsum(chain.mass[::-1])[::-1], 0.0)
    for j in range(n):
        R, r = chain.rotation[j], skew(chain.translation[j])
        outward[j] = interleave([[R.T, zero, zero], [-R.T @ r, R.T, zero], [zero, zero, R.T]])
        m, c = chain.mass[j], skew(chain.com[j])
        about_origin = chain.inertia[j] - m * c @ c
        back[j, :, :9] = interleave(
            [[-m * c, m * np.eye(3), zero], [about_origin, m * c, zero], [zero, zero, zero]]
        )
        moment = m * chain.com[j]
        if j + 1 < n:
            R, r = chain.rotation[j + 1], skew(chain.translation[j + 1])
            back[j, :, 9:] = interleave([[R, zero, zero], [r @ R, R, zero], [zero, zero, R]])
            moment = moment + behind[j + 1] * chain.translation[j + 1]
        first_moment[j, :, 0] = moment
    start = np.zeros((9, 1))
    start[2::3, 0] = chain.gravity
    rotor = chain.rotor_inertia[:, None].copy()
    return Maps(outward, back, first_moment, rotor, chain.rotor_coupling, start)


class Workspace:
    """Buffers of one chunk, made once and used for every chunk of a log.

    Attributes:
        state: Motion state of each frame above the momentum state behind it. (n+1, 18, N)
        room: For products of three rows. (2, 3, N)
    """

    def __init__(self, joints: int, samples: int) -> None:
        self.state = np.empty((joints + 1, 18, samples))
        self.room = np.empty((2, 3, samples))


def momentum_chunk(
    maps: Maps, space: Workspace, q: Array, dq: Array, p: Array, coriolis: Array, gravity: Array
) -> None:
    """Fill `p`, `coriolis` and `gravity`, all (n, N), for one chunk of `q` and `dq`. (n, N)"""
    n, count = q.shape
    cosine, sine = cosine_and_sine(q)
    room, base = space.room[:, :, :count], space.state[0, :9, :count]
    base[:] = maps.start
    for j in range(n):
        parent, state = space.state[j, :9, :count], space.state[j + 1, :9, :count]
        np.matmul(maps.outward[j], parent, out=state)
        turn(state, cosine[j], -sine[j], room)
        state[6] += dq[j]
    for j in range(n - 1, -1, -1):
        below = space.state[j + 1, :, :count]
        momentum = space.state[j, 9:, :count]
        if j == n - 1:
            np.matmul(maps.back[j, :, :9], below[:9], out=momentum)
        else:
            np.matmul(maps.back[j], below, out=momentum)
        momentum[2::3] += maps.first_moment[j]
        project(below, momentum, p[j], coriolis[j], gravity[j], room[0, 0])
        p[j] += maps.rotor_inertia[j] * dq[j]
        turn(momentum, cosine[j], sine[j], room)
    if maps.rotor_coupling is not None:
        p += maps.rotor_coupling @ dq


def turn(vectors: Array, cosine: Array, sine: Array, room: Array) -> None:
    """Rotate three vectors about z in place: x ← c·x − s·y, y ← s·x + c·y. (9, N)"""
    x, y = vectors[:3], vectors[3:6]
    np.multiply(x, sine, out=room[0])
    np.multiply(y, sine, out=room[1])
    x *= cosine
    y *= cosine
    x -= room[1]
    y += room[0]


def project(
    state: Array, momentum: Array, p: Array, coriolis: Array, gravity: Array, room: Array
) -> None:
    """Take the joint's own components out of the composite momentum. (N,) each

    p = k_z, Cᵀq̇ = v_y l_x − v_x l_y + ω_y k_x − ω_x k_y, g = h_y γ_x − h_x γ_y.
    """
    p[:] = momentum[7]
    np.multiply(state[4], momentum[0], out=coriolis)
    np.multiply(state[3], momentum[1], out=room)
    coriolis += room
    np.multiply(state[1], momentum[3], out=room)
    coriolis -= room
    np.multiply(state[0], momentum[4], out=room)
    coriolis -= room
    np.multiply(momentum[5], state[2], out=gravity)
    np.multiply(momentum[2], state[5], out=room)
    gravity -= room


def cosine_and_sine(q: Array) -> tuple[Array, Array]:
    """Cosine and sine through the tangent of half the angle. Like `q` [rad]

    With t = tan(q/2), cos q = (1 − t²)/(1 + t²) and sin q = 2t/(1 + t²), good to some 1e-16: one
    transcendental function instead of two, and the one that NumPy vectorises best.
    """
    t = np.tan(0.5 * q)
    square = t * t
    share = 1.0 / (1.0 + square)
    t *= 2.0
    t *= share
    np.subtract(1.0, square, out=square)
    square *= share
    return square, t


def momentum_chunks(
    chain: Chain, q: Array, dq: Array
) -> Iterator[tuple[slice, Array, MomentumTerms]]:
    """Evaluate one chunk of samples after another.

    Args:
        chain: The arm, its payload merged in.
        q: Joint positions. (T, n) [rad]
        dq: Joint velocities. (T, n) [rad/s]

    Yields:
        Which samples, their velocity (N, n) and their terms (N, n), all with their columns whole;
        the terms are written over by the next chunk's.
    """
    samples, n = q.shape
    maps, size = maps_of(chain), min(CHUNK, samples)
    space, rows = Workspace(n, size), np.empty((3, n, size))
    for start in range(0, samples, CHUNK):
        span = slice(start, min(start + CHUNK, samples))
        p, coriolis, gravity = rows[:, :, : span.stop - span.start]
        columns = np.ascontiguousarray(q[span].T), np.ascontiguousarray(dq[span].T)
        momentum_chunk(maps, space, *columns, p, coriolis, gravity)
        yield span, columns[1].T, MomentumTerms(p.T, coriolis.T, gravity.T)


def momentum_terms(chain: Chain, q: Array, dq: Array) -> MomentumTerms:
    """Evaluate p = M q̇, Cᵀq̇ and g for every sample of `q` [rad] and `dq` [rad/s]. (T, n)"""
    terms = MomentumTerms(*(empty_series(*q.shape) for _ in range(3)))
    for span, _, chunk in momentum_chunks(chain, q, dq):
        for whole, part in zip(terms, chunk, strict=True):
            whole[span] = part
    return terms
