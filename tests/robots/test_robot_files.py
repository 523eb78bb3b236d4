"""Users' own robot files: what is accepted, and that a complaint names the line that is wrong."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.robots import PROFILES, JointFriction, Payload, load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.profile import robot_toml
from vftcli.robots.robot_file import BOUNDS, lines_of, value_text
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


def test_limits_of_numbers_are_round() -> None:
    """Powers of ten, but for two turns; as far below zero, or zero, or a hair above it."""
    for key, bound in BOUNDS.items():
        assert bound.high == 4.0 * np.pi or np.log10(bound.high) % 1.0 == 0.0, key
        assert bound.low in {-bound.high, 0.0, 1e-9, 1e-7, 1.0}, key


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
        (
            '"xyz-rpy"',
            '"dh"',
            "line 4: convention is 'dh'; it must be one of standard-dh, modified-dh",
        ),
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
        ('"xyz-rpy"', "[]", r"line 4: convention is \[\]; it must be one of standard-dh"),
        (
            '"coulomb-viscous"',
            "[]",
            r"line 23: joint 2 \(elbow\): model is \[\]; it must be one of",
        ),
        (
            '"coulomb-viscous"',
            "{}",
            r"line 23: joint 2 \(elbow\): model is {}; it must be one of",
        ),
        ('"elbow"', '"shoulder"', "line 16: joint 2 .*: name is 'shoulder', as another joint's"),
        ("mass = 1.0", "mass = 1e308", r"line 19: .*mass is 1e\+308 kg; on a robot it is"),
        ("mass = 1.0", f"mass = {10**400}", "line 19: .*mass is 1000.*; it must be a finite"),
        (
            "viscous = 0.5",
            "viscous = 1e20",
            r"line 25: .*viscous is 1e\+20 N·m·s/rad; on a robot",
        ),
        ("coulomb = 1.0", f"coulomb = {10**20}", "line 24: .*coulomb is 1e.20 N·m; on a robot"),
        ("mass = 1.0", "mass = 1.0\nrotor_inertia = 1e308", "line 20: .*rotor_inertia is 1e.308"),
        ("mass = 1.0", "mass = 1.0\nq_min = 1\nq_max = 0", "q_min is 1 rad, not below q_max 0"),
        (
            "viscous = 0.5",
            "viscous = 0.5\n[observers.gmo]\ngain = nan",
            "line 27: gain is nan; it",
        ),
        (
            "viscous = 0.5",
            "viscous = 0.5\n[observers]\ngmo = 3",
            "line 27: gmo is 3; it must be a section",
        ),
        (
            "viscous = 0.5",
            "viscous = 0.5\n[admittance]\nperiod = true",
            "line 27: period is True",
        ),
        (
            "viscous = 0.5",
            "viscous = 0.5\n[admittance]\nmass = 3",
            "line 27: no key 'mass'; it has",
        ),
        (
            "viscous = 0.5",
            "viscous = 0.5\n[admittance]\nstart = 3",
            "line 27: start is 3; it must",
        ),
        (
            "viscous = 0.5",
            "viscous = 0.5\n[admittance.position]\nmass = [nan]",
            r"line 27: mass is \[nan\]; it must be a number or one an axis",
        ),
        ("dof = 2", "payload = 2", "line 3: payload is 2; it must be a section"),
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


CHAIN = ("rotation", "translation", "mass", "com", "inertia", "rotor_inertia", "gravity")


def again(robot, folder):
    path = folder / "again.toml"
    path.write_text(robot_toml(robot, ["written by a test"]), encoding="utf-8")
    return load_robot(path)


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_reads_back_identically(name, tmp_path):
    robot = load_robot(name)
    read = again(robot, tmp_path)
    for key in (*CHAIN, "flange_rotation", "flange_translation"):
        assert np.array_equal(getattr(read.chain, key), getattr(robot.chain, key)), key
    assert read.chain.names == robot.chain.names
    assert read.friction == robot.friction
    assert read.gains == robot.gains
    assert read.remarks == robot.remarks
    assert read.title == robot.title
    assert read.torque_source == robot.torque_source
    assert read.payloads.keys() == robot.payloads.keys()
    for label in robot.payloads:
        assert np.array_equal(read.payloads[label].com, robot.payloads[label].com)
    for group in ("limits", "noise"):
        for key, values in vars(getattr(robot, group)).items():
            np.testing.assert_array_equal(getattr(getattr(read, group), key), values)


@pytest.mark.parametrize("name", ["ur10e", "panda"])
def test_changed_numbers_are_written(name, tmp_path):
    robot = load_robot(name)
    chain = replace(
        robot.chain,
        mass=robot.chain.mass * 1.1,
        com=robot.chain.com + 0.01,
        inertia=robot.chain.inertia * 1.2,
        rotor_inertia=robot.chain.rotor_inertia + 0.5,
    )
    friction = JointFriction(
        model="coulomb-viscous-load",
        parameters={"coulomb": 1.5, "viscous": 2.5, "load_coulomb": 0.07, "smoothing": 0.02},
        confidence='made up, "quoted" \\ and so on',
    )
    load = Payload(mass=1.25, com=np.array([0.01, 0.0, 0.05]), inertia=np.eye(3) * 1e-3)
    changed = replace(
        robot, chain=chain, friction=(friction,) * robot.joints, payload=load, name="mine"
    )
    read = again(changed, tmp_path)
    for key in CHAIN:
        # turned into the table's frames and back: rounding of a rotation
        np.testing.assert_allclose(getattr(read.chain, key), getattr(chain, key), atol=1e-15)
    assert read.friction == changed.friction
    assert read.name == "mine"
    assert read.payload is not None
    assert read.payload.mass == 1.25
    np.testing.assert_array_equal(read.payload.com, load.com)


def test_a_robot_from_a_urdf_becomes_a_file(tmp_path):
    import pinocchio as pin

    source = load_robot("ur5")
    links = "".join(f'<link name="l{j}">{INERTIAL}</link>' for j in range(3))
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(
        f'<robot name="arm"><link name="base"/>{links}'
        f"{joint(0, 'base', 'l0', '0 0 1')}{joint(1, 'l0', 'l1', '0 1 0')}"
        f"{joint(2, 'l1', 'l2', '1 0 0')}</robot>"
    )
    robot = load_robot(urdf)
    read = again(robot, tmp_path)
    rng = np.random.default_rng(0)
    q, dq, ddq = rng.normal(size=(3, 3))
    torques = [pin.rnea(r.model, r.model.createData(), q, dq, ddq) for r in (robot, read)]
    # angles and back: rounding
    np.testing.assert_allclose(torques[0], torques[1], atol=1e-12)
    assert source.joints == 6


INERTIAL = (
    '<inertial><origin xyz="0.1 0.02 0.03"/><mass value="2"/>'
    '<inertia ixx="0.02" ixy="0.001" ixz="0" iyy="0.03" iyz="0" izz="0.025"/></inertial>'
)


def joint(j, parent, child, axis):
    return (
        f'<joint name="j{j}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.1 0 0.3" rpy="0.3 -0.2 0.5"/><axis xyz="{axis}"/>'
        '<limit lower="-3" upper="3" effort="50" velocity="2"/></joint>'
    )


def test_what_toml_has_not_is_refused():
    with pytest.raises(RobotError, match="cannot hold a complex"):
        value_text(1j, "here")


def test_every_value_that_toml_has_is_written_as_it_was():
    text = """day = 2026-01-02
at = 2026-01-02T03:04:05+01:00
hour = 03:04:05
mixed = [1, {a = 2, "b c" = [true]}]
sign = "\\U000E0001 \\u0007"
"""
    document = tomllib.loads(text)
    assert tomllib.loads("".join(lines_of(document))) == document
