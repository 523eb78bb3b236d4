r"""The momentum form of an arm's dynamics over all samples: p, Cᵀq̇ and g.

With the Christoffel C,
:math:`C^T\dot q = \tfrac12\,\partial(\dot q^T M \dot q)/\partial q`: the rate at which
the kinetic energy would change if only q moved. Turning link j and everything behind it
by dq_j turns their momenta, so each component is a cross product of the link's own
velocity with the composite momentum behind it, and no derivative of M is needed. One pass
out, one pass back:

- out: v_j = R_jᵀ(v_{j−1} + ω_{j−1} × r_j), ω_j = R_jᵀω_{j−1}, γ_j = R_jᵀγ_{j−1}, each turned by
  −q_j, then ω_j += z q̇_j;
- link: L = ω × h + m v, K = J ω + h × v with J about the frame's origin and h = m c;
- back, turned by q_j and added to the parent's: L ← R_j L, K ← R_j K + r_j × (R_j L),
  H ← R_j H + m r_j, so that L, K and H are those of link j and all behind it;
- p_j = K_z + J_j q̇_j, (Cᵀq̇)_j = (K × ω + L × v)_z, −g_j = (H × γ)_z.

γ₀ is the gravity vector itself, J_j the reflected rotor inertia. These are p of (8), Cᵀq̇
of (14) and G of (16), exactly rather than by differences; the tests hold them against
Pinocchio's mass matrix, Coriolis matrix and gravity.

An arm's equations are recorded once (`tape`), constants included, and replayed on chunks.

The torque regressor is rigid-body torque as a matrix times the inertial parameters,
τ = Y(q, q̇, q̈) φ with ten numbers a link, in the chain's own frames and Pinocchio's
order: m, m·c (3), then xx, xy, yy, xz, yz, zz of the tensor about the frame's origin.
Reflected rotor inertia is not part of it (Pinocchio's regressor leaves it out too): it is
a column q̈_j of its own.
"""

import threading
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import (
    Body,
    Chain,
    flange_jacobian,
    link_poses,
    point_tensor,
    stacked,
    symmetric,
)
from vftcli.robots.tape import NOTHING, ZERO, Program, Tape, Value, constants
from vftcli.signals.arrays import Array, empty_series
from vftcli.signals.pose import cross, skew

#: Samples at a time: more than some 6000 gain nothing. Blocks of a long log hold whole chunks.
CHUNK = 8192
KEPT = 4  #: Programs that are kept, some 5 MB each.
#: A rotation's entry, or an inertia's share, that counts as zero.
ROUNDING = 1e-15


class MomentumTerms(NamedTuple):
    """The pieces of the equations of motion without acceleration."""

    p: Array  #: Generalised momentum M q̇. (T, n) [kg·m²/s]
    coriolis_transpose_dq: Array  #: Cᵀq̇. (T, n) [N·m]
    gravity: Array  #: Gravity torque g(q). (T, n) [N·m]


def felt_bodies(chain: Chain) -> tuple[Array, Array]:
    """Bodies equal to the links in motion, with fewest numbers (base parameters).

    Returned are their inertias J about the origins of the links' frames (n, 3, 3) [kg·m²]
    and first moments h = m c (n, 3) [kg·m]. Their masses are zero.

    Joint j cannot feel a body of link j that is symmetric about its axis and has no
    moment of inertia there: turning it changes neither energy nor momentum. Each link
    therefore hands the body with J = diag(a, a, 0), a = J_yy, h = (0, 0, h_z) and all its
    mass to the link before, which moves alike but for the turn, and keeps
    J_yy = 0, h_z = 0, m = 0. What reaches the base never moves. p, Cᵀq̇ and g stay
    exactly what they were; the links' own energies do not.

    M. Gautier, W. Khalil, "Direct calculation of minimum set of inertial parameters of
    serial robots", IEEE Trans. Robotics and Automation 6(3), 1990.
    """
    cross = skew(chain.com)
    J = chain.inertia - chain.mass[:, None, None] * cross @ cross
    h, m = chain.mass[:, None] * chain.com, np.array(chain.mass)
    for j in range(chain.joints - 1, -1, -1):
        R, r = chain.rotation[j], skew(chain.translation[j])
        symmetric = J[j, 1, 1] * np.diag([1.0, 1.0, 0.0])
        along = skew(R[:, 2] * h[j, 2])
        if j > 0:
            J[j - 1] += R @ symmetric @ R.T - r @ along - along @ r - m[j] * r @ r
            h[j - 1] += R[:, 2] * h[j, 2] + m[j] * chain.translation[j]
            m[j - 1] += m[j]
        J[j] -= symmetric
        h[j, 2] = 0.0
    size = abs(J).max(axis=(1, 2), keepdims=True, initial=0.0)
    return np.where(abs(J) <= ROUNDING * size, 0.0, J), h


