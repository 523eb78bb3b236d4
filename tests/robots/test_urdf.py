"""URDF: what is read and refused, and that Pinocchio reads the same."""

import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from made_urdfs import (
    SHAPES,
    agrees_with_pinocchio,
    arm,
    fingered,
    joint,
    link,
    robot,
    said,
    written,
)

from vftcli.robots import RobotChoice, load_robot
from vftcli.signals.errors import RobotError
from vftcli.signals.recording import Recording

URDF = """<robot name="slanted">
  <link name="base"/>
  <link name="one">
    <inertial><origin xyz="0.1 0.2 0.05" rpy="0.3 0 0"/><mass value="3"/>
      <inertia ixx="0.03" ixy="0.001" ixz="0" iyy="0.02" iyz="0.002" izz="0.025"/></inertial>
  </link>
  <link name="two">
    <inertial><origin xyz="0 0.1 0.1"/><mass value="1.5"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.008" iyz="0" izz="0.006"/></inertial>
  </link>
  <link name="hand">
    <inertial><mass value="0.4"/>
      <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
  </link>
  <joint name="a" type="revolute">
    <parent link="base"/><child link="one"/>
    <origin xyz="0 0 0.3" rpy="0.2 0.1 0"/><axis xyz="1 2 -0.5"/>
    <limit lower="-2" upper="2" velocity="3" effort="50"/>
  </joint>
  <joint name="b" type="revolute">
    <parent link="one"/><child link="two"/>
    <origin xyz="0.1 0 0.4" rpy="0 0.5 0"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" velocity="2" effort="20"/>
  </joint>
  <joint name="tool" type="fixed">
    <parent link="two"/><child link="hand"/><origin xyz="0 0 0.2"/>
  </joint>
</robot>
"""


def refused(folder: Path, text: str, words: str, capfd, name: str = "arm.urdf") -> None:
    """A description is refused in one line, in which the parser's own words stand."""
    with pytest.raises(RobotError, match=words) as error:
        load_robot(written(folder, text, name))
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


ONE_JOINT = link("base") + link("one") + joint("j", "base", "one")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<model/>", "its first element is <model>, not <robot> or <mujoco>"),
        ("<robot/>", "the <robot> is empty: it has no link and no joint"),
        ('<robot name="x"><link name="base"/></robot>', "no moving joint"),
        *(
            (robot(ONE_JOINT.replace("revolute", kind)), "no moving joint; an arm needs revolute")
            for kind in ("prismatic", "planar", "floating", "fixed")
        ),
        (robot(ONE_JOINT, joint("back", "one", "base")), "no link is the root: .* make a circle"),
        (robot(ONE_JOINT * 1001), "1001 joints; a robot has at most 1000"),
    ],
)
def test_a_urdf_that_is_no_arm_is_refused(text, words, tmp_path, capfd):
    refused(tmp_path, text, words, capfd)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('value="3"', 'value=""', "link 'one': mass value is ''; it must be a number"),
        ('value="3"', 'value="1,2,3"', "link 'one': mass value is '1,2,3'"),
        ('value="1.5"', 'value="1_5"', "link 'two': mass value is '1_5'"),
        ('value="3"', 'value="nan"', "link 'one': mass value is 'nan'"),
        ('value="3"', 'value="-3"', "mass value is -3 kg"),
        ('value="3"', 'value="1e20"', "link 'one': mass value is 1e.20 kg; on a robot it is"),
        ('value="3"', 'kilograms="3"', "link 'one': <mass> has no value"),
        ('<mass value="3"/>', "", "link 'one': <inertial> has no <mass>"),
        ('ixx="0.03"', 'ixx="1 2 3 4"', "link 'one': inertia ixx is '1 2 3 4'; .* a number"),
        ('ixx="0.03" ', "", "link 'one': <inertia> has no ixx"),
        ('"0.1 0.2 0.05"', '"0.1 0.2"', "link 'one': origin xyz is .* it must be 3 numbers"),
        ('"0.2 0.1 0"', '"0 90 0"', "joint 'a': origin rpy is 90 rad; on a robot it is"),
        ('axis xyz="1 2 -0.5"', 'axis xyz="0 0 0"', "joint 'a': axis is '0 0 0'"),
        ('axis xyz="1 2 -0.5"', 'axis xyz="1e154 2 0"', "joint 'a': axis is '1e154 2 0'"),
        ('lower="-1"', 'lower="-1rad"', "joint 'b': limit lower is '-1rad'"),
        ('<joint name="b"', '<joint name="a"', "two joints are named 'a'; each needs its own"),
        ('<parent link="one"/>', '<parent link="base"/>', "two arms of 1 joint: --tip one or"),
        ('type="fixed"', 'type="welded"', "joint 'tool': type is 'welded'; it is one of"),
        ('<link name="hand">', "<link>", "link 'without a name': it needs a name"),
        ('<child link="hand"/>', "", "joint 'tool': <child> is missing, or names no link"),
        ('link="hand"', 'link="paw"', "joint 'tool': no link 'paw'"),
        ('<link name="hand">', '<link name="two">', "link 'two': another link has this name"),
        ('<child link="hand"/>', '<child link="two"/>', "link 'two' hangs on two joints"),
        ('<child link="hand"/>', '<child link="base"/>', "link 'base' is not connected with"),
        ('<axis xyz="0 1 0"/>', "<mimic/>", "joint 'b': <mimic> names no joint"),
    ],
)
def test_a_urdf_with_an_error_is_refused_by_the_part(tmp_path, old, new, words, capfd):
    assert old in URDF
    refused(tmp_path, URDF.replace(old, new, 1), words, capfd)


