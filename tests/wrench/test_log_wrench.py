"""A log's own wrench: its axes, point and sign, and what is assumed where it states none."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from rosbags.highlevel import AnyReader

from vftcli.readers.reading import read
from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian, link_poses
from vftcli.robots.robot import Robot
from vftcli.signals.errors import MissingSignalError, ParameterError
from vftcli.signals.pose import IDENTITY, Pose, rpy_matrix
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import WrenchFrame
from vftcli.wrench.solvers import FRAMES, Mounting, from_base, logged_wrench

FIXTURES = Path(__file__).parents[2] / "fixtures"
UR5 = load_robot("ur5")
SENSOR = Pose(rpy_matrix((0.1, -0.2, 0.8)), np.array([0.01, -0.02, 0.04]))
TOOL = Pose(rpy_matrix((-0.4, 0.3, 1.1)), np.array([0.05, 0.0, 0.15]))
MOUNTED = Mounting(tool=TOOL, sensor=SENSOR)
ROUNDING = 1e-12  # products of rotations and levers with forces of up to 30 N

rng = np.random.default_rng(4)
Q = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2]) + rng.normal(0.0, 0.3, (30, 6))
READ = rng.normal(0.0, 10.0, (30, 6))
FLANGE = link_poses(UR5.chain, Q).rotation[:, -1]


def log(frame: WrenchFrame | None, wrench: np.ndarray = READ) -> Recording:
    return Recording(t=np.arange(30.0), q=Q, wrench=wrench, wrench_frame=frame)


def in_base(frame: WrenchFrame | None, mounting: Mounting = MOUNTED) -> np.ndarray:
    """The log's wrench in base axes about the flange point."""
    return logged_wrench(log(frame), UR5.chain, mounting).values


@pytest.mark.parametrize(
    ("frame", "pose"),
    [
        (WrenchFrame("flange", "flange"), IDENTITY),
        (WrenchFrame("tool", "tool"), TOOL),
        (WrenchFrame("sensor", "sensor"), SENSOR),
        (WrenchFrame("flange", "tool"), Pose(np.eye(3), TOOL.translation)),
        (WrenchFrame("tool", "sensor"), Pose(TOOL.rotation, SENSOR.translation)),
        (WrenchFrame("base", "flange"), IDENTITY),
        (WrenchFrame("base", "tool"), TOOL),
        (WrenchFrame("base", "sensor"), SENSOR),
        (WrenchFrame("base", "sensor", "by-robot"), SENSOR),
        (WrenchFrame("sensor", "sensor", "by-robot"), SENSOR),
    ],
)
def test_axes_and_point_are_pinocchios_action(frame, pose):
    for found, R, given in zip(in_base(frame), FLANGE, READ, strict=True):
        axes = np.eye(3) if frame.axes == "base" else R @ pose.rotation
        there = pin.SE3(axes, R @ pose.translation)
        expected = there.act(pin.Force(given[:3], given[3:])).vector
        sign = -1.0 if frame == WrenchFrame(frame.axes, frame.point, "by-robot") else 1.0
        np.testing.assert_allclose(found, sign * expected, atol=ROUNDING)


def test_a_moment_about_the_bases_origin_is_pinocchios_action():
    """What libfranka's O_F_ext_hat_K is: the base's placement moves it to the flange's point."""
    origins = link_poses(UR5.chain, Q).translation[:, -1]
    found = in_base(WrenchFrame("base", "base"), Mounting())
    for mine, p, given in zip(found, origins, READ, strict=True):
        expected = pin.SE3(np.eye(3), -p).act(pin.Force(given[:3], given[3:])).vector
        np.testing.assert_allclose(mine, expected, atol=ROUNDING)


def explained(recording: Recording, robot: Robot) -> list[np.ndarray]:
    """pinv(Jᵀ) of the log's joint torque, sample by sample."""
    J = flange_jacobian(robot.chain, recording.q)
    pairs = zip(J, recording.tau_ext, strict=True)
    return [np.linalg.lstsq(j.T, tau, rcond=None)[0] for j, tau in pairs]


