"""Built-in profiles against numbers Pinocchio computed from the manufacturers' URDFs."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest
from made_urdfs import written

from vftcli.robots import PROFILES, load_robot
from vftcli.robots.chain import link_poses, unphysical
from vftcli.robots.kernels import momentum_terms
from vftcli.signals.errors import RobotError

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
def test_flange_and_gravity_are_the_makers(name: str) -> None:
    robot = load_robot(name)
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


@pytest.mark.parametrize("name", PROFILES)
def test_every_number_has_a_source_and_every_body_is_physical(name: str) -> None:
    robot = load_robot(name)
    assert robot.sources
    assert "falling-friction" not in {remark.code for remark in robot.remarks}
    for mass, inertia in zip(robot.chain.mass, robot.chain.inertia, strict=True):
        assert unphysical(float(mass), inertia) == ""
    assert robot.joints == robot.document["dof"]


def test_the_papers_torque_constants_are_kept_beside_the_corrected_ones() -> None:
    robot = load_robot("ur5")
    assert robot.document["torque_constant_printed"][1] == 12.1625  # Sec. IV-A, as printed
    assert robot.torque_constant is not None
    assert robot.torque_constant[1] == 12.625  # 0.125 N·m/A · 101


def test_the_hand_is_mounted_turned_as_the_maker_mounts_it() -> None:
    """The same hand in the simulated FR3's own file has its centre of mass at ∓6.8 mm."""
    bare, hand = load_robot("fr3"), load_robot("fr3").with_payload("franka_hand")
    assert hand.payload is not None
    np.testing.assert_allclose(hand.payload.com[:2], [-0.00707, 0.00707], atol=1e-5)
    assert hand.loaded_chain.mass[-1] == bare.chain.mass[-1] + 0.73


@pytest.mark.parametrize(
    ("name", "meant"),
    [("pnada", "panda"), ("ru5e", "ur5e"), ("ur6e", ""), ("ur9", ""), ("fr4", "")],
)
def test_a_misspelt_name_suggests_the_arm_it_means_and_never_another(name, meant) -> None:
    """A profile of another arm gives wrong newtons, however near its name is."""
    words = f"Did you mean {meant}?" if meant else "Built in: ur3"
    with pytest.raises(RobotError, match=rf"no robot '{name}'\. {re.escape(words)}"):
        load_robot(name)


@pytest.mark.parametrize("word", ["UR5e", "ur-5e", "ur_5e", "UR 5E"])
def test_a_name_is_understood_however_it_is_written(word: str) -> None:
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
