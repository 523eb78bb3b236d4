"""A run: what the model says of a recording, of a part of it, and less an error of the model."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_urdfs import arm, link, robot, written

from vftcli.doctor.examination import Examiner
from vftcli.readers.aliases import UR_NAMES, UR_WORDS
from vftcli.readers.reader import ReadChoice
from vftcli.robots import load_robot
from vftcli.robots.run import SERIES, Run, RunSamples, paired, places, signal_edge, unwound
from vftcli.signals.errors import RobotError
from vftcli.signals.filters import low_pass
from vftcli.signals.recording import Recording

FIXTURE = Path(__file__).parents[2] / "fixtures" / "ur5_circle.csv"
UR, PANDA = load_robot("ur5"), load_robot("panda")
T = 0.002 * np.arange(2000)


def swing(speed: float = 1.0) -> Recording:
    """Six joints on smooth paths, with their own velocities and no current."""
    phase = speed * np.outer(T, np.linspace(0.4, 1.4, 6)) + np.arange(6.0)
    slope = speed * np.linspace(0.4, 1.4, 6)
    q = 0.5 * np.sin(phase) + np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2])
    return Recording(t=T, q=q, dq=0.5 * slope * np.cos(phase), current=np.zeros_like(q))


def test_the_model_s_torque_does_not_depend_on_the_currents():
    """It is what the motion takes; the drive's torque is what the currents say."""
    log = swing()
    quiet = Run(recording=log, robot=UR)
    driven = Run(recording=replace(log, current=np.ones_like(log.q)), robot=UR)
    np.testing.assert_allclose(driven.model_torque, quiet.model_torque, atol=1e-9)
    assert np.all(quiet.drive_torque == 0.0)
    assert np.all(driven.drive_torque != 0.0)


def test_a_joint_that_stands_is_marked():
    log = swing()
    dq = log.dq.copy()
    dq[500:800, 2] = 0.0
    run = Run(recording=replace(log, dq=dq), robot=UR)
    assert run.standstill[600, 2] == pytest.approx(0.6)
    assert run.standing[600].tolist() == [False, False, True, False, False, False]
    assert run.step == pytest.approx(0.002)


@pytest.mark.parametrize(("step", "edge", "path"), [(0.002, 12.0, 12.0), (0.05, 4.4, 4.0)])
def test_smooth_series_end_below_half_the_rate(step, edge, path):
    """At .22 and .2 of the rate of a slow log, so that its noise is left out."""
    log = replace(swing(), t=T * step / 0.002)
    run = Run(recording=log, robot=UR)
    assert (signal_edge(step), signal_edge(step, 4.0)) == pytest.approx((edge, 4.0))
    np.testing.assert_allclose(run.smooth_dq, low_pass(log.t, log.dq, path), atol=1e-9)


def test_a_part_of_a_run_keeps_what_belongs_to_joints():
    run = Run(recording=swing(), robot=UR)
    part = run.part(slice(100, 300))
    for name in ("t", "q", "dq", *SERIES):
        np.testing.assert_array_equal(getattr(part, name), getattr(run, name)[100:300])
    np.testing.assert_array_equal(part.dry_friction, run.dry_friction)
    assert part.name == run.name


NAMES = ("base_yaw", "shoulder_pitch", "elbow_pitch", "wrist_a", "wrist_b", "wrist_c")


FR3_NAMES = ("fr3_finger_1", *(f"fr3_joint{j}" for j in range(7, 0, -1)), "fr3_finger_2")


def test_a_coarse_run_holds_means_of_whole_blocks():
    """Of 33 000 samples of 1 ms, 8 in each; four and a third second are free."""
    t = 0.001 * np.arange(33_001)
    q = np.sin(np.outer(t, np.linspace(0.4, 1.4, 6)))
    dq = np.gradient(q, t, axis=0)
    log = Recording(t=t, q=q, dq=dq, current=np.ones_like(q))
    run = Run(recording=log, robot=UR).less(np.full_like(q, 2.0))
    free = RunSamples(run, (t >= 1.0) & (t < 5.333)).coarse
    coarse = free.run
    assert coarse.recording.samples == 33_000 // 8
    np.testing.assert_allclose(coarse.t[:2], [0.0035, 0.0115], rtol=1e-12)
    np.testing.assert_allclose(coarse.terms.mu[7], run.terms.mu[56:64].mean(axis=0), rtol=1e-12)
    np.testing.assert_allclose(coarse.q[-1], q[32_992:33_000].mean(axis=0), rtol=1e-12)
    assert np.count_nonzero(free.inside) == 541  # of 541.6 blocks those that are whole
    assert coarse.coarse is coarse


def log_of(names: tuple[str, ...]) -> Recording:
    """A log with j everywhere in column j. 10 samples"""
    t = 0.01 * np.arange(10)
    q = np.tile(np.arange(len(names), dtype=float), (10, 1))
    wrench = np.zeros((10, 6))
    return Recording(t=t, q=q, dq=q, torque=q, tau_ext=q, wrench=wrench, joint_names=names)


