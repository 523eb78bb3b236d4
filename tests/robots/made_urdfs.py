"""Small URDFs of the shapes that users have, and Pinocchio's answer for them."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pinocchio as pin

from vftcli.robots import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.remarks import Remark

TENSOR = (0.03, 0.001, 0.002, 0.028, -0.001, 0.025)


def link(name, mass=1.0, tensor=TENSOR, rpy="0 0 0") -> str:
    """A link whose centre of mass lies off its frame; without inertia where its mass is zero."""
    if not mass:
        return f'<link name="{name}"/>'
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    entries = " ".join(f'{k}="{mass * v}"' for k, v in zip(keys, tensor, strict=True))
    return (
        f'<link name="{name}"><inertial><origin xyz="0.02 -0.03 0.1" rpy="{rpy}"/>'
        f'<mass value="{mass}"/><inertia {entries}/></inertial></link>'
    )


def joint(
    name,
    parent,
    child,
    kind="revolute",
    *,
    axis="0 0 1",
    xyz="0.05 -0.02 0.2",
    rpy="0 0 0",
    mimic="",
) -> str:
    """A joint; `mimic` holds the attributes of that element."""
    limit = '<limit lower="-2" upper="2" velocity="3" effort="50"/>' if kind != "fixed" else ""
    follows = f"<mimic {mimic}/>" if mimic else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>{limit}{follows}</joint>'
    )


def robot(*parts: str, name: str = "made") -> str:
    return "\n".join([f'<robot name="{name}">', *parts, "</robot>"])


def arm(count: int, prefix: str = "", root: str = "base", kind: str = "revolute") -> str:
    """Links ``link1`` … and joints ``joint1`` … behind a link, with slanted axes and turned frames.

    The masses fall towards the tip.
    """
    parts, parent = [], root
    for k in range(1, count + 1):
        name = f"{prefix}link{k}"
        parts.append(link(name, 5.0 / k, rpy=f"0.{k} -0.2 0.3"))
        axis = ("0 0 1", "0 1 0", "1 2 -0.5", "-1 0 0")[k % 4]
        rpy = f"0.{k} 0.{9 - k} -0.3"
        parts.append(joint(f"{prefix}joint{k}", parent, name, kind, axis=axis, rpy=rpy))
        parent = name
    return "\n".join(parts)


def fixed(name: str, parent: str, mass: float = 0.0, xyz: str = "0 0 0.1") -> str:
    held = joint(f"{name}_mount", parent, name, "fixed", xyz=xyz, rpy="0.1 0 0.7")
    return link(name, mass) + held


def fingered() -> str:
    """As fr3: a hand on a fixed flange, two prismatic fingers, the second follows the first."""
    slide = "prismatic"
    return robot(
        link("base", 2.0),
        arm(7),
        fixed("link8", "link7"),
        fixed("hand", "link8", 0.73, "0 0 0"),
        fixed("hand_tcp", "hand"),
        link("finger1", 0.015),
        link("finger2", 0.015),
        joint("finger_joint1", "hand", "finger1", slide, axis="0 1 0"),
        joint("finger_joint2", "hand", "finger2", slide, axis="0 -1 0",
              mimic='joint="finger_joint1"'),
        name="fingered",
    )  # fmt: skip


def knuckled() -> str:
    """As gen3 with a 2f85: endless joints in the arm, a tree of followers behind joint 7."""
    parts = [link("base", 1.0), arm(7, kind="continuous"), fixed("gripper", "link7", 0.6)]
    parts += [link("drive", 0.02), joint("finger_joint", "gripper", "drive", axis="0 1 0")]
    for side in ("left", "right"):
        for bone, parent in (("knuckle", "gripper"), ("tip", f"{side}_knuckle")):
            parts.append(link(f"{side}_{bone}", 0.02))
            followed = 'joint="finger_joint" multiplier="-1" offset="0.1"'
            name = f"{side}_{bone}_joint"
            child = f"{side}_{bone}"
            parts.append(joint(name, parent, child, axis="0 1 0", mimic=followed))
    return robot(*parts, name="knuckled")


def barred() -> str:
    """As wx250s: a propeller and two fingers on a bar behind joint 6."""
    return robot(
        link("base", 1.0),
        arm(6),
        fixed("ee_arm_link", "link6", 0.01),
        fixed("gripper_link", "ee_arm_link", 0.1),
        link("prop", 0.008),
        joint("gripper", "gripper_link", "prop", "continuous", axis="1 0 0"),
        fixed("bar", "gripper_link", 0.05),
        link("left_finger_link", 0.01),
        link("right_finger_link", 0.01),
        joint("left_finger", "bar", "left_finger_link", "prismatic", axis="0 1 0"),
        joint("right_finger", "bar", "right_finger_link", "prismatic", axis="0 1 0",
              mimic='joint="left_finger" multiplier="-1"'),
        name="barred",
    )  # fmt: skip


def clawed() -> str:
    """As Kinova's: three fingers of two joints each that nothing follows."""
    parts = [link("base", 1.0), arm(6)]
    for k in (1, 2, 3):
        parts += [link(f"finger{k}", 0.02), link(f"fingertip{k}", 0.01)]
        parts.append(joint(f"finger_{k}", "link6", f"finger{k}"))
        parts.append(joint(f"fingertip_{k}", f"finger{k}", f"fingertip{k}"))
    return robot(*parts, name="clawed")


