"""Built-in profiles against numbers Pinocchio computed from the manufacturers' URDFs."""

import re

import numpy as np
import pytest

from vftcli.robots import PROFILES, load_robot
from vftcli.robots.chain import unphysical
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.kinematics import link_poses
from vftcli.signals.errors import RobotError

# Origin: Pinocchio 4.1 on the manufacturers' URDFs (UniversalRobots ROS 2 description for the UR
# arms, franka_description for the FR3, an arm-only URDF with the parameters of Gaz et al. 2019 for
# the Panda), in the DH base frame, g = (0, 0, −9.81). Joint positions [rad], flange position [m],
# gravity torque [N·m]; two poses an arm.
CASES = {
    "ur5": [
        (
            [0.767584, 2.608886, 1.554407, 2.587101, 0.238482, -2.445745],
            [0.560275779983, 0.277844262661, 0.11464090377],
            [0.0, 41.628726804167, 8.757512364044, 0.593920766106, -0.150974432744, 0.0],
        ),
        (
            [1.731913, -0.334621, -1.947926, -2.237653, -0.394982, -1.346197],
            [0.192078957859, -0.027914821462, 0.57491733516],
            [0.0, -24.398115491012, 11.644053133675, 1.42759752765, -0.312543606054, 0.0],
        ),
    ],
    "ur5e": [
        (
            [2.738508, 0.846952, -2.478091, 0.24594, 0.920393, -0.076128],
            [0.416684302013, 0.032788784502, 0.295054754831],
            [0.0, -28.127331747685, -0.764145855953, -1.876138492873, 0.333776633846, 0.0],
        ),
        (
            [-1.225053, 1.135764, 2.555162, -1.582125, 1.120542, -1.050951],
            [-0.068945490468, -0.329835052769, -0.044055954373],
            [0.0, 0.139557333672, 17.552294870476, 1.826043423775, -0.209604798883, 0.0],
        ),
    ],
    "ur10e": [
        (
            [2.286592, 2.773178, -0.004992, -1.445399, 1.315108, 2.626143],
            [-0.628728254196, 1.033265062641, -0.38718218525],
            [0.0, 116.050259172286, 39.563147276606, 2.972551019159, -0.219657956346, 0.0],
        ),
        (
            [-2.159547, -0.952467, -2.182906, -2.59501, 2.55683, -2.755042],
            [-0.188704427065, -0.14400217269, 0.547732043916],
            [0.0, -6.92436999915, 40.602335566984, 1.30442991911, 0.392264659452, 0.0],
        ),
    ],
    "panda": [
        (
            [-0.683471, -2.76425, 1.699268, 0.895841, 2.653289, 1.966183, -0.149391],
            [-0.417833216135, -0.17663830123, -0.14572797722],
            [
                0.0,
                15.777464489114,
                4.000853614756,
                16.837036672853,
                -0.466435098683,
                -0.886443034941,
                -0.076563718294,
            ],
        ),
        (
            [-0.498883, 0.986559, 2.159122, -1.313209, 1.218679, -1.633321, -0.202015],
            [0.488800151546, 0.126629283514, 0.700838307287],
            [
                0.0,
                -27.34719945346,
                14.017632021894,
                2.92333661631,
                -0.942111042169,
                0.375351271189,
                -0.070925288792,
            ],
        ),
    ],
    "fr3": [
        (
            [-2.134796, -1.951188, -1.630934, -0.520201, -1.266821, 1.606039, -0.765968],
            [0.125128527057, 0.698946242222, -0.054210951289],
            [
                0.0,
                46.049318916747,
                11.854584379608,
                -1.163696380036,
                0.9187561223,
                1.220045914049,
                -0.017085992472,
            ],
        ),
        (
            [1.456174, 2.709327, -1.250035, 2.229803, 2.595198, 1.979159, -1.329735],
            [-0.232235411196, 0.02267688813, 0.444090317245],
            [
                0.0,
                -8.370849285865,
                1.88316516542,
                8.639207450516,
                -0.370332230055,
                -0.653800240959,
                -0.032245146617,
            ],
        ),
    ],
}


# The files print α as ±1.5707963267949, 13 digits, which is 1e-10 m over an arm.
POSITION, TORQUE = 1e-6, 1e-6


@pytest.mark.parametrize("name", PROFILES)
def test_flange_and_gravity_are_the_makers(name: str) -> None:
    robot = load_robot(name)
    for q, position, gravity in CASES[name]:
        at = np.array([q])
        flange = link_poses(robot.chain, at).translation[0, -1]
        np.testing.assert_allclose(flange, position, atol=POSITION)
        terms = momentum_terms(robot.chain, at, np.zeros_like(at))
        np.testing.assert_allclose(terms.gravity[0], gravity, atol=TORQUE)


@pytest.mark.parametrize("name", PROFILES)
def test_every_number_has_a_source_and_every_body_is_physical(name: str) -> None:
    robot = load_robot(name)
    assert robot.sources
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
    [("UR-10e", "ur10e"), ("pnada", "panda"), ("ru5e", "ur5e"), ("ur10", ""), ("ur9", ""),
     ("ur3e", ""), ("fr4", "")],
)  # fmt: skip
def test_a_misspelt_name_suggests_the_arm_it_means_and_never_another(name: str, meant: str) -> None:
    words = f"Did you mean {meant}?" if meant else "Built in: ur5"
    with pytest.raises(RobotError, match=rf"no robot '{name}'\. {re.escape(words)}"):
        load_robot(name)


def test_an_unknown_payload_lists_what_there_is() -> None:
    with pytest.raises(RobotError, match="the robot file has franka_hand"):
        load_robot("panda").with_payload("bucket")


def test_tools_sensors_and_admittance_are_typed(tmp_path):
    text = PROFILES["ur5"].read_text(encoding="utf-8")
    path = tmp_path / "own.toml"
    path.write_text(
        text + "\n[tool]\nxyz = [0, 0, 0.1]\n[tool.gripper]\nrpy = [0, 0, 1.0]\n"
        "[sensor.wrist]\nxyz = [0, 0, 0.03]\n",
        encoding="utf-8",
    )
    robot = load_robot(path)
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
    path = tmp_path / "own.toml"
    path.write_text(PROFILES["ur5"].read_text(encoding="utf-8") + f"\n{section}\n")
    with pytest.raises(RobotError, match=words):
        load_robot(path)
