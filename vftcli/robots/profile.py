"""Robot files, TOML of schema 1: read, checked, and written to read alike."""

import itertools
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.robots.chain import (
    CONVENTIONS,
    Body,
    Chain,
    Payload,
    kinematics,
    symmetric,
    unphysical,
)
from vftcli.robots.friction import FRICTION_MODELS, PRESLIDING, falling_friction, lawless
from vftcli.robots.robot import TORQUE_SOURCES, JointFriction, Limits, Robot, SensorNoise
from vftcli.robots.robot_file import (
    NUMBER,
    PER_AXIS,
    PER_JOINT,
    SWITCH,
    TABLE,
    TEXT,
    TEXTS,
    RobotFile,
    Section,
    ValueKind,
    is_table,
    lines_of,
    several,
    weightless,
)
from vftcli.signals.arrays import Array
from vftcli.signals.parsing import shown
from vftcli.signals.pose import Pose, inverse, rpy_angles, rpy_matrix
from vftcli.signals.remarks import fact

SCHEMA = 1
UPRIGHT = (0.0, 0.0, -9.81)
ORIGIN = (0.0, 0.0, 0.0)

Table = dict[str, Any]


def load_profile(path: Path) -> Robot:
    """Read a robot file."""
    root = RobotFile(path).root
    check_count(root, "schema", SCHEMA, f"; this version reads schema {SCHEMA}")
    tables = root.tables("joints")
    if not tables:
        root.refuse("there are no [[joints]] tables; a robot file has one for each joint")
    count = len(tables)
    check_count(root, "dof", count, f" but the file has {count} [[joints]] tables")
    joints = [Section(root.file, table, "joints", j) for j, table in enumerate(tables)]
    names = [joint.text("name", f"joint{i}") for i, joint in enumerate(joints, start=1)]
    for j, (joint, name) in enumerate(zip(joints, names, strict=True)):
        if name in names[:j]:
            joint.refuse(f"name is {name!r}, as another joint's; each has its own", "name")
    convention = root.choice("convention", CONVENTIONS)
    numbers, vectors = CONVENTIONS[convention]
    frames: list[dict[str, Any]] = [
        {key: joint.number(key) for key in numbers}
        | {key: joint.vector(key, 3) for key in vectors}
        for joint in joints
    ]
    end: dict[str, Any] = {"flange_d": root.number("flange_d", 0.0)}
    end |= {key: root.vector(key, 3, ORIGIN) for key in ("ee_xyz", "ee_rpy")}
    placements, inertial_frames = kinematics(convention, frames, end)
    bodies = [
        checked_body(joint).moved(frame)
        for joint, frame in zip(joints, inertial_frames, strict=True)
    ]
    if why := weightless(sum(body.mass for body in bodies)):
        root.refuse(why)
    rotors, gravity = column(joints, "rotor_inertia", 0.0), root.vector("gravity", 3, UPRIGHT)
    chain = Chain.of(names, placements, bodies, rotor_inertia=rotors, gravity=gravity)
    return assemble(root, joints, chain)


def assemble(root: Section, joints: Sequence[Section], chain: Chain) -> Robot:
    """The Robot of a chain and the rest of its file (drives, friction, gains)."""
    source = root.choice("torque_source", TORQUE_SOURCES, "joint_torque")
    payloads = {}
    for own, section in root.section("payload").named_sections("mass").items():
        turn = Pose(rpy_matrix(section.vector("rpy", 3, ORIGIN)))
        body = checked_body(section, default=(0.0,) * 6).moved(turn)
        payloads[own] = Payload(**body._asdict())
    friction = tuple(friction_of(joint) for joint in joints)
    if all(joint.model == "none" for joint in friction):
        friction = ()
    limits = Limits(**columns(joints, Limits))
    for joint, low, high in zip(joints, limits.q_min, limits.q_max, strict=True):
        if low >= high:
            joint.refuse(f"q_min is {low:g} rad, not below q_max {high:g} rad", "q_min")
    endless = [joint.value("endless", SWITCH, False) for joint in joints]
    notes = root.value("notes", TEXTS, ())
    notes = [notes] if isinstance(notes, str) else notes
    return Robot(
        name=(name := root.text("name", root.file.path.stem)),
        title=root.text("title", name),
        chain=chain,
        torque_source=source,
        torque_constant=torque_constants(joints, source),
        gear=gear_numbers(joints, "gear"),
        efficiency=gear_numbers(joints, "gear_efficiency"),
        endless=tuple(itertools.compress(chain.names, endless)),
        friction=friction,
        limits=limits,
        noise=SensorNoise(**columns(joints, SensorNoise, "noise_")),
        sample_rate_hz=root.number("sample_rate_hz", math.nan),
        ros_state=root.text("ros_state"),
        payload=payloads.pop("", None),
        payloads=payloads,
        gains=checked_gains(root.section("observers")),
        tools=poses(root.section("tool")),
        sensors=poses(root.section("sensor")),
        admittance=checked_admittance(root.section("admittance")),
        sources=root.tables("sources"),
        document=root.values,
        remarks=(
            *(fact("robot-file-note", text=text) for text in notes if text),
            *falling_friction(friction, limits.qd_max),
        ),
        path=root.file.path,
    )


