"""Users' own robot files: what is accepted, and that a complaint names the line that is wrong."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_urdfs import written

from vftcli.robots import PROFILES, JointFriction, Payload, load_robot
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.profile import robot_toml
from vftcli.robots.robot_file import lines_of, value_text
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


def test_a_planar_arm_weighs_what_the_textbook_says(tmp_path: Path) -> None:
    """g₂ = m₂g·l_c2·cos(q₁+q₂), g₁ = (m₁l_c1 + m₂l₁)g·cos q₁ + g₂ for a vertical two-link arm."""
    robot = load_robot(written(tmp_path, TWO_LINKS, "arm.toml"))
    q = np.array([[0.3, -0.8]])
    gravity = momentum_terms(robot.chain, q, np.zeros((1, 2))).gravity[0]
    second = 1.0 * 9.81 * 0.2 * np.cos(0.3 - 0.8)
    first = (2.0 * 0.25 + 1.0 * 0.5) * 9.81 * np.cos(0.3) + second
    np.testing.assert_allclose(gravity, [first, second], rtol=1e-14)
    assert [f.model for f in robot.friction] == ["none", "coulomb-viscous"]


TENSOR = "inertia = [0.001, 0.0, 0.0, 0.01, 0.0, 0.01]"
PLANAR, VISCOUS, MASS, DOF = 'name = "planar"', "viscous = 0.5", "mass = 1.0", "dof = 2"


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (MASS, "mass = -1.0", r"line 19: joint 2 \(elbow\): mass is -1 kg"),
        (MASS, "mas = 1.0", r"line 15: joint 2 \(elbow\): mass is missing"),
        (
            TENSOR,
            "inertia = [0.1, 0, 0, 0.01, 0, 0.01]",
            "line 21: .*elbow.*: inertia breaks the",
        ),
        (
            TENSOR,
            "inertia = [0.01, 0.02, 0, 0.01, 0, 0.01]",
            "line 21: .* has the negative princ",
        ),
        ("com = [0.2, 0.0, 0.0]", "com = [0.2, 0.0]", "line 20: .*com is .* 3 finite numbers"),
        (MASS, 'mass = "one"', "line 19: .*mass is 'one'; it must be a finite number"),
        (MASS, "mass = nan", "line 19: .*mass is nan; it must be a finite number"),
        (MASS, f"mass = {10**400}", "line 19: .*mass is 1000.*; it must be a finite"),
        (MASS, "mass = 1e308", r"line 19: .*mass is 1e\+308 kg; on a robot it is"),
        (MASS, "mass = 1.0\nq_min = 1\nq_max = 0", "q_min is 1 rad, not below q_max 0"),
        (MASS, "mass = 1.0\ngear = 0.0", r"joint 2 \(elbow\): gear is 0"),
        (MASS, "mass = 1.0\ngear_efficiency = 1.2", "gear_efficiency is 1.2; it is above 0, at"),
        (DOF, "dof = 3", r"line 3: dof is 3 but the file has 2 \[\[joints\]\] tables"),
        (DOF, "dof = true", "line 3: dof is True but"),
        (DOF, "dof = = 2", r"not valid TOML: .*line 3"),
        (DOF, f"dof = {'9' * 5000}", "not valid TOML: Exceeds the limit"),
        (DOF, f"x = {'[' * 5000}", "not valid TOML: nested too deep"),
        (DOF, "payload = 2", "line 3: payload is 2; it must be a section"),
        ('"xyz-rpy"', '"dh"', "line 4: convention is 'dh'; it must be one of standard-dh, modif"),
        ('"xyz-rpy"', "[]", r"line 4: convention is \[\]; it must be one of standard-dh"),
        ("joint_torque", "amps", "line 5: torque_source is 'amps'"),
        ('"joint_torque"', '"current"', "line 7: joint 1 .*torque_constant is missing"),
        ("schema = 1", "schema = 2", "line 1: schema is 2; this version reads schema 1"),
        (PLANAR, "name = 3", "line 2: name is 3; it must be text in quotes"),
        (PLANAR, "notes = nan", "line 2: notes is nan; it must be text in quotes, or"),
        (PLANAR, "sources = [3]", r"line 2: sources is \[3\]; it must be tables"),
        (PLANAR, 'flange_d = ["a", "b"]', "line 2: flange_d is .* a finite number"),
        (PLANAR, "ee_rpy = [0, 180, 0]", "line 2: ee_rpy is 180 rad; on a robot it"),
        ('"elbow"', '"shoulder"', "line 16: joint 2 .*: name is 'shoulder', as another joint's"),
        ("coulomb-viscous", "sticky", "line 23: joint 2 .*: model is 'sticky'"),
        (
            '"coulomb-viscous"',
            "{}",
            r"line 23: joint 2 \(elbow\): model is {}; it must be one of",
        ),
        (VISCOUS, "vicous = 0.5", "line 22: joint 2 .*viscous is missing"),
        (VISCOUS, "viscous = 1e20", r"line 25: .*viscous is 1e\+20 N·m·s/rad; on a robot"),
        (VISCOUS, "viscous = 0.5\n[observers.gmo]\ngain = nan", "line 27: gain is nan; it"),
        (
            VISCOUS,
            "viscous = 0.5\n[observers.gmo]\ngain = []",
            r"27: gain is \[\]; it must be a n",
        ),
        (VISCOUS, "viscous = 0.5\n[observers]\ngmo = 3", "line 27: gmo is 3; it must be a sec"),
        (VISCOUS, "viscous = 0.5\n[admittance]\nperiod = true", "line 27: period is True"),
        (VISCOUS, "viscous = 0.5\n[admittance]\nmass = 3", "line 27: no key 'mass'; it has"),
        (VISCOUS, "viscous = 0.5\n[admittance]\nstart = 3", "line 27: start is 3; it must"),
        (
            VISCOUS,
            "viscous = 0.5\n[admittance.position]\nmass = [nan]",
            r"line 27: mass is \[nan\]; it must be a number or one an axis",
        ),
    ],
)
def test_a_complaint_names_the_line(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in TWO_LINKS
    with pytest.raises(RobotError, match=words) as caught:
        load_robot(written(tmp_path, TWO_LINKS.replace(old, new), "arm.toml"))
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
    return load_robot(written(folder, robot_toml(robot, ["written by a test"]), "again.toml"))


@pytest.mark.parametrize("name", PROFILES)
def test_a_profile_reads_back_identically(name, tmp_path):
    robot = load_robot(name)
    read = again(robot, tmp_path)
    for key in (*CHAIN, "flange_rotation", "flange_translation"):
        assert np.array_equal(getattr(read.chain, key), getattr(robot.chain, key)), key
    assert read.chain.names == robot.chain.names
    for key in ("friction", "gains", "remarks", "title", "torque_source"):
        assert getattr(read, key) == getattr(robot, key), key
    assert read.payloads.keys() == robot.payloads.keys()
    for label in robot.payloads:
        assert np.array_equal(read.payloads[label].com, robot.payloads[label].com)
    for group in ("limits", "noise"):
        for key, values in vars(getattr(robot, group)).items():
            np.testing.assert_array_equal(getattr(getattr(read, group), key), values)


@pytest.mark.parametrize("name", ["ur10e", "panda"])
def test_changed_numbers_are_written(name, tmp_path):
    robot = load_robot(name)
    own = robot.chain
    chain = replace(own, mass=own.mass * 1.1, com=own.com + 0.01, inertia=own.inertia * 1.2,
                    rotor_inertia=own.rotor_inertia + 0.5)  # fmt: skip
    values = {"coulomb": 1.5, "viscous": 2.5, "load_coulomb": 0.07, "smoothing": 0.02}
    said = 'made up, "quoted" \\ and so on'
    friction = JointFriction(model="coulomb-viscous-load", parameters=values, confidence=said)
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


def test_every_value_that_toml_has_is_written_as_it_was():
    text = """day = 2026-01-02
at = 2026-01-02T03:04:05+01:00
hour = 03:04:05
mixed = [1, {a = 2, "b c" = [true]}]
sign = "\\U000E0001 \\u0007"
"""
    document = tomllib.loads(text)
    assert tomllib.loads("".join(lines_of(document))) == document
    with pytest.raises(RobotError, match="cannot hold a complex"):
        value_text(1j, "here")