def mobile() -> str:
    """A base of x, y and yaw, a lift, a head beside the arm, and a spring within it."""
    return robot(
        link("world", 0.0),
        link("x", 1.0),
        link("y", 1.0),
        link("yaw", 30.0),
        link("lift", 5.0),
        link("head", 1.0),
        joint("x_joint", "world", "x", "prismatic", axis="1 0 0"),
        joint("y_joint", "x", "y", "prismatic", axis="0 1 0"),
        joint("yaw_joint", "y", "yaw", rpy="0 0 0.4"),
        joint("lift_joint", "yaw", "lift", "prismatic"),
        joint("head_joint", "yaw", "head"),
        arm(6, root="lift"),
        link("piston", 0.4),
        joint("piston_joint", "link2", "piston"),
        fixed("tool0", "link6"),
        name="mobile",
    )


def two_armed() -> str:
    return robot(
        link("base", 20.0),
        arm(7, "right_", "base"),
        arm(7, "left_", "base"),
        fixed("left_tool0", "left_link7"),
        fixed("right_tool0", "right_link7"),
        name="two_armed",
    )


SHAPES = {made.__name__: made for made in (fingered, knuckled, barred, clawed, mobile)}
"""Shapes with one arm."""


def written(folder: Path, text: str, name: str = "arm.urdf") -> Path:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def said(robot: Robot, code: str) -> Remark:
    (remark,) = (remark for remark in robot.remarks if remark.code == code)
    return remark


def reduced_model(text, names, angles) -> tuple[pin.Model, Array]:
    """Pinocchio's model of a URDF with all joints but these locked, and which of its q each is."""
    model = pin.buildModelFromXML(text)
    q = pin.neutral(model)
    for name, angle in angles.items():
        one = model.joints[model.getJointId(name)]
        q[one.idx_q : one.idx_q + one.nq] = (
            angle if one.nq == 1 else [np.cos(angle), np.sin(angle)]
        )
    locked = [k for k in range(1, model.njoints) if model.names[k] not in names]
    reduced = pin.buildReducedModel(model, locked, q) if locked else model
    assert list(reduced.names)[1:] == list(names)
    return reduced, np.array([reduced.joints[k].nq for k in range(1, reduced.njoints)])


def agrees_with_pinocchio(text: str, robot: Robot, angles: Mapping[str, float] = {}) -> None:
    """Inverse dynamics and the flange of the robot are those of Pinocchio's reduced model."""
    theirs, sizes = reduced_model(text, robot.chain.names, angles)
    ours = robot.chain.to_pinocchio()
    taken = next(r for r in robot.remarks if "flange" in r.values)
    # A joint may have a link's name.
    frame = theirs.getFrameId(taken.values["flange"], pin.FrameType.BODY)
    rng = np.random.default_rng(3)
    for _ in range(10):
        q, v, a = rng.uniform(-2.0, 2.0, (3, robot.joints))
        full = np.concatenate(
            [[x] if nq == 1 else [np.cos(x), np.sin(x)] for x, nq in zip(q, sizes, strict=True)]
        )
        data, own = theirs.createData(), ours.createData()
        expected = pin.rnea(theirs, data, full, v, a)
        # rounding, of torques up to a hundred newton metres
        np.testing.assert_allclose(pin.rnea(ours, own, q, v, a), expected, rtol=1e-12, atol=1e-12)
        pin.framesForwardKinematics(theirs, data, full)
        pin.framesForwardKinematics(ours, own, q)
        pose, expected_pose = own.oMf[ours.getFrameId("flange")], data.oMf[frame]
        np.testing.assert_allclose(pose.homogeneous, expected_pose.homogeneous, atol=1e-12)
