from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pinocchio as pin
import pytest

from vftcli.outputs.log.description import urdf_text
from vftcli.robots import PROFILES, load_robot
from vftcli.signals.pose import Pose, rpy_matrix


@pytest.mark.parametrize("name", PROFILES)
def test_the_urdf_is_the_arm(name: str, tmp_path: Path) -> None:
    """Read back through Pinocchio, the flange is where it was; 12 printed digits."""
    from vftcli.robots.kinematics import link_poses

    robot = load_robot(name)
    path = tmp_path / "arm.urdf"
    path.write_text(urdf_text(robot, robot.chain.names), encoding="utf-8")
    back = load_robot(path)
    q = np.random.default_rng(7).uniform(-2.0, 2.0, (20, robot.joints))
    found, expected = link_poses(back.chain, q), link_poses(robot.chain, q)
    np.testing.assert_allclose(found.translation, expected.translation, atol=1e-10)
    np.testing.assert_allclose(found.rotation[:, -1], expected.rotation[:, -1], atol=1e-10)
    np.testing.assert_allclose(back.chain.mass, robot.chain.mass, rtol=1e-10)
    np.testing.assert_allclose(back.chain.inertia, robot.chain.inertia, atol=1e-10)


def test_names_of_joints_are_escaped() -> None:
    robot = load_robot("ur5")
    names = ('a"<b>&', *robot.chain.names[1:])
    joint = ET.fromstring(urdf_text(robot, names)).find("joint")
    assert joint is not None
    assert joint.get("name") == names[0]


def test_what_is_mounted_is_a_frame_on_the_flange() -> None:
    robot = load_robot("ur5")
    tool = Pose(rpy_matrix((0.1, -0.2, 0.3)), np.array([0.01, 0.02, 0.15]))
    model = pin.buildModelFromXML(urdf_text(robot, robot.chain.names, {"tool": tool}))
    data, q = model.createData(), np.linspace(-1.0, 1.0, 6)
    pin.framesForwardKinematics(model, data, q)
    flange, found = (data.oMf[model.getFrameId(name)] for name in ("flange", "tool"))
    between = flange.actInv(found)
    # 12 printed digits
    np.testing.assert_allclose(between.translation, tool.translation, atol=1e-10)
    np.testing.assert_allclose(between.rotation, tool.rotation, atol=1e-10)
