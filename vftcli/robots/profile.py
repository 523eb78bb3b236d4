"""Robot files: TOML, schema 1, read and checked, every complaint with the line that is wrong."""

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.robots.chain import CONVENTIONS, Chain, Payload, kinematics, symmetric, unphysical
from vftcli.robots.friction import PRESLIDING, falling_friction, lawless
from vftcli.robots.robot import TORQUE_SOURCES, JointFriction, Limits, Robot, SensorNoise
from vftcli.robots.robot_file import RobotFile, Section, weightless
from vftcli.signals.arrays import Array
from vftcli.signals.parsing import (
    NUMBER,
    PER_AXIS,
    PER_JOINT,
    SWITCH,
    TABLE,
    TEXT,
    TEXTS,
    ValueKind,
    several,
    shown,
)
from vftcli.signals.pose import Pose, rpy_matrix
from vftcli.signals.remarks import fact

SCHEMA = 1
UPRIGHT = (0.0, 0.0, -9.81)
ORIGIN = (0.0, 0.0, 0.0)

#: Friction model → its required and its optional keys in ``[joints.friction]``.
#:
#: Beside these every model may have `PRESLIDING` and a temperature law; "points" has lists.
FRICTION_KEYS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "coulomb-viscous": (("coulomb", "viscous"), ("smoothing",)),
    "coulomb-viscous-offset": (("coulomb", "viscous"), ("offset", "smoothing")),
    "coulomb-viscous-quadratic": (("coulomb", "viscous"), ("quadratic", "offset", "smoothing")),
    "coulomb-viscous-load": (
        ("coulomb", "viscous", "load_coulomb"),
        ("quadratic", "offset", "smoothing"),
    ),
    "coulomb-viscous-stribeck": (
        ("coulomb", "viscous", "stribeck", "stribeck_velocity"),
        ("load_coulomb", "quadratic", "offset", "smoothing"),
    ),
    "coulomb-logarithmic": (
        ("coulomb", "logarithmic", "logarithmic_velocity"),
        ("viscous", "load_coulomb", "stribeck", "stribeck_velocity", "offset", "smoothing"),
    ),
    "points": ((), ("load_coulomb", "stribeck", "stribeck_velocity", "offset", "smoothing")),
    "sigmoid": (("amplitude", "slope", "shift"), ()),
}


def load_profile(path: Path) -> Robot:
    """Read a robot file."""
    root = RobotFile(path).root
    schema = root.values.get("schema", SCHEMA)
    if isinstance(schema, bool) or schema != SCHEMA:
        root.refuse(f"schema is {shown(schema)}; this version reads schema {SCHEMA}", "schema")
    joints = checked_joints(root)
    return assemble(root, joints, build_chain(root, joints))


def assemble(root: Section, joints: Sequence[Section], chain: Chain) -> Robot:
    """Put a Robot together from its chain and the rest of its file (drives, friction, gains)."""
    source = root.choice("torque_source", TORQUE_SOURCES, "joint_torque")
    payloads = {
        name: checked_payload(section)
        for name, section in root.section("payload").named_sections("mass").items()
    }
    noise = {name: column(joints, f"noise_{name}") for name in SensorNoise.__dataclass_fields__}
    friction, limits = checked_friction(joints), checked_limits(joints)
    endless = [joint.value("endless", SWITCH, False) for joint in joints]
    notes = root.value("notes", TEXTS, ())
    notes = [notes] if isinstance(notes, str) else notes
    return Robot(
        name=(name := root.text("name", root.file.path.stem)),
        title=root.text("title", name),
        chain=chain,
        torque_source=source,
        torque_constant=checked_torque_constant(joints, source),
        gear=checked_gear(joints, "gear"),
        efficiency=checked_gear(joints, "gear_efficiency"),
        endless=tuple(itertools.compress(chain.names, endless)),
        friction=friction,
        limits=limits,
        noise=SensorNoise(**noise),
        sample_rate_hz=root.number("sample_rate_hz", math.nan),
        ros_state=root.text("ros_state"),
        payload=payloads.pop("", None),
        payloads=payloads,
        gains=checked_gains(root.section("observers")),
        tools=checked_poses(root.section("tool")),
        sensors=checked_poses(root.section("sensor")),
        admittance=checked_admittance(root.section("admittance")),
        sources=root.tables("sources"),
        published=root.section("published").values,
        document=root.values,
        remarks=(
            *(fact("robot-file-note", text=text) for text in notes if text),
            *falling_friction(friction, limits.qd_max),
        ),
        path=root.file.path,
    )


