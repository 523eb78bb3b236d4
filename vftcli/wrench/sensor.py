"""A real force/torque sensor beside ours: its pose or its vendor's convention."""

from itertools import permutations
from typing import NamedTuple

import numpy as np

from vftcli.robots.chain import Chain, link_poses
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array, root_mean_square
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.lag import bridge_unknown, time_offset
from vftcli.signals.pose import Pose, rpy_angles, skew
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, caution, fact
from vftcli.signals.series import resample_columns
from vftcli.signals.wrench import Wrench
from vftcli.wrench import FIT, WrenchChoice
from vftcli.wrench.frames import UNSTATED, Mounting
from vftcli.wrench.solvers import VirtualSensor

#: Second to first singular value of the forces below which they lie on one line.
LEAST_DIRECTIONS = 0.02
#: Correlation of a field that is made from the torques.
DERIVED = 0.9995
RESEMBLES = 0.5  #: Below this correlation no convention explains the field.


class PoseFit(NamedTuple):
    """A sensor's pose on the flange, estimated from both sensors' readings."""

    pose: Pose  #: Orientation and origin of the sensor in the flange frame.
    force_rms: float  #: Force that the pose leaves unexplained, rms over axes and samples. [N]
    moment_rms: float  #: The same of the moment. [N·m]
    position_sd: Array  #: SD of the origin. (3,) [m]


def fit_pose(flange: Array, sensor: Array) -> PoseFit:
    """R and p of (56) from readings of flange and sensor. (T, 6) each [N, N·m]

    R solves Wahba's problem on the forces (Kabsch), p the linear least squares of N_F − R
    N_S = p × F_F, both about the mean: constant offsets do not matter.
    """
    ours, theirs = centred(flange, sensor)
    if len(ours) < 4:
        raise ParameterError(
            "the sensor's pose: too few samples in which both wrenches are known"
        )
    U, s, Vt = np.linalg.svd(theirs[:, :3].T @ ours[:, :3])
    if not s[1] > LEAST_DIRECTIONS * s[0]:
        raise ParameterError(
            "the sensor's pose cannot be found: the forces lie on one line; push in two "
            "directions, or give the pose with --set virtual-sensor.sensor=x,y,z,roll,pitch,yaw"
        )
    # A reflection may fit better than a rotation: the smallest direction gives way.
    R = Vt.T @ np.diag([1.0, 1.0, np.sign(np.linalg.det(Vt.T @ U.T))]) @ U.T
    lever = skew(-ours[:, :3]).reshape(-1, 3)
    excess = (ours[:, 3:] - theirs[:, 3:] @ R.T).ravel()
    p = np.linalg.lstsq(lever, excess, rcond=None)[0]
    left = excess - lever @ p
    variance = np.mean(left**2)
    force_rms = root_mean_square(ours[:, :3] - theirs[:, :3] @ R.T)
    position_sd = np.sqrt(variance * np.diag(np.linalg.pinv(lever.T @ lever)))
    return PoseFit(Pose(R, p), force_rms, np.sqrt(variance), position_sd)


def find_mounting(
    recording: Recording, robot: Robot, disturbance: ExternalTorque, choice: WrenchChoice
) -> tuple[Mounting, tuple[Remark, ...]]:
    """Tool and sensor poses as asked, with remarks; ``fit`` estimates the sensor's."""
    mounting = choice.mounting(robot)
    if choice.sensor_pose != FIT:
        return mounting, ()
    reading, frame = recording.require("wrench"), recording.wrench_frame or UNSTATED
    if frame.axes != "sensor":
        raise ParameterError(
            f"virtual-sensor.sensor=fit: the log's wrench is in {frame}, not in sensor axes; name "
            "it with --columns wrench[sensor]=…, or leave the setting away"
        )
    ours = VirtualSensor(frame="flange").wrench(disturbance, recording.q, robot.chain)
    fit = fit_pose(ours.known, frame.factor * reading)
    remark = fact(
        "sensor-pose-fitted",
        position_mm=(fit.pose.translation * 1e3).tolist(),
        position_sd_mm=(fit.position_sd * 1e3).tolist(),
        angles_deg=np.degrees(rpy_angles(fit.pose.rotation)).tolist(),
        force_rms_N=fit.force_rms,
        moment_rms_Nm=fit.moment_rms,
    )
    return mounting._replace(sensor=fit.pose), (remark,)