@pytest.mark.parametrize(
    ("shape", "count"),
    [("fingered", 7), ("knuckled", 7), ("barred", 6), ("clawed", 6), ("mobile", 6)],
)
def test_every_shape_is_read_as_pinocchio_reads_it(shape, count, tmp_path):
    text = SHAPES[shape]()
    found = load_robot(written(tmp_path, text))
    assert found.chain.names == tuple(f"joint{k}" for k in range(1, count + 1))
    agrees_with_pinocchio(text, found)
    assert np.isnan(found.limits.q_max).all() == (shape == "knuckled")  # endless joints


def test_a_joint_and_a_link_may_share_a_name(tmp_path):
    text = robot(link("base"), arm(5)).replace('"joint3"', '"link3"')
    found = load_robot(written(tmp_path, text))
    assert found.chain.names == ("joint1", "joint2", "link3", "joint4", "joint5")


def test_what_a_urdf_leaves_out_has_its_default(tmp_path):
    """No limit, no axis (x then), no origin."""
    bare = '<joint name="j" type="revolute"><parent link="base"/><child link="one"/></joint>'
    found = load_robot(written(tmp_path, robot(link("base"), link("one"), bare)))
    assert np.isnan(found.limits.q_min[0])
    assert np.isnan(found.limits.tau_max[0])
    np.testing.assert_allclose(found.chain.rotation[0][:, 2], [1.0, 0.0, 0.0], atol=1e-15)


INERTIAL = '<inertial mass="{}" pos="0.02 -0.01 0.1" diaginertia="0.02 0.018 0.01"/>'
TURN = 'quat="0.9 0.1 0.2 0.3"'


def mjcf(joint: str = "", hand: str = "", extra: str = "") -> str:
    """An arm of five hinges: `joint` holds attributes of the second one, `hand` stands on it."""
    text, ends = "", ""
    for k in range(1, 6):
        axis = ("0 0 1", "0 1 0", "1 1 0")[k % 3]
        own = joint if k == 2 else ""
        text += (
            f'<body name="link{k}" pos="0.05 0 0.2" {TURN}>{INERTIAL.format(4 / k)}'
            f'<joint name="joint{k}" axis="{axis}" range="-90 90" {own}/>'
        )
        ends += "</body>"
    site = '<site name="attachment_site" pos="0 0 0.1"/>'
    return (
        f'<mujoco model="made">{extra}<worldbody><body name="base">{text}{site}{hand}{ends}'
        "</body></worldbody></mujoco>"
    )


HAND = "".join(
    f'<body name="finger{k}" pos="0 0 0.1">{INERTIAL.format(0.05)}'
    f'<joint name="slide{k}" type="slide" axis="0 1 0"/></body>'
    for k in (1, 2)
)


