"""Every URDF of example-robot-data 6.0.0 by the rules; skipped without that package.

It is the extra ``robots-test``: 131 MB.
"""

import importlib.metadata
import re
from functools import cache
from hashlib import sha256
from pathlib import Path

import pytest
from made_urdfs import agrees_with_pinocchio

from vftcli.robots import load_robot
from vftcli.robots.arm import LumpedArm
from vftcli.robots.described import xml_root
from vftcli.robots.urdf import urdf_tree
from vftcli.signals.errors import RobotError

LOADED = {
    "anymal_b_simple_description/robots/anymal-kinova": 6,
    "b1_description/urdf/b1-z1": 7,
    "hextilt_description/urdf/hextilt_flying_arm_5": 5,
    "kinova_description/robots/kinova": 6,
    "panda_description/urdf/panda": 7,
    "panda_description/urdf/panda_collision": 7,
    "so_arm_description/urdf/so100": 6,
    "so_arm_description/urdf/so101": 6,
    "talos_data/robots/talos_left_arm": 7,
    "tiago_description/robots/tiago": 7,
    "tiago_description/robots/tiago_no_hand": 7,
    "ur_description/urdf/ur10_joint_limited_robot": 6,
    "ur_description/urdf/ur10_robot": 6,
    "ur_description/urdf/ur3_gripper": 6,
    "ur_description/urdf/ur3_joint_limited_robot": 6,
    "ur_description/urdf/ur3_robot": 6,
    "ur_description/urdf/ur5_gripper": 6,
    "ur_description/urdf/ur5_joint_limited_robot": 6,
    "ur_description/urdf/ur5_robot": 6,
    "xarm_description/urdf/xarm7": 7,
    "z1_description/urdf/z1": 7,
}
"""File → joints of its arm: all with at least five that load without a word."""

SMALL = {
    "asr_twodof_description/urdf/TwoDofs",
    "borinot_description/urdf/borinot_flying_arm_2",
    "double_pendulum_description/urdf/double_pendulum",
    "double_pendulum_description/urdf/double_pendulum_continuous",
    "double_pendulum_description/urdf/double_pendulum_simple",
    "finger_edu_description/robots/finger_edu",
}
"""Pendulums and fingers of two and three joints."""

TWO_ARMS = {
    **dict.fromkeys(
        [f"alex_description/urdf/alex_{hand}_hands" for hand in ("nub", "psyonic", "sake")],
        ("LeftGripperYawLink", "RightGripperYawLink"),
    ),
    "alexander_description/urdf/alexander_v1.lowerBodyOnly": ("LEFT_FOOT", "RIGHT_FOOT"),
    "baxter_description/urdf/baxter": ("left_wrist", "right_wrist"),
    "centauro_description/urdf/centauro": ("arm1_6", "arm2_6"),
    **dict.fromkeys(
        [f"g1_description/urdf/g1_29dof_{hand}rev_1_0" for hand in ("", "with_hand_")],
        ("left_wrist_yaw_link", "right_wrist_yaw_link"),
    ),
    "icub_description/robots/icub": ("l_hand", "r_hand"),
    "icub_description/robots/icub_reduced": ("l_hand", "r_hand"),
    "pr2_description/urdf/pr2": ("l_wrist_roll_link", "r_wrist_roll_link"),
    "romeo_description/urdf/romeo": ("l_wrist", "r_wrist"),
    "romeo_description/urdf/romeo_laas_small": ("l_gripper", "r_gripper"),
    "romeo_description/urdf/romeo_small": ("l_wrist", "r_wrist"),
    "simple_humanoid_description/urdf/simple_humanoid": ("l_wrist", "r_wrist"),
    "simple_humanoid_description/urdf/simple_humanoid_classical": ("l_wrist", "r_wrist"),
    "talos_data/robots/talos_full_v2": ("arm_left_7_link", "arm_right_7_link"),
    "talos_data/robots/talos_full_v2_box": ("arm_left_7_link", "arm_right_7_link"),
    **dict.fromkeys(
        [f"talos_data/robots/talos_reduced{end}" for end in ("", "_box", "_corrected")],
        ("gripper_left_motor_double_link", "gripper_right_motor_double_link"),
    ),
    "tiago_description/robots/tiago_dual": ("arm_left_7_link", "arm_right_7_link"),
    "tiago_pro_description/robots/tiago_pro": ("arm_left_7_link", "arm_right_7_link"),
}
"""File → the tips of its two arms of at least five joints."""

