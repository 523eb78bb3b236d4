"""Commanded motions: geometry, derivatives, limits, and how well they excite."""

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import load_robot
from vftcli.signals.errors import ParameterError
from vftcli.simulation import load_scenario
from vftcli.simulation.trajectories import (
    CircleSpec,
    Command,
    HoldSpec,
    JointMovesSpec,
    JointwiseSpec,
    OffsetsSpec,
    PosesSpec,
    check_limits,
    flange_pose,
    plan,
)

SPECS = [
    CircleSpec(towards=-1.5),
    HoldSpec(),
    OffsetsSpec(moves=((0.5, 1.5, 0.1, 0.0, 0.05), (2.0, 3.0, 0.0, 0.0, 0.0)), length=3.5),
    JointMovesSpec(moves=((0.2, 1.5, 0.1, 0, 0.3, 0, 0, 0.2),), length=2.0),
    PosesSpec(count=3),
    JointwiseSpec(speeds=(0.4,)),
    load_scenario("free-excitation").trajectory,
]


@pytest.mark.parametrize("spec", SPECS, ids=lambda s: s.kind)
def test_derivatives_are_those_of_the_positions(spec: object) -> None:
    motion: Command = spec.motion(load_robot("ur5"))  # type: ignore[attr-defined]
    t, h = np.linspace(0.05, min(motion.duration, 6.0) - 0.05, 400), 1e-5
    here, before, after = motion.at(t), motion.at(t - h), motion.at(t + h)
    # central differences: h² times the third derivative (about 1e2), and rounding 1e-16/h
    np.testing.assert_allclose((after.q - before.q) / (2 * h), here.dq, atol=1e-7)
    np.testing.assert_allclose((after.dq - before.dq) / (2 * h), here.ddq, atol=2e-6)


def test_sweeps_go_out_across_and_back_one_joint_at_a_time() -> None:
    """.4 rad at .4 rad/s: 1 s out, 2 s across, 1 s back, .3 s of rest, joint after joint."""
    robot = load_robot("ur5")
    motion = JointwiseSpec(speeds=(0.4,)).motion(robot)
    assert motion.duration == pytest.approx(0.3 + 6 * 4.3)
    start = motion.at(np.array([0.0])).q
    for j in range(6):
        t = 0.3 + 4.3 * j + np.array([-0.1, 1.0, 2.0, 3.0, 4.1])
        away = np.zeros((5, 6))
        away[:, j] = [0.0, 0.4, 0.0, -0.4, 0.0]
        np.testing.assert_allclose(motion.at(t).q - start, away, atol=1e-9)


def test_circle_is_a_horizontal_circle_of_fixed_orientation() -> None:
    robot = load_robot("ur5")
    spec = CircleSpec(towards=-1.5)
    q = plan(spec, robot, np.linspace(0.0, 20.0, 101)).q
    poses = [flange_pose(robot.model, row) for row in q]
    points = np.array([p.translation for p in poses])
    centre = points[0] + 0.2 * np.array([np.cos(-1.5), np.sin(-1.5), 0.0])
    # the inverse kinematics stop at 1e-10; the series of 48 harmonics leaves 1e-9
    np.testing.assert_allclose(np.linalg.norm(points - centre, axis=1), 0.2, atol=1e-8)
    np.testing.assert_allclose(points[:, 2], points[0, 2], atol=1e-8)
    for pose in poses:
        np.testing.assert_allclose(pose.rotation, poses[0].rotation, atol=1e-8)
    np.testing.assert_allclose(q[0], q[20], atol=1e-9)


def regressor(robot, motion):
    """τ = Y π for inertial, rotor, viscous, dry and offset parameters. (T·n, 14n)"""
    data, blocks = robot.model.createData(), []
    for q, dq, ddq in zip(*motion, strict=True):
        rigid = pin.computeJointTorqueRegressor(robot.model, data, q, dq, ddq)
        drive = [np.diag(ddq), np.diag(dq), np.diag(np.tanh(dq / 0.01)), np.eye(robot.joints)]
        blocks.append(np.hstack([rigid, *drive]))
    return np.vstack(blocks)


def base_columns(robot):
    """Columns of the regressor that add to those before them, found on random states."""
    rng = np.random.default_rng(0)
    states = [rng.uniform(-scale, scale, (60, robot.joints)) for scale in (np.pi, 2.0, 5.0)]
    R = np.linalg.qr(regressor(robot, states), mode="r")
    kept, basis = [], np.zeros((len(R), 0))
    for j, column in enumerate(R.T):
        rest = column - basis @ (basis.T @ column)
        rest -= basis @ (basis.T @ rest)
        # dependent columns leave rounding, 1e-13 of the largest; independent ones 1e-3 or more
        if np.linalg.norm(rest) > 1e-8 * np.max(np.linalg.norm(R, axis=0)):
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
            kept.append(j)
    return kept


@pytest.mark.parametrize(
    ("name", "rank", "condition"),
    [("", 58, 13.9), ("panda-", 69, 10.1), ("fr3-load-", 69, 11.8)],
)
def test_excitation_is_well_conditioned_inside_the_limits(name, rank, condition):
    scenario = load_scenario(f"{name}free-excitation")
    robot, series = load_robot(scenario.robot), scenario.trajectory
    motion = series.motion(robot).at(np.linspace(0.0, series.period, 500, endpoint=False))
    check_limits(robot, motion.q, motion.dq, name)
    known = np.where(np.isfinite(robot.limits.qdd_max), robot.limits.qdd_max, np.inf)
    assert np.all(np.abs(motion.ddq) <= known)
    columns = base_columns(robot)
    assert len(columns) == rank  # of 14n: the ranks known for these arms
    Y = regressor(robot, motion)[:, columns]
    # the figures that stand in the files of the scenarios
    assert np.linalg.cond(Y / np.linalg.norm(Y, axis=0)) == pytest.approx(condition, abs=0.1)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        (["trajectory.radius=0.6"], "cannot reach"),
        (["trajectory.period=1.0"], "its limit is 3.14"),
        (["trajectory.radius=-0.1"], "must be positive"),
        (["trajectory.start=[0,0,0]"], "has 3 angles"),
        (
            ["robot=panda", "trajectory.start=[]", "trajectory.period=4"],
            "joint 1 of .panda. would move",
        ),
    ],
)
def test_impossible_circles_are_refused(settings: list[str], words: str) -> None:
    scenario = load_scenario("ur5-circle", settings)
    with pytest.raises(ParameterError, match=words):
        plan(scenario.trajectory, load_robot(scenario.robot), np.linspace(0, 4, 50))


def test_moves_out_of_order_are_refused() -> None:
    spec = OffsetsSpec(moves=((2.0, 1.0, 0.1, 0.0, 0.0),), length=3.0)
    with pytest.raises(ParameterError, match="times that increase"):
        spec.motion(load_robot("ur5"))
