"""The virtual force/torque sensor: τ = J_Fᵀ w inverted (46), in a named frame.

All is solved at the flange point in base axes with lengths in units of 0.3 m, so that a
newton and a newton-metre weigh alike: J_s = S J, S = diag(1, 1, 1, 0.3, 0.3, 0.3),
w_s = S⁻¹w.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import Chain, link_jacobian, link_poses
from vftcli.signals.arrays import Array, Mask, handed_over
from vftcli.signals.errors import RobotError, ShapeError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.parsing import check_known
from vftcli.signals.shown import Shown, record
from vftcli.signals.wrench import Wrench
from vftcli.wrench.frames import Mounting, check_frame, frame_pose, from_base

LENGTH = 0.3  #: Length by which moments are made comparable with forces. [m]
SCALE = np.array([1.0, 1.0, 1.0, LENGTH, LENGTH, LENGTH])  #: Diagonal of S.
#: σ_min of S J at which 1 N·m of torque error is 20 N. [m]
LEAST_SIGMA = 0.05
#: Prior deviations of w_s: 50 N and 10 N·m. (6,) [N]
PRIOR = np.repeat([50.0, 10.0 / LENGTH], 3)
#: Torque error against which the MAP solver weighs its prior. [N·m]
TORQUE_SD = 0.3


class Decomposition(NamedTuple):
    """J_s J_sᵀ = U diag(λ) Uᵀ of every sample."""

    scaled: Array  #: J_s. (T, 6, n) [m]
    U: Array  #: Eigenvectors, as columns. (T, 6, 6)
    squares: Array  #: λ, ascending: squares of the singular values of J_s. (T, 6) [m²]

    @property
    def sigma_min(self) -> Array:
        """Smallest singular value of J_s. (T,) [m]"""
        return np.sqrt(np.maximum(self.squares[:, 0], 0.0))


def decompose(jacobian: Array) -> Decomposition:
    """Decompose the flange Jacobian in base axes. (T, 6, n)"""
    n = jacobian.shape[2]
    if n < 6:
        raise RobotError(
            f"{n} joint torques cannot determine the six components of a wrench; "
            "leave --wrench and its options out: use the joint torques"
        )
    scaled = SCALE[:, None] * jacobian
    # 6×6 is cheaper than 6×n, and only the squares are needed.
    squares, U = np.linalg.eigh(scaled @ scaled.swapaxes(1, 2))
    return Decomposition(scaled, U, squares)


def least_squares_gain(parts: Decomposition, left_out: float = 0.0) -> Array:
    """S U diag(1/λ) Uᵀ J_s; singular values ≤ `left_out` [m] left out. (T, 6, n)"""
    # λ is a difference of larger numbers: rounding may make it negative.
    rounding = np.finfo(np.float64).eps * parts.squares[:, -1:]
    inverse = 1.0 / np.maximum(parts.squares, rounding)
    if left_out:
        inverse = np.where(parts.squares > left_out**2, inverse, 0.0)
    U = parts.U
    return SCALE[:, None] * ((U * inverse[:, None, :]) @ (U.swapaxes(1, 2) @ parts.scaled))


#: SDs of joint torques (T, n) [N·m] → A (T, 6, n) of the estimate w = Aτ for
#: them, and B (T, 6, k) of its covariance BBᵀ.
Solver = Callable[[Array], tuple[Array, Array]]


def pinv(parts: Decomposition, X: Array) -> Solver:
    """Least squares (46), the pseudo-inverse of Jᵀ: unbiased, unbounded as σ_min → 0."""
    gain = X @ least_squares_gain(parts)
    return lambda sd: (gain, gain * sd[:, None, :])


def maximum_a_posteriori(parts: Decomposition, X: Array) -> Solver:
    """The most probable wrench under a normal prior of 50 N and 10 N·m about zero.

    w = C J Σ⁻¹τ with C = (J Σ⁻¹ Jᵀ + P⁻¹)⁻¹, its covariance: near least squares in a good
    pose, near the prior where the pose hides the wrench.
    """

    def solve(sd: Array) -> tuple[Array, Array]:
        weighted = parts.scaled / sd[:, None, :]
        information = weighted @ weighted.swapaxes(1, 2) + np.diag(PRIOR**-2)
        root = np.linalg.inv(np.linalg.cholesky(information))  # C = rootᵀ root
        C = root.swapaxes(1, 2) @ root
        scaled = X * SCALE
        return scaled @ (C @ (weighted / sd[:, None, :])), scaled @ root.swapaxes(1, 2)

    return solve


#: Name at the command line → solver, given the poses' Jacobian and X (T, 6, 6), which
#: maps a wrench in base axes to the frame asked for.
SOLVERS: dict[str, Callable[[Decomposition, Array], Solver]] = {
    "pinv": pinv,
    "map": maximum_a_posteriori,
}
LEAST_SQUARES = "pinv"  #: The solver where none is asked for.


def null_space(parts: Decomposition, tau: Array) -> Array:
    """(I − Jᵀpinv(Jᵀ))τ of τ (T, n, K), not explained by a flange wrench. [N·m]

    A wrench at the flange leaves it unchanged; a contact further down the arm, or a model
    error, does not. Singular directions count as unexplained.
    """
    # U is orthonormal: V = J_sᵀU/σ spans the row space; λ below 1e-12 is rounding.
    tall = parts.scaled.swapaxes(1, 2) @ parts.U
    share = np.where(parts.squares > 1e-12, 1.0 / np.maximum(parts.squares, 1e-12), 0.0)
    return tau - tall @ (share[:, :, None] * (tall.swapaxes(1, 2) @ tau))


def wrench_of(tau: Array, jacobian: Array, left_out: float = 0.0) -> tuple[Array, Mask]:
    """Least squares (46) from torques and given Jacobians, and whether the pose shows it.

    Force, then moment, about the flange point in the Jacobian's axes. (T, 6) [N, N·m], (T,)
    """
    parts = decompose(jacobian)
    values = np.squeeze(least_squares_gain(parts, left_out) @ tau[:, :, None], axis=2)
    return values, parts.sigma_min >= LEAST_SIGMA


CHUNK = 4096  #: Samples that are solved at once: about 10 MB of 6×6 matrices.


@record
class VirtualSensor(Shown):
    """A solver of wrenches from joint torques, in a frame."""

    solver: str = LEAST_SQUARES  #: A key of `vftcli.wrench.solvers.SOLVERS`.
    frame: str = "flange"  #: A key of `vftcli.wrench.frames.FRAMES`.
    #: Poses of tool and sensor on the flange.
    mounting: Mounting = field(default_factory=Mounting)
    #: σ_min of J with angular rows × 0.3 m below which a sample is masked. [m]
    least_sigma: float = LEAST_SIGMA

    def __post_init__(self) -> None:
        check_known(self.solver, SOLVERS, f"no solver {self.solver!r} for a wrench")
        frame_pose(check_frame(self.frame), self.mounting)

    def wrench(self, torque: ExternalTorque, q: Array, chain: Chain) -> Wrench:
        """The wrench of one estimate, without a band; see `wrenches`."""
        return self.wrenches((torque,), q, chain)[0]

    def wrenches(
        self,
        torques: Sequence[ExternalTorque],
        q: Array,
        chain: Chain,
        sd: Mapping[str, Array] = MappingProxyType({}),
    ) -> tuple[Wrench, ...]:
        """The wrench of each estimate at q (T, n) [rad], about flange, tool or sensor.

        An estimate without a standard deviation of its torques, (n,) or (T, n) [N·m] by its
        name, has no band.
        """
        samples, n = q.shape
        for torque in torques:
            if torque.tau.shape != q.shape:
                raise ShapeError(f"{torque.name}: torque {torque.tau.shape} against q {q.shape}")
        # A view: one row serves all samples.
        errors = [
            np.broadcast_to(np.maximum(sd.get(torque.name, TORQUE_SD), 1e-6), q.shape)
            for torque in torques
        ]
        values, spread = ([np.empty((samples, 6)) for _ in torques] for _ in range(2))
        residual, sigma = np.empty((len(torques), samples)), np.empty(samples)
        # Chunk by chunk, so that memory does not grow with the log.
        for start in range(0, samples, CHUNK):
            span = slice(start, min(start + CHUNK, samples))
            poses = link_poses(chain, q[span])
            parts = decompose(link_jacobian(poses, chain.joints))
            X = from_base(self.frame, poses.rotation[:, -1], self.mounting)
            solve = SOLVERS[self.solver](parts, X)
            sigma[span] = parts.sigma_min
            for k, torque in enumerate(torques):
                gain, root = solve(errors[k][span])
                values[k][span] = np.squeeze(gain @ torque.tau[span, :, None], axis=2)
                if torque.name in sd:
                    spread[k][span] = np.sqrt(np.sum(root**2, axis=2))
            if n > 6:
                every = np.stack([torque.tau[span] for torque in torques], axis=2)
                residual[:, span] = np.linalg.norm(null_space(parts, every), axis=1).T
        masked = sigma < self.least_sigma
        return tuple(
            Wrench(
                name=torque.name,
                t=torque.t,
                values=handed_over(values[k]),
                frame=self.frame,
                sd=handed_over(spread[k]) if torque.name in sd else None,
                sigma_min=sigma,
                masked=masked,
                null_space=handed_over(residual[k]) if n > 6 else None,
            )
            for k, torque in enumerate(torques)
        )

    def arrow(self, force: Array, q: Array, chain: Chain) -> "ForceArrow":
        """Origin and direction of this sensor's forces (S, 3) [N] at q (S, n) [rad]."""
        poses = link_poses(chain, q)
        flange, pose = poses.rotation[:, -1], frame_pose(self.frame, self.mounting)
        origin = poses.translation[:, -1] + flange @ pose.translation
        if self.frame == "base":
            return ForceArrow(origin, force)
        return ForceArrow(origin, np.einsum("tij,tj->ti", flange @ pose.rotation, force))


class ForceArrow(NamedTuple):
    """A force as an arrow in the base frame."""

    origin: Array  #: The point that the wrench's moment refers to. (S, 3) [m]
    force: Array  #: Force on the robot in base axes, NaN where it is not known. (S, 3) [N]
