"""Commanded motions: geometry, derivatives, limits, and how well they excite."""

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import load_robot
from vftcli.robots.robot import FlangeSolver
from vftcli.signals.errors import ParameterError
from vftcli.simulation import load_scenario
from vftcli.simulation.trajectories import (
    HOMES,
    CircleSpec,
    Command,
    ExcitationSpec,
    HoldSpec,
    JointMovesSpec,
    OffsetsSpec,
    check_start,
    plan,
)

SPECS = [
    CircleSpec(towards=-1.5),
    HoldSpec(),
    OffsetsSpec(moves=((0.5, 1.5, 0.1, 0.0, 0.05), (2.0, 3.0, 0.0, 0.0, 0.0)), length=3.5),
    JointMovesSpec(moves=((0.2, 1.5, 0.1, 0, 0.3, 0, 0, 0.2),), length=2.0),
    load_scenario("free-excitation").trajectory,
]


def test_the_usual_poses_are_those_of_the_paper_and_of_franka() -> None:
    """The start of the circle, and Franka's: 0, −π/4, 0, −3π/4, 0, π/2, π/4 to four digits."""
    np.testing.assert_array_equal(HOMES[6], load_scenario("ur5-circle").trajectory.start)
    ready = np.pi * np.array([0, -1, 0, -3, 0, 2, 1]) / 4.0
    np.testing.assert_allclose(HOMES[7], ready, atol=5e-5)


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_a_pose_nearby_is_reached(name: str) -> None:
    robot = load_robot(name)
    home, solver = check_start(robot, ()), FlangeSolver(robot, 1e-10)
    # the flange looks down, to the four digits of the angles
    np.testing.assert_allclose(solver.pose(home).rotation[:, 2], [0, 0, -1], atol=2e-4)
    goal = solver.pose(home + 0.1)
    found, good = solver.reach(*goal, home)
    assert good
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, found)
    frame = data.oMf[robot.model.getFrameId("flange")]
    # the iteration stops at an error twist of 1e-10
    np.testing.assert_allclose(frame.translation, goal.translation, atol=1e-9)
    np.testing.assert_allclose(frame.rotation, goal.rotation, atol=1e-9)


@pytest.mark.parametrize("spec", SPECS, ids=lambda s: s.kind)
def test_derivatives_are_those_of_the_positions(spec: object) -> None:
    motion: Command = spec.motion(load_robot("ur5"))  # type: ignore[attr-defined]
    t, h = np.linspace(0.05, min(motion.duration, 6.0) - 0.05, 400), 1e-5
    here, before, after = motion.at(t), motion.at(t - h), motion.at(t + h)
    # central differences: h² times the third derivative (about 1e2), and rounding 1e-16/h
    np.testing.assert_allclose((after.q - before.q) / (2 * h), here.dq, atol=1e-7)
    np.testing.assert_allclose((after.dq - before.dq) / (2 * h), here.ddq, atol=2e-6)


def test_circle_is_a_horizontal_circle_of_fixed_orientation() -> None:
    robot = load_robot("ur5")
    spec = CircleSpec(towards=-1.5)
    q = plan(spec, robot, np.linspace(0.0, 20.0, 101)).q
    poses = list(map(FlangeSolver(robot).pose, q))
    centre = poses[0].translation + 0.2 * np.array([np.cos(-1.5), np.sin(-1.5), 0.0])
    # counterclockwise, a round in 4 s, from opposite to where the centre is
    angle = np.pi - 1.5 + 2.0 * np.pi * np.linspace(0.0, 5.0, 101)
    points = centre + 0.2 * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    # the inverse kinematics stop at 1e-10; the series of 48 harmonics leaves 1e-9
    np.testing.assert_allclose([p.translation for p in poses], points, atol=1e-8)
    for pose in poses:
        np.testing.assert_allclose(pose.rotation, poses[0].rotation, atol=1e-8)
    np.testing.assert_allclose(q[[0, 20]], [check_start(robot, ())] * 2, atol=1e-9)
    assert spec.motion(robot).duration == 20.0


# of a minimum-jerk move after a quarter of its time: 10/64 − 15/256 + 6/1024
MIDWAY = 0.103515625


