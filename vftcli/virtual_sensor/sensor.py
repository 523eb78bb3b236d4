"""A real force/torque sensor beside the virtual one: its pose, its tool's weight, its lag."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.signals.arrays import Array, frozen, is_uniform
from vftcli.signals.errors import ParameterError
from vftcli.signals.pose import Pose, rpy_angles, skew
from vftcli.signals.remarks import Remark, fact
from vftcli.signals.series import bridged, median_step, resampled
from vftcli.virtual_sensor.solvers import SCALE

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
        object.__setattr__(self, "position_sd", frozen(self.position_sd))


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
        for name in ("com", "zero"):
            object.__setattr__(self, name, frozen(getattr(self, name)))

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


class Offset(NamedTuple):
    """How far one series runs behind another.

    Attributes:
        lag: Time by which the first is late. [s]
        correlation: Correlation once that is taken out.
    """

    lag: float
    correlation: float


def time_offset(t: Array, late: Array, early: Array, limit: float = 0.5) -> Offset:
    """The lag of `late` behind `early` at which they correlate best, all columns together.

    Of six columns the last three are moments and count by a lever of 0.3 m. The peak is refined
    by a parabola through its neighbours.

    Args:
        t: Common clock. (T,) [s]
        late: A series. (T, k)
        early: Another. (T, k)
        limit: Largest lag considered, either way. [s]
    """
    step = median_step(t)
    even = t if is_uniform(t) else np.arange(t[0], t[-1], step)
    x, y = (comparable(resampled(even, t, bridged(t, series))) for series in (late, early))
    count = len(even)
    reach = min(int(limit / step), count - 2)
    size = 1 << int(np.ceil(np.log2(2 * count)))
    spectrum = np.fft.rfft(x, size, axis=0) * np.conj(np.fft.rfft(y, size, axis=0))
    cross = np.fft.irfft(spectrum, size, axis=0).sum(axis=1)
    lags = np.arange(-reach, reach + 1)
    value = cross[lags % size] / np.sqrt(overlap_energy(x, lags) * overlap_energy(y, -lags))
    best = int(np.argmax(value))
    shift = 0.0
    if 0 < best < len(lags) - 1:
        low, peak, high = value[best - 1 : best + 2]
        bend = low - 2.0 * peak + high
        shift = 0.5 * (low - high) / bend if bend < 0 else 0.0
    return Offset(lag=float((lags[best] + shift) * step), correlation=float(value[best]))


def overlap_energy(series: Array, lags: NDArray[np.intp]) -> Array:
    """Sum of squares of what overlaps when a series is moved back by each lag. (L,)

    Without it a correlation would favour small lags, which overlap longer.
    """
    total = np.concatenate([[0.0], np.cumsum(np.sum(series**2, axis=1))])
    count = len(series)
    energy = total[np.minimum(count, count + lags)] - total[np.maximum(0, lags)]
    positive: Array = np.maximum(energy, np.finfo(np.float64).tiny)
    return positive


def comparable(series: Array) -> Array:
    """Columns without mean; moments of a wrench as the forces of a lever of 0.3 m. (N, k)"""
    centred: Array = series - series.mean(axis=0)
    return centred / SCALE if series.shape[1] == len(SCALE) else centred


def pose_remark(fit: PoseFit) -> Remark:
    """A fitted pose as a remark."""
    return fact(
        "sensor-pose-fitted",
        position_mm=(fit.pose.translation * 1e3).tolist(),
        position_sd_mm=(fit.position_sd * 1e3).tolist(),
        angles_deg=np.degrees(rpy_angles(fit.pose.rotation)).tolist(),
        force_rms_N=fit.force_rms,
        moment_rms_Nm=fit.moment_rms,
    )


def tool_remark(weight: ToolWeight) -> Remark:
    """An identified tool as a remark."""
    return fact(
        "sensor-tool-weighed",
        mass_kg=weight.mass,
        mass_sd_kg=weight.mass_sd,
        com_mm=(weight.com * 1e3).tolist(),
        force_rms_N=weight.force_rms,
    )


def without_tool(sensor: Array, weight: ToolWeight, rotation: Array, gravity: Array) -> Array:
    """A sensor's reading less the weight of its tool and its zero. (T, 6) [N, N·m]"""
    return sensor - weight.reading(rotation, gravity)
