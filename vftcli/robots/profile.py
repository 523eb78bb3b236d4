"""Robot files: TOML, schema 1, read and checked, every complaint with the line that is wrong."""

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from vftcli.robots.chain import Chain, Payload, symmetric, unphysical
from vftcli.robots.conventions import CONVENTIONS, Convention, Kinematics
from vftcli.robots.robot import TORQUE_SOURCES, JointFriction, Limits, Robot, SensorNoise
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import Pose, rpy_matrix
from vftcli.signals.remarks import fact

SCHEMA = 1
UPRIGHT = (0.0, 0.0, -9.81)

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
    "sigmoid": (("amplitude", "slope", "shift"), ()),
}
"""Friction model → its required and its optional keys in ``[joints.friction]``."""


class RobotFile:
    """A parsed robot file that can point at the line a complaint is about."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self.text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", None) or "not text"
            raise RobotError(f"{path}: cannot be read as a robot file ({reason})") from None
        try:
            self.document: dict[str, Any] = tomllib.loads(self.text)
        except tomllib.TOMLDecodeError as error:
            raise RobotError(f"{path}: not valid TOML: {error}") from None

    def line(self, table: str, index: int | None, key: str) -> int | None:
        """Line of `key` in `table`, from 1, or of the table's header.

        Args:
            table: Dotted name, "" for the keys before any table.
            index: Which ``[[joints]]`` the table belongs to, from 0, or None outside of them.
            key: The key to look for.
        """
        header = 1 if table == "" else None
        joint, name = -1, ""
        for number, line in enumerate(self.text.splitlines(), start=1):
            stripped = line.strip()
            if stripped.startswith("["):
                name = stripped.split("#")[0].strip().strip("[]").strip()
                joint += stripped.startswith("[[joints]]")
                if name == table and index in {None, joint}:
                    header = number
            elif name == table and index in {None, joint} and starts_with_key(stripped, key):
                return number
        if header is None and "." in table:
            return self.line(table.rpartition(".")[0], index, "")
        return header

    def refuse(
        self, message: str, table: str = "", index: int | None = None, key: str = ""
    ) -> NoReturn:
        """Raise a RobotError that names the file, the line and the joint."""
        line = self.line(table, index, key)
        where = f"{self.path}" + (f", line {line}" if line else "")
        joint = ""
        if index is not None:
            names = self.document.get("joints", [])
            label = names[index].get("name", "") if index < len(names) else ""
            joint = f"joint {index + 1}{f' ({label})' if label else ''}: "
        raise RobotError(f"{where}: {joint}{message}")


def starts_with_key(line: str, key: str) -> bool:
    """Whether a line of TOML assigns `key`."""
    return bool(key) and re.match(rf"[\"']?{re.escape(key)}[\"']?\s*=", line) is not None


def load_profile(path: Path) -> Robot:
    """Read a robot file.

    Raises:
        RobotError: If the file is missing, incomplete or describes no physical arm; the message
            names the line.
    """
    file = RobotFile(path)
    doc = file.document
    if doc.get("schema", SCHEMA) != SCHEMA:
        file.refuse(
            f"schema is {doc['schema']!r}; this version reads schema {SCHEMA}", key="schema"
        )
    joints = checked_joints(file)
    convention = checked_convention(file, joints)
    chain = build_chain(file, joints, convention.kinematics(joints, doc))
    return assemble(file, joints, chain)


def assemble(file: RobotFile, joints: Sequence[Mapping[str, Any]], chain: Chain) -> Robot:
    """Put a Robot together from its chain and the rest of its file (drives, friction, gains)."""
    doc = file.document
    source = doc.get("torque_source", "joint_torque")
    if source not in TORQUE_SOURCES:
        file.refuse(
            f"torque_source is {source!r}; it is one of {', '.join(TORQUE_SOURCES)}",
            key="torque_source",
        )
    payloads = checked_payloads(file)
    gains = doc.get("observers", {})
    if not isinstance(gains, dict) or not all(isinstance(v, dict) for v in gains.values()):
        file.refuse(
            "[observers] must hold sections, as [observers.gmo] gain = 10.0", key="observers"
        )
    notes = doc.get("notes", ())
    sentences = (notes,) if isinstance(notes, str) else notes
    return Robot(
        name=str(doc.get("name", file.path.stem)),
        title=str(doc.get("title", doc.get("name", file.path.stem))),
        chain=chain,
        torque_source=source,
        torque_constant=checked_torque_constant(file, joints, source),
        friction=checked_friction(file, joints),
        limits=Limits(**{k: column(file, joints, k) for k in Limits.__dataclass_fields__}),
        noise=SensorNoise(
            **{k: column(file, joints, f"noise_{k}") for k in SensorNoise.__dataclass_fields__}
        ),
        sample_rate_hz=number(file, doc, "sample_rate_hz", default=math.nan),
        ros_state=str(doc.get("ros_state", "")),
        payload=payloads.pop("", None),
        payloads=payloads,
        gains=gains,
        tools=checked_poses(file, "tool"),
        sensors=checked_poses(file, "sensor"),
        admittance=checked_section(file, "admittance"),
        sources=tuple(s for s in doc.get("sources", ()) if isinstance(s, dict)),
        published=checked_section(file, "published"),
        document=doc,
        remarks=tuple(fact("robot-file-note", text=text) for text in sentences if text),
        path=file.path,
    )


def checked_joints(file: RobotFile) -> list[dict[str, Any]]:
    """Return the ``[[joints]]`` tables, as many as `dof` says."""
    joints = file.document.get("joints")
    if not isinstance(joints, list) or not joints or not all(isinstance(j, dict) for j in joints):
        file.refuse("there are no [[joints]] tables; a robot file has one for each joint")
    dof = file.document.get("dof", len(joints))
    if dof != len(joints):
        file.refuse(f"dof is {dof} but the file has {len(joints)} [[joints]] tables", key="dof")
    return joints


def checked_convention(file: RobotFile, joints: Sequence[Mapping[str, Any]]) -> Convention:
    """Return the file's kinematic convention, with every key it needs present in every joint."""
    name = file.document.get("convention")
    if name not in CONVENTIONS:
        file.refuse(
            f"convention is {name!r}; it is one of {', '.join(CONVENTIONS)}", key="convention"
        )
    convention = CONVENTIONS[name]
    for j, joint in enumerate(joints):
        for key in convention.numbers:
            number(file, joint, key, index=j)
        for key in convention.vectors:
            vector(file, joint, key, 3, index=j)
    return convention


