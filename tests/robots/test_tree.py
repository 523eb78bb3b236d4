"""Trees of links and joints: one root, every link below it, masses summed from the tips."""

from pathlib import Path

import numpy as np
import pytest

from vftcli.robots.arm import MOST, BodyTree, TreeJoint
from vftcli.robots.chain import Body
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import Pose, rotation_about


def body(mass: float) -> Body:
    return Body(mass, np.zeros(3), np.zeros((3, 3)))


def tree(*joints: TreeJoint, links: str = "abcd") -> BodyTree:
    bodies = {link: body(2.0**k) for k, link in enumerate(links)}
    path = Path("arm.urdf")
    return BodyTree(name="t", path=path, bodies=bodies, joints=joints, gravity=np.zeros(3))


def fixed(name: str, parent: str, child: str) -> TreeJoint:
    lifted = Pose(np.eye(3), np.array([0.0, 0.0, 1.0]))
    return TreeJoint(name=name, kind="fixed", parent=parent, child=child, placement=lifted)


def test_links_follow_their_parents_and_carry_what_is_beyond() -> None:
    """Masses 1, 2, 4, 8: b carries d, a carries all; branches in the order of the joints' names."""
    found = tree(fixed("z", "a", "b"), fixed("y", "a", "c"), fixed("x", "b", "d"))
    assert found.root == "a"
    assert found.links == ("a", "c", "b", "d")
    assert found.mass_beyond == {"a": 15.0, "b": 10.0, "c": 4.0, "d": 8.0}
    assert [joint.name for joint in found.path_to("d")] == ["z", "x"]
    heights = {link: pose.translation[2] for link, pose in found.rigid_links("a")}
    assert heights == {"a": 0.0, "b": 1.0, "c": 1.0, "d": 2.0}


@pytest.mark.parametrize(
    ("joints", "words"),
    [
        (
            [fixed("z", "a", "b"), fixed("z", "a", "c"), fixed("x", "b", "d")],
            "two joints are nam",
        ),
        ([fixed("z", "a", "b"), fixed("y", "c", "b")], "link 'b' hangs on two joints"),
        ([fixed("z", "a", "e")], "joint 'z': no link 'e'"),
        ([fixed("z", "a", "b"), fixed("y", "a", "c")], "link 'd' is not connected with 'a'"),
        (
            [fixed("z", "c", "d"), fixed("y", "d", "c"), fixed("x", "a", "b")],
            "'c' is not con",
        ),
        ([fixed(str(k), "a", "b") for k in range(MOST + 1)], "has 1001 joints, more than 1000"),
    ],
)
def test_what_is_no_tree_is_refused(joints: list[TreeJoint], words: str) -> None:
    with pytest.raises(RobotError, match=words):
        tree(*joints)


def test_a_joint_moves_its_child_from_where_it_is_placed() -> None:
    placed = Pose(rotation_about("x", 0.5), np.array([1.0, 2.0, 3.0]))
    axis = np.array([0.0, 0.0, 1.0])
    common = {"name": "j", "parent": "a", "child": "b", "placement": placed, "axis": axis}
    turned = TreeJoint(kind="revolute", **common).at(0.7)
    np.testing.assert_allclose(
        turned.rotation, rotation_about("x", 0.5) @ rotation_about("z", 0.7), atol=1e-15
    )
    slid = TreeJoint(kind="prismatic", **common).at(0.7)
    np.testing.assert_array_equal(slid.rotation, placed.rotation)
    expected = placed.translation + 0.7 * placed.rotation[:, 2]
    np.testing.assert_allclose(slid.translation, expected, atol=1e-15)
