"""Robots from descriptions: the TOML beside them, and what is said of their inertia."""

import re
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from made_urdfs import (
    agrees_with_pinocchio,
    arm,
    clawed,
    fingered,
    fixed,
    joint,
    knuckled,
    link,
    mobile,
    robot,
    said,
    two_armed,
    written,
)

from vftcli.robots import Robot, described, load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.profile import robot_toml
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError


def beside(folder: Path, text: str, toml: str) -> Path:
    written(folder, toml, "arm.toml")
    return written(folder, text)


def test_the_toml_beside_says_which_arm_its_drives_and_gains(tmp_path):
    """`[[joints]]` match by name; those of the other arm are left alone."""
    toml = """tip = "right_link7"
torque_source = "current"
observers.gmo.gain = 12.0
"""
    for k in range(7, 0, -1):
        toml += f'[[joints]]\nname = "right_joint{k}"\ntorque_constant = {k}.0\n'
    toml += 'rotor_inertia = 0.5\n[[joints]]\nname = "left_joint2"\nrotor_inertia = 9.0\n'
    path = beside(tmp_path, two_armed(), toml)
    found = load_robot(path)
    assert found.chain.names[0] == "right_joint1"
    np.testing.assert_array_equal(found.chain.rotor_inertia, [0.5, 0, 0, 0, 0, 0, 0])
    np.testing.assert_array_equal(found.torque_constant, np.arange(1.0, 8.0))
    np.testing.assert_array_equal(found.limits.tau_max, 50.0)
    assert found.gains["gmo"]["gain"] == 12.0
    written(tmp_path, 'tip = "right_link7"', "arm.toml")
    assert load_robot(path, tip="left_tool0").chain.names[0] == "left_joint1"  # the option wins


FOLLOWERS = [f"{side}_{bone}_joint" for side in ("left", "right") for bone in ("knuckle", "tip")]


@pytest.mark.parametrize(
    ("text", "angles", "more"),
    [
        (fingered(), {"finger_joint1": 0.03, "finger_joint2": 0.01}, {}),
        (clawed(), {"finger_1": 0.7, "fingertip_1": -0.4, "finger_3": 0.2}, {}),
        (
            mobile(),
            {"x_joint": 0.4, "yaw_joint": 0.8, "lift_joint": 0.3, "piston_joint": -0.5},
            {},
        ),
        # what follows goes with it: the URDF's multiplier −1 and offset 0.1
        (knuckled(), {"finger_joint": 0.3}, dict.fromkeys(FOLLOWERS, -0.2)),
        (robot(link("base"), arm(7)), {"joint1": 0.4}, {}),  # a torso that the arm stands on
    ],
    ids=["fingered", "clawed", "mobile", "knuckled", "torso"],
)
def test_what_is_locked_at_an_angle_is_where_pinocchio_holds_it(text, angles, more, tmp_path):
    table = ", ".join(f"{name} = {angle}" for name, angle in angles.items())
    found = load_robot(beside(tmp_path, text, f"lock = {{{table}}}\n"))
    assert not angles.keys() & {*found.chain.names}
    agrees_with_pinocchio(text, found, angles | more)
    assert all(f"{name} at {angle:g}" in str(found.remarks[0]) for name, angle in angles.items())


@pytest.mark.parametrize(
    ("toml", "words"),
    [
        ("lock = {finger = 1}", r"line 1: lock: no joint 'finger'\. There is jo"),
        ("lock = {finger_joint1 = true}", "finger_joint1 is True; it must be a finite number"),
        ("lock = {finger_joint1 = 1e9}", "finger_joint1 is 1e.09; on a robot|must be a finite"),
        ("lock = 3", "lock is 3; it must be a section"),
        ("tip = 3", "tip is 3; it must be text in quotes"),
        ('tip = "nowhere"', "--tip 'nowhere': no link or joint of that name"),
        ('[[joints]]\nname = "joint9"', r"no joint 'joint9' in arm\.urdf; it has joint1, joint2"),
        ('[[joints]]\nname = "joint1"\nendless = 1', "endless is 1; it must be true or false"),
    ],
)
def test_a_toml_that_does_not_fit_is_refused(tmp_path, toml, words):
    with pytest.raises(RobotError, match=words):
        load_robot(beside(tmp_path, fingered(), toml))


def flattened(urdf: str, name: str, moments: tuple[float, float, float]) -> str:
    bad = link(name, 1.0, (moments[0], 0, 0, moments[1], 0, moments[2]))
    before, after = urdf.split(f'<link name="{name}">')
    return before + bad + after.partition("</link>")[2]