def build_chain(
    file: RobotFile, joints: Sequence[Mapping[str, Any]], kinematics: Kinematics
) -> Chain:
    """Move the inertials into the chain's frames and check that a body can have them."""
    doc = file.document
    masses, coms, inertias = [], [], []
    for j, (joint, frame) in enumerate(zip(joints, kinematics.inertial_frames, strict=True)):
        mass = number(file, joint, "mass", index=j)
        com = vector(file, joint, "com", 3, index=j)
        tensor = symmetric(vector(file, joint, "inertia", 6, index=j).tolist())
        if why := unphysical(mass, tensor):
            key = "mass" if why.startswith("mass") else "inertia"
            file.refuse(why, "joints", j, key)
        masses.append(mass)
        coms.append(frame.rotation @ com + frame.translation)
        inertias.append(frame.rotation @ tensor @ frame.rotation.T)
    rotor = column(file, joints, "rotor_inertia", default=0.0)
    if np.any(rotor < 0):
        j = int(np.argmax(rotor < 0))
        file.refuse(
            f"rotor_inertia is {rotor[j]:g} kg·m²; it must not be negative",
            "joints",
            j,
            "rotor_inertia",
        )
    gravity = vector(file, doc, "gravity", 3) if "gravity" in doc else np.array(UPRIGHT)
    return Chain(
        names=tuple(str(j.get("name", f"joint{i}")) for i, j in enumerate(joints, start=1)),
        rotation=np.array([p.rotation for p in kinematics.placements]),
        translation=np.array([p.translation for p in kinematics.placements]),
        mass=np.array(masses),
        com=np.array(coms),
        inertia=np.array(inertias),
        rotor_inertia=rotor,
        gravity=gravity,
        flange_rotation=kinematics.tip.rotation,
        flange_translation=kinematics.tip.translation,
    )


def checked_torque_constant(
    file: RobotFile, joints: Sequence[Mapping[str, Any]], source: str
) -> Array | None:
    """Return the drive constants, or None where no joint has one and none is needed."""
    missing = [j for j, joint in enumerate(joints) if "torque_constant" not in joint]
    if len(missing) == len(joints) and source != "current":
        return None
    if missing:
        file.refuse(
            "torque_constant is missing; torque_source = current needs it in every joint",
            "joints",
            missing[0],
        )
    constant = column(file, joints, "torque_constant")
    if np.any(constant <= 0):
        j = int(np.argmax(constant <= 0))
        file.refuse(
            f"torque_constant is {constant[j]:g} N·m/A; it must be positive",
            "joints",
            j,
            "torque_constant",
        )
    return constant


