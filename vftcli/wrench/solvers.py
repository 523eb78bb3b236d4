"""The virtual force/torque sensor: τ = J_Fᵀ w inverted (46), in a named frame.

All is solved at the flange point in base axes with lengths in units of 0.3 m, so that a
newton and a newton-metre weigh alike: J_s = S J, S = diag(1, 1, 1, 0.3, 0.3, 0.3),
w_s = S⁻¹w.

The adjoint of a pose moves a wrench between frames. With R the orientation of S in F and
p its origin, a wrench given in S reads in F

    [F_F; N_F] = [[R, 0], [[p]×R, R]] [F_S; N_S]

which is (56), corrected (the paper prints R inverted in the lower left block), and
Pinocchio's ``SE3(R, p).act(Force)``.

A log may state its wrench's axes, the point of its moment and its sign (`WrenchFrame`);
a remark names what is assumed instead.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import field, replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import Chain, flange_jacobian, link_jacobian, link_poses
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array, Mask, handed_over
from vftcli.signals.errors import MissingSignalError, ParameterError, RobotError, ShapeError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.option import numbers
from vftcli.signals.parsing import check_known
from vftcli.signals.pose import IDENTITY, Pose, adjoint, inverse, rpy_matrix
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, caution, fact, warning
from vftcli.signals.shown import Shown, record
from vftcli.signals.wrench import Wrench, WrenchFrame

#: Name at the command line → axes and reference point.
FRAMES: dict[str, str] = {
    "flange": "flange axes, moment about the flange point",
    "base": "base axes, moment about the flange point",
    "tool": "tool axes, moment about the tool point (virtual-sensor.tool)",
    "sensor": "sensor axes, moment about the sensor's origin (virtual-sensor.sensor)",
}


class Mounting(NamedTuple):
    """Poses of tool and sensor on the flange."""

    tool: Pose | None = None  #: Pose of the tool in the flange frame, None if there is none.
    #: Pose of the force/torque sensor in the flange frame, None if there is none.
    sensor: Pose | None = None


NOTHING = Mounting()  #: A bare flange.


def check_frame(name: str) -> str:
    """Return the frame's name."""
    if name not in FRAMES:
        raise ParameterError(
            f"no frame {name!r} for a wrench; there is "
            + ", ".join(f"{key} ({words})" for key, words in FRAMES.items())
        )
    return name


def frame_pose(frame: str, mounting: Mounting) -> Pose:
    """Pose of a frame's origin and axes in the flange frame."""
    if frame == "tool":
        if mounting.tool is None:
            raise ParameterError(
                "the robot has no tool, so there is no Jacobian for it: give its pose on the "
                "flange with --set virtual-sensor.tool=x,y,z,roll,pitch,yaw, or a [tool.NAME] "
                "section in the robot file and --set virtual-sensor.tool=NAME"
            )
        return mounting.tool
    if frame == "sensor":
        if mounting.sensor is None:
            raise ParameterError(
                "the sensor's pose on the flange is not known: give it with --set "
                "virtual-sensor.sensor=x,y,z,roll,pitch,yaw, or virtual-sensor.sensor=fit to "
                "estimate it from the log"
            )
        return mounting.sensor
    return IDENTITY


def from_base(frame: str, flange: Array, mounting: Mounting) -> Array:
    """Matrices to a frame from base axes about a flange turned so. (T, 6, 6)"""
    if check_frame(frame) == "base":
        # Base axes need no pose, not even the tool's.
        return np.broadcast_to(np.eye(6), (len(flange), 6, 6))
    turned = flange.swapaxes(1, 2)
    X = np.zeros((len(flange), 6, 6))
    X[:, :3, :3] = X[:, 3:, 3:] = turned
    if frame == "flange":
        return X
    return adjoint(inverse(frame_pose(frame, mounting))) @ X


def read_pose(text: str, robot: Robot, section: str, option: str) -> Pose:
    """A pose from numbers, or from NAME of ``[section.NAME]`` in the robot file."""
    if (values := numbers(text)) is not None:
        if len(values) not in {3, 6} or not np.isfinite(values).all():
            raise ParameterError(
                f"{option}: {len(values)} numbers; a pose is three or six finite ones, "
                "x,y,z or x,y,z,roll,pitch,yaw [m, rad]"
            )
        return Pose(rpy_matrix(values[3:] or (0.0, 0.0, 0.0)), np.array(values[:3]))
    poses = {"tool": robot.tools, "sensor": robot.sensors}[section]
    if not text or text not in poses:
        there = ", ".join(filter(None, poses)) or "none"
        raise ParameterError(
            f"{option} {text!r}: {robot.name} has no [{section}.{text}]; it has {there}. Give "
            f"numbers x,y,z,roll,pitch,yaw [m, rad], or add the section with xyz and rpy"
        )
    return poses[text]


#: Of a log that states nothing: a sensor's reading, on the robot.
UNSTATED = WrenchFrame("sensor", "sensor")
#: One independent sample: errors of friction last as long. [s]
PIECE = 1.0
#: Evidence of three standard errors, enough to decide by currents. [nats]
SURE = 4.5


