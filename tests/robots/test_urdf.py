"""URDF: what is read and refused, and that Pinocchio reads the same."""

import re
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from made_urdfs import SHAPES, agrees_with_pinocchio, arm, joint, link, robot, written

from vftcli.robots import load_robot
from vftcli.robots.choice import RobotChoice
from vftcli.robots.kernels import momentum_terms
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
  <joint name="a" type="{kind}">
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


@pytest.mark.parametrize("kind", ["revolute", "continuous"])
def test_a_urdf_with_slanted_axes_ends_in_the_same_kernel(tmp_path: Path, kind: str) -> None:
    """Against Pinocchio on its own model of the URDF, whatever the axes."""
    path = written(tmp_path, URDF.format(kind=kind))
    robot = load_robot(path)
    model = pin.buildModelFromUrdf(str(path))
    data = model.createData()
    rng = np.random.default_rng(0)
    q, dq = rng.uniform(-1, 1, (2, 20, 2))
    terms = momentum_terms(robot.chain, q, dq)
    for k in range(20):
        full = q[k] if kind == "revolute" else [np.cos(q[k, 0]), np.sin(q[k, 0]), q[k, 1]]
        full = np.asarray(full)
        M = pin.crba(model, data, full)
        C = pin.computeCoriolisMatrix(model, data, full, dq[k])
        g = pin.computeGeneralizedGravity(model, data, full)
        # rounding of both sides
        np.testing.assert_allclose(terms.p[k], M @ dq[k], atol=1e-13)
        np.testing.assert_allclose(terms.coriolis_transpose_dq[k], C.T @ dq[k], atol=1e-13)
        np.testing.assert_allclose(terms.gravity[k], g, atol=1e-12)
    assert np.isnan(robot.limits.q_max[0]) == (kind == "continuous")


def test_a_toml_beside_the_urdf_adds_drives_friction_and_gains(tmp_path: Path) -> None:
    path = written(tmp_path, URDF.format(kind="revolute"))
    written(
        tmp_path,
        'torque_source = "current"\n[[joints]]\nname = "b"\ntorque_constant = 8.0\n'
        'rotor_inertia = 0.4\n[[joints]]\nname = "a"\ntorque_constant = 10.0\n'
        "[observers.gmo]\ngain = 12.0\n",
        "arm.toml",
    )
    robot = load_robot(path)
    assert robot.torque_constant is not None
    np.testing.assert_array_equal(robot.torque_constant, [10.0, 8.0])
    np.testing.assert_array_equal(robot.chain.rotor_inertia, [0.0, 0.4])
    assert robot.gains["gmo"]["gain"] == 12.0
    assert robot.limits.tau_max[1] == 20.0


