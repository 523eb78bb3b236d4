"""Robots from descriptions (URDF, xacro, MJCF), and from a TOML beside them what these cannot say.

The TOML has the description's name with the ending ``.toml``. Its `tip` and `lock` say which arm
it is and at which angles the rest is held; its ``[[joints]]`` are matched by name.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np

from vftcli.robots.arm import BASE, ArmSearch, LumpedArm, shortened
from vftcli.robots.chain import Chain
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.mjcf import mjcf_tree
from vftcli.robots.profile import assemble, column
from vftcli.robots.regressor import LINK, TENSOR, torque_regressor
from vftcli.robots.robot import JointFriction, Limits, Robot, SensorNoise
from vftcli.robots.robot_file import (
    DESCRIPTIONS,
    TRAVEL,
    RobotFile,
    Section,
    robot_text,
    weightless,
)
from vftcli.robots.tree import BodyTree
from vftcli.robots.urdf import urdf_tree
from vftcli.robots.xml_text import NAMESPACE, urdf_of_xacro, xml_root
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError
from vftcli.signals.parsing import did_you_mean, is_finite, shown
from vftcli.signals.remarks import Remark, Where, caution, fact

#: First element of a description → who reads it.
READERS: dict[str, Callable[[Path, ET.Element], BodyTree]] = {
    "robot": urdf_tree,
    "mujoco": mjcf_tree,
}
#: First element of what is no description that can be read → what it is, and what to do.
CONVERSIONS = {
    "sdf": "an SDF; take the robot's URDF, or convert it (sdf2urdf of pysdf, sdformat_urdf of ROS)",
    "mujocoinclude": "a part of an MJCF; take the file that includes it",
    "COLLADA": "a mesh; take the URDF that names it",
}
#: Motion for which the effect of a changed tensor is stated. [rad/s], [rad/s²]
SPEED, ACCELERATION = 1.0, 2.0
POSES = 64  #: Poses that it is the worst of.


def load_described(path: Path, tip: str = "", arguments: Sequence[str] = ()) -> Robot:
    """Read an arm from a URDF, xacro or MJCF, and from the TOML beside it."""
    text = robot_text(path)
    root = xml_root(text, path)
    remarks: tuple[Remark, ...] = ()
    has_macros = any(NAMESPACE.match(str(element.tag)) for element in root.iter())
    if path.suffix.lower() == ".xacro" or has_macros:
        root = xml_root(urdf_of_xacro(path, arguments), path)
        remarks = (fact("xacro-run", file=path.name),)
    elif arguments:
        raise RobotError(f"{path}: {arguments[0]!r} is for a xacro, which this is not")
    if root.tag not in READERS:
        other = f"its first element is <{root.tag}>, not <robot> or <mujoco>"
        what = CONVERSIONS.get(root.tag, other)
        raise RobotError(f"{path}: not a URDF, xacro or MJCF: {what}")
    tree = READERS[root.tag](path, root)
    stem = path  # the TOML beside it has its name without all endings of descriptions
    while stem.suffix.lower() in DESCRIPTIONS:
        stem = stem.with_suffix("")
    beside = stem.with_name(f"{stem.name}.toml")
    file = RobotFile(beside).root if beside.is_file() else None
    angles = locked_angles(file, tree) if file is not None else {}
    wanted = tip or (file.text("tip") if file is not None else "")
    lumped = LumpedArm(tree, ArmSearch(tree, angles.keys()).find(wanted), angles)
    robot = robot_of(lumped, file, beside)
    remarks = (*remarks, *arm_remarks(lumped, robot.chain), *simulator_remarks(lumped))
    endless = [joint.name for joint in lumped.arm.joints if joint.kind == "continuous"]
    endless += [name for name in robot.endless if name not in endless]
    return replace(
        robot,
        path=path,
        endless=tuple(endless),
        simulated_friction=simulated_friction(lumped),
        remarks=(*remarks, *robot.remarks),
    )


def robot_of(lumped: LumpedArm, file: Section | None, beside: Path) -> Robot:
    """The robot of an arm: its chain and limits, the rest from the TOML beside it."""
    chain, name = lumped.chain(), lumped.tree.name
    if why := weightless(float(np.sum(chain.mass))):
        raise RobotError(f"{lumped.tree.path}: {why}, or take the maker's dynamic description")
    limits = Limits(
        **{
            key: np.array([joint.limits.get(key, np.nan) for joint in lumped.arm.joints])
            for key in Limits.__dataclass_fields__
        }
    )
    if file is None:
        nothing = np.full(chain.joints, np.nan)
        return Robot(
            name=name,
            title=name,
            chain=chain,
            limits=limits,
            noise=SensorNoise(current=nothing, tau=nothing, q=nothing, qd=nothing),
            remarks=(caution("urdf-alone", file=beside.name),),
        )
    joints = matched_joints(file, chain, lumped.tree)
    rotor = column(joints, "rotor_inertia")
    rotor = np.where(np.isnan(rotor), chain.rotor_inertia, rotor)
    gravity = file.vector("gravity", 3, chain.gravity.tolist())
    robot = assemble(file, joints, replace(chain, rotor_inertia=rotor, gravity=gravity))
    known = {
        name: np.where(np.isnan(mine := getattr(robot.limits, name)), getattr(limits, name), mine)
        for name in Limits.__dataclass_fields__
    }
    return replace(robot, limits=Limits(**known))


def locked_angles(file: Section, tree: BodyTree) -> dict[str, float]:
    """The joints that `lock = {joint = angle}` holds, whatever they are. [rad or m]"""
    table = file.section("lock")
    names = [joint.name for joint in tree.joints if joint.kind != "fixed"]
    for name, value in table.values.items():
        if name not in names:
            meant = did_you_mean(name, names)
            file.refuse(f"lock: no joint {name!r}.{meant} There is {shortened(names)}", "lock")
        if not is_finite(value) or (why := TRAVEL.broken(name, [float(value)])):
            why = f"{name} is {shown(value)}; it must be a finite number"
            file.refuse(f"lock: {why}", "lock")
    return {name: float(value) for name, value in table.values.items()}


def matched_joints(file: Section, chain: Chain, tree: BodyTree) -> list[Section]:
    """The ``[[joints]]`` of the TOML in the chain's order; those of locked joints are left out."""
    tables = {str(table.get("name")): (j, table) for j, table in enumerate(file.tables("joints"))}
    known = {joint.name for joint in tree.joints}
    if unknown := [name for name in tables if name not in known]:
        raise RobotError(
            f"{file.file.path}: no joint {unknown[0]!r} in {tree.path.name}; "
            f"it has {', '.join(chain.names)}"
        )
    return [
        Section(file.file, table, "joints", j)
        for j, table in (tables.get(name, (None, {"name": name})) for name in chain.names)
    ]