def logged_wrench(recording: Recording, chain: Chain, mounting: Mounting) -> Wrench:
    """The log's own wrench as force on the robot, in base axes about the flange point."""
    if not recording.require("wrench").any():
        raise MissingSignalError(
            f"{recording.name}: the log's wrench is zero in every sample, so it measures nothing"
        )
    return in_base_axes(recording, chain, mounting)


def in_base_axes(recording: Recording, chain: Chain, mounting: Mounting) -> Wrench:
    """A recording's wrench as force on the robot, in base axes about the flange point."""
    values, stated = recording.require("wrench"), recording.wrench_frame
    frame = stated or UNSTATED
    remarks = [warning("wrench-frame-unstated")] if stated is None else []
    if frame.point == "controller":
        tool = None if mounting.tool is None else mounting.tool.translation
        point, why = controller_point(recording, chain, tool)
        frame, remarks = replace(frame, point=point), [*why]
    # The flange replaces a tool or sensor of unknown pose; base axes need none.
    fixed = {name: pose or IDENTITY for name, pose in mounting._asdict().items()}
    poses = {"flange": IDENTITY, **fixed}
    points = (*poses, "base")
    if frame.axes not in FRAMES or frame.point not in points:
        raise ParameterError(
            f"the log's wrench is in {frame}, which is no frame known here; say which with "
            f"--columns wrench[AXES@POINT], of the axes {', '.join(FRAMES)} and the points "
            f"{', '.join(points)}, as in wrench[base@tool]"
        )
    if mounting.sensor is None and "sensor" in (frame.axes, frame.point):
        remarks.append(caution("sensor-pose-unstated"))
    if mounting.tool is None and "tool" in (frame.axes, frame.point):
        remarks.append(caution("tool-pose-unstated", frame=str(frame)))
    axes, point_pose = poses.get(frame.axes), poses.get(frame.point)
    placed = link_poses(chain, recording.q)
    flange = placed.rotation[:, -1]
    force, moment = frame.factor * values[:, :3], frame.factor * values[:, 3:]
    if axes is not None:
        turn = flange @ axes.rotation
        force, moment = (np.einsum("tij,tj->ti", turn, part) for part in (force, moment))
    # About the flange the force has the moment of its lever too.
    lever = -placed.translation[:, -1]
    if point_pose is not None:
        lever = flange @ point_pose.translation
    moment = moment + np.cross(lever, force)
    return Wrench(
        name="log",
        t=recording.t,
        values=np.concatenate([force, moment], axis=1),
        frame="base",
        remarks=tuple(remarks),
    )


def controller_point(
    recording: Recording, chain: Chain, tool: Array | None
) -> tuple[str, tuple[Remark, ...]]:
    """The point of a controller's moment, "flange" or "tool", and why.

    The controller knows its payload and its arm: the measured current less its target is the
    touch, each joint with its own factor and offset. Jᵀ of the wrench explains it, once about
    the flange and once about the tool's point. The one that leaves less is used if it is
    likelier by `SURE`, else the flange, as of an e-Series' own sensor. The log's wrench is in
    base axes, and the tool's point in the flange frame. (3,) [m]
    """
    if recording.current is None or recording.target_current is None:
        return "flange", (caution("controller-point-without-currents"),)
    if tool is None or not tool.any():
        return "flange", (caution("controller-point-without-tool"),)
    beyond = recording.current - recording.target_current
    force, moment = np.hsplit(recording.require("wrench"), 2)
    lever = link_poses(chain, recording.q).rotation[:, -1] @ tool
    J = flange_jacobian(chain, recording.q)
    about = {"flange": moment, "tool": moment + np.cross(lever, force)}
    left = {
        point: unexplained(beyond, np.einsum("tij,ti->tj", J, np.hstack([force, turned])))
        for point, turned in about.items()
    }
    values = {point: np.sqrt(share.mean()) for point, share in left.items()}
    pieces = recording.duration / PIECE
    evidence = 0.5 * pieces * np.log(left["flange"] / left["tool"]).sum()
    if abs(evidence) <= SURE:
        return "flange", (caution("controller-point-open", **values),)
    point = "tool" if evidence > 0.0 else "flange"
    return point, (fact(f"controller-point-{point}", **values),)


def unexplained(beyond: Array, torque: Array) -> Array:
    """Share of each joint's variance (T, n) left by a line in torque (T, n). (n,)"""
    y, x = beyond - beyond.mean(axis=0), torque - torque.mean(axis=0)
    tiny = np.finfo(np.float64).tiny
    slope = np.sum(x * y, axis=0) / np.maximum(np.sum(x**2, axis=0), tiny)
    rest = np.sum((y - slope * x) ** 2, axis=0)
    return np.asarray(np.maximum(rest, tiny) / np.maximum(np.sum(y**2, axis=0), tiny))


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
    frame: str = "flange"  #: A key of `vftcli.wrench.solvers.FRAMES`.
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

        An estimate without an SD of its torques, (n,) or (T, n) [N·m] by its
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
