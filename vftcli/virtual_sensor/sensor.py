"""A real force/torque sensor beside the virtual one: its pose, its tool's weight, its lag."""

from dataclasses import dataclass

import numpy as np

from vftcli.signals.arrays import Array, seal
from vftcli.signals.errors import ParameterError
from vftcli.signals.pose import Pose, rpy_angles, skew
from vftcli.signals.remarks import Remark, fact

LEAST_DIRECTIONS = 0.02
"""Second to first singular value of the forces below which they lie on one line."""

LEAST_TURN = 0.1
"""Spread of the gravity direction (rms, each axis) below which poses cannot weigh a tool."""


@dataclass(frozen=True, kw_only=True)
class PoseFit:
    """A sensor's pose on the flange, estimated from what it and the virtual sensor read.

    Attributes:
        pose: Orientation and origin of the sensor in the flange frame.
        force_rms: Force that the pose leaves unexplained, rms over axes and samples. [N]
        moment_rms: The same of the moment. [N·m]
        position_sd: Standard deviation of the origin. (3,) [m]
    """

    pose: Pose
    force_rms: float
    moment_rms: float
    position_sd: Array

    def __post_init__(self) -> None:
        seal(self, "position_sd")

    @property
    def remark(self) -> Remark:
        """The fitted pose."""
        return fact(
            "sensor-pose-fitted",
            position_mm=(self.pose.translation * 1e3).tolist(),
            position_sd_mm=(self.position_sd * 1e3).tolist(),
            angles_deg=np.degrees(rpy_angles(self.pose.rotation)).tolist(),
            force_rms_N=self.force_rms,
            moment_rms_Nm=self.moment_rms,
        )


def fit_pose(flange: Array, sensor: Array) -> PoseFit:
    """Find R and p of (56) from readings of the same contact. Constant offsets do not matter.

    R solves Wahba's problem on the forces (Kabsch), p the linear least squares of
    N_F − R N_S = p × F_F, both on departures from the mean.

    Args:
        flange: Virtual wrench in flange axes about the flange point. (T, 6) [N, N·m]
        sensor: The sensor's reading as force on the robot, in its own axes. (T, 6) [N, N·m]

    Raises:
        ParameterError: If the forces do not span at least two directions.
    """
    known = np.all(np.isfinite(flange) & np.isfinite(sensor), axis=1)
    ours, theirs = flange[known], sensor[known]
    if len(ours) < 4:
        raise ParameterError("the sensor's pose: too few samples in which both wrenches are known")
    ours, theirs = ours - ours.mean(axis=0), theirs - theirs.mean(axis=0)
    U, s, Vt = np.linalg.svd(theirs[:, :3].T @ ours[:, :3])
    if not s[1] > LEAST_DIRECTIONS * s[0]:
        raise ParameterError(
            "the sensor's pose cannot be found: the forces lie on one line; push in two "
            "directions, or give the pose with --sensor-pose x,y,z,roll,pitch,yaw"
        )
    # A reflection may fit better than any rotation; the smallest direction gives way.
    turn = np.diag([1.0, 1.0, np.sign(np.linalg.det(Vt.T @ U.T))])
    R = Vt.T @ turn @ U.T
    lever = skew(-ours[:, :3]).reshape(-1, 3)
    excess = (ours[:, 3:] - theirs[:, 3:] @ R.T).ravel()
    p = np.linalg.lstsq(lever, excess, rcond=None)[0]
    left = excess - lever @ p
    variance = float(np.mean(left**2))
    return PoseFit(
        pose=Pose(R, p),
        force_rms=float(np.sqrt(np.mean((ours[:, :3] - theirs[:, :3] @ R.T) ** 2))),
        moment_rms=float(np.sqrt(variance)),
        position_sd=np.sqrt(variance * np.diag(np.linalg.pinv(lever.T @ lever))),
    )


@dataclass(frozen=True, kw_only=True)
class ToolWeight:
    """What a sensor weighs, and its zero.

    Attributes:
        mass: Mass beyond the measuring element. [kg]
        com: Its centre of mass in sensor axes. (3,) [m]
        zero: The sensor's reading without weight. (6,) [N, N·m]
        mass_sd: Standard deviation of the mass. [kg]
        force_rms: Force left unexplained over the poses, rms. [N]
    """

    mass: float
    com: Array
    zero: Array
    mass_sd: float
    force_rms: float

    def __post_init__(self) -> None:
        seal(self, "com", "zero")

    @property
    def remark(self) -> Remark:
        """What was weighed."""
        return fact(
            "sensor-tool-weighed",
            mass_kg=self.mass,
            mass_sd_kg=self.mass_sd,
            com_mm=(self.com * 1e3).tolist(),
            force_rms_N=self.force_rms,
        )

    def reading(self, rotation: Array, gravity: Array) -> Array:
        """What the sensor reads of weight and zero. (T, 6) [N, N·m]

        Args:
            rotation: Orientation of the sensor in the base. (T, 3, 3)
            gravity: Gravity vector in base axes. (3,) [m/s²]
        """
        weight = self.mass * np.einsum("tji,j->ti", rotation, gravity)
        loaded: Array = np.concatenate([weight, np.cross(self.com, weight)], axis=1) + self.zero
        return loaded


def weigh_tool(sensor: Array, rotation: Array, gravity: Array) -> ToolWeight:
    """Mass, centre of mass and zero from unloaded readings in several orientations.

    Linear least squares: F = m Rᵀg + F₀ and N = (m c) × Rᵀg + N₀.

    Args:
        sensor: Readings as force on the robot, in sensor axes. (T, 6) [N, N·m]
        rotation: Orientation of the sensor in the base. (T, 3, 3)
        gravity: Gravity vector in base axes. (3,) [m/s²]

    Raises:
        ParameterError: If the orientations are all alike, so that weight and zero cannot be told
            apart.
    """
    down = np.einsum("tji,j->ti", rotation, gravity)
    centred = down - down.mean(axis=0)
    turned = np.sqrt(np.mean(centred**2)) / np.linalg.norm(gravity)
    if not turned > LEAST_TURN:
        raise ParameterError(
            "the sensor's tool cannot be weighed: the unloaded samples are all in one orientation "
            f"(gravity turns by {turned:.2g} rms); give --zero spans in other poses"
        )
    force, moment = sensor[:, :3], sensor[:, 3:]
    mass = float(np.sum(centred * force) / np.sum(centred**2))
    zero = force.mean(axis=0) - mass * down.mean(axis=0)
    left = force - mass * down - zero
    # (m c) × Rᵀg is linear in m c, the first moment of the mass.
    lever = skew(-centred).reshape(-1, 3)
    moved = (moment - moment.mean(axis=0)).ravel()
    first = np.linalg.lstsq(lever, moved, rcond=None)[0]
    torque_zero = (moment - np.cross(first, down)).mean(axis=0)
    return ToolWeight(
        mass=mass,
        com=first / mass if mass != 0.0 else np.zeros(3),
        zero=np.concatenate([zero, torque_zero]),
        mass_sd=float(np.sqrt(np.mean(left**2) / np.sum(centred**2))),
        force_rms=float(np.sqrt(np.mean(left**2))),
    )
