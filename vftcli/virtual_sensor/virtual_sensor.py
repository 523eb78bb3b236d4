"""The virtual force/torque sensor: observers' joint torques become wrenches in a named frame."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import Chain, flange_jacobian, link_poses
from vftcli.signals.arrays import Array, handed_over
from vftcli.signals.errors import ShapeError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.parsing import check_known
from vftcli.signals.shown import Shown
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.frames import Mounting, check_frame, frame_pose, from_base
from vftcli.virtual_sensor.solvers import (
    LEAST_SIGMA,
    LEAST_SQUARES,
    SOLVERS,
    TORQUE_SD,
    decompose,
    null_space,
)

CHUNK = 4096  #: Samples that are solved at once: about 10 MB of 6×6 matrices.


@dataclass(frozen=True, kw_only=True, repr=False)
class VirtualSensor(Shown):
    """How joint torques become a wrench."""

    solver: str = LEAST_SQUARES  #: A key of `vftcli.virtual_sensor.solvers.SOLVERS`.
    frame: str = "flange"  #: A key of `vftcli.virtual_sensor.frames.FRAMES`.
    #: Where tool and sensor sit on the flange.
    mounting: Mounting = field(default_factory=Mounting)
    #: σ_min of J with angular rows × 0.3 m below which a sample is masked. [m]
    least_sigma: float = LEAST_SIGMA

    def __post_init__(self) -> None:
        check_known(self.solver, SOLVERS, f"no solver {self.solver!r} for a wrench")
        frame_pose(check_frame(self.frame), self.mounting)

    def wrench(
        self, torque: ExternalTorque, q: Array, chain: Chain, sd: Array | None = None
    ) -> Wrench:
        """The wrench of one estimate, with a band where `sd` is given; see `wrenches`."""
        return self.wrenches((torque,), q, chain, {} if sd is None else {torque.name: sd})[0]

    def wrenches(
        self,
        torques: Sequence[ExternalTorque],
        q: Array,
        chain: Chain,
        sd: dict[str, Array] | None = None,
    ) -> tuple[Wrench, ...]:
        """The wrench of every estimate, about the flange, tool or sensor.

        Args:
            torques: Estimates on the log's clock.
            q: Joint positions. (T, n) [rad]
            chain: The arm.
            sd: Name of an estimate → standard deviation of its torques, (n,) or (T, n) [N·m]; one
                without has a wrench without band.
        """
        samples, n = q.shape
        for torque in torques:
            if torque.tau.shape != q.shape:
                raise ShapeError(f"{torque.name}: torque {torque.tau.shape} against q {q.shape}")
        known = sd or {}
        # A view: one row stands for every sample. Zero is raised, so that weights stay finite.
        errors = [
            np.broadcast_to(np.maximum(known.get(torque.name, TORQUE_SD), 1e-6), q.shape)
            for torque in torques
        ]
        values = np.empty((len(torques), samples, 6))
        spread = np.empty((len(torques), samples, 6))
        residual = np.empty((len(torques), samples))
        sigma = np.empty(samples)
        # Chunk by chunk, so that memory does not grow with the log.
        for start in range(0, samples, CHUNK):
            span = slice(start, min(start + CHUNK, samples))
            parts = decompose(flange_jacobian(chain, q[span]))
            flange = link_poses(chain, q[span]).rotation[:, -1]
            X = from_base(self.frame, flange, self.mounting)
            sigma[span] = parts.sigma_min
            for k, torque in enumerate(torques):
                tau = torque.tau[span]
                gain, root = SOLVERS[self.solver](parts, errors[k][span])
                values[k, span] = np.squeeze(X @ (gain @ tau[:, :, None]), axis=2)
                spread[k, span] = np.sqrt(np.sum((X @ root) ** 2, axis=2))
                if n > 6:
                    residual[k, span] = np.linalg.norm(null_space(parts, tau), axis=1)
        masked = sigma < self.least_sigma
        return tuple(
            Wrench(
                name=torque.name,
                t=torque.t,
                values=handed_over(values[k].copy()),
                frame=self.frame,
                sd=handed_over(spread[k].copy()) if torque.name in known else None,
                sigma_min=sigma,
                masked=masked,
                null_space=handed_over(residual[k].copy()) if n > 6 else None,
            )
            for k, torque in enumerate(torques)
        )

    def arrow(self, force: Array, q: Array, chain: Chain) -> "ForceArrow":
        """Where a force of this sensor acts, and where it points, both seen from the base.

        Args:
            force: Forces in the sensor's frame, as of its wrenches. (S, 3) [N]
            q: Joint positions then. (S, n) [rad]
            chain: The arm.
        """
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
