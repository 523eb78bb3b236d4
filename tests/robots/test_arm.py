"""Which joints are the arm: fingers, rails and heads locked, hands left, two arms kept apart."""

from pathlib import Path

import numpy as np
import pytest
from made_urdfs import (
    SHAPES,
    arm,
    barred,
    clawed,
    fingered,
    fixed,
    joint,
    link,
    mobile,
    robot,
    two_armed,
    written,
)

from vftcli.robots import Robot, load_robot
from vftcli.robots.chain import nearest_tensor, unphysical
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import rotation_about


def loaded(folder: Path, text: str, tip: str = "") -> Robot:
    return load_robot(written(folder, text), tip=tip)


def said(robot: Robot, code: str) -> dict[str, object]:
    """The values of the robot's remark of a code."""
    (remark,) = (remark for remark in robot.remarks if remark.code == code)
    return dict(remark.values)


@pytest.mark.parametrize(
    ("shape", "count"),
    [("fingered", 7), ("knuckled", 7), ("barred", 6), ("clawed", 6), ("mobile", 6)],
)
def test_hands_and_bases_are_no_joints_of_the_arm(shape: str, count: int, tmp_path: Path) -> None:
    found = loaded(tmp_path, SHAPES[shape]())
    assert found.chain.names == tuple(f"joint{k}" for k in range(1, count + 1))


def test_what_was_taken_and_locked_is_one_line(tmp_path: Path) -> None:
    found = loaded(tmp_path, fingered())
    values = said(found, "arm-and-locked-used")
    assert values["flange"] == "link8"
    assert values["locked"] == {"finger_joint1": 0.0, "finger_joint2": 0.0}
    assert values["lumped_kg"] == {"joint7": pytest.approx(0.76)}
    assert str(found.remarks[0]) == (
        "fingered: 7 joints joint1, joint2, joint3, joint4, joint5, joint6, joint7, flange link8; "
        "locked finger_joint1, finger_joint2 at 0; lumped: 0.76 kg into joint7"
    )


def test_a_side_branch_of_the_arm_is_locked_and_said(tmp_path: Path) -> None:
    found = loaded(tmp_path, mobile())
    assert said(found, "side-branch-locked")["locked"] == ["piston_joint"]
    locked = said(found, "arm-and-locked-used")["locked"]
    assert isinstance(locked, dict)
    assert set(locked) == {
        "x_joint", "y_joint", "yaw_joint", "lift_joint", "head_joint", "piston_joint"
    }  # fmt: skip


def test_two_equal_arms_are_refused_with_their_tips_and_each_is_taken(tmp_path: Path) -> None:
    with pytest.raises(
        RobotError, match=r"two arms of 7 joints: --tip left_link7 or --tip right_link7$"
    ):
        loaded(tmp_path, two_armed())
    for side in ("left", "right"):
        names = tuple(f"{side}_joint{k}" for k in range(1, 8))
        for tip in (f"{side}_link7", f"{side}_joint7", f"{side}_tool0", f"{side}_tool0_mount"):
            found = loaded(tmp_path, two_armed(), tip)
            assert found.chain.names == names
            assert said(found, "arm-and-locked-used")["flange"] == f"{side}_tool0"


def test_a_longer_arm_goes_before_a_shorter_one(tmp_path: Path) -> None:
    text = robot(link("base"), arm(6, "long_"), arm(5, "short_"))
    assert loaded(tmp_path, text).chain.names[0] == "long_joint1"
    assert loaded(tmp_path, text, "short_link5").joints == 5


def test_a_tip_behind_the_hand_takes_the_finger_too(tmp_path: Path) -> None:
    names = loaded(tmp_path, clawed(), "fingertip2").chain.names
    assert names[-3:] == ("joint6", "finger_2", "fingertip_2")


def test_a_tip_on_the_hand_moves_the_flange(tmp_path: Path) -> None:
    assert said(loaded(tmp_path, fingered(), "hand_tcp"), "arm-and-locked-used")["flange"] == (
        "hand_tcp"
    )
    finger = loaded(tmp_path, fingered(), "finger1")  # a locked joint between
    assert said(finger, "arm-and-locked-used")["flange"] == "finger1"
    assert finger.joints == 7


def test_a_tip_that_does_not_exist_is_answered_with_those_that_do(tmp_path: Path) -> None:
    with pytest.raises(
        RobotError,
        match=r"--tip 'left_tool': no link or joint of that name\. Did you mean left_tool0\? "
        r"Tips: left_link7, left_tool0, right_link7, right_tool0$",
    ):
        loaded(tmp_path, two_armed(), "left_tool")
    with pytest.raises(RobotError, match=r"--tip 'elbow': no link or joint of that name\. Tips:"):
        loaded(tmp_path, two_armed(), "elbow")
    with pytest.raises(RobotError, match=r"--tip 'base': no arm leads there\. Tips: left_link7"):
        loaded(tmp_path, two_armed(), "base")


def test_a_list_of_tips_is_no_longer_than_a_message(tmp_path: Path) -> None:
    legs = [arm(2, f"leg{k:02}_") for k in range(20)]
    with pytest.raises(RobotError, match=r"20 arms of 2 joints: .*--tip leg11_link2 and 8 more$"):
        loaded(tmp_path, robot(link("base"), *legs))