def inverse_dynamics(robot: Robot, q: Array, v: Array, a: Array) -> Array:
    model = robot.chain.to_pinocchio()
    return np.array(pin.rnea(model, model.createData(), q, v, a))


def test_a_tensor_that_no_body_has_is_projected_and_its_effect_said(tmp_path):
    """Principal moments 1, 2, 4 g·m²: second moments −.5 + … → (2.5, 1.5, 0), so 1.5, 2.5, 4."""
    text = flattened(robot(link("base"), arm(6)), "link4", (1e-3, 2e-3, 4e-3))
    found = load_robot(written(tmp_path, text))
    remark = said(found, "tensors-changed")
    assert remark.where.joints == (4,)
    assert remark.values["links"] == ["link4"]
    moments = np.linalg.eigvalsh(found.chain.inertia[3])
    np.testing.assert_allclose(moments, [1.5e-3, 2.5e-3, 4e-3], rtol=1e-12)
    # What Pinocchio makes of the file as it is differs by what is said, at 1 rad/s and 2 rad/s².
    model, rng, worst = pin.buildModelFromXML(text), np.random.default_rng(5), 0.0
    for _ in range(300):
        q = rng.uniform(-np.pi, np.pi, 6)
        v, a = rng.choice([-1.0, 1.0], 6), 2.0 * rng.choice([-1.0, 1.0], 6)
        theirs = pin.rnea(model, model.createData(), q, v, a)
        worst = max(worst, float(np.max(np.abs(inverse_dynamics(found, q, v, a) - theirs))))
    assert remark.values["worst_Nm"] == pytest.approx(worst, rel=0.3)  # of 64 poses and of 300
    assert "J4: the inertia of link4 is impossible" in str(remark)


def test_a_file_that_gives_only_the_moment_about_the_axis_keeps_it(tmp_path):
    text = flattened(robot(link("base"), arm(6)), "link1", (0.0, 0.0, 4e-3))
    moments = np.linalg.eigvalsh(load_robot(written(tmp_path, text)).chain.inertia[0])
    np.testing.assert_allclose(moments, [2e-3, 2e-3, 4e-3], rtol=1e-12)


def test_a_negative_moment_is_refused(tmp_path):
    text = flattened(robot(link("base"), arm(6)), "link2", (-1e-3, 2e-3, 2e-3))
    with pytest.raises(RobotError, match="joint 'joint2' is unphysical: inertia has the negat"):
        load_robot(written(tmp_path, text))


def without_inertia(urdf: str, *names: str) -> str:
    for name in names:
        before, after = urdf.split(f'<link name="{name}">')
        urdf = f'{before}<link name="{name}"/>{after.partition("</link>")[2]}'
    return urdf


def test_an_arm_without_mass_is_refused(tmp_path):
    """Three fingers without mass are a hand all the same."""
    bones = [f"{bone}{k}" for bone in ("finger", "fingertip") for k in (1, 2, 3)]
    text = without_inertia(clawed(), *(f"link{k}" for k in range(1, 7)), *bones)
    with pytest.raises(RobotError, match=r"weigh 0 kg, less than 0\.05 kg.*maker's dynamic desc"):
        load_robot(written(tmp_path, text))


def test_a_last_link_without_mass_is_said(tmp_path):
    text = robot(link("base"), arm(6))
    at_the_end = load_robot(written(tmp_path, without_inertia(text, "link6")))
    assert said(at_the_end, "mass-matrix-singular")
    terms = momentum_terms(at_the_end.chain, np.zeros((1, 6)), np.ones((1, 6)))
    assert np.all(np.isfinite(terms.p))


def test_a_small_arm_is_not_called_singular(tmp_path):
    """Lengths and masses a hundredth, moments a millionth: all of the mass matrix is as small."""

    def scaled(found: re.Match[str]) -> str:
        factor = 0.01 if found[1] in ("xyz", "value") else 1e-6
        return f'{found[1]}="{" ".join(str(factor * float(x)) for x in found[2].split())}"'

    text = robot(link("base"), arm(6))
    small = re.sub(r'(xyz|value|i[xyz]{2})="([^"]*)"', scaled, text)
    found = load_robot(written(tmp_path, without_inertia(small, "link3")))
    assert said(found, "links-without-mass").where.joints == (3,)
    assert "mass-matrix-singular" not in {remark.code for remark in found.remarks}


def test_the_base_s_place_is_in_the_chain_and_gravity_is_said(tmp_path):
    """A mount that the URDF tilts: gravity stays the root's; one that it does not know is given."""
    tilted = robot(link("world", 0.0), joint("mount", "world", "base", "fixed", rpy="1.2 0 0"),
                   link("base"), arm(5))  # fmt: skip
    agrees_with_pinocchio(tilted, load_robot(written(tmp_path, tilted)))
    wall = beside(tmp_path, robot(link("base"), arm(5)), "gravity = [0, -9.81, 0]\n")
    assert said(load_robot(wall), "arm-used").values["gravity_m_s2"] == [0.0, -9.81, 0.0]


