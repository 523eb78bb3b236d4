"""Frames: what rotating a frame does to the answer; the adjoint itself: test_pose.py."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.robots import load_robot
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.pose import Pose, adjoint, rpy_matrix
from vftcli.wrench.solvers import (
    Mounting,
    VirtualSensor,
    read_pose,
)


def test_the_printed_56_turns_the_rotation_round_in_its_lower_left_block() -> None:
    """docs/paper.md: 20 mm off, turned by .5 rad, 20 N across: 20·.02·2 sin .5 = .38 N·m."""
    c, s = np.cos(0.5), np.sin(0.5)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    right = adjoint(Pose(turn, np.array([0.0, 0.0, 0.02])))
    cross = right[3:, :3] @ turn.T
    error = (cross @ turn.T - right[3:, :3]) @ np.array([20.0, 0.0, 0.0])
    assert np.linalg.norm(error) == pytest.approx(20.0 * 0.02 * 2.0 * np.sin(0.5), rel=1e-12)


def sensed(frame: str, mounting: Mounting, turn: np.ndarray | None = None):
    """The wrench of one random torque, optionally with the base turned."""
    chain = load_robot("ur5").chain
    if turn is not None:
        first = chain.rotation.copy(), chain.translation.copy()
        first[0][0], first[1][0] = turn @ first[0][0], turn @ first[1][0]
        chain = replace(chain, rotation=first[0], translation=first[1])
    q = np.random.default_rng(3).uniform(-1.5, 1.5, (40, 6))
    tau = np.random.default_rng(5).normal(size=q.shape)
    torque = ExternalTorque(name="x", t=np.arange(len(q)) * 0.01, tau=tau)
    sensor = VirtualSensor(frame=frame, mounting=mounting)
    return sensor.wrenches((torque,), q, chain, {"x": np.ones(chain.joints)})[0]


TOOL = Pose(rpy_matrix((0.2, 0.5, -0.4)), np.array([0.05, -0.1, 0.15]))
TURN = rpy_matrix((0.7, -0.3, 1.9))


def test_turning_the_base_turns_the_answer_in_base_axes_only() -> None:
    plain, turned = sensed("base", Mounting()), sensed("base", Mounting(), turn=TURN)
    expected = np.concatenate([plain.force @ TURN.T, plain.moment @ TURN.T], axis=1)
    np.testing.assert_allclose(turned.known, expected, rtol=1e-9, atol=1e-9)
    for frame in ("flange", "tool"):
        same = sensed(frame, Mounting(tool=TOOL)), sensed(frame, Mounting(tool=TOOL), turn=TURN)
        np.testing.assert_allclose(same[1].known, same[0].known, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("frame", ["tool", "sensor"])
def test_turning_what_is_mounted_turns_the_answer(frame: str) -> None:
    """A tool turned about its own point reads the same force in turned axes."""
    other = Pose(TOOL.rotation @ TURN, TOOL.translation)
    plain = sensed(frame, Mounting(tool=TOOL, sensor=TOOL))
    turned = sensed(frame, Mounting(tool=other, sensor=other))
    expected = np.concatenate([plain.force @ TURN, plain.moment @ TURN], axis=1)
    np.testing.assert_allclose(turned.known, expected, rtol=1e-9, atol=1e-9)
    # the variance summed over the axes of force is a trace, which no rotation changes
    for part in (slice(0, 3), slice(3, 6)):
        trace = np.sum(plain.sd[:, part] ** 2, axis=1)
        np.testing.assert_allclose(np.sum(turned.sd[:, part] ** 2, axis=1), trace, rtol=1e-9)


def test_moving_the_tool_moves_the_moment_by_the_lever() -> None:
    lever = np.array([0.1, -0.2, 0.3])
    flange = sensed("flange", Mounting())
    tool = sensed("tool", Mounting(tool=Pose(np.eye(3), lever)))
    np.testing.assert_allclose(tool.force, flange.force, atol=1e-9)
    np.testing.assert_allclose(
        tool.moment, flange.moment - np.cross(lever, flange.force), atol=1e-9
    )


def test_a_frame_without_its_pose_says_how_to_give_it() -> None:
    with pytest.raises(
        ParameterError, match=r"no tool, so there is no Jacobian.*virtual-sensor.tool"
    ):
        VirtualSensor(frame="tool")
    with pytest.raises(ParameterError, match=r"virtual-sensor\.sensor"):
        VirtualSensor(frame="sensor")


def test_poses_are_read_as_three_or_six_numbers_or_a_name(tmp_path) -> None:
    robot = load_robot("ur5")
    short = read_pose("0.1,0,0.2", robot, "tool", "virtual-sensor.tool")
    long = read_pose("0.1,0,0.2,0.1,0.2,0.3", robot, "tool", "virtual-sensor.tool")
    np.testing.assert_array_equal(short.translation, [0.1, 0.0, 0.2])
    np.testing.assert_allclose(long.rotation, rpy_matrix((0.1, 0.2, 0.3)))
    for text, words in (
        ("1,2,3,4,5", "5 numbers"),
        ("0,nan,0", "finite"),
        ("gripper", r"no \[tool.gripper\]"),
    ):
        with pytest.raises(ParameterError, match=words):
            read_pose(text, robot, "tool", "virtual-sensor.tool")
    path = tmp_path / "mine.toml"
    path.write_text(
        robot.path.read_text(encoding="utf-8") + "\n[tool.gripper]\nxyz = [0, 0, 0.15]\n"
    )
    named = read_pose("gripper", load_robot(path), "tool", "virtual-sensor.tool")
    np.testing.assert_array_equal(named.translation, [0.0, 0.0, 0.15])
