"""Users' own robot files: what is accepted, and that a complaint names the line that is wrong."""

import re
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from vftcli.robots import load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.urdf import chain_from_model
from vftcli.signals.errors import RobotError

HEAD = """schema = 1
name = "planar"
dof = 2
convention = "xyz-rpy"
torque_source = "joint_torque"

"""

JOINT = """[[joints]]
name = "{}"
xyz = {}
rpy = {}
mass = {}
com = {}
inertia = {}
"""

FRICTION = """[joints.friction]
model = "coulomb-viscous"
coulomb = 1.0
viscous = 0.5
"""

TENSORS = ([0.001, 0.0, 0.0, 0.02, 0.0, 0.02], [0.001, 0.0, 0.0, 0.01, 0.0, 0.01])
SHOULDER = JOINT.format(
    "shoulder", [0.0, 0.0, 0.1], [np.pi / 2, 0.0, 0.0], 2.0, [0.25, 0.0, 0.0], TENSORS[0]
)
ELBOW = JOINT.format("elbow", [0.5, 0.0, 0.0], [0.0] * 3, 1.0, [0.2, 0.0, 0.0], TENSORS[1])
TWO_LINKS = HEAD + SHOULDER + "\n" + ELBOW + FRICTION


def written(folder: Path, text: str, name: str = "arm.toml") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def test_a_planar_arm_weighs_what_the_textbook_says(tmp_path: Path) -> None:
    """g₂ = m₂g·l_c2·cos(q₁+q₂), g₁ = (m₁l_c1 + m₂l₁)g·cos q₁ + g₂ for a vertical two-link arm."""
    robot = load_robot(written(tmp_path, TWO_LINKS))
    q = np.array([[0.3, -0.8]])
    gravity = momentum_terms(robot.chain, q, np.zeros((1, 2))).gravity[0]
    second = 1.0 * 9.81 * 0.2 * np.cos(0.3 - 0.8)
    first = (2.0 * 0.25 + 1.0 * 0.5) * 9.81 * np.cos(0.3) + second
    np.testing.assert_allclose(gravity, [first, second], rtol=1e-14)
    assert [f.model for f in robot.friction] == ["none", "coulomb-viscous"]


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("mass = 1.0", "mass = -1.0", r"line 19: joint 2 \(elbow\): mass is -1 kg"),
        ("mass = 1.0", "mas = 1.0", r"line 15: joint 2 \(elbow\): mass is missing"),
        (
            "inertia = [0.001, 0.0, 0.0, 0.01, 0.0, 0.01]",
            "inertia = [0.1, 0.0, 0.0, 0.01, 0.0, 0.01]",
            r"line 21: joint 2 \(elbow\): inertia breaks the triangle inequality",
        ),
        (
            "inertia = [0.001, 0.0, 0.0, 0.01, 0.0, 0.01]",
            "inertia = [0.01, 0.02, 0.0, 0.01, 0.0, 0.01]",
            r"line 21: joint 2 \(elbow\): inertia has the negative principal moment",
        ),
        ("com = [0.2, 0.0, 0.0]", "com = [0.2, 0.0]", "line 20: .*com is .* 3 finite numbers"),
        ("mass = 1.0", 'mass = "one"', "line 19: .*mass is 'one'; it must be a finite number"),
        ("mass = 1.0", "mass = nan", "line 19: .*mass is nan; it must be a finite number"),
        ("dof = 2", "dof = 3", r"line 3: dof is 3 but the file has 2 \[\[joints\]\] tables"),
        ('"xyz-rpy"', '"dh"', "line 4: convention is 'dh'; it is one of standard-dh, modified-dh"),
        ("joint_torque", "amps", "line 5: torque_source is 'amps'"),
        ('"joint_torque"', '"current"', "line 7: joint 1 .*torque_constant is missing"),
        ("coulomb-viscous", "sticky", "line 23: joint 2 .*: model is 'sticky'"),
        ("viscous = 0.5", "vicous = 0.5", "line 22: joint 2 .*viscous is missing"),
        ("schema = 1", "schema = 2", "line 1: schema is 2; this version reads schema 1"),
        ("dof = 2", "dof = = 2", r"not valid TOML: .*line 3"),
        ("dof = 2", "dof = true", "line 3: dof is True but"),
        ("dof = 2", f"dof = {'9' * 5000}", "not valid TOML: Exceeds the limit"),
        ("dof = 2", f"x = {'[' * 5000}", "not valid TOML: nested too deep"),
        ('name = "planar"', "name = 3", "line 2: name is 3; it must be text in quotes"),
        ('name = "planar"', "notes = nan", "line 2: notes is nan; it must be text in quotes, or"),
        ('name = "planar"', "sources = [3]", r"line 2: sources is \[3\]; it must be tables"),
        ('name = "planar"', 'flange_d = ["a", "b"]', "line 2: flange_d is .* a finite number"),
        ('name = "planar"', "ee_rpy = [0, 180, 0]", "line 2: ee_rpy is 180 rad; on a robot it"),
        ('"xyz-rpy"', "[]", r"line 4: convention is \[\]; it is one of standard-dh"),
        ('"coulomb-viscous"', "[]", r"line 23: joint 2 \(elbow\): model is \[\]; it is one of"),
        ('"coulomb-viscous"', "{}", r"line 23: joint 2 \(elbow\): model is {}; it is one of"),
        ('"elbow"', '"shoulder"', "line 16: joint 2 .*: name is 'shoulder', as another joint's"),
        ("mass = 1.0", "mass = 1e308", r"line 19: .*mass is 1e\+308 kg; on a robot it lies"),
        ("mass = 1.0", f"mass = {10**400}", "line 19: .*mass is 1000.*; it must be a finite"),
        ("viscous = 0.5", "viscous = 1e20", r"line 25: .*viscous is 1e\+20 N·m·s/rad; on a robot"),
        ("coulomb = 1.0", f"coulomb = {10**20}", "line 24: .*coulomb is 1e.20 N·m; on a robot"),
        ("mass = 1.0", "mass = 1.0\nrotor_inertia = 1e308", "line 20: .*rotor_inertia is 1e.308"),
        ("mass = 1.0", "mass = 1.0\nq_min = 1\nq_max = 0", "q_min is 1 rad, not below q_max 0"),
        ("viscous = 0.5", "viscous = 0.5\n[observers.gmo]\ngain = nan", "line 27: gain is nan; it"),
        ("viscous = 0.5", "viscous = 0.5\n[observers]\ngmo = 3", "line 27: gmo must be a section"),
        ("viscous = 0.5", "viscous = 0.5\n[admittance]\nperiod = true", "line 27: period is True"),
        (
            "viscous = 0.5",
            "viscous = 0.5\n[admittance]\nmass = 3",
            "line 27: no key 'mass'; it has",
        ),
        ("viscous = 0.5", "viscous = 0.5\n[admittance]\nstart = 3", "line 27: start is 3; it must"),
        (
            "viscous = 0.5",
            "viscous = 0.5\n[admittance.position]\nmass = [nan]",
            r"line 27: mass is \[nan\]; it must be a number or one an axis",
        ),
        ("dof = 2", "payload = 2", r"line 3: payload must be a section \[payload\]"),
    ],
)
def test_a_complaint_names_the_line(tmp_path: Path, old: str, new: str, words: str) -> None:
    with pytest.raises(RobotError, match=words) as caught:
        load_robot(written(tmp_path, TWO_LINKS.replace(old, new)))
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_a_binary_one_are_refused(tmp_path: Path) -> None:
    with pytest.raises(RobotError, match="no such robot file"):
        load_robot(tmp_path / "nowhere.toml")
    (tmp_path / "noise.toml").write_bytes(bytes(range(128, 256)))
    with pytest.raises(RobotError, match="not text"):
        load_robot(tmp_path / "noise.toml")
    with pytest.raises(RobotError, match="no such robot file"):
        load_robot(tmp_path / "nowhere.urdf")


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
    path = written(tmp_path, URDF.format(kind=kind), "arm.urdf")
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
    path = written(tmp_path, URDF.format(kind="revolute"), "arm.urdf")
    written(
        tmp_path,
        'torque_source = "current"\n[[joints]]\nname = "b"\ntorque_constant = 8.0\n'
        'rotor_inertia = 0.4\n[[joints]]\nname = "a"\ntorque_constant = 10.0\n'
        "[observers.gmo]\ngain = 12.0\n",
    )
    robot = load_robot(path)
    assert robot.torque_constant is not None
    np.testing.assert_array_equal(robot.torque_constant, [10.0, 8.0])
    np.testing.assert_array_equal(robot.chain.rotor_inertia, [0.0, 0.4])
    assert robot.gains["gmo"]["gain"] == 12.0
    assert robot.limits.tau_max[1] == 20.0