def test_the_arm_that_was_found_is_what_is_written(tmp_path):
    """Where `tip` and `lock` chose it, and its endless joints, the chain says it all."""
    text = knuckled().replace('name="joint7" type="continuous"', 'name="joint7" type="revolute"')
    found = load_robot(beside(tmp_path, text, 'tip = "gripper"\nlock = {finger_joint = 0.3}\n'))
    again = load_robot(written(tmp_path, robot_toml(found), "again.toml"))
    assert again.endless == found.endless == found.chain.names[:6]
    np.testing.assert_array_equal(again.limits.q_max, found.limits.q_max)
    q, v, a = np.random.default_rng(2).uniform(-2, 2, (3, 7))
    # rpy and back: rounding
    expected = inverse_dynamics(found, q, v, a)
    np.testing.assert_allclose(inverse_dynamics(again, q, v, a), expected, atol=1e-11)


def test_options_of_descriptions_are_refused_where_they_mean_nothing(tmp_path):
    with pytest.raises(RobotError, match="--tip is for a URDF, xacro or MJCF; ur5 is a robot f"):
        load_robot("ur5", tip="tool0")
    with pytest.raises(RobotError, match="name:=ur is for a URDF, xacro or MJCF; ur5"):
        load_robot("ur5 name:=ur")
    path = written(tmp_path, fingered())
    with pytest.raises(RobotError, match="'name:=ur' is for a xacro, which this is not"):
        load_robot(f"{path} name:=ur")


# Xacro: expanded with arguments, its packages found, and what is refused


HEAD = """<robot name="$(arg name)" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="gripper" default="false"/>
<xacro:property name="mass" value="${2 * 0.5}"/>
"""


def xacro(inside: str = "") -> str:
    hand = f'<xacro:if value="$(arg gripper)">{fixed("hand", "link5", 0.5)}</xacro:if>'
    body = link("base") + arm(5).replace('mass value="5.0"', 'mass value="${mass}"')
    return f"{HEAD}{body}{hand}{inside}</robot>"


@pytest.fixture
def _xacro_installed() -> None:
    pytest.importorskip("xacro", reason="the extra vftcli[xacro] is not installed")
    pytest.importorskip("xacrodoc", reason="the extra vftcli[xacro] is not installed")


@pytest.mark.usefixtures("_xacro_installed")
def test_a_xacro_is_expanded_with_its_arguments(tmp_path):
    path = written(tmp_path, xacro(), "arm.urdf.xacro")
    bare = load_robot(f"{path} name:=made")
    assert (bare.name, bare.joints, bare.chain.mass[0]) == ("made", 5, 1.0)
    held = load_robot(f"{path} name:=made gripper:=true")
    assert held.chain.mass[-1] - bare.chain.mass[-1] == pytest.approx(0.5)
    assert bare.remarks[0].code == "xacro-run"
    # A file that holds macros is a xacro whatever it is called.
    assert load_robot(f"{written(tmp_path, xacro())} name:=made").name == "made"


@pytest.mark.slow
@pytest.mark.usefixtures("_xacro_installed")
@pytest.mark.parametrize(
    ("text", "arguments", "words"),
    [
        (xacro(), "", "the xacro needs name: .*name:=VALUE'; it takes name, gripper"),
        (xacro(), "name:=m griper:=1", r"no argument 'griper'\. Did you .* takes name, gripper"),
        (xacro("$(arg tool)"), "name:=made", "the xacro needs tool: .*tool:=VALUE"),
        (xacro('<xacro:include filename="$(find nowhere)/x.xacro"/>'), "name:=made", "nowhere"),
        (xacro("${1 / 0}"), "name:=made", "cannot be expanded: .*division by zero"),
        (xacro("${__import__('os')}"), "name:=made", "cannot be expanded: "),
        (xacro('<xacro:include filename="arm.xacro"/>'), "name:=made", "cannot be expanded: "),
        (xacro("${'a' * 10 ** 12}"), "name:=made", r"cannot be expanded: .*10 \*\* 12"),
        (xacro("$(env HOME)"), "name:=made", "it reads the environment variable HOME"),
        (xacro("${xacro.load_yaml('/etc/passwd')}"), "name:=made", "/etc/passwd, which is out"),
        (xacro("${load_yaml('../beside.yaml')}"), "name:=made", r"\./beside\.yaml, which is out"),
    ],
)
def test_a_xacro_that_cannot_be_expanded_says_why(text, arguments, words, tmp_path, capfd):
    with pytest.raises(RobotError, match=words) as caught:
        load_robot(f"{written(tmp_path, text, 'arm.xacro')} {arguments}".strip())
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
@pytest.mark.usefixtures("_xacro_installed")
@pytest.mark.parametrize("name", ["arm.xacro", "arm.urdf"])
def test_a_xacro_that_never_ends_is_ended(tmp_path, monkeypatch, name):
    """9^9^9 has 370 million digits: hours of a processor, in one step of the interpreter."""
    monkeypatch.setattr(described, "SECONDS", 1)
    path = written(tmp_path, xacro("${9**9**9}"), name)
    with pytest.raises(RobotError, match="cannot be expanded within 1 s of a processor"):
        load_robot(f"{path} name:=made")