SHARED_NAME = "b1_description/urdf/b1-z1"
"""Pinocchio cannot lock a model in which a joint and a link share a name."""

PERSON = "human_description/robots/human"
"""Its longest runs are two legs: no arm, and refused like two."""


@cache
def files() -> dict[str, Path]:
    """The different URDFs of the package, by their place without the ending."""
    try:
        listed = importlib.metadata.files("example-robot-data") or []
    except importlib.metadata.PackageNotFoundError:
        pytest.skip("example-robot-data is not installed: pip install 'vftcli[robots-test]'")
    paths = sorted(Path(str(file.locate())) for file in listed if file.suffix == ".urdf")
    # Of equal files the first.
    different = {sha256(path.read_bytes()).digest(): path for path in reversed(paths)}
    return {key_of(path): path for path in sorted(different.values())}


def key_of(path: Path) -> str:
    """A file's place below the folder of the robots."""
    return str(path.with_suffix("")).partition("/example-robot-data/robots/")[2]


@pytest.mark.slow
def test_every_robot_is_loaded_or_refused_by_the_rules():
    arms: dict[str, int] = {}
    refused = {}
    for name, path in files().items():
        try:
            arms[name] = load_robot(path).joints
        except RobotError as error:
            refused[name] = error
    assert arms == LOADED | {name: arms[name] for name in SMALL}
    assert max(arms[name] for name in SMALL) < 5
    assert (len(files()), len(LOADED), len(TWO_ARMS)) == (69, 21, 23)
    with_two = {name for name, error in refused.items() if "two arms of " in error.args[0]}
    legged = {"bolt_description/robots/bolt"}  # two legs of three joints
    assert with_two == TWO_ARMS.keys() | legged | {PERSON}


@pytest.mark.parametrize("name", TWO_ARMS)
def test_each_of_two_arms_is_taken_by_its_tip(name):
    path = files()[name]
    left, right = TWO_ARMS[name]
    with pytest.raises(RobotError, match=f"--tip {left} or --tip {right}$"):
        load_robot(path)
    tree = urdf_tree(path, xml_root(path.read_text(encoding="utf-8"), path))
    one, other = (LumpedArm(tree, tip).joints for tip in (left, right))
    assert len(one) == len(other) >= 5
    assert one[-1].child == left
    assert other[-1].child == right


@pytest.mark.parametrize("name", sorted(LOADED.keys() - {SHARED_NAME}))
def test_every_arm_is_what_pinocchio_makes_of_the_file(name):
    text = files()[name].read_text(encoding="utf-8")
    # Pinocchio takes a text without what says how it is encoded.
    text = re.sub(r"^\s*<\?xml[^>]*\?>", "", text)
    agrees_with_pinocchio(text, load_robot(files()[name]))


def test_an_empty_robot_is_said_to_be_empty():
    with pytest.raises(RobotError, match="the <robot> is empty: it has no link and no joint"):
        load_robot(files()["ur_description/urdf/ur3"])


@pytest.mark.parametrize(
    ("name", "count"),
    [
        ("ur_description/urdf/ur5_robot", 7),
        ("panda_description/urdf/panda", 11),  # with a hand and two fingers
        ("xarm_description/urdf/xarm7", 8),
    ],
)
def test_meshes_are_found_in_a_package_that_only_its_folder_names(name, count):
    found = load_robot(files()[name])
    assert len(found.meshes) == count
    assert all(mesh.file for mesh in found.meshes)
    assert "meshes-not-found" not in {remark.code for remark in found.remarks}