def test_moves_lead_straight_to_where_they_say() -> None:
    """The flange on lines without turning, the joints by their displacements."""
    robot = load_robot("ur5")
    t, way = np.array([0.0, 0.5, 0.75, 1.25, 1.5, 1.9]), [0, 0, MIDWAY, 1 - MIDWAY, 1, 1]
    line, joints = SPECS[2], SPECS[3]
    back = line.motion(robot).at(np.array([2.25, 3.0, 9.0])).q  # type: ignore[attr-defined]
    q = np.vstack([line.motion(robot).at(t).q, back])  # type: ignore[attr-defined]
    home, *poses = map(FlangeSolver(robot).pose, q)
    for pose, share in zip(poses, [*way[1:], 1 - MIDWAY, 0, 0], strict=True):
        # a polynomial of degree 16 for the joints leaves less than a nanometre
        away = home.translation + share * np.array([0.1, 0.0, 0.05])
        np.testing.assert_allclose(pose.translation, away, atol=1e-9)
        np.testing.assert_allclose(pose.rotation, home.rotation, atol=1e-9)
    q = joints.motion(robot).at(0.2 + 1.3 * (t - 0.5)).q  # type: ignore[attr-defined]
    np.testing.assert_allclose(q - q[0], np.outer(way, [0.1, 0, 0.3, 0, 0, 0.2]), atol=1e-12)


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
    ("name", "rank", "condition"), [("", 58, 13.9), ("panda-", 69, 10.1), ("fr3-load-", 69, 11.8)]
)
def test_excitation_is_well_conditioned_inside_the_limits(name, rank, condition):
    scenario = load_scenario(f"{name}free-excitation")
    robot, series = load_robot(scenario.robot), scenario.trajectory
    motion = plan(series, robot, np.linspace(0.0, series.period, 500, endpoint=False))
    known = np.where(np.isfinite(robot.limits.qdd_max), robot.limits.qdd_max, np.inf)
    assert np.all(np.abs(motion.ddq) <= known)
    columns = base_columns(robot)
    assert len(columns) == rank  # of 14n: the ranks known for these arms
    Y = regressor(robot, motion)[:, columns]
    # the figures that stand in the files of the scenarios
    assert np.linalg.cond(Y / np.linalg.norm(Y, axis=0)) == pytest.approx(condition, abs=0.1)


def test_a_circle_about_the_base_winds_its_joint_up() -> None:
    robot = load_robot("ur5")
    x, y, _ = FlangeSolver(robot).pose(check_start(robot, ())).translation
    about = CircleSpec(radius=float(np.hypot(x, y)), towards=float(np.arctan2(-y, -x)))
    with pytest.raises(ParameterError, match="winds a joint up"):
        about.motion(robot)


ROW, SHORT = (0.1,) * 6, (0.1,) * 5


def moves(*times: tuple[float, float]) -> JointMovesSpec:
    return JointMovesSpec(moves=tuple((*span, *ROW) for span in times), length=2.0)


@pytest.mark.parametrize(
    ("spec", "words"),
    [
        (JointMovesSpec(moves=((0.0, 1.0, *SHORT),), length=1.0), "two times and 6 displacemen"),
        (moves(), "times that increase"),
        (moves((-0.1, 1.0)), "times that increase"),
        (moves((1.0, 2.1)), "times that increase"),
        (moves((0.0, 1.0), (0.9, 2.0)), "times that increase"),
        (moves((1.0, 1.0)), "times that increase"),
        (ExcitationSpec(mean=ROW, cosine=(ROW,), sine=(SHORT,)), "must have 6 numbers"),
        (ExcitationSpec(mean=SHORT, cosine=(ROW,), sine=(ROW,)), "must have 6 numbers"),
        (ExcitationSpec(mean=ROW, cosine=(ROW, ROW), sine=(ROW,)), "as many rows"),
        (ExcitationSpec(mean=ROW, cosine=(ROW,), sine=(ROW,), period=0.0), "must be positive"),
    ],
)
def test_impossible_motions_are_refused(spec: object, words: str) -> None:
    with pytest.raises(ParameterError, match=words):
        spec.motion(load_robot("ur5"))  # type: ignore[attr-defined]
    moves((0.0, 1.0), (1.0, 2.0)).motion(load_robot("ur5"))
