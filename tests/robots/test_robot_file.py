"""Users' own robot files: what is accepted, and that a complaint names the line that is wrong."""

import csv
import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_urdfs import two_armed, written

from vftcli.robots import NAMES, PROFILES, JointFriction, Payload, RobotChoice, load_robot
from vftcli.robots.chain import link_poses
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.profile import robot_toml
from vftcli.robots.robot_file import lines_of, value_text
from vftcli.signals.errors import ParameterError, RobotError
from vftcli.signals.recording import Recording

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


def test_a_planar_arm_weighs_what_the_textbook_says(tmp_path):
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
        (TENSOR, "inertia = [0.1, 0, 0, 0.01, 0, 0.01]", "21: .*elbow.*: inertia breaks the"),
        (TENSOR, "inertia = [0.01, 0.02, 0, 0.01, 0, 0.01]", "21: .* has the negative princ"),
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
        ('"coulomb-viscous"', "{}", r"line 23: joint 2 \(elbow\): model is {}; it must be one"),
        (VISCOUS, "vicous = 0.5", "line 22: joint 2 .*viscous is missing"),
        (VISCOUS, "viscous = 1e20", r"line 25: .*viscous is 1e\+20 N·m·s/rad; on a robot"),
        (VISCOUS, "viscous = 0.5\n[observers.gmo]\ngain = nan", "line 27: gain is nan; it"),
        (VISCOUS, "viscous = 0.5\n[observers.gmo]\ngain = []", r"27: gain is \[\]; it must"),
        (VISCOUS, "viscous = 0.5\n[observers]\ngmo = 3", "line 27: gmo is 3; it must be a sec"),
        (VISCOUS, "viscous = 0.5\n[admittance]\nperiod = true", "line 27: period is True"),
        (VISCOUS, "viscous = 0.5\n[admittance]\nmass = 3", "line 27: no key 'mass'; it has"),
        (VISCOUS, "viscous = 0.5\n[admittance]\nstart = 3", "line 27: start is 3; it must"),
        (VISCOUS, f"{VISCOUS}\n[admittance.position]\nmass = [nan]", r"27: mass is \[nan\]; it"),
    ],
)
def test_a_complaint_names_the_line(tmp_path, old, new, words):
    assert old in TWO_LINKS
    with pytest.raises(RobotError, match=words) as caught:
        load_robot(written(tmp_path, TWO_LINKS.replace(old, new), "arm.toml"))
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_a_binary_one_are_refused(tmp_path):
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
    friction = (friction,) * robot.joints
    changed = replace(robot, chain=chain, friction=friction, payload=load, name="mine")
    read = again(changed, tmp_path)
    for key in CHAIN:
        # turned into the table's frames and back: rounding of a rotation
        np.testing.assert_allclose(getattr(read.chain, key), getattr(chain, key), atol=1e-15)
    assert read.friction == changed.friction
    assert read.name == "mine"
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


# Built-in profiles against numbers Pinocchio computed from the manufacturers' URDFs


POSES = Path(__file__).with_name("profile_poses.csv")
"""Two poses an arm: joint positions, flange position and gravity torque, of one row each.

Origin: Pinocchio 4.1 on the manufacturers' URDFs (UniversalRobots ROS 2 description for the UR
arms, franka_description for the FR3, an arm-only URDF with the parameters of Gaz et al. 2019 for
the Panda; for the others the maker's own description that each file names, right angles made
exact), in the DH base frame, g = (0, 0, −9.81).
"""

# The files print α as ±1.5707963267949, 13 digits, which is 1e-10 m over an arm.
POSITION, TORQUE = 1e-6, 1e-6


@pytest.mark.parametrize("name", PROFILES)
def test_flange_and_gravity_are_the_makers(name):
    """And the file names its sources, and friction that falls nowhere."""
    robot = load_robot(name)
    assert robot.sources
    assert "falling-friction" not in {remark.code for remark in robot.remarks}
    lines = csv.reader(POSES.read_text("utf-8").splitlines())
    rows = [
        [np.array(text.split(), float) for text in row[1:]] for row in lines if row[0] == name
    ]
    assert len(rows) == 2
    for q, position, gravity in rows:
        at = q[None]
        flange = link_poses(robot.chain, at).translation[0, -1]
        np.testing.assert_allclose(flange, position, atol=POSITION)
        terms = momentum_terms(robot.chain, at, np.zeros_like(at))
        np.testing.assert_allclose(terms.gravity[0], gravity, atol=TORQUE)


def test_the_papers_torque_constants_are_kept_beside_the_corrected_ones():
    robot = load_robot("ur5")
    assert robot.document["torque_constant_printed"][1] == 12.1625  # Sec. IV-A, as printed
    assert robot.torque_constant[1] == 12.625  # 0.125 N·m/A · 101


def test_the_hand_is_mounted_turned_as_the_maker_mounts_it():
    """The same hand in the simulated FR3's own file has its centre of mass at ∓6.8 mm."""
    bare, hand = load_robot("fr3"), load_robot("fr3").with_payload("franka_hand")
    np.testing.assert_allclose(hand.payload.com[:2], [-0.00707, 0.00707], atol=1e-5)
    assert hand.loaded_chain.mass[-1] == bare.chain.mass[-1] + 0.73


