"""Pose of a real force/torque sensor on the flange: as asked, or found in the log."""

from dataclasses import dataclass

import numpy as np

from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array, seal
from vftcli.signals.errors import ParameterError
from vftcli.signals.pose import Pose, rpy_angles, skew
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact
from vftcli.signals.wrench import ExternalTorque
from vftcli.virtual_sensor.choice import FIT, WrenchChoice
from vftcli.virtual_sensor.frames import Mounting
from vftcli.virtual_sensor.log_wrench import UNSTATED
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor

#: Second to first singular value of the forces below which they lie on one line.
LEAST_DIRECTIONS = 0.02


@dataclass(frozen=True, kw_only=True)
class PoseFit:
    """A sensor's pose on the flange, estimated from what it and the virtual sensor read."""

    pose: Pose  #: Orientation and origin of the sensor in the flange frame.
    force_rms: float  #: Force that the pose leaves unexplained, rms over axes and samples. [N]
    moment_rms: float  #: The same of the moment. [N·m]
    position_sd: Array  #: Standard deviation of the origin. (3,) [m]

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
            "directions, or give the pose with --set virtual-sensor.sensor=x,y,z,roll,pitch,yaw"
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


def find_mounting(
    recording: Recording, robot: Robot, disturbance: ExternalTorque, choice: WrenchChoice
) -> tuple[Mounting, tuple[Remark, ...]]:
    """Tool and sensor poses as asked, and what was found: ``fit`` estimates the sensor's pose."""
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
    return mounting._replace(sensor=fit.pose), (fit.remark,)