def test_a_toml_beside_the_urdf_must_match_its_joints(tmp_path: Path) -> None:
    path = written(tmp_path, URDF.format(kind="revolute"))
    written(tmp_path, '[[joints]]\nname = "c"\nrotor_inertia = 1.0\n', "arm.toml")
    with pytest.raises(RobotError, match=r"no joint 'c' in arm\.urdf; it has a, b"):
        load_robot(path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<robot", "not a URDF, xacro or MJCF, which is XML: unclosed token"),
        ("<model/>", "its first element is <model>, not <robot> or <mujoco>"),
        ("<robot/>", "the <robot> is empty: it has no link and no joint"),
        ('<!DOCTYPE r [<!ENTITY a "1">]><robot/>', "defines XML entities"),
        ('<robot name="x"><link name="base"/></robot>', "no moving joint"),
        (URDF.format(kind="revolute").replace('value="3"', 'value="-3"'), "mass value is -3 kg"),
        (
            URDF.format(kind="revolute").replace('<parent link="one"/>', '<parent link="base"/>'),
            "two arms of 1 joint: --tip one or --tip two",
        ),
    ],
)
def test_a_urdf_that_is_no_serial_revolute_arm_is_refused(
    tmp_path: Path, text: str, words: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(RobotError, match=words) as error:
        load_robot(written(tmp_path, text))
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")  # the URDF parser's own words stand in the error


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('value="3"', 'value=""', "link 'one': mass value is ''; it must be a number"),
        ('value="3"', 'value="heavy"', "link 'one': mass value is 'heavy'; it must be a number"),
        ('value="3"', 'value="1,2,3"', "link 'one': mass value is '1,2,3'"),
        ('value="1.5"', 'value="1_5"', "link 'two': mass value is '1_5'"),
        ('value="3"', 'value="nan"', "link 'one': mass value is 'nan'"),
        ('value="3"', 'value="1e20"', "link 'one': mass value is 1e.20 kg; on a robot it is"),
        ('value="3"', 'kilograms="3"', "link 'one': <mass> has no value"),
        ('<mass value="3"/>', "", "link 'one': <inertial> has no <mass>"),
        ('ixx="0.03"', 'ixx="1 2 3 4"', "link 'one': inertia ixx is '1 2 3 4'; .* a number"),
        ('ixx="0.03" ', "", "link 'one': <inertia> has no ixx"),
        ('"0.1 0.2 0.05"', '"0.1 0.2"', "link 'one': origin xyz is .* it must be 3 numbers"),
        ('"0.2 0.1 0"', '"0 90 0"', "joint 'a': origin rpy is 90 rad; on a robot it is"),
        ('axis xyz="1 2 -0.5"', 'axis xyz="0 0 0"', "joint 'a': axis is '0 0 0'"),
        (
            'axis xyz="1 2 -0.5"',
            'axis xyz="1e154 2 0"',
            "joint 'a': axis is '1e154 2 0'; it must",
        ),
        ('axis xyz="1 2 -0.5"', 'axis xyz="z"', "joint 'a': axis xyz is 'z'; it must be 3"),
        ('lower="-1"', 'lower="-1rad"', "joint 'b': limit lower is '-1rad'"),
        ('<joint name="b"', '<joint name="a"', "two joints are named 'a'; each needs its own"),
    ],
)
def test_what_is_no_number_in_a_urdf_is_refused_by_its_link(
    tmp_path: Path, old: str, new: str, words: str, capfd: pytest.CaptureFixture[str]
) -> None:
    text = URDF.format(kind="revolute")
    assert text.count(old) >= 1
    with pytest.raises(RobotError, match=words) as error:
        load_robot(written(tmp_path, text.replace(old, new, 1)))
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")


def test_a_urdf_without_mass_is_refused(tmp_path: Path) -> None:
    text = re.sub(r"<inertial>.*?</inertial>", "", URDF.format(kind="revolute"), flags=re.DOTALL)
    with pytest.raises(RobotError, match="all moving bodies together weigh 0 kg"):
        load_robot(written(tmp_path, text))


@pytest.mark.parametrize("shape", SHAPES)
def test_every_shape_is_read_as_pinocchio_reads_it(shape: str, tmp_path: Path) -> None:
    text = SHAPES[shape]()
    agrees_with_pinocchio(text, load_robot(written(tmp_path, text)))


def test_a_joint_and_a_link_may_share_a_name(tmp_path: Path) -> None:
    text = robot(link("base"), arm(5)).replace('"joint3"', '"link3"')
    found = load_robot(written(tmp_path, text))
    assert found.chain.names == ("joint1", "joint2", "link3", "joint4", "joint5")


def test_what_a_urdf_leaves_out_has_its_default(tmp_path: Path) -> None:
    """No limit, no axis (x then), no origin."""
    bare = '<joint name="j" type="revolute"><parent link="base"/><child link="one"/></joint>'
    found = load_robot(written(tmp_path, robot(link("base"), link("one"), bare)))
    assert np.isnan(found.limits.q_min[0])
    assert np.isnan(found.limits.tau_max[0])
    np.testing.assert_allclose(found.chain.rotation[0][:, 2], [1.0, 0.0, 0.0], atol=1e-15)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (
            'type="fixed"',
            'type="welded"',
            "joint 'tool': type is 'welded'; it is one of revolute",
        ),
        ('<link name="hand">', "<link>", "link 'without a name': it needs a name"),
        ('<child link="hand"/>', "", "joint 'tool': <child> is missing, or names no link"),
        ('link="hand"', 'link="paw"', "joint 'tool': no link 'paw'"),
        ('<link name="hand">', '<link name="two">', "link 'two': another link has this name"),
        ('<child link="hand"/>', '<child link="two"/>', "link 'two' hangs on two joints"),
        (
            '<child link="hand"/>',
            '<child link="base"/>',
            "link 'base' is not connected with",
        ),
        ('<axis xyz="0 1 0"/>', "<mimic/>", "joint 'b': <mimic> names no joint"),
    ],
)
def test_links_and_joints_that_make_no_tree_are_refused(
    tmp_path: Path, old: str, new: str, words: str
) -> None:
    text = URDF.format(kind="revolute")
    assert old in text
    with pytest.raises(RobotError, match=words):
        load_robot(written(tmp_path, text.replace(old, new, 1)))


