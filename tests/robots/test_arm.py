"""Which joints are the arm: fingers, rails and heads locked, hands left, two arms kept apart."""

from pathlib import Path

import pytest
from made_urdfs import (
    arm,
    barred,
    clawed,
    fingered,
    fixed,
    joint,
    link,
    mobile,
    robot,
    said,
    two_armed,
    written,
)

from vftcli.robots import Robot, load_robot
from vftcli.signals.errors import RobotError


def loaded(folder: Path, text: str, tip: str = "") -> Robot:
    return load_robot(written(folder, text), tip=tip)


def flange(found: Robot) -> object:
    return next(r.values["flange"] for r in found.remarks if "flange" in r.values)


def test_what_was_taken_and_locked_is_one_line(tmp_path):
    found = loaded(tmp_path, fingered())
    values = said(found, "arm-and-locked-used").values
    assert values["flange"] == "link8"
    assert values["locked"] == {"finger_joint1": 0.0, "finger_joint2": 0.0}
    assert values["lumped_kg"] == {"joint7": pytest.approx(0.76)}
    assert "locked finger_joint1, finger_joint2 at 0; lumped: 0.76 kg" in str(found.remarks[0])


def test_a_side_branch_of_the_arm_is_locked_and_said(tmp_path):
    found = loaded(tmp_path, mobile())
    assert said(found, "side-branch-locked").values["locked"] == ["piston_joint"]
    others = {"x_joint", "y_joint", "yaw_joint", "lift_joint", "head_joint"}
    assert set(said(found, "arm-and-locked-used").values["locked"]) == {*others, "piston_joint"}


def test_two_equal_arms_are_refused_with_their_tips_and_each_is_taken(tmp_path):
    """By name, whatever their order in the file."""
    with pytest.raises(RobotError, match="two arms of 7 joints: --tip left_link7 or --tip right"):
        loaded(tmp_path, two_armed())
    for side in ("left", "right"):
        names = tuple(f"{side}_joint{k}" for k in range(1, 8))
        for tip in (f"{side}_link7", f"{side}_joint7", f"{side}_tool0", f"{side}_tool0_mount"):
            found = loaded(tmp_path, two_armed(), tip)
            assert found.chain.names == names
            assert flange(found) == f"{side}_tool0"


def test_a_longer_arm_goes_before_a_shorter_one(tmp_path):
    text = robot(link("base"), arm(6, "long_"), arm(5, "short_"))
    assert loaded(tmp_path, text).chain.names[0] == "long_joint1"
    assert loaded(tmp_path, text, "short_link5").joints == 5


def test_a_tip_behind_the_hand_takes_the_finger_too(tmp_path):
    names = loaded(tmp_path, clawed(), "fingertip2").chain.names
    assert names[-3:] == ("joint6", "finger_2", "fingertip_2")


def test_a_tip_on_the_hand_moves_the_flange(tmp_path):
    assert flange(loaded(tmp_path, fingered(), "hand_tcp")) == "hand_tcp"
    finger = loaded(tmp_path, fingered(), "finger1")  # a locked joint between
    assert (flange(finger), finger.joints) == ("finger1", 7)


@pytest.mark.parametrize(
    ("tip", "words"),
    [
        ("left_tool", r"no link or joint .*mean left_tool0\? Tips: left_link7, left_tool0, r"),
        ("elbow", r"--tip 'elbow': no link or joint of that name\. Tips:"),
        ("base", r"--tip 'base': no arm leads there\. Tips: left_link7"),
    ],
)
def test_a_tip_that_does_not_exist_is_answered_with_those_that_do(tip, words, tmp_path):
    with pytest.raises(RobotError, match=words):
        loaded(tmp_path, two_armed(), tip)


def test_a_list_of_tips_is_no_longer_than_a_message(tmp_path):
    legs = [arm(2, f"leg{k:02}_") for k in range(20)]
    with pytest.raises(RobotError, match=r"20 arms of 2 joints: .*--tip leg11_link2 and 8 more$"):
        loaded(tmp_path, robot(link("base"), *legs))


def test_a_heavy_branch_is_a_second_arm_and_no_hand(tmp_path):
    """Five joints of a body, then two arms: each weighs more than a quarter of what is before."""
    text = robot(link("base"), arm(5), arm(4, "left_", "link5"), arm(4, "right_", "link5"))
    with pytest.raises(RobotError, match="two arms of 9 joints: --tip left_link4 or --tip right"):
        loaded(tmp_path, text)


def test_a_joint_within_the_arm_that_follows_another_is_refused(tmp_path):
    old, new = '<child link="link3"/>', '<child link="link3"/><mimic joint="joint2"/>'
    text = robot(link("base"), arm(6)).replace(old, new)
    with pytest.raises(RobotError, match=r"joint 'joint3' within the arm follows 'joint2' \(mi"):
        loaded(tmp_path, text)
    # A follower behind the last joint that moves by itself is not within it.
    jaw = [link("jaw", 0.1), joint("jaw_joint", "link6", "jaw", mimic='joint="joint1"')]
    assert loaded(tmp_path, robot(link("base"), arm(6), *jaw)).joints == 6


def test_of_two_runs_on_one_way_the_longer_is_the_arm(tmp_path):
    """Two joints of a base, a rail, three joints: a planar arm on a turning rail."""
    rail = [link("rail", 4.0), joint("rail_joint", "low_link2", "rail", "prismatic")]
    text = robot(link("base"), arm(2, "low_"), *rail, arm(3, "high_", "rail"))
    assert loaded(tmp_path, text).chain.names == tuple(f"high_joint{k}" for k in (1, 2, 3))


def test_the_flange_is_a_frame_of_a_usual_name_or_the_farthest(tmp_path):
    parts = [link("base"), arm(5), fixed("far", "link5", xyz="0 0 0.5")]
    assert flange(loaded(tmp_path, robot(*parts))) == "far"
    named = robot(*parts, fixed("my_attachment_site", "link5"))
    assert flange(loaded(tmp_path, named)) == "my_attachment_site"
    assert flange(loaded(tmp_path, barred())) == "bar"


def test_a_link_that_only_a_locked_branch_gives_mass_has_it(tmp_path):
    bare = link("link6", 0.0) + joint("joint6", "link5", "link6")
    text = robot(link("base"), arm(5), bare, fixed("hand", "link6", 0.5))
    assert load_robot(written(tmp_path, text)).chain.mass[-1] == 0.5
