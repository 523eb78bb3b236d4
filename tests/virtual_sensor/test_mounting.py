"""Where a sensor sits and what it weighs, found in the log."""

import numpy as np
import pytest

from vftcli.robots import load_robot
from vftcli.robots.kinematics import flange_jacobian, link_poses
from vftcli.signals.errors import MissingSignalError, ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.pose import Pose, adjoint, inverse, rpy_matrix
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import WrenchFrame
from vftcli.virtual_sensor.choice import FIT, WrenchChoice
from vftcli.virtual_sensor.frames import Mounting
from vftcli.virtual_sensor.mounting import find_mounting, without_tool_weight

UR5 = load_robot("ur5")
POSE = Pose(rpy_matrix((0.1, -0.2, 0.8)), np.array([0.01, -0.02, 0.04]))
T = np.arange(0.0, 20.0, 0.05)
rng = np.random.default_rng(7)
Q = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2]) + 0.5 * np.sin(
    np.outer(T, [0.3, 0.5, 0.7, 0.9, 1.1, 0.4])
)
FLANGE = link_poses(UR5.chain, Q).rotation[:, -1]
PUSH = np.sin(np.outer(T, [0.7, 1.1, 1.3, 0.9, 1.7, 2.1])) * [20, 15, 25, 2, 2, 1.5]
"""A contact at the flange, in flange axes. (T, 6) [N, N·m]"""


def log(wrench: np.ndarray | None, frame: WrenchFrame | None = None) -> Recording:
    return Recording(t=T, q=Q, wrench=wrench, wrench_frame=frame)


def disturbance() -> ExternalTorque:
    """The torque of that contact."""
    base = np.concatenate(
        [np.einsum("tij,tj->ti", FLANGE, part) for part in (PUSH[:, :3], PUSH[:, 3:])], axis=1
    )
    tau = np.einsum("tij,ti->tj", flange_jacobian(UR5.chain, Q), base)
    return ExternalTorque(name="disturbance", t=T, tau=tau)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_pose_is_found_in_the_contacts_whatever_sign_they_are_logged_in(sign: float) -> None:
    frame = WrenchFrame("sensor", "sensor", "on-robot" if sign > 0 else "by-robot")
    recording = log(sign * PUSH @ adjoint(inverse(POSE)).T, frame)
    mounting, remarks = find_mounting(recording, UR5, disturbance(), WrenchChoice(sensor_pose=FIT))
    assert mounting.sensor is not None
    np.testing.assert_allclose(mounting.sensor.rotation, POSE.rotation, atol=1e-9)
    np.testing.assert_allclose(mounting.sensor.translation, POSE.translation, atol=1e-9)
    (remark,) = remarks
    np.testing.assert_allclose(remark.values["position_mm"], [10, -20, 40], atol=1e-6)
    assert str(remark).startswith("sensor pose found from the log: x, y, z = 10.0 ± 0.0")


def test_a_pose_that_is_given_is_not_looked_for() -> None:
    choice = WrenchChoice(sensor_pose="0,0,0.05")
    mounting, remarks = find_mounting(log(None), UR5, disturbance(), choice)
    assert mounting.sensor is not None
    np.testing.assert_array_equal(mounting.sensor.translation, [0, 0, 0.05])
    assert remarks == ()


def test_a_pose_is_not_found_without_a_sensors_wrench() -> None:
    fit = WrenchChoice(sensor_pose=FIT)
    with pytest.raises(MissingSignalError, match="no wrenches"):
        find_mounting(log(None), UR5, disturbance(), fit)
    with pytest.raises(ParameterError, match=r"--sensor-pose fit: .* in base axes"):
        find_mounting(log(PUSH, WrenchFrame("base", "flange")), UR5, disturbance(), fit)


@pytest.mark.parametrize("sign", ["on-robot", "by-robot"])
def test_the_weight_of_a_tool_leaves_the_log_in_its_own_sign(sign: str) -> None:
    gravity = np.asarray(UR5.chain.gravity)
    down = np.einsum("tji,j->ti", FLANGE @ POSE.rotation, gravity)
    zero = np.array([0.5, -1.0, 2.0, 0.02, 0.03, -0.01])
    com = np.array([0.01, 0.0, 0.05])
    weight = 0.35 * np.concatenate([down, np.cross(com, down)], axis=1) + zero
    contact = np.where(T[:, None] > 12.0, PUSH, 0.0)
    frame = WrenchFrame.parsed(f"sensor,{sign}")
    recording = log(frame.factor * (weight + contact), frame)
    lighter, remarks = without_tool_weight(recording, UR5.chain, Mounting(sensor=POSE), T < 12.0)
    assert lighter.wrench is not None
    np.testing.assert_allclose(lighter.wrench, frame.factor * contact, atol=1e-9)
    assert lighter.wrench_frame == frame
    assert remarks[0].values["mass_kg"] == pytest.approx(0.35)
    np.testing.assert_allclose(remarks[0].values["com_mm"], [10, 0, 50], atol=1e-6)


def test_too_few_samples_weigh_nothing() -> None:
    with pytest.raises(ParameterError, match=r"too few unloaded samples.*--zero A:B"):
        without_tool_weight(log(PUSH), UR5.chain, Mounting(), T < 0.4)