class AxesFit(NamedTuple):
    """One force in terms of another: theirs ≈ gain · matrix · ours."""

    matrix: Array  #: The signed permutation of axes that fits best. (3, 3)
    gain: float  #: Factor on top of it.
    correlation: float  #: Their correlation, all axes together.

    @property
    def derived(self) -> bool:
        """Whether theirs is computed from the same torques, not measured."""
        return self.correlation >= DERIVED

    @property
    def words(self) -> str:
        """Their axes in ours, as "+x +z −y"."""
        places = abs(self.matrix).argmax(axis=1)
        signs = np.where(self.matrix.sum(axis=1) > 0, "+", "−")
        return " ".join(f"{sign}{'xyz'[k]}" for sign, k in zip(signs, places, strict=True))


def fit_axes(ours: Array, theirs: Array) -> AxesFit:
    """Signed permutation of axes from our force to theirs; offsets do not matter.

    The best orthogonal matrix (improper ones allowed: loggers swap axes freely), rounded
    to the signed permutation with the largest sum of matching entries.
    """
    x, y = centred(ours, theirs)
    U, _, Vt = np.linalg.svd(y.T @ x)
    Q, rows = U @ Vt, np.arange(3)
    order = max(permutations(range(3)), key=lambda order: abs(Q[rows, order]).sum())
    matrix = np.zeros((3, 3))
    matrix[rows, order] = np.sign(Q[rows, order])
    z = x @ matrix.T
    power, both = np.sum(z**2), np.sum(z * y)
    scale = np.sqrt(power * np.sum(y**2))
    gain, correlation = (both / size if size > 0 else np.nan for size in (power, scale))
    return AxesFit(matrix, gain, correlation)


def centred(ours: Array, theirs: Array) -> tuple[Array, Array]:
    """Departures from the means of two readings (T, k), both known. (S, k) each"""
    known = np.all(np.isfinite(ours) & np.isfinite(theirs), axis=1)
    x, y = ours[known], theirs[known]
    return (x - x.mean(axis=0), y - y.mean(axis=0)) if len(x) else (x, y)


def vendor_remarks(recording: Recording, ours: Wrench, chain: Chain) -> list[Remark]:
    """Convention of the log's own wrench against ours, in base and flange axes."""
    theirs = recording.wrench
    if theirs is None:
        return []
    empty = ~theirs.any(axis=1)
    share, remarks = empty.mean(), list[Remark]()
    norm = np.linalg.norm(ours.force[empty & ~ours.hidden], axis=1)
    force = root_mean_square(norm) if len(norm) else np.nan
    if share == 1.0:
        return [caution("log-wrench-all-zero", force_N=force)]
    if share:
        remarks.append(caution("log-wrench-zero", share=share, force_N=force))
    # Zeros may mean "not known", and would bias every fit.
    t, usable = recording.t, ~(empty | ours.hidden)[:, None]
    if np.count_nonzero(usable) < 10:
        return [*remarks, caution("log-wrench-unlike")]
    flange = link_poses(chain, recording.q).rotation[:, -1]
    forces = {"base": ours.force, "flange": np.einsum("tji,tj->ti", flange, ours.force)}
    given = np.where(usable, theirs[:, :3], np.nan)
    fits = {name: fit_axes(force, given) for name, force in forces.items()}
    frame, fit = max(fits.items(), key=lambda item: item[1].correlation)
    turned = forces[frame] @ fit.matrix.T
    lag = time_offset(t, given, turned).lag
    moved = resample_columns(t - lag, t, bridge_unknown(t, turned))
    axes = fit_axes(np.where(usable, moved, np.nan) @ fit.matrix, given)
    if not axes.correlation > RESEMBLES:
        return [*remarks, caution("log-wrench-unlike")]
    # The trace of a signed permutation: 3 for our axes, −3 for opposite.
    turn = {3: "log-wrench-fits", -3: "log-wrench-fits-turned"}
    remarks.append(
        fact(
            turn.get(round(np.trace(axes.matrix)), "log-wrench-fits-other-axes"),
            stated=str(recording.wrench_frame or "frame not stated"),
            frame=frame,
            axes=axes.words,
            gain=axes.gain,
            lag_ms=lag * 1e3,
            correlation=axes.correlation,
        )
    )
    if axes.derived:
        remarks.append(caution("log-wrench-derived", correlation=DERIVED))
    return remarks