def check_count(root: Section, key: str, count: int, message: str) -> None:
    """Refuse an optional whole number of a key unless it is this one."""
    stated = root.values.get(key, count)
    if isinstance(stated, bool) or stated != count:
        root.refuse(f"{key} is {shown(stated)}{message}", key)


def checked_body(table: Section, default: Sequence[float] | None = None) -> Body:
    """The body of a table, with a mass and a tensor that a body can have."""
    mass, com = table.number("mass"), table.vector("com", 3, default and default[:3])
    tensor = symmetric(table.vector("inertia", 6, default))
    if why := unphysical(mass, tensor):
        table.refuse(why, "mass" if why.startswith("mass") else "inertia")
    return Body(mass, com, tensor)


def torque_constants(joints: Sequence[Section], source: str) -> Array | None:
    """The drive constants, None where none are and none is needed."""
    missing = [joint for joint in joints if "torque_constant" not in joint.values]
    if len(missing) == len(joints) and source != "current":
        return None
    if missing:
        missing[0].refuse(
            "torque_constant is missing; torque_source = current needs it in every joint"
        )
    return column(joints, "torque_constant")


def gear_numbers(joints: Sequence[Section], key: str) -> Array | None:
    """The numbers of a gear, 1 where a joint has none; None of none."""
    if not any(key in joint.values for joint in joints):
        return None
    found = column(joints, key, default=1.0)
    for joint, value in zip(joints, found, strict=True):
        if value == 0 or (key == "gear_efficiency" and not 0 < value <= 1):
            allowed = "any number but 0" if key == "gear" else "above 0, at most 1"
            joint.refuse(f"{key} is {value:g}; it is {allowed}", key)
    return found


def friction_of(joint: Section) -> JointFriction:
    """One joint's ``[joints.friction]``, its keys checked."""
    section = joint.section("friction")
    there = section.values
    default = None if "friction" in joint.values else "none"
    name = section.choice("model", (*FRICTION_MODELS, "none"), default)
    if name == "none":
        return JointFriction()
    for key, other in (PRESLIDING, PRESLIDING[::-1], ("temperature", "temperature_at")):
        if key in there and other not in there:
            section.refuse(f"{other} is missing; {key} needs it beside it", key)
    model = FRICTION_MODELS[name]
    keys = (*model.required, *(key for key in (*model.optional, *PRESLIDING) if key in there))
    law = section.vector("temperature", 4).tolist() if "temperature" in there else ()
    if why := lawless(law):
        section.refuse(why, "temperature")
    line: dict[str, tuple[float, ...]] = {}
    if name == "points":
        line = {key: tuple(section.bounded(key, several(2))) for key in ("speeds", "torques")}
        speeds, count = line["speeds"], len(line["torques"])
        if count != len(speeds):
            section.refuse(f"there are {count} torques for {len(speeds)} speeds", "torques")
        if any(fast <= slow for slow, fast in itertools.pairwise(speeds)):
            section.refuse(
                f"speeds is {shown(list(speeds))}; each must be above the one before", "speeds"
            )
    return JointFriction(
        model=name,
        parameters={key: section.number(key) for key in keys},
        **line,
        temperature=tuple(law),
        temperature_at=section.number("temperature_at") if "temperature_at" in there else None,
        confidence=section.text("confidence"),
    )


def checked_gains(section: Section) -> dict[str, Mapping[str, Any]]:
    """The ``[observers.*]`` tables of numbers, lists of them, and words."""
    for own in map(section.section, section.values):
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
    "start": ValueKind("one number per joint", several(1).fits),
    "threshold_mode": TEXT,
}


def checked_admittance(section: Section) -> Mapping[str, Any]:
    """The ``[admittance]`` table, the kinds of its keys checked."""
    for key in section.values:
        if key not in ADMITTANCE:
            section.refuse(f"no key {key!r}; it has {', '.join(ADMITTANCE)}", key)
        section.value(key, ADMITTANCE[key])
    section.number("period", 1.0)
    for axes in map(section.section, ("position", "rotation")):
        for key in axes.values:
            axes.value(key, PER_AXIS)
    return section.values