def checked_joints(root: Section) -> list[Section]:
    """Return the ``[[joints]]`` tables, as many as `dof` says, each with a name of its own."""
    tables = root.tables("joints")
    if not tables:
        root.refuse("there are no [[joints]] tables; a robot file has one for each joint")
    dof = root.values.get("dof", len(tables))
    if isinstance(dof, bool) or dof != len(tables):
        root.refuse(f"dof is {shown(dof)} but the file has {len(tables)} [[joints]] tables", "dof")
    joints = [Section(root.file, table, "joints", j) for j, table in enumerate(tables)]
    names = joint_names(joints)
    for j, (joint, name) in enumerate(zip(joints, names, strict=True)):
        if name in names[:j]:
            joint.refuse(f"name is {name!r}, as another joint's; each has its own", "name")
    return joints


def joint_names(joints: Sequence[Section]) -> tuple[str, ...]:
    """The names of the joints, joint1, joint2, … where the file gives none."""
    return tuple(joint.text("name", f"joint{i}") for i, joint in enumerate(joints, start=1))


def build_chain(root: Section, joints: Sequence[Section]) -> Chain:
    """The chain, each joint with the keys of the file's convention and a body that can be."""
    convention = root.choice("convention", CONVENTIONS)
    numbers, vectors = CONVENTIONS[convention]
    frames: list[dict[str, Any]] = [
        {key: joint.number(key) for key in numbers} | {key: joint.vector(key, 3) for key in vectors}
        for joint in joints
    ]
    end: dict[str, Any] = {"flange_d": root.number("flange_d", 0.0)}
    end |= {key: root.vector(key, 3, ORIGIN) for key in ("ee_xyz", "ee_rpy")}
    placements, inertial_frames, tip = kinematics(convention, frames, end)
    masses, coms, inertias = [], [], []
    for joint, frame in zip(joints, inertial_frames, strict=True):
        mass, com, tensor = checked_body(joint)
        masses.append(mass)
        coms.append(frame.rotation @ com + frame.translation)
        inertias.append(frame.rotation @ tensor @ frame.rotation.T)
    if why := weightless(sum(masses)):
        root.refuse(why)
    return Chain(
        names=joint_names(joints),
        rotation=np.array([p.rotation for p in placements]),
        translation=np.array([p.translation for p in placements]),
        mass=np.array(masses),
        com=np.array(coms),
        inertia=np.array(inertias),
        rotor_inertia=column(joints, "rotor_inertia", default=0.0),
        gravity=root.vector("gravity", 3, UPRIGHT),
        flange_rotation=tip.rotation,
        flange_translation=tip.translation,
    )


def checked_body(
    table: Section, default: Sequence[float] | None = None
) -> tuple[float, Array, Array]:
    """Return mass [kg], centre of mass (3,) [m] and tensor (3, 3) [kg·m²] that a body can have."""
    mass, com = table.number("mass"), table.vector("com", 3, default and default[:3])
    tensor = symmetric(table.vector("inertia", 6, default).tolist())
    if why := unphysical(mass, tensor):
        table.refuse(why, "mass" if why.startswith("mass") else "inertia")
    return mass, com, tensor


def checked_torque_constant(joints: Sequence[Section], source: str) -> Array | None:
    """Return the drive constants, or None where no joint has one and none is needed."""
    missing = [joint for joint in joints if "torque_constant" not in joint.values]
    if len(missing) == len(joints) and source != "current":
        return None
    if missing:
        missing[0].refuse(
            "torque_constant is missing; torque_source = current needs it in every joint"
        )
    return column(joints, "torque_constant")


def checked_gear(joints: Sequence[Section], key: str) -> Array | None:
    """Return the numbers of a gear between log and joint, 1 where a joint has none, else None."""
    if not any(key in joint.values for joint in joints):
        return None
    found = column(joints, key, default=1.0)
    for joint, value in zip(joints, found, strict=True):
        if value == 0 or (key == "gear_efficiency" and not 0 < value <= 1):
            allowed = "any number but 0" if key == "gear" else "above 0, at most 1"
            joint.refuse(f"{key} is {value:g}; it is {allowed}", key)
    return found


def checked_friction(joints: Sequence[Section]) -> tuple[JointFriction, ...]:
    """Return one friction model a joint; a joint without one has the model "none"."""
    models = [
        checked_joint_friction(joint.section("friction"))
        if "friction" in joint.values
        else JointFriction()
        for joint in joints
    ]
    return tuple(models) if any(m.model != "none" for m in models) else ()