def checked_friction(
    file: RobotFile, joints: Sequence[Mapping[str, Any]]
) -> tuple[JointFriction, ...]:
    """Return one friction model a joint; a joint without one has the model "none"."""
    models = []
    for j, joint in enumerate(joints):
        section = joint.get("friction", {"model": "none"})
        name = section.get("model") if isinstance(section, dict) else None
        if name == "none":
            models.append(JointFriction())
            continue
        if name not in FRICTION_KEYS:
            file.refuse(
                f"friction model is {name!r}; it is one of {', '.join(FRICTION_KEYS)}",
                "joints.friction",
                j,
                "model",
            )
        required, optional = FRICTION_KEYS[name]
        values = {k: number(file, section, k, "joints.friction", j) for k in required}
        values |= {
            k: number(file, section, k, "joints.friction", j) for k in optional if k in section
        }
        for key in ("smoothing", "stribeck_velocity"):
            if values.get(key, 1.0) <= 0:
                file.refuse(f"{key} must be positive [rad/s]", "joints.friction", j, key)
        models.append(
            JointFriction(
                model=name, parameters=values, confidence=str(section.get("confidence", ""))
            )
        )
    return tuple(models) if any(m.model != "none" for m in models) else ()


def checked_payloads(file: RobotFile) -> dict[str, Payload]:
    """Return ``[payload]`` under the name "" and each ``[payload.NAME]`` under its own."""
    section = checked_section(file, "payload")
    found = {}
    if "mass" in section:
        found[""] = checked_payload(file, section, "payload")
    for name, value in section.items():
        if isinstance(value, dict):
            found[name] = checked_payload(file, value, f"payload.{name}")
    return found


def checked_payload(file: RobotFile, section: Mapping[str, Any], table: str) -> Payload:
    """Return one payload section as a Payload; `rpy` turns its axes into the flange's."""
    mass = number(file, section, "mass", table)
    com = vector(file, section, "com", 3, table) if "com" in section else np.zeros(3)
    tensor = vector(file, section, "inertia", 6, table) if "inertia" in section else np.zeros(6)
    turn = (
        rpy_matrix(vector(file, section, "rpy", 3, table).tolist())
        if "rpy" in section
        else np.eye(3)
    )
    com, inertia = turn @ com, turn @ symmetric(tensor.tolist()) @ turn.T
    if why := unphysical(mass, inertia):
        file.refuse(why, table, None, "mass" if why.startswith("mass") else "inertia")
    return Payload(mass=mass, com=com, inertia=inertia)


def checked_section(file: RobotFile, name: str) -> Mapping[str, Any]:
    """Return the section of a name, empty if the file has none, or complain about its line."""
    section: Mapping[str, Any] = file.document.get(name, {})
    if not isinstance(section, dict):
        file.refuse(f"{name} must be a section [{name}]", key=name)
    return section


def checked_poses(file: RobotFile, name: str) -> dict[str, Pose]:
    """Return the poses on the flange that ``[name]``, under "", and each ``[name.NAME]`` state.

    Keys are xyz [m] and rpy [rad]; what is left out is zero.
    """
    section = checked_section(file, name)
    tables: dict[str, Mapping[str, Any]] = {k: v for k, v in section.items() if isinstance(v, dict)}
    if "xyz" in section or "rpy" in section:
        tables[""] = section
    found = {}
    for key, table in tables.items():
        place = f"{name}.{key}" if key else name
        xyz, rpy = (
            vector(file, table, part, 3, place) if part in table else np.zeros(3)
            for part in ("xyz", "rpy")
        )
        found[key] = Pose(rpy_matrix(rpy.tolist()), xyz)
    return found


def column(
    file: RobotFile,
    joints: Sequence[Mapping[str, Any]],
    key: str,
    default: float = math.nan,
) -> Array:
    """Return one number a joint, `default` where a joint has none. (n,)"""
    return np.array([number(file, j, key, index=i, default=default) for i, j in enumerate(joints)])


def number(
    file: RobotFile,
    table: Mapping[str, Any],
    key: str,
    section: str = "joints",
    index: int | None = None,
    default: float | None = None,
) -> float:
    """Return a finite number, `default` if the key is absent, or complain about its line."""
    place = (section, index) if index is not None or section != "joints" else ("", None)
    if key not in table:
        if default is not None:
            return default
        file.refuse(f"{key} is missing", *place, key)
    value = table[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        file.refuse(f"{key} is {value!r}; it must be a finite number", *place, key)
    return float(value)


def vector(
    file: RobotFile,
    table: Mapping[str, Any],
    key: str,
    length: int,
    section: str = "joints",
    index: int | None = None,
) -> Array:
    """Return `length` finite numbers, or complain about their line. (length,)"""
    place = (section, index) if index is not None or section != "joints" else ("", None)
    if key not in table:
        file.refuse(f"{key} is missing; it has {length} numbers", *place, key)
    value = table[key]
    good = isinstance(value, list) and len(value) == length
    if not good or not all(
        isinstance(v, int | float) and not isinstance(v, bool) and math.isfinite(v) for v in value
    ):
        file.refuse(f"{key} is {value!r}; it must be {length} finite numbers", *place, key)
    return np.array(value, dtype=float)