def test_a_heavy_branch_is_a_second_arm_and_no_hand(tmp_path: Path) -> None:
    """Five joints of a body, then two arms: each weighs more than a quarter of what is before."""
    text = robot(link("base"), arm(5), arm(4, "left_", "link5"), arm(4, "right_", "link5"))
    with pytest.raises(
        RobotError, match="two arms of 9 joints: --tip left_link4 or --tip right_l"
    ):
        loaded(tmp_path, text)


def test_a_joint_within_the_arm_that_follows_another_is_refused(tmp_path: Path) -> None:
    old, new = '<child link="link3"/>', '<child link="link3"/><mimic joint="joint2"/>'
    with pytest.raises(
        RobotError, match=r"joint 'joint3' within the arm follows 'joint2' \(mimic"
    ):
        loaded(tmp_path, robot(link("base"), arm(6)).replace(old, new))


def test_a_single_jaw_that_is_followed_is_not_within_the_arm(tmp_path: Path) -> None:
    """The follower comes behind the last joint that moves by itself."""
    jaw = [link("jaw", 0.1), joint("jaw_joint", "link6", "jaw", mimic='joint="joint1"')]
    assert loaded(tmp_path, robot(link("base"), arm(6), *jaw)).joints == 6


@pytest.mark.parametrize("kind", ["prismatic", "planar", "floating", "fixed"])
def test_without_a_joint_that_turns_there_is_no_arm(kind: str, tmp_path: Path) -> None:
    text = robot(link("base"), link("one"), joint("slide", "base", "one", kind))
    with pytest.raises(RobotError, match="no moving joint; an arm needs revolute ones"):
        loaded(tmp_path, text)


def test_of_two_runs_on_one_way_the_longer_is_the_arm(tmp_path: Path) -> None:
    """Two joints of a base, a rail, three joints: a planar arm on a turning rail."""
    rail = [link("rail", 4.0), joint("rail_joint", "low_link2", "rail", "prismatic")]
    text = robot(link("base"), arm(2, "low_"), *rail, arm(3, "high_", "rail"))
    assert loaded(tmp_path, text).chain.names == tuple(f"high_joint{k}" for k in (1, 2, 3))


def test_the_flange_is_a_frame_of_a_usual_name_or_the_farthest(tmp_path: Path) -> None:
    far = fixed("far", "link5", xyz="0 0 0.5")
    plain = robot(link("base"), arm(5), far)
    assert said(loaded(tmp_path, plain), "arm-used")["flange"] == "far"
    named = robot(link("base"), arm(5), far, fixed("my_attachment_site", "link5"))
    assert said(loaded(tmp_path, named), "arm-used")["flange"] == "my_attachment_site"
    assert said(loaded(tmp_path, barred()), "arm-and-locked-used")["flange"] == "bar"


def test_a_locked_point_mass_is_added_by_the_parallel_axes(tmp_path: Path) -> None:
    """2 kg on a rail 0.3 m out of the last link: M = m₁ + m₂, centre and tensor by hand."""
    point = link("point", 2.0, (0, 0, 0, 0, 0, 0)).replace('xyz="0.02 -0.03 0.1"', 'xyz="0 0 0"')
    rail = joint("rail", "link5", "point", "prismatic", axis="1 0 0", xyz="0 0 0.1")
    plain = load_robot(written(tmp_path, robot(link("base"), arm(5)))).chain
    written(tmp_path, "lock = {rail = 0.3}", "railed.toml")
    text = robot(link("base"), arm(5), point, rail)
    loaded = load_robot(written(tmp_path, text, "railed.urdf")).chain
    m1, m2 = plain.mass[-1], 2.0
    assert loaded.mass[-1] == m1 + m2
    # The chain's frame is turned so that its z is the joint's axis; compare what no turn changes.
    own = np.array([0.02, -0.03, 0.1])
    centre = (m1 * own + m2 * np.array([0.3, 0.0, 0.1])) / (m1 + m2)
    assert np.linalg.norm(loaded.com[-1]) == pytest.approx(np.linalg.norm(centre), rel=1e-14)
    apart = np.sum((np.array([0.3, 0.0, 0.1]) - own) ** 2)
    more = 2.0 * m1 * m2 / (m1 + m2) * apart  # the trace of a reduced mass at that distance
    traces = np.trace(loaded.inertia[-1]) - np.trace(plain.inertia[-1])
    assert traces == pytest.approx(more, rel=1e-13)


def test_a_link_that_only_a_locked_branch_gives_mass_has_it(tmp_path: Path) -> None:
    bare = link("link6", 0.0) + joint("joint6", "link5", "link6")
    text = robot(link("base"), arm(5), bare, fixed("hand", "link6", 0.5))
    assert load_robot(written(tmp_path, text)).chain.mass[-1] == 0.5


def test_the_nearest_tensor_is_valid_and_no_farther_than_it_must_be() -> None:
    R = rotation_about("x", 0.4) @ rotation_about("z", -1.1)
    bad = R @ np.diag([1.0, 2.0, 4.0]) @ R.T
    assert "triangle" in unphysical(1.0, bad)
    assert not unphysical(1.0, bad, triangle=False)
    near = nearest_tensor(bad)
    assert not unphysical(1.0, near)
    np.testing.assert_allclose(near, R @ np.diag([1.5, 2.5, 4.0]) @ R.T, atol=1e-14)
    np.testing.assert_allclose(nearest_tensor(near), near, atol=1e-14)
    good = np.diag([1.0, 2.0, 2.5])
    assert nearest_tensor(good) is good
