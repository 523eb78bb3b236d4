"""Robots from descriptions (URDF, xacro, MJCF), with a TOML beside them.

The TOML says what these cannot: it has the description's name, `tip` and `lock` for the
arm and the held rest, and ``[[joints]]`` that match by name.

A xacro is a program that writes a URDF. The package xacro expands it without ROS, in a
process of its own, since a program need not end.
"""

import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from io import StringIO
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from vftcli.robots.arm import BASE, BodyTree, LumpedArm, shortened
from vftcli.robots.chain import Chain
from vftcli.robots.kernels import chain_parameters, momentum_terms, torque_regressor
from vftcli.robots.meshes import meshes_of, packages_near
from vftcli.robots.profile import assemble, column
from vftcli.robots.robot import JointFriction, Limits, Robot
from vftcli.robots.robot_file import DESCRIPTIONS, RobotFile, Section, robot_text, weightless
from vftcli.robots.urdf import mjcf_tree, urdf_tree
from vftcli.signals.errors import RobotError
from vftcli.signals.packages import needed
from vftcli.signals.parsing import did_you_mean
from vftcli.signals.remarks import Remark, caution, fact, on_joints

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


def load_described(path: Path, tip: str, arguments: Sequence[str]) -> Robot:
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
    stem = path  # without all endings of descriptions
    while stem.suffix.lower() in DESCRIPTIONS:
        stem = stem.with_suffix("")
    beside = stem.with_name(f"{stem.name}.toml")
    alone = not beside.is_file()
    file = RobotFile(beside, text="" if alone else None).root
    lumped = LumpedArm(tree, tip or file.text("tip"), locked_angles(file, tree))
    robot = robot_of(lumped, file)
    if alone:
        said = caution("urdf-alone", file=beside.name)
        robot = replace(robot, name=tree.name, title=tree.name, remarks=(said,))
    meshes = meshes_of(lumped, root) if root.tag == "robot" else ()
    if lacking := [mesh.name for mesh in meshes if mesh.file is None]:
        remarks += (fact("meshes-not-found", count=len(lacking), first=lacking[0]),)
    remarks = (*remarks, *arm_remarks(lumped, robot.chain), *inertia_remarks(lumped, robot.chain))
    damping = [joint.damping for joint in lumped.joints]
    dry = [joint.dry_friction for joint in lumped.joints]
    friction: tuple[JointFriction, ...] = ()
    if any(damping) or any(dry):
        left = caution("simulator-friction-left", damping_Nms_rad=damping, dry_friction_Nm=dry)
        remarks += (left,)
        friction = tuple(
            JointFriction(
                model="coulomb-viscous",
                parameters={"coulomb": coulomb, "viscous": viscous},
                confidence="a simulator's",
            )
            for coulomb, viscous in zip(dry, damping, strict=True)
        )
    endless = [joint.name for joint in lumped.joints if joint.kind == "continuous"]
    return replace(
        robot,
        path=path,
        endless=tuple(dict.fromkeys([*endless, *robot.endless])),
        simulated_friction=friction,
        meshes=meshes,
        remarks=(*remarks, *robot.remarks),
    )


def robot_of(lumped: LumpedArm, file: Section) -> Robot:
    """The robot of an arm: chain and limits, the rest from its TOML."""
    chain = lumped.chain
    if why := weightless(chain.mass.sum()):
        raise RobotError(f"{lumped.tree.path}: {why}, or take the maker's dynamic description")
    tables = {str(table.get("name")): (j, table) for j, table in enumerate(file.tables("joints"))}
    known = {joint.name for joint in lumped.tree.joints}
    if unknown := [name for name in tables if name not in known]:
        raise RobotError(
            f"{file.file.path}: no joint {unknown[0]!r} in {lumped.tree.path.name}; "
            f"it has {', '.join(chain.names)}"
        )
    each = (tables.get(name, (None, {"name": name})) for name in chain.names)
    joints = [Section(file.file, table, "joints", j) for j, table in each]
    rotor = column(joints, "rotor_inertia")
    rotor = np.where(np.isnan(rotor), chain.rotor_inertia, rotor)
    gravity = file.vector("gravity", 3, chain.gravity.tolist())
    robot = assemble(file, joints, replace(chain, rotor_inertia=rotor, gravity=gravity))
    limits = {}
    for name, values in vars(robot.limits).items():
        described = [joint.limits.get(name, np.nan) for joint in lumped.joints]
        limits[name] = np.where(np.isnan(values), described, values)
    return replace(robot, limits=Limits(**limits))