def checked_joint_friction(section: Section) -> JointFriction:
    """Return one joint's ``[joints.friction]``, its keys checked."""
    name = section.choice("model", (*FRICTION_KEYS, "none"))
    if name == "none":
        return JointFriction()
    for key, other in (PRESLIDING, PRESLIDING[::-1], ("temperature", "temperature_at")):
        if key in section.values and other not in section.values:
            section.refuse(f"{other} is missing; {key} needs it beside it", key)
    required, optional = FRICTION_KEYS[name]
    keys = (*required, *(key for key in (*optional, *PRESLIDING) if key in section.values))
    law = section.vector("temperature", 4).tolist() if "temperature" in section.values else ()
    if why := lawless(law):
        section.refuse(why, "temperature")
    return JointFriction(
        model=name,
        parameters={key: section.number(key) for key in keys},
        **(checked_points(section) if name == "points" else {}),
        temperature=tuple(law),
        temperature_at=section.number("temperature_at")
        if "temperature_at" in section.values
        else None,
        confidence=section.text("confidence"),
    )


def checked_points(section: Section) -> dict[str, tuple[float, ...]]:
    """Return the points of a bent line: rising speeds [rad/s] and a torque [N·m] at each."""
    speeds, torques = (tuple(section.bounded(key, several(2))) for key in ("speeds", "torques"))
    if len(torques) != len(speeds):
        section.refuse(f"there are {len(torques)} torques for {len(speeds)} speeds", "torques")
    if any(fast <= slow for slow, fast in itertools.pairwise(speeds)):
        section.refuse(f"speeds is {shown(list(speeds))}; each lies above the one before", "speeds")
    return {"speeds": speeds, "torques": torques}


def checked_limits(joints: Sequence[Section]) -> Limits:
    """Return the joint limits, NaN where the file gives none; a lower one is below its upper."""
    limits = Limits(**{name: column(joints, name) for name in Limits.__dataclass_fields__})
    for joint, low, high in zip(joints, limits.q_min, limits.q_max, strict=True):
        if low >= high:
            joint.refuse(f"q_min is {low:g} rad, not below q_max {high:g} rad", "q_min")
    return limits


def checked_gains(section: Section) -> dict[str, Mapping[str, Any]]:
    """Return the ``[observers.*]`` tables: each value is a number, a list of them, or a word."""
    for name in section.values:
        own = section.section(name)
        for key, value in own.values.items():
            own.value(key, TEXT if isinstance(value, str) else PER_JOINT)
    return dict(section.values)


#: Key of ``[admittance]`` → its kind.
ADMITTANCE = {
    "confidence": TEXT,
    "period": NUMBER,
    "position": TABLE,
    "rotation": TABLE,
    "source": TEXT,
    "start": ValueKind("one number a joint", several(1).fits),
    "threshold_mode": TEXT,
}


def checked_admittance(section: Section) -> Mapping[str, Any]:
    """Return ``[admittance]``, the kinds of its keys checked; their range the admittance knows."""
    for key in section.values:
        if key not in ADMITTANCE:
            section.refuse(f"no key {key!r}; it has {', '.join(ADMITTANCE)}", key)
        section.value(key, ADMITTANCE[key])
    section.number("period", 1.0)
    for axes in map(section.section, ("position", "rotation")):
        for key in axes.values:
            axes.value(key, PER_AXIS)
    return section.values


def checked_payload(section: Section) -> Payload:
    """Return one payload section as a Payload; `rpy` turns its axes into the flange's."""
    mass, com, tensor = checked_body(section, default=np.zeros(6).tolist())
    turn = rpy_matrix(section.vector("rpy", 3, ORIGIN).tolist())
    return Payload(mass=mass, com=turn @ com, inertia=turn @ tensor @ turn.T)


def checked_poses(section: Section) -> dict[str, Pose]:
    """Return the poses on the flange that ``[name]``, under "", and each ``[name.NAME]`` state.

    Keys are xyz [m] and rpy [rad]; what is left out is zero.
    """
    found = {}
    for name, table in section.named_sections("xyz", "rpy").items():
        turn = rpy_matrix(table.vector("rpy", 3, ORIGIN).tolist())
        found[name] = Pose(turn, table.vector("xyz", 3, ORIGIN))
    return found


def column(joints: Sequence[Section], key: str, default: float = math.nan) -> Array:
    """Return one number a joint, `default` where a joint has none. (n,)"""
    return np.array([joint.number(key, default) for joint in joints])