def record(chain: Chain) -> tuple[Tape, dict[str, list[Value]]]:
    """Record the equations above. Rows given: q̇ (n), cos q (n), sin q (n).

    Results, one a joint: ``p``, ``coriolis`` Cᵀq̇, ``gravity`` g and ``bias`` Cᵀq̇ − g.
    """
    n, (inertia, moment) = chain.joints, felt_bodies(chain)
    on = Tape(inputs=3 * n)
    dq, cosine, sine = ([Value(1.0, part * n + j) for j in range(n)] for part in range(3))
    # cos(π/2) is 6e-17 in floating point, and 1 − 1e-16 is one.
    whole = np.rint(chain.rotation)
    R = np.where(abs(chain.rotation - whole) <= ROUNDING, whole, chain.rotation)
    r = [constants(translation) for translation in chain.translation]

    omega, v, gamma = NOTHING, NOTHING, constants(chain.gravity)
    motion = []
    for j in range(n):
        v = on.add(v, on.cross(omega, r[j]))
        omega, v, gamma = (
            on.turn(on.map(R[j].T, x), cosine[j], -sine[j]) for x in (omega, v, gamma)
        )
        omega = on.add(omega, (ZERO, ZERO, dq[j]))
        motion.append((omega, v, gamma))

    results = []
    K, L, H = NOTHING, NOTHING, NOTHING  # of the links behind, in the axes of this one
    for j in range(n - 1, -1, -1):
        omega, v, gamma = motion[j]
        h = constants(moment[j])
        K = on.add(on.map(inertia[j], omega), on.cross(h, v), K)
        L = on.add(on.cross(omega, h), L)
        H = on.add(h, H)
        coriolis = on.plus(on.cross(K, omega)[2], on.cross(L, v)[2])
        weight = on.cross(H, gamma)[2]
        results.append(
            {
                "p": on.plus(K[2], on.times(Value(float(chain.rotor_inertia[j])), dq[j])),
                "coriolis": coriolis,
                "gravity": -weight,
                "bias": on.plus(coriolis, weight),
            }
        )
        K, L, H = (on.map(R[j], on.turn(x, cosine[j], sine[j])) for x in (K, L, H))
        K = on.add(K, on.cross(r[j], L))
    return on, {name: [found[name] for found in reversed(results)] for name in results[0]}


#: The programs that a thread used last; each works in memory of its own.
PROGRAMS = threading.local()


def program_of(chain: Chain, wanted: tuple[str, ...]) -> Program:
    """The program of an arm, recorded unless among the last `KEPT`."""
    made: dict[tuple[bytes, tuple[str, ...]], Program] = vars(PROGRAMS).setdefault("made", {})
    numbers = vars(chain).values()
    key = b"".join(x.tobytes() for x in numbers if isinstance(x, np.ndarray)), wanted
    if (program := made.pop(key, None)) is None:
        tape, results = record(chain)
        program = Program(tape, [value for name in wanted for value in results[name]])
    made[key] = program
    if len(made) > KEPT:
        del made[next(iter(made))]
    return program


