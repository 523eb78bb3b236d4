"""The arm as URDF text, so that viewers of ROS 2 recordings can draw it."""

from collections.abc import Mapping
from xml.sax.saxutils import quoteattr

import numpy as np

from vftcli.outputs.arm import Capsule, capsules
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.pose import Pose, rotation_onto, rpy_angles


def urdf_text(
    robot: Robot, names: tuple[str, ...], mounted: Mapping[str, Pose] | None = None
) -> str:
    """URDF of the arm as it was used, the payload in its last link."""
    chain = robot.loaded_chain
    shapes = capsules(chain)
    parts = [f"<robot name={quoteattr(robot.name)}>", link("base", shapes[0], "")]
    for j, name in enumerate(names):
        inertial = inertial_text(float(chain.mass[j]), chain.com[j], chain.inertia[j])
        parts.append(link(f"link_{j + 1}", shapes[j + 1], inertial))
        parent = f"link_{j}" if j else "base"
        placed = origin(chain.translation[j], chain.rotation[j])
        limits = limit_text(robot, j)
        parts.append(
            f'<joint name={quoteattr(name)} type="revolute"><parent link="{parent}"/>'
            f'<child link="link_{j + 1}"/>{placed}<axis xyz="0 0 1"/>{limits}</joint>'
        )
    placed = origin(chain.flange_translation, chain.flange_rotation)
    parts.append(fixed("flange", f"link_{chain.joints}", placed))
    for name, pose in (mounted or {}).items():
        parts.append(fixed(name, "flange", origin(pose.translation, pose.rotation)))
    return "\n".join([*parts, "</robot>"]) + "\n"


def fixed(name: str, parent: str, placed: str) -> str:
    """A frame that is fixed to a link, at an origin."""
    return (
        f'<link name="{name}"/><joint name="{name}_mount" type="fixed">'
        f'<parent link="{parent}"/><child link="{name}"/>{placed}</joint>'
    )


def link(name: str, shapes: list[Capsule], inertial: str) -> str:
    """A link as URDF: its mass and the cylinders that show it."""
    visuals = "".join(
        f"<visual>{origin(s.start + 0.5 * s.direction, rotation_onto(s.direction))}<geometry>"
        f'<cylinder radius="{s.radius:.6g}" length="{np.linalg.norm(s.direction):.9g}"/>'
        "</geometry></visual>"
        for s in shapes
    )
    return f'<link name="{name}">{inertial}{visuals}</link>'


def inertial_text(mass: float, com: Array, inertia: Array) -> str:
    """Mass, centre of mass and tensor of one link."""
    entries = {"xx": (0, 0), "xy": (0, 1), "xz": (0, 2), "yy": (1, 1), "yz": (1, 2), "zz": (2, 2)}
    tensor = " ".join(f'i{key}="{inertia[at]:.12g}"' for key, at in entries.items())
    placed = origin(com, np.eye(3))
    return f'<inertial>{placed}<mass value="{mass:.12g}"/><inertia {tensor}/></inertial>'


def limit_text(robot: Robot, j: int) -> str:
    """Limits of one joint; where the robot file gives none, wide ones, as URDF insists on some."""
    limits = robot.limits
    given = {
        "lower": (limits.q_min[j], -2.0 * np.pi),
        "upper": (limits.q_max[j], 2.0 * np.pi),
        "velocity": (limits.qd_max[j], 10.0),
        "effort": (limits.tau_max[j], 1000.0),
    }
    values = {k: v if np.isfinite(v) else wide for k, (v, wide) in given.items()}
    text = " ".join(f'{key}="{value:.9g}"' for key, value in values.items())
    return f"<limit {text}/>"


def origin(translation: Array, rotation: Array) -> str:
    """A pose as URDF writes it: R = Rz(yaw) Ry(pitch) Rx(roll)."""
    roll, pitch, yaw = rpy_angles(rotation)
    xyz = " ".join(f"{value:.12g}" for value in translation)
    return f'<origin xyz="{xyz}" rpy="{roll:.15g} {pitch:.15g} {yaw:.15g}"/>'
