"""A real sensor's pose on the flange, found again in its contacts."""

import numpy as np
import pytest

from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian, link_poses
from vftcli.signals.errors import MissingSignalError, ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.pose import Pose, adjoint, inverse, rpy_matrix
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import WrenchFrame
from vftcli.wrench import FIT, WrenchChoice
from vftcli.wrench.sensor import find_mounting, fit_pose

POSE = Pose(rpy_matrix((0.1, -0.2, 0.8)), np.array([0.01, -0.02, 0.04]))
UR5 = load_robot("ur5")
T = np.arange(0.0, 20.0, 0.05)
Q = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2]) + 0.5 * np.sin(
    np.outer(T, [0.3, 0.5, 0.7, 0.9, 1.1, 0.4])
)
FLANGE = link_poses(UR5.chain, Q).rotation[:, -1]
PUSH = np.sin(np.outer(T, [0.7, 1.1, 1.3, 0.9, 1.7, 2.1])) * [20, 15, 25, 2, 2, 1.5]
"""A contact at the flange, in flange axes. (T, 6) [N, N·m]"""


def test_a_sensors_pose_is_found_again_whatever_its_zero() -> None:
    reading = PUSH @ adjoint(inverse(POSE)).T + np.array([1.0, -2.0, 3.0, 0.1, 0.0, -0.2])
    fit = fit_pose(PUSH, reading)
    np.testing.assert_allclose(fit.pose.rotation, POSE.rotation, atol=1e-9)
    np.testing.assert_allclose(fit.pose.translation, POSE.translation, atol=1e-9)


def test_under_noise_the_pose_is_found_within_its_own_deviation() -> None:
    """Of 50 noises a deviation is known to 10 %; .05 N·m over √400 samples of 20 N are < 1 mm."""
    rng = np.random.default_rng(2)
    reading = PUSH @ adjoint(inverse(POSE)).T
    noises = rng.standard_normal((50, *PUSH.shape)) * np.repeat([0.5, 0.05], 3)
    fits = [fit_pose(PUSH + noise, reading) for noise in noises]
    error = np.array([fit.pose.translation - POSE.translation for fit in fits])
    sd = np.mean([fit.position_sd for fit in fits], axis=0)
    np.testing.assert_allclose(sd, np.sqrt(np.mean(error**2, axis=0)), rtol=0.4)
    assert np.all(sd < 1e-3)


def test_pushes_along_one_line_tell_no_pose() -> None:
    line = np.outer(np.sin(np.linspace(0, 6, 50)), [10.0, 0, 0, 0, 1, 0])
    with pytest.raises(ParameterError, match=r"forces lie on one line.*virtual-sensor.sensor"):
        fit_pose(line, line)


def log(wrench: np.ndarray | None, frame: WrenchFrame | None = None) -> Recording:
    return Recording(t=T, q=Q, wrench=wrench, wrench_frame=frame)


def disturbance() -> ExternalTorque:
    """The torque of that contact."""
    base = np.concatenate(
        [np.einsum("tij,tj->ti", FLANGE, part) for part in (PUSH[:, :3], PUSH[:, 3:])], axis=1
    )
    tau = np.einsum("tij,ti->tj", flange_jacobian(UR5.chain, Q), base)
    return ExternalTorque(name="disturbance", t=T, tau=tau)


@pytest.mark.parametrize(
    ("sign", "frame"), [(1.0, None), (-1.0, WrenchFrame("sensor", "sensor", "by-robot"))]
)
def test_a_pose_is_found_in_the_contacts_whatever_sign_they_are_logged_in(
    sign: float, frame: WrenchFrame | None
) -> None:
    recording = log(sign * PUSH @ adjoint(inverse(POSE)).T, frame)
    mounting, remarks = find_mounting(
        recording, UR5, disturbance(), WrenchChoice(sensor_pose=FIT)
    )
    np.testing.assert_allclose(mounting.sensor.rotation, POSE.rotation, atol=1e-9)
    np.testing.assert_allclose(mounting.sensor.translation, POSE.translation, atol=1e-9)
    (remark,) = remarks
    np.testing.assert_allclose(remark.values["position_mm"], [10, -20, 40], atol=1e-6)
    assert "10.0 −20.0 40.0 mm" in str(remark)


def test_a_pose_that_is_given_is_not_looked_for_nor_one_without_a_sensors_wrench() -> None:
    given = WrenchChoice(sensor_pose="0,0,0.05")
    mounting, remarks = find_mounting(log(None), UR5, disturbance(), given)
    np.testing.assert_array_equal(mounting.sensor.translation, [0, 0, 0.05])
    assert remarks == ()
    fit = WrenchChoice(sensor_pose=FIT)
    with pytest.raises(MissingSignalError, match="no wrenches"):
        find_mounting(log(None), UR5, disturbance(), fit)
    with pytest.raises(ParameterError, match=r"fit: .* in base axes.*wrench\[sensor\]"):
        find_mounting(log(PUSH, WrenchFrame("base", "flange")), UR5, disturbance(), fit)