def momentum_chunks(
    chain: Chain, q: Array, dq: Array, wanted: tuple[str, ...]
) -> Iterator[tuple[slice, Array, list[Array]]]:
    """Samples, their velocity and each `wanted` result of `record`, chunk by chunk.

    Of q (T, n) [rad], dq (T, n) [rad/s] and a chain with its payload; (N, n) with whole
    columns, which the next chunk is written over.
    """
    samples, n = q.shape
    if not samples:
        return
    program, size = program_of(chain, wanted), -(-samples // -(-samples // CHUNK))
    for start in range(0, samples, size):
        # All chunks have one size: the last one reaches back.
        begin = min(start, samples - size)
        inputs, outputs = program.bind(size)
        given, cosine, sine = inputs.reshape(3, n, size)
        velocity = np.ascontiguousarray(dq[begin : begin + size].T)
        given[:] = velocity
        cosine_and_sine(q[begin : begin + size].T, cosine, sine)
        program.run()
        results = outputs.reshape(-1, n, size)
        fresh = [rows[:, start - begin :].T for rows in (velocity, *results)]
        yield slice(start, begin + size), fresh[0], fresh[1:]


def cosine_and_sine(q: Array, cosine: Array, sine: Array) -> None:
    """Fill in cosine and sine through the tangent of half the angle. Like `q` [rad]

    t = tan(q/2), cos q = 2/(1 + t²) − 1, sin q = 2t/(1 + t²): NumPy's fastest, to some 1e-16.
    """
    np.multiply(q, 0.5, out=sine)
    np.tan(sine, out=sine)
    np.multiply(sine, sine, out=cosine)
    cosine += 1.0
    np.divide(2.0, cosine, out=cosine)
    sine *= cosine
    cosine -= 1.0


def momentum_terms(chain: Chain, q: Array, dq: Array) -> MomentumTerms:
    """Terms p = M q̇, Cᵀq̇ and g of each sample of `q` [rad], `dq` [rad/s]. (T, n)"""
    terms = MomentumTerms(*(empty_series(*q.shape) for _ in range(3)))
    for span, _, chunk in momentum_chunks(chain, q, dq, ("p", "coriolis", "gravity")):
        for whole, part in zip(terms, chunk, strict=True):
            whole[span] = part
    return terms


LINK = 10  #: Inertial parameters a link.
#: Their names, in order.
INERTIAL_NAMES = ("m", "mx", "my", "mz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
#: Row and column of the six tensor entries, in order.
TENSOR = ((0, 0), (0, 1), (1, 1), (0, 2), (1, 2), (2, 2))


def link_columns(
    axis: Array, lever: Array, omega: Array, alpha: Array, acceleration: Array, out: Array
) -> None:
    """Fill the ten columns of one link for the joints up to its own. (j+1, 10, N)

    The link's force is f = m a + (α̂ + ω̂²) h with a less gravity, its moment about the
    frame's origin n = I α + ω × I ω + h × a; a joint feels axis·n + lever·f, all in the
    link's axes. A lever is axis × (origin of the link − origin of the joint). (3, j+1, N)
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

    Of the chain it uses geometry and gravity. It takes 80 n² bytes a sample: pass chunks.
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

    A mass m at c in flange axes pulls with m g₀ and turns by R m c × g₀ about the flange.
    """
    wrench = np.zeros((len(q), 6, 4))
    wrench[:, :3, 0] = chain.gravity
    # v × g₀ = −[g₀]× v
    wrench[:, 3:, 1:] = -skew(chain.gravity) @ link_poses(chain, q).rotation[:, -1]
    return wrench


LIGHT = 0.1  #: Links below are as wrong as one of this mass. [kg]


def usual_errors(chain: Chain, q: Array) -> Array:
    """Holding torque by usual errors, 5 % of a link's mass, 12 mm of its centre. (N, n, 4n)

    Public URDFs and profiles of one arm differ by 2–12 % in gravity's torque.
    """
    columns = torque_regressor(chain, q, 0.0 * q, 0.0 * q).reshape(*q.shape, -1, LINK)
    found = columns[..., :4]
    found *= np.maximum(chain.mass, LIGHT)[:, None] * np.repeat([0.05, 0.0125], [1, 3])
    return found.reshape(*q.shape, -1)


def load_regressor(chain: Chain, q: Array) -> Array:
    """External joint torque of `load_wrench`, by the same four numbers. (N, n, 4)"""
    return flange_jacobian(chain, q).transpose(0, 2, 1) @ load_wrench(chain, q)


def chain_parameters(chain: Chain) -> Array:
    """The inertial parameters φ of a chain. (10n,)"""
    phi = list[float]()
    for m, c, tensor in chain.bodies:
        about_origin = tensor + m * point_tensor(c)
        phi += [m, *(m * c), *(about_origin[r, s] for r, s in TENSOR)]
    return np.array(phi)


def with_parameters(chain: Chain, phi: Array, rotor_inertia: Array) -> Chain:
    """The chain with other parameters φ (10n,) and rotor inertias. (n,)"""
    bodies = []
    for mass, *moment, xx, xy, yy, xz, yz, zz in phi.reshape(chain.joints, LINK).tolist():
        com = np.array(moment) / mass if mass > 0 else np.zeros(3)
        tensor = symmetric([xx, xy, xz, yy, yz, zz]) - mass * point_tensor(com)
        bodies.append(Body(mass, com, tensor))
    return replace(chain, **stacked(bodies), rotor_inertia=rotor_inertia)