def poses(section: Section) -> dict[str, Pose]:
    """The poses that ``[name]``, under "", and each ``[name.NAME]`` state."""
    found = {}
    for name, table in section.named_sections("xyz", "rpy").items():
        turn = rpy_matrix(table.vector("rpy", 3, ORIGIN))
        found[name] = Pose(turn, table.vector("xyz", 3, ORIGIN))
    return found


def column(joints: Sequence[Section], key: str, default: float = math.nan) -> Array:
    """One number a joint, `default` where a joint has none. (n,)"""
    return np.array([joint.number(key, default) for joint in joints])


def columns(
    joints: Sequence[Section], kind: type[Limits | SensorNoise], prefix: str = ""
) -> dict[str, Array]:
    """The fields of a record, each a number a joint, by keys with a prefix."""
    return {name: column(joints, prefix + name) for name in kind.__dataclass_fields__}


AGREES = 1e-12  #: Relative difference of a number that counts as unchanged.


def robot_toml(robot: Robot, heading: Sequence[str] = ()) -> str:
    """The robot as the text of a robot file, its words kept."""
    comments = "".join(f"# {line}\n" for line in heading)
    return comments + "".join(lines_of(robot_document(robot)))


def robot_document(robot: Robot) -> Table:
    """The tables of a robot's file, brought up to date. Schema 1."""
    old = dict(robot.document)
    if old.get("convention") not in CONVENTIONS:
        old = xyz_rpy_document(robot)
    tables = [dict(table) for table in old["joints"]]
    chain, (_, frames) = robot.chain, kinematics(old["convention"], tables, old)
    for j, (table, frame, link) in enumerate(zip(tables, frames, chain.bodies, strict=True)):
        mass, com, inertia = link.moved(inverse(frame))
        values = {"mass": np.array(mass), "com": com, "inertia": inertia[np.triu_indices(3)]}
        for key, value in values.items():
            scale, before = float(abs(value).max(initial=1e-12)), table.get(key)
            if before is None or not np.allclose(before, value, rtol=0, atol=AGREES * scale):
                table[key] = value.tolist()
        table["rotor_inertia"] = float(robot.chain.rotor_inertia[j])
        if robot.torque_constant is not None:
            table["torque_constant"] = float(robot.torque_constant[j])
        table.pop("friction", None)
        if robot.friction and (friction := robot.friction[j].table):
            table["friction"] = friction
    document = {**old, "schema": SCHEMA, "name": robot.name, "title": robot.title or robot.name}
    document |= {"torque_source": robot.torque_source, "gravity": robot.chain.gravity.tolist()}
    held = robot.document.get("payload", {})
    loads = {} if robot.payload is None else kept_or_new(held, robot.payload)
    loads |= {name: kept_or_new(held.get(name, {}), x) for name, x in robot.payloads.items()}
    document |= {"dof": robot.joints, "joints": tables, "payload": loads}
    return {key: value for key, value in document.items() if value != {}}


def kept_or_new(old: Table, payload: Payload) -> Table:
    """The file's own section of equal mass, else one in flange axes."""
    if old.get("mass") == payload.mass:
        return {key: value for key, value in old.items() if not is_table(value)}
    tensor = payload.inertia[np.triu_indices(3)].tolist()
    return {"mass": payload.mass, "com": payload.com.tolist(), "inertia": tensor}


def xyz_rpy_document(robot: Robot) -> Table:
    """A document for a robot from a URDF: its chain as xyz and rpy."""
    chain = robot.chain
    joints = []
    figures = {**vars(robot.limits), **{f"noise_{k}": v for k, v in vars(robot.noise).items()}}
    for j, name in enumerate(chain.names):
        rpy = list(rpy_angles(chain.rotation[j]))
        known = {key: float(of[j]) for key, of in figures.items() if math.isfinite(of[j])}
        joints.append({"name": name, "xyz": chain.translation[j].tolist(), "rpy": rpy, **known})
        if name in robot.endless:
            joints[-1]["endless"] = True
    # The chain is already that of one arm.
    settled = {"joints", "tip", "lock"}
    return {
        **{key: value for key, value in robot.document.items() if key not in settled},
        "convention": "xyz-rpy",
        "ee_xyz": chain.flange_translation.tolist(),
        "ee_rpy": list(rpy_angles(chain.flange_rotation)),
        "joints": joints,
    }