@pytest.mark.parametrize(
    ("name", "meant"),
    [("pnada", "panda"), ("ru5e", "ur5e"), ("ur6e", ""), ("ur9", ""), ("fr4", "")],
)
def test_a_misspelt_name_suggests_the_arm_it_means_and_never_another(name, meant):
    """A profile of another arm gives wrong newtons, however near its name is."""
    words = f"Did you mean {meant}?" if meant else "Built in: ur3"
    with pytest.raises(RobotError, match=rf"no robot '{name}'\. {re.escape(words)}"):
        load_robot(name)


@pytest.mark.parametrize("word", ["UR5e", "ur-5e", "ur_5e", "UR 5E"])
def test_a_name_is_understood_however_it_is_written(word):
    assert load_robot(word).name == "ur5e"


def test_tools_sensors_and_admittance_are_typed(tmp_path):
    text = PROFILES["ur5"].read_text("utf-8") + (
        "\n[tool]\nxyz = [0, 0, 0.1]\n[tool.gripper]\nrpy = [0, 0, 1.0]\n"
        "[sensor.wrist]\nxyz = [0, 0, 0.03]\n"
    )
    robot = load_robot(written(tmp_path, text, "own.toml"))
    assert sorted(robot.tools) == ["", "gripper"]
    assert list(robot.sensors) == ["wrist"]  # no plain [sensor], so none is mounted
    np.testing.assert_array_equal(robot.tools[""].translation, [0.0, 0.0, 0.1])
    np.testing.assert_allclose(robot.tools["gripper"].rotation[0, 0], np.cos(1.0))
    assert robot.admittance["period"] == 0.008
    assert load_robot("panda").tools == {}


@pytest.mark.parametrize(
    ("section", "words"),
    [
        ("[tool.gripper]\nxyz = [0, 0]", r"line \d+: xyz .*3"),
        ("[sensor]\nrpy = 'up'", r"line \d+: rpy .*3"),
    ],
)
def test_a_pose_that_is_none_is_refused_with_its_line(tmp_path, section, words):
    text = PROFILES["ur5"].read_text("utf-8") + f"\n{section}\n"
    with pytest.raises(RobotError, match=words):
        load_robot(written(tmp_path, text, "own.toml"))


# RobotChoice: the arm that is named, or the one the log settles


def log(joints: int = 6, hint: str | None = None) -> Recording:
    return Recording(t=np.array([0.0, 0.1]), q=np.zeros((2, joints)), robot_hint=hint)


def test_the_named_arm_wins_over_the_log_s():
    assert RobotChoice(name="ur5").load(log(hint="ur10e")).name == "ur5"
    assert RobotChoice().load(log(hint="ur10e")).name == "ur10e"


def test_without_either_the_fitting_profiles_are_listed():
    """Of an arm that none fits all of them."""
    for joints, words in (
        (6, r"choose one with --robot: ur3, ur5, .*, m1013, or"),
        (7, "choose one with --robot: panda, fr3, iiwa7, iiwa14, gen3, xarm7, or"),
        (4, r"ur3, ur5, .*panda, .*m1013, or .* of 4 joints"),
    ):
        with pytest.raises(RobotError, match=words):
            RobotChoice().load(log(joints))


def test_the_number_of_joints_is_known_without_the_file():
    assert {name: load_robot(name).joints for name in PROFILES} == NAMES


def test_friction_can_be_left_away_and_another_is_refused_before_a_log_is_read():
    assert any(f.model != "none" for f in RobotChoice(name="ur5").load(log()).friction)
    without = RobotChoice.parsed(robot="ur5", settings={"model.friction": "none"}).load(log())
    assert all(f.model == "none" for f in without.friction)
    with pytest.raises(ParameterError, match=r"model\.friction=lugre; there is profile, none"):
        RobotChoice.parsed(settings={"model.friction": "lugre"})


def test_a_payload_that_the_file_has_not_is_refused():
    with pytest.raises(RobotError, match=r"no payload 'bucket'.*the robot file has franka_hand"):
        RobotChoice(name="panda", payload="bucket").load(log(7))


def test_the_tip_of_a_description_are_part_of_the_choice(tmp_path):
    path = written(tmp_path, two_armed())
    choice = RobotChoice.parsed(robot=str(path), tip="left_tool0")
    assert choice.load(log(7)).chain.names[0] == "left_joint1"
    assert hash(choice) == hash(RobotChoice(name=str(path), tip="left_tool0"))


def test_the_payload_that_the_log_declares_is_mounted():
    reported = replace(log(6), payload_mass=1.2, payload_com=(0.0, 0.01, 0.1))
    payload = RobotChoice(name="ur5e", payload="log").load(reported).payload
    assert (payload.mass, payload.com.tolist()) == (1.2, [0.0, 0.01, 0.1])
    with pytest.raises(RobotError, match="does not say which payload"):
        RobotChoice(name="ur5e", payload="log").load(log(6))