def simulated_friction(lumped: LumpedArm) -> tuple[JointFriction, ...]:
    """The friction that a simulator gives the joints; empty where it gives none."""
    joints = lumped.arm.joints
    if not any(joint.damping or joint.dry_friction for joint in joints):
        return ()
    return tuple(
        JointFriction(
            model="coulomb-viscous",
            parameters={"coulomb": joint.dry_friction, "viscous": joint.damping},
            confidence="a simulator's",
        )
        for joint in joints
    )


def arm_remarks(lumped: LumpedArm, chain: Chain) -> Iterator[Remark]:
    """Which joints, flange and locked parts were taken, and what is odd about their inertia."""
    locked = {joint.name: lumped.position(joint) for joint in lumped.locked}
    taken: dict[str, Any] = {
        "robot": lumped.tree.name,
        "count": chain.joints,
        "joints_taken": list(chain.names),
        "flange": lumped.flange[0],
        "gravity_m_s2": chain.gravity.tolist(),
        "root": lumped.tree.root,
    }
    if not locked:
        yield fact("arm-taken", **taken)
    else:
        lumps = lumped.lumped()
        zero = [name for name, value in locked.items() if not value]
        held = [f"{name} at {value:g}" for name, value in locked.items() if value]
        held += [f"{shortened(zero)} at 0"] if zero else []
        taken |= {"locked": locked, "locked_shown": ", ".join(held), "lumped_kg": lumps}
        taken["lumped_shown"] = (
            ", ".join(f"{mass:.3g} kg into {joint}" for joint, mass in lumps.items()) or "none"
        )
        yield fact("arm-and-locked-taken", **taken)
    last = chain.joints - 1
    beside = [joint.name for joint in lumped.locked if BASE < lumped.group_of(joint) < last]
    if beside:
        yield caution("side-branch-locked", locked=beside, locked_shown=shortened(beside))
    yield from inertia_remarks(lumped, chain)


def inertia_remarks(lumped: LumpedArm, chain: Chain) -> Iterator[Remark]:
    """Links without mass, tensors that no body has, and a mass matrix that cannot be inverted."""
    if bare := tuple(j + 1 for j, mass in enumerate(chain.mass) if mass == 0.0):
        yield caution("links-without-mass", Where(joints=bare))
    changes = lumped.tensor_changes()
    if changed := tuple(j + 1 for j, change in enumerate(changes) if np.any(change)):
        links = [lumped.arm.joints[j - 1].child for j in changed]
        worst = largest_effect(chain, changes)
        yield caution("tensors-changed", Where(joints=changed), links=links, worst_Nm=worst)
    if bare and singular(chain):
        yield caution("mass-matrix-singular")


def largest_effect(chain: Chain, changes: Array) -> float:
    """Largest joint torque of changed tensors at 1 rad/s and 2 rad/s², over random poses. [N·m]"""
    rng = np.random.default_rng(0)
    q = rng.uniform(-np.pi, np.pi, (POSES, chain.joints))
    sign = rng.choice([-1.0, 1.0], (2, *q.shape))
    regressor = torque_regressor(chain, q, SPEED * sign[0], ACCELERATION * sign[1])
    parameters = np.zeros((chain.joints, LINK))
    for k, (row, col) in enumerate(TENSOR, start=4):
        parameters[:, k] = changes[:, row, col]
    return float(np.max(np.abs(regressor @ parameters.ravel())))


def singular(chain: Chain) -> bool:
    """Whether the mass matrix cannot be inverted at some of a few poses."""
    rng, n = np.random.default_rng(0), chain.joints
    for q in rng.uniform(-np.pi, np.pi, (8, n)):
        M = momentum_terms(chain, np.tile(q, (n, 1)), np.eye(n)).p
        low, *_, high = np.linalg.eigvalsh(M + M.T) if n > 1 else (M[0, 0], M[0, 0])
        if low <= 1e-12 * high:
            return True
    return False


def simulator_remarks(lumped: LumpedArm) -> Iterator[Remark]:
    """What a simulator's description says of drives, which is tuned for the simulation."""
    joints = lumped.arm.joints
    if any(joint.rotor_inertia for joint in joints):
        yield caution("armature-taken", armature_kg_m2=[joint.rotor_inertia for joint in joints])
    if any(joint.damping or joint.dry_friction for joint in joints):
        yield caution(
            "simulator-friction-left",
            damping_Nms_rad=[joint.damping for joint in joints],
            dry_friction_Nm=[joint.dry_friction for joint in joints],
        )