def test_both_wrenches_of_a_real_franka_are_its_joint_torque(logs):
    """O_F_ext_hat_K about the base's origin, K_F_ext_hat_K about K, K being this log's flange.

    Both equal pinv(Jᵀ) of its joint torque within 7e-4 N and 2e-4 N·m on every sample, which the
    controller's own lengths of the arm may explain; about K the moment was .73 N·m wrong.
    """
    path, robot = logs / "franka_bags" / "calib_0308.bag", load_robot("fr3")
    recording = read(path)
    expected = explained(recording, robot)
    of_base = logged_wrench(recording, robot.chain, Mounting()).values
    np.testing.assert_allclose(of_base, expected, atol=1e-3)
    with AnyReader([path]) as bag:
        states = [
            bag.deserialize(raw, connection.msgtype)
            for connection, _, raw in bag.messages()
            if connection.msgtype.endswith("FrankaState")
        ]
    np.testing.assert_array_equal([state.q for state in states], recording.q)
    own = np.array([state.K_F_ext_hat_K for state in states])
    given = replace(recording, wrench=own, wrench_frame=WrenchFrame("tool", "tool", "by-robot"))
    # Where K is the flange itself no tool has to be known.
    of_stiffness = logged_wrench(given, robot.chain, Mounting(tool=IDENTITY)).values
    np.testing.assert_allclose(of_stiffness, expected, atol=1e-3)
    np.testing.assert_allclose(of_stiffness, of_base, atol=1e-3)


def test_a_simulated_franka_states_its_wrench_as_a_real_one():
    """panda_bag's O_F_ext_hat_K is its joint torque's wrench about the base's origin."""
    recording, robot = read(FIXTURES / "panda_bag"), load_robot("panda")
    wrench = logged_wrench(recording, robot.chain, Mounting()).values
    # Forces of a few N at a metre's lever, in double precision throughout.
    np.testing.assert_allclose(wrench, explained(recording, robot), atol=1e-9)


@pytest.mark.parametrize("frame", FRAMES)
def test_the_answers_frame_undoes_the_logs(frame):
    back = from_base(frame, FLANGE, MOUNTED) @ in_base(WrenchFrame.parsed(frame))[:, :, None]
    np.testing.assert_allclose(np.squeeze(back, axis=2), READ, atol=ROUNDING)


def codes(frame: WrenchFrame | None, mounting: Mounting) -> list[str]:
    return [remark.code for remark in logged_wrench(log(frame), UR5.chain, mounting).remarks]


def test_what_is_not_stated_is_assumed_aloud():
    assert codes(None, MOUNTED) == ["wrench-frame-unstated"]
    assert codes(None, Mounting()) == ["wrench-frame-unstated", "sensor-pose-unstated"]
    assert codes(WrenchFrame("base", "tool"), Mounting()) == ["tool-pose-unstated"]
    assert codes(WrenchFrame("base", "tool"), MOUNTED) == []
    assert codes(WrenchFrame("base", "base"), Mounting()) == []
    assert codes(WrenchFrame("tool", "tool"), Mounting(sensor=SENSOR)) == ["tool-pose-unstated"]
    assert codes(WrenchFrame("base", "flange"), Mounting()) == []
    assert codes(WrenchFrame("tool", "sensor"), MOUNTED) == []
    np.testing.assert_array_equal(in_base(None), in_base(WrenchFrame("sensor", "sensor")))
    flange, tool = (in_base(WrenchFrame(x, x), Mounting()) for x in ("flange", "tool"))
    np.testing.assert_array_equal(tool, flange)  # which stands for one that is not known


@pytest.mark.parametrize("frame", [WrenchFrame("world", "flange"), WrenchFrame("base", "wrist")])
def test_a_frame_that_is_not_known_is_refused(frame):
    with pytest.raises(ParameterError, match=r"no frame known here.*flange, base, tool, sensor"):
        in_base(frame)