def locked_angles(file: Section, tree: BodyTree) -> dict[str, float]:
    """The joints that `lock = {joint = angle}` holds, whatever they are. [rad or m]"""
    table = file.section("lock")
    names = [joint.name for joint in tree.joints if joint.kind != "fixed"]
    for name in table.values:
        if name not in names:
            meant = did_you_mean(name, names)
            file.refuse(f"lock: no joint {name!r}.{meant} There is {shortened(names)}", "lock")
    return {name: table.number(name) for name in table.values}


def arm_remarks(lumped: LumpedArm, chain: Chain) -> Iterator[Remark]:
    """Remarks on the joints, flange and locked parts of the arm."""
    locked = {joint.name: lumped.position(joint) for joint in lumped.locked}
    values = {
        "robot": lumped.tree.name,
        "count": chain.joints,
        "joints_taken": list(chain.names),
        "flange": lumped.flange[0],
        "gravity_m_s2": chain.gravity,
        "root": lumped.tree.root,
    }
    if not locked:
        yield fact("arm-used", **values)
    else:
        # Joint of the arm that carries locked ones → mass that its own link carries. [kg]
        lumps = {
            (joint := lumped.joints[j]).name: mass - lumped.tree.bodies[joint.child].mass
            for j, mass in enumerate(chain.mass.tolist())
            if j in lumped.locked.values()
        }
        zero = [name for name, value in locked.items() if not value]
        held = [f"{name} at {value:g}" for name, value in locked.items() if value]
        held += [f"{shortened(zero)} at 0"] if zero else []
        values |= {"locked": locked, "locked_shown": ", ".join(held), "lumped_kg": lumps}
        values["lumped_shown"] = (
            ", ".join(f"{mass:.3g} kg into {joint}" for joint, mass in lumps.items()) or "none"
        )
        yield fact("arm-and-locked-used", **values)
    last = chain.joints - 1
    beside = [joint.name for joint, group in lumped.locked.items() if BASE < group < last]
    if beside:
        yield caution("side-branch-locked", locked=beside, locked_shown=shortened(beside))


def inertia_remarks(lumped: LumpedArm, chain: Chain) -> Iterator[Remark]:
    """Remarks on odd inertia of links and rotors."""
    bare = chain.mass == 0.0
    if bare.any():
        yield caution("links-without-mass", on_joints(bare))
    # Zero where the tensor was one that a body can have.
    given = replace(chain, inertia=np.array([body.inertia for _, body in lumped.turned]))
    changed = np.any(chain.inertia != given.inertia, axis=(1, 2))
    if changed.any():
        links = [lumped.joints[j].child for j in np.flatnonzero(changed)]
        parameters = chain_parameters(chain) - chain_parameters(given)
        rng = np.random.default_rng(0)
        q = rng.uniform(-np.pi, np.pi, (POSES, chain.joints))
        sign = rng.choice([-1.0, 1.0], (2, *q.shape))
        regressor = torque_regressor(chain, q, SPEED * sign[0], ACCELERATION * sign[1])
        worst = abs(regressor @ parameters).max()
        yield caution("tensors-changed", on_joints(changed), links=links, worst_Nm=worst)
    if bare.any():
        n = chain.joints
        q = np.random.default_rng(0).uniform(-np.pi, np.pi, (8, n))
        M = momentum_terms(chain, q.repeat(n, axis=0), np.tile(np.eye(n), (8, 1))).p
        M = M.reshape(8, n, n)
        values = np.linalg.eigvalsh(M + M.swapaxes(1, 2))
        if np.any(values[:, 0] <= 1e-12 * values[:, -1]):
            yield caution("mass-matrix-singular")
    rotors = [joint.rotor_inertia for joint in lumped.joints]
    if any(rotors):
        yield caution("armature-used", armature_kg_m2=rotors)