def test_an_mjcf_is_pinocchio_s_model_of_it(tmp_path):
    """Two sliding fingers are locked, the site is the flange, the armature the rotor's inertia."""
    path = written(tmp_path, mjcf('armature="0.4"', HAND), "arm.mjcf.xml")
    found = load_robot(path)
    assert found.chain.names == tuple(f"joint{k}" for k in range(1, 6))
    np.testing.assert_array_equal(found.chain.rotor_inertia, [0, 0.4, 0, 0, 0])
    np.testing.assert_allclose(found.limits.q_max, np.pi / 2)
    assert found.remarks[0].values["flange"] == "attachment_site"
    assert set(found.remarks[0].values["locked"]) == {"slide1", "slide2"}
    model = pin.buildModelFromMJCF(str(path))
    locked = [model.getJointId(name) for name in ("slide1", "slide2")]
    theirs = pin.buildReducedModel(model, locked, pin.neutral(model))
    ours = found.chain.to_pinocchio()
    for q, v, a in np.random.default_rng(0).uniform(-2, 2, (10, 3, 5)):
        expected = pin.rnea(theirs, theirs.createData(), q, v, a)
        np.testing.assert_allclose(
            pin.rnea(ours, ours.createData(), q, v, a), expected, atol=1e-12
        )


def test_a_body_is_a_tip_and_a_pendulum_an_arm_of_one_joint(tmp_path):
    path = written(tmp_path, mjcf(), "arm.xml")
    assert load_robot(path, tip="link4").chain.names[-1] == "joint4"
    body = f'<body name="bob">{INERTIAL.format(1)}<joint name="swing" axis="0 1 0"/></body>'
    text = f"<mujoco><worldbody>{body}</worldbody></mujoco>"
    turn = load_robot(written(tmp_path, text, "arm.xml")).chain.rotation[0]
    np.testing.assert_allclose(turn[:, 2], [0, 1, 0], atol=1e-15)


def test_the_friction_of_a_simulation_is_left_out_and_said(tmp_path):
    path = written(tmp_path, mjcf('damping="20" frictionloss="0.3"'), "arm.xml")
    log = Recording(t=np.array([0.0, 0.1]), q=np.zeros((2, 5)))
    robot = RobotChoice(name=str(path)).load(log)
    assert robot.friction == ()
    assert said(robot, "simulator-friction-left").values["damping_Nms_rad"] == [0, 20, 0, 0, 0]
    arm = RobotChoice(name=str(path), friction="model").load(log)
    assert arm.friction[1].parameters == {"coulomb": 0.3, "viscous": 20.0}
    with pytest.raises(RobotError, match=r"model\.friction=model is what an MJCF gives"):
        RobotChoice(name="ur5", friction="model").load(log)
    assert said(load_robot(written(tmp_path, mjcf('damping="20"'), "damped.xml")),
                "simulator-friction-left")  # fmt: skip


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<mujoco/>", "no moving joint|Pinocchio can read"),
        (mjcf('axis="0 0 0"').replace('axis="1 1 0"', "", 1), "'joint2': its axis points nowh"),
        (mjcf('armature="-1"'), "joint 'joint2': armature is -1"),
        (mjcf().replace(TURN, 'xyaxes="1 0 0 2 0 0"', 1), "'joint1': its orientation is no rot"),
        (mjcf().replace('mass="4.0"', 'mass="1e9"'), "'joint1': mass is 1e.09 kg; on a robot"),
        (mjcf(extra='<include file="nowhere.xml"/>'), r"includes 'nowhere\.xml', which Pin"),
        ("<mujoco>" + "<body>" * 5000, "more than 500 elements within one another"),
        ('<mujoco><body quat="0 0 0 0"/></mujoco>', "body quat is of zeros only"),
        # Pinocchio would take 20 GB for it.
        (f"<mujoco>{'<body><joint/></body>' * 1000}</mujoco>", "has 1000 joints, more than 250"),
        ("<mujocoinclude/>", "a part of an MJCF; take the file that includes it"),
        ("<sdf version='1.9'/>", "an SDF; take the robot's URDF, or convert it"),
        ("<COLLADA/>", "a mesh; take the URDF that names it"),
    ],
)
def test_an_mjcf_that_is_no_arm_is_refused(text, words, tmp_path, capfd):
    refused(tmp_path, text, words, capfd, "arm.xml")


def test_without_pinocchio_an_mjcf_is_refused_and_a_urdf_is_read(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(RobotError, match=r"an MJCF needs pin, which is not .*: pip install pin"):
        load_robot(written(tmp_path, mjcf(), "arm.xml"))
    assert load_robot(written(tmp_path, fingered())).joints == 7