def test_a_toml_beside_the_urdf_must_match_its_joints(tmp_path: Path) -> None:
    path = written(tmp_path, URDF.format(kind="revolute"), "arm.urdf")
    written(tmp_path, '[[joints]]\nname = "c"\nrotor_inertia = 1.0\n')
    with pytest.raises(RobotError, match="no joint 'c' in the URDF; it has a, b"):
        load_robot(path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (URDF.format(kind="prismatic"), "joint 'a' is a .*not revolute"),
        ("<robot", "not a URDF, which is XML: unclosed token"),
        ("<model/>", "its first element is <model>, not <robot>"),
        ('<!DOCTYPE r [<!ENTITY a "1">]><robot/>', "defines XML entities"),
        ('<robot name="x"><link name="base"/></robot>', "no moving joint"),
        (URDF.format(kind="revolute").replace('value="3"', 'value="-3"'), "mass value is -3 kg"),
        (
            URDF.format(kind="revolute").replace('<parent link="one"/>', '<parent link="base"/>'),
            "branches off",
        ),
    ],
)
def test_a_urdf_that_is_no_serial_revolute_arm_is_refused(
    tmp_path: Path, text: str, words: str, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(RobotError, match=words) as caught:
        load_robot(written(tmp_path, text, "arm.urdf"))
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")  # the URDF parser's own words stand in the error


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('value="3"', 'value=""', "link 'one': mass value is ''; it must be a number"),
        ('value="3"', 'value="heavy"', "link 'one': mass value is 'heavy'; it must be a number"),
        ('value="3"', 'value="1,2,3"', "link 'one': mass value is '1,2,3'"),
        ('value="1.5"', 'value="1_5"', "link 'two': mass value is '1_5'"),
        ('value="3"', 'value="nan"', "link 'one': mass value is 'nan'"),
        ('value="3"', 'value="1e20"', "link 'one': mass value is 1e.20 kg; on a robot it lies"),
        ('value="3"', 'kilograms="3"', "link 'one': <mass> has no value"),
        ('<mass value="3"/>', "", "link 'one': <inertial> has no <mass>"),
        ('ixx="0.03"', 'ixx="1 2 3 4"', "link 'one': inertia ixx is '1 2 3 4'; .* a number"),
        ('ixx="0.03" ', "", "link 'one': <inertia> has no ixx"),
        ('"0.1 0.2 0.05"', '"0.1 0.2"', "link 'one': origin xyz is .* it must be 3 numbers"),
        ('"0.2 0.1 0"', '"0 90 0"', "joint 'a': origin rpy is 90 rad; on a robot it lies"),
        ('axis xyz="1 2 -0.5"', 'axis xyz="0 0 0"', "joint 'a': axis is '0 0 0'"),
        ('axis xyz="1 2 -0.5"', 'axis xyz="1e154 2 0"', "joint 'a': axis is '1e154 2 0'; it must"),
        ('axis xyz="1 2 -0.5"', 'axis xyz="z"', "joint 'a': axis xyz is 'z'; it must be 3"),
        ('lower="-1"', 'lower="-1rad"', "joint 'b': limit lower is '-1rad'"),
        ('<joint name="b"', '<joint name="a"', "not a URDF that Pinocchio can read: .*unique"),
    ],
)
def test_what_is_no_number_in_a_urdf_is_refused_by_its_link(
    tmp_path: Path, old: str, new: str, words: str, capfd: pytest.CaptureFixture[str]
) -> None:
    text = URDF.format(kind="revolute")
    assert text.count(old) >= 1
    with pytest.raises(RobotError, match=words) as caught:
        load_robot(written(tmp_path, text.replace(old, new, 1), "arm.urdf"))
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def test_a_urdf_without_mass_is_refused(tmp_path: Path) -> None:
    text = re.sub(r"<inertial>.*?</inertial>", "", URDF.format(kind="revolute"), flags=re.DOTALL)
    with pytest.raises(RobotError, match="all moving bodies together weigh 0 kg"):
        load_robot(written(tmp_path, text, "arm.urdf"))


def test_the_pinocchio_model_gives_back_the_chain(tmp_path: Path) -> None:
    """Chain → Pinocchio → chain, in all three conventions and with a payload."""
    for name in ("ur10e", "panda", str(written(tmp_path, TWO_LINKS))):
        chain = load_robot(name).chain
        again = chain_from_model(chain.to_pinocchio(), name)
        for field in ("rotation", "translation", "mass", "com", "inertia", "rotor_inertia"):
            # Pinocchio stores the tensor in another basis: rounding
            np.testing.assert_allclose(getattr(again, field), getattr(chain, field), atol=1e-14)
        np.testing.assert_allclose(again.flange_translation, chain.flange_translation)