def test_a_wrench_of_zeros_is_no_reference():
    with pytest.raises(MissingSignalError, match="zero in every sample"):
        logged_wrench(log(None, np.zeros((30, 6))), UR5.chain, Mounting())
    with pytest.raises(MissingSignalError, match="no wrenches"):
        logged_wrench(Recording(t=np.arange(30.0), q=Q), UR5.chain, Mounting())


ROBOT = load_robot("ur5e")
TOOL_AHEAD = Mounting(tool=Pose(np.eye(3), np.array([0.02, 0.0, 0.16])))
CONTROLLER = WrenchFrame("base", "controller")
NOISE = 0.05  # Noise of the currents, as UR logs have it. [A]


def pushed(point: str, force: float = 25.0, seed: int = 3) -> Recording:
    """20 s of motion with five pushes, planted; the controller gives their moment about a point."""
    rng = np.random.default_rng(seed)
    t = np.arange(0.0, 20.0, 0.008)
    angle = t[:, None] * rng.uniform(0.3, 1.0, 6) + rng.uniform(0.0, 6.0, 6)
    q = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2]) + 0.4 * np.sin(angle)
    about_flange = np.zeros((len(t), 6))
    for start in (2.0, 5.0, 9.0, 13.0, 17.0):
        inside = (t >= start) & (t < start + 1.5)
        shape = np.sin(np.pi * (t[inside] - start) / 1.5)[:, None]
        about_flange[inside] = shape * rng.normal(0.0, 1.0, 6) * np.repeat([force, 1.0], 3)
    J = flange_jacobian(ROBOT.chain, q)
    torque = np.einsum("tij,ti->tj", J, about_flange)
    target = rng.normal(0.0, 1.0, 6) * np.sin(t)[:, None]
    current = target - torque / ROBOT.torque_constant + rng.normal(0.0, NOISE, q.shape)
    wrench = about_flange.copy()
    if point == "tool":
        lever = link_poses(ROBOT.chain, q).rotation[:, -1] @ TOOL_AHEAD.tool.translation
        wrench[:, 3:] -= np.cross(lever, wrench[:, :3])
    currents = {"current": current, "target_current": target}
    return Recording(t=t, q=q, wrench=wrench, wrench_frame=CONTROLLER, **currents)


@pytest.mark.parametrize("seed", [3, 4, 5])
@pytest.mark.parametrize("point", ["flange", "tool"])
def test_the_currents_tell_the_point(point, seed):
    log = pushed(point, seed=seed)
    found = logged_wrench(log, ROBOT.chain, TOOL_AHEAD)
    (remark,) = found.remarks
    assert remark.code == f"controller-point-{point}"
    other = {"flange": "tool", "tool": "flange"}[point]
    assert remark.values[point] < remark.values[other]
    # Planted about the flange, to the rounding of a lever of .16 m.
    planted = logged_wrench(pushed("flange", seed=seed), ROBOT.chain, TOOL_AHEAD)
    np.testing.assert_allclose(found.values, planted.values, atol=1e-12)


def test_a_log_without_pushes_tells_nothing():
    log = pushed("tool", force=0.0)
    noise = np.random.default_rng(8).normal(0.0, 2.0, log.q.shape)
    quiet = replace(log, current=log.target_current + NOISE * noise, wrench=noise)
    found = logged_wrench(quiet, ROBOT.chain, TOOL_AHEAD)
    assert [remark.code for remark in found.remarks] == ["controller-point-open"]


def test_without_a_tool_or_target_currents_it_is_the_flange_aloud():
    log = pushed("flange")
    bare = logged_wrench(log, ROBOT.chain, Mounting())
    assert [remark.code for remark in bare.remarks] == ["controller-point-without-tool"]
    found = logged_wrench(replace(log, target_current=None), ROBOT.chain, TOOL_AHEAD)
    assert [remark.code for remark in found.remarks] == ["controller-point-without-currents"]
    np.testing.assert_array_equal(found.values, log.wrench)