#: Elements within one another: a URDF has four, an MJCF one more than its arm has links.
DEEPEST = 500
#: Tag of an xacro element: it still has to be expanded.
NAMESPACE = re.compile(r"\{[^}]*xacro[^}]*\}")
#: A declaration of an argument, which has a default.
DECLARED = re.compile(r"<xacro:arg\s[^>]*?name\s*=\s*[\"']([^\"']+)[\"']")
#: A use of an argument; one that is not declared has to be given.
USED = re.compile(r"\$\(arg\s+([^)\s]+)\s*\)")
#: Time of a processor in which a xacro must be expanded; large ones take below one. [s]
SECONDS = 10
WAITED = 6  #: How many times as long it may take on busy processors.
MEMORY = 1 << 30  #: Memory for it; large ones take a tenth. [B]


def xml_root(text: str, path: Path) -> ET.Element:
    """The first element of an XML text without a document type and deep nesting."""
    if "<!DOCTYPE" in text:
        raise RobotError(
            f"{path}: has a document type, which defines XML entities; "
            "a robot description needs none: remove it"
        )
    depth = 0
    try:
        for event, element in ET.iterparse(StringIO(text), ("start", "end")):
            root: ET.Element = element
            depth += 1 if event == "start" else -1
            if depth > DEEPEST:
                raise RobotError(f"{path}: more than {DEEPEST} elements within one another")
    except (ET.ParseError, ValueError) as error:
        raise RobotError(f"{path}: not a URDF, xacro or MJCF, which is XML: {error}") from None
    return root


def urdf_of_xacro(path: Path, arguments: Sequence[str]) -> str:
    """The URDF that `vftcli.robots.xacro_child` makes of a xacro, within its limits."""
    given = dict(word.split(":=", 1) for word in arguments)
    line = " ".join(["xacro", path.name, *(f"{k}:={v}" for k, v in given.items())])
    otherwise = f"; or give the URDF that it writes: {line} > {path.name.split('.')[0]}.urdf"
    for module in ("xacro", "xacrodoc"):
        needed(module, f"{path}: a xacro", otherwise, RobotError)
    limits = {"seconds": SECONDS, "memory": MEMORY, "packages": dict(packages_near(path))}
    try:
        ended = subprocess.run(
            # By path, not from the current folder, which may hold an xacro.py.
            [sys.executable, "-P", str(Path(__file__).with_name("xacro_child.py"))],
            input=json.dumps({"path": str(path), "arguments": given, **limits}),
            capture_output=True,
            encoding="utf-8",
            timeout=WAITED * SECONDS,
            check=True,
        )
    except (subprocess.CalledProcessError, subprocess.TimeoutExpired):
        raise RobotError(
            f"{path}: the xacro cannot be expanded within {SECONDS} s of a processor and "
            f"{MEMORY / 2**30:.0f} GiB of memory; give the URDF that it writes"
        ) from None
    made = json.loads(ended.stdout)
    why, sources = made["why"], [robot_text(Path(file)) for file in (path, *made["files"])]
    declared = [name for source in sources for name in DECLARED.findall(source)]
    used = [name for source in sources for name in USED.findall(source)]
    known = dict.fromkeys([*used, *declared])
    takes = f"it takes {', '.join(known) or 'none'}"
    if unknown := next((name for name in given if name not in known), None):
        meant = did_you_mean(unknown, known)
        raise RobotError(
            f"{path}: the xacro takes no argument {unknown!r}.{meant} Behind its name {takes}"
        )
    if why and (missing := [k for k in dict.fromkeys(used) if k not in (*declared, *given)]):
        raise RobotError(
            f"{path}: the xacro needs {', '.join(missing)}: give --robot '{path} "
            f"{missing[0]}:=VALUE'; {takes}"
        )
    if why:
        raise RobotError(f"{path}: the xacro cannot be expanded: {why}; {takes}")
    return str(made["text"])