def test_a_circle_of_joints_is_refused(tmp_path: Path) -> None:
    parts = [link("one"), link("two"), joint("a", "one", "two"), joint("b", "two", "one")]
    with pytest.raises(RobotError, match="no link is the root: the joints make a circle"):
        load_robot(written(tmp_path, robot(*parts)))


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


def test_an_mjcf_is_pinocchio_s_model_of_it(tmp_path: Path) -> None:
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


def test_a_body_is_a_tip(tmp_path: Path) -> None:
    path = written(tmp_path, mjcf(), "arm.xml")
    assert load_robot(path, tip="link4").chain.names[-1] == "joint4"


def test_a_pendulum_is_an_arm_of_one_joint(tmp_path: Path) -> None:
    body = f'<body name="bob">{INERTIAL.format(1)}<joint name="swing" axis="0 1 0"/></body>'
    text = f"<mujoco><worldbody>{body}</worldbody></mujoco>"
    np.testing.assert_allclose(
        load_robot(written(tmp_path, text, "arm.xml")).chain.rotation[0][:, 2],
        [0, 1, 0],
        atol=1e-15,
    )


def test_the_friction_of_a_simulation_is_left_out_and_said(tmp_path: Path) -> None:
    path = written(tmp_path, mjcf('damping="20" frictionloss="0.3"'), "arm.xml")
    log = Recording(t=np.array([0.0, 0.1]), q=np.zeros((2, 5)))
    robot = RobotChoice(name=str(path)).load(log)
    assert robot.friction == ()
    (left,) = (r for r in robot.remarks if r.code == "simulator-friction-left")
    assert left.values["damping_Nms_rad"] == [0, 20, 0, 0, 0]
    arm = RobotChoice(name=str(path), friction="model").load(log)
    assert arm.friction[1].parameters == {"coulomb": 0.3, "viscous": 20.0}
    with pytest.raises(
        RobotError, match=r"model\.friction=model is what an MJCF gives its joints"
    ):
        RobotChoice(name="ur5", friction="model").load(log)
    damped = load_robot(str(written(tmp_path, mjcf('damping="20"'), "damped.xml")))
    assert "simulator-friction-left" in {remark.code for remark in damped.remarks}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("<mujoco/>", "no moving joint|Pinocchio can read"),
        (
            mjcf('axis="0 0 0"').replace('axis="1 1 0"', "", 1),
            "'joint2': its axis points nowhere",
        ),
        (mjcf('armature="-1"'), "joint 'joint2': armature is -1"),
        (mjcf().replace(TURN, 'xyaxes="1 0 0 2 0 0"', 1), "'joint1': its orientation is no rot"),
        (mjcf().replace('mass="4.0"', 'mass="1e9"'), "'joint1': mass is 1e.09 kg; on a robot"),
        (mjcf(extra='<include file="nowhere.xml"/>'), r"includes 'nowhere\.xml', which Pin"),
        ("<mujoco>" + "<body>" * 5000, "more than 500 elements within one another"),
        ('<!DOCTYPE m [<!ENTITY a "1">]><mujoco/>', "defines XML entities"),
    ],
)
def test_an_mjcf_that_is_no_arm_is_refused(
    text: str, words: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(RobotError, match=words) as error:
        load_robot(written(tmp_path, text, "arm.xml"))
    assert "\n" not in str(error.value)
    assert capfd.readouterr() == ("", "")  # the parser's own words stand in the error


def test_without_pinocchio_an_mjcf_is_refused_and_a_urdf_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from made_urdfs import fingered

    monkeypatch.setitem(sys.modules, "pinocchio", None)
    with pytest.raises(
        RobotError, match="an MJCF needs pin, which is not installed here: pip install pin"
    ):
        load_robot(written(tmp_path, mjcf(), "arm.xml"))
    assert load_robot(written(tmp_path, fingered())).joints == 7