@pytest.mark.parametrize(
    ("logged", "joints", "expected"),
    [
        (("b", "finger", "a"), ("a", "b"), (2, 0)),
        (tuple(reversed(UR_NAMES)), UR.chain.names, (5, 4, 3, 2, 1, 0)),
        (("gripper", *(f"left_{name}" for name in UR_NAMES)), UR.chain.names, (1, 2, 3, 4, 5, 6)),
        (tuple(f"ns/{name}" for name in UR_NAMES), UR.chain.names, (0, 1, 2, 3, 4, 5)),
        (("Wrist 3", *UR_WORDS[:5]), UR.chain.names, (1, 2, 3, 4, 5, 0)),
        (FR3_NAMES, PANDA.chain.names, (7, 6, 5, 4, 3, 2, 1)),
        # Numbers of the log alone, from zero or one, and of the robot alone.
        (("axis_2", "axis_0", "axis_1"), NAMES[:3], (1, 2, 0)),
        (("A3", "A1", "A2"), ("lbr_joint_1", "lbr_joint_2", "lbr_joint_3"), (1, 2, 0)),
        (UR_NAMES, tuple(f"joint{j}" for j in range(1, 7)), (0, 1, 2, 3, 4, 5)),
    ],
)
def test_joints_are_found_by_name(logged, joints, expected):
    assert places(logged, joints) == expected


@pytest.mark.parametrize(
    ("logged", "joints"),
    [
        (NAMES, UR.chain.names),  # other names
        (NAMES[:5], NAMES),  # one is missing
        ((*NAMES, "base_yaw"), NAMES),  # one stands twice
        (("a_1", "a_2", "b_1", "b_2"), ("x", "y")),  # two arms
        (("joint1", "joint3", "joint4"), NAMES[:3]),  # a hole
        (("joint2", "joint3", "joint4"), NAMES[:3]),  # the first is missing
        (tuple(f"{side}_{name}" for side in "lr" for name in UR_NAMES), UR.chain.names),
    ],
)
def test_names_that_do_not_tell_find_nothing(logged, joints):
    assert places(logged, joints) is None


def test_every_joint_signal_follows_and_what_goes_is_said():
    shuffled = ("finger", "elbow_joint", "wrist_1_joint", "shoulder_pan_joint", "wrist_3_joint",
                "shoulder_lift_joint", "wrist_2_joint")  # fmt: skip
    log = paired(log_of(shuffled), UR)
    assert log.joint_names == UR_NAMES
    for signal in ("q", "dq", "torque", "tau_ext"):
        np.testing.assert_array_equal(log.require(signal)[0], [3, 5, 1, 2, 6, 4])
    assert log.require("wrench").shape == (10, 6)
    assert {r.code: r.values["joints"] for r in log.source.remarks} == {
        "joints-by-name": list(UR_NAMES),
        "joints-left-out": ["finger"],
    }
    assert paired(log, UR) is log


def test_names_that_do_not_cover_the_arm_are_refused_with_both_lists():
    words = r"wrist_c.*are not named as.*shoulder_pan.*\[\[joints\]\]"
    with pytest.raises(RobotError, match=words):
        paired(log_of(NAMES), UR)
    # Without names on either side the order stays.
    log = replace(log_of(NAMES), joint_names=())
    assert paired(log, UR) is log
    nameless = replace(UR, document={"joints": [{} for _ in range(6)]})
    named = log_of(NAMES)
    assert paired(named, nameless) is named


def test_a_log_of_the_motors_side_is_brought_to_the_joints_once():
    gear, efficiency = np.array([101.0, -50, 1, 1, 1, 1]), np.array([0.9, 1, 1, 1, 1, 1])
    robot = replace(UR, gear=gear, efficiency=efficiency)
    log = replace(log_of(NAMES), joint_names=(), current=np.ones((10, 6)))
    found = paired(log, robot)
    np.testing.assert_allclose(found.q, log.q / gear, rtol=1e-15)
    np.testing.assert_allclose(found.require("dq"), log.q / gear, rtol=1e-15)
    np.testing.assert_allclose(found.require("torque"), log.q * gear * efficiency, rtol=1e-15)
    np.testing.assert_array_equal(found.require("tau_ext"), log.q)
    np.testing.assert_array_equal(found.require("current"), np.ones((10, 6)))
    assert paired(found, robot) is found


def test_a_gear_is_read_from_the_robot_file(tmp_path):
    text = UR.path.read_text("utf-8").replace("mass = 3.7\n", "mass = 3.7\ngear = -101.0\n", 1)
    found = load_robot(written(tmp_path, text, "geared.toml"))
    np.testing.assert_array_equal(found.gear, [-101, 1, 1, 1, 1, 1])
    assert found.efficiency is None


def test_a_jump_of_a_turn_is_taken_back_and_said(tmp_path):
    arm6 = load_robot(written(tmp_path, robot(link("base"), arm(6, kind="continuous"))))
    t = np.arange(0.0, 8.0, 0.01)
    q = np.stack([(k - 2.5) * t for k in range(6)], axis=1)
    within = (q + np.pi) % (2.0 * np.pi) - np.pi
    log = Recording(t=t, q=within, target_q=within)
    found = unwound(log, arm6)
    np.testing.assert_allclose(found.q, q, atol=1e-13)  # rounding of a few turns
    np.testing.assert_allclose(found.target_q, q, atol=1e-13)
    (remark,) = found.source.remarks
    assert remark.where.joints == (1, 2, 3, 4, 5, 6)
    assert Examiner().read_as(log, arm6, ReadChoice()).source.remarks == (remark,)


def test_what_does_not_jump_is_the_log_itself(tmp_path):
    endless = load_robot(written(tmp_path, robot(link("base"), arm(5, kind="continuous"))))
    limited = replace(endless, endless=())
    jumping = Recording(t=np.array([0.0, 0.1]), q=np.array([[0.0] * 5, [6.0] * 5]))
    still = replace(jumping, q=np.zeros((2, 5)))
    missing = replace(jumping, q=np.array([[0.0] * 5, [np.nan] * 5]))
    for log, robot_ in ((jumping, limited), (still, endless), (missing, endless)):
        assert unwound(log, robot_) is log
