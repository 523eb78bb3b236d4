from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np
import pytest

from vftcli.outputs.log.description import urdf_text
from vftcli.robots import PROFILES, load_robot


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