@pytest.mark.usefixtures("_xacro_installed")
def test_a_maker_s_package_loads_its_tables_and_those_beside_it(tmp_path, monkeypatch):
    """As UR's description does: arguments name the files, a macro of another folder loads them.

    A package is found by its manifest, and what it includes may declare arguments.
    """
    monkeypatch.setenv("ARM_MASS", "9.0")
    own, other = tmp_path / "own_description", tmp_path / "beside"
    for folder in (own / "urdf" / "inc", own / "config", other / "config"):
        folder.mkdir(parents=True)
    written(own, "<package><name>own_description</name></package>", "package.xml")
    written(other, "<package><name>other_description</name></package>", "package.xml")
    written(own / "config", "masses: {link: !degrees 57.29577951308232}\n", "physical.yaml")
    written(other / "config", "tool: 0.25\n", "tool.yaml")
    macro = """<robot xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="far" default="1"/>
<xacro:macro name="read" params="physical tool">
<xacro:property name="table" value="${xacro.load_yaml(physical)}" scope="parent"/>
<xacro:property name="tool" value="${$(arg far) * xacro.load_yaml(tool)['tool']}" scope="parent"/>
</xacro:macro></robot>"""
    written(own / "urdf" / "inc", macro, "common.xacro")
    hand = fixed("hand", "link5", 0.5).replace('mass value="0.5"', 'mass value="${tool}"')
    mass = "${table['masses']['link'] * $(optenv ARM_MASS 2)}"
    body = link("base") + arm(5).replace('mass value="5.0"', f'mass value="{mass}"')
    text = f"""<robot name="made" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="physical" default="$(find own_description)/config/physical.yaml"/>
<xacro:include filename="$(find own_description)/urdf/inc/common.xacro"/>
<xacro:read physical="$(arg physical)" tool="$(find other_description)/config/tool.yaml"/>
{body}{hand}</robot>"""
    robot = load_robot(f"{written(own / 'urdf', text, 'own.urdf.xacro')} far:=3")
    # The table's own number, and the default of what the environment may hold.
    assert robot.chain.mass[0] == pytest.approx(2.0)
    assert robot.chain.mass[-1] == pytest.approx(1.0 + 3.0 * 0.25)


def test_without_the_package_the_line_that_expands_it_is_reported(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "xacro", None)
    path = written(tmp_path, xacro(), "arm.urdf.xacro")
    line = r"pip install 'vftcli\[xacro\]'.*xacro arm\.urdf\.xacro name:=made > arm\.urdf$"
    with pytest.raises(RobotError, match=line):
        load_robot(f"{path} name:=made")


def test_what_only_names_the_language_is_a_urdf(tmp_path):
    """Expanded files keep the declaration of its namespace."""
    text = robot(link("base"), arm(5)).replace("<robot", '<robot xmlns:xacro="http://xacro"', 1)
    assert load_robot(written(tmp_path, text)).joints == 5


BOMB = (
    "<!DOCTYPE r ["
    + '<!ENTITY a0 "boom">'
    + "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 12))
    + "]><robot>&a11;</robot>"
)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (BOMB, "has a document type, which defines XML entities"),
        ('<!DOCTYPE r SYSTEM "file:///etc/passwd"><r/>', "has a document type"),
        ("<a>" * 100_000, "more than 500 elements within one another"),
        ("<a>" * 500 + "</a>" * 500, "its first element is <a>, not <robot> or <mujoco>"),
        ("", "which is XML: no element found"),
        ("<robot", "which is XML: unclosed token"),
        ("<robot>&undefined;</robot>", "which is XML: undefined entity"),
        ("<x:robot/>", "which is XML: unbound prefix"),
        ("<robot>\x00</robot>", "which is XML: "),
    ],
)
def test_a_hostile_text_is_refused(text, words, tmp_path):
    with pytest.raises(RobotError, match=words):
        load_robot(written(tmp_path, text))
