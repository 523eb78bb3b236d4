"""Robot files: TOML, schema 1, read and checked, every complaint with the line that is wrong."""

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np

from vftcli.robots.chain import Chain, Payload, symmetric, unphysical
from vftcli.robots.conventions import CONVENTIONS, Kinematics
from vftcli.robots.robot import TORQUE_SOURCES, JointFriction, Limits, Robot, SensorNoise
from vftcli.signals.arrays import Array
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import Pose, rpy_matrix
from vftcli.signals.remarks import fact

SCHEMA = 1
UPRIGHT = (0.0, 0.0, -9.81)
ORIGIN = (0.0, 0.0, 0.0)

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
        assigns = re.compile(rf"[\"']?{re.escape(key)}[\"']?\s*=")
        joint, name = -1, ""
        for number, line in enumerate(self.text.splitlines(), start=1):
            stripped = line.strip()
            if stripped.startswith("["):
                name = stripped.split("#")[0].strip().strip("[]").strip()
                joint += stripped.startswith("[[joints]]")
                if name == table and index in {None, joint}:
                    header = number
            elif name == table and index in {None, joint} and key and assigns.match(stripped):
                return number
        if header is None and "." in table:
            return self.line(table.rpartition(".")[0], index, "")
        return header

    @property
    def root(self) -> "Section":
        """The keys before any table, and the tables under theirs."""
        return Section(self, self.document)


class Section(NamedTuple):
    """A table of a robot file, whose values are checked as they are read.

    Attributes:
        file: The file.
        values: The table.
        table: Its dotted name, "" for the whole document.
        joint: Which ``[[joints]]`` it is or belongs to, from 0, or None outside of them.
    """

    file: RobotFile
    values: Mapping[str, Any]
    table: str = ""
    joint: int | None = None

    def refuse(self, message: str, key: str = "") -> NoReturn:
        """Raise a RobotError that names the file, the line and the joint."""
        line = self.file.line(self.table, self.joint, key)
        where = f"{self.file.path}" + (f", line {line}" if line else "")
        whose = ""
        if self.joint is not None:
            names = self.file.document.get("joints", [])
            label = names[self.joint].get("name", "") if self.joint < len(names) else ""
            whose = f"joint {self.joint + 1}{f' ({label})' if label else ''}: "
        raise RobotError(f"{where}: {whose}{message}")

    def number(self, key: str, default: float | None = None) -> float:
        """Return a finite number, `default` if the key is absent, or complain about its line."""
        if key not in self.values:
            if default is not None:
                return default
            self.refuse(f"{key} is missing", key)
        value = self.values[key]
        if not is_finite(value):
            self.refuse(f"{key} is {value!r}; it must be a finite number", key)
        return float(value)

    def vector(self, key: str, length: int, default: Sequence[float] | None = None) -> Array:
        """Return `length` finite numbers, `default` if absent, or complain. (length,)"""
        if key not in self.values and default is None:
            self.refuse(f"{key} is missing; it has {length} numbers", key)
        value = self.values.get(key, default)
        if key in self.values and not (
            isinstance(value, list) and len(value) == length and all(map(is_finite, value))
        ):
            self.refuse(f"{key} is {value!r}; it must be {length} finite numbers", key)
        return np.array(value, dtype=float)

    def section(self, name: str) -> "Section":
        """Return the section of a name, empty if there is none, or complain about its line."""
        values = self.values.get(name, {})
        if not isinstance(values, dict):
            self.refuse(f"{name} must be a section [{name}]", name)
        return Section(self.file, values, name)

    def named_sections(self, *keys: str) -> dict[str, "Section"]:
        """Return each table in this one by its name, itself under "" if it has one of `keys`."""
        found = {
            name: Section(self.file, table, f"{self.table}.{name}")
            for name, table in self.values.items()
            if isinstance(table, dict)
        }
        return {**found, "": self} if any(key in self.values for key in keys) else found


def is_finite(value: object) -> bool:
    """Whether a value of TOML is a finite number; true and false are none."""
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def load_profile(path: Path) -> Robot:
    """Read a robot file.

    Raises:
        RobotError: If the file is missing, incomplete or describes no physical arm; the message
            names the line.
    """
    root = RobotFile(path).root
    schema = root.values.get("schema", SCHEMA)
    if schema != SCHEMA:
        root.refuse(f"schema is {schema!r}; this version reads schema {SCHEMA}", "schema")
    joints = checked_joints(root)
    return assemble(root, joints, build_chain(root, joints, checked_kinematics(root, joints)))


def assemble(root: Section, joints: Sequence[Section], chain: Chain) -> Robot:
    """Put a Robot together from its chain and the rest of its file (drives, friction, gains)."""
    doc, path = root.values, root.file.path
    source = doc.get("torque_source", "joint_torque")
    if source not in TORQUE_SOURCES:
        root.refuse(
            f"torque_source is {source!r}; it is one of {', '.join(TORQUE_SOURCES)}",
            "torque_source",
        )
    payloads = {
        name: checked_payload(section)
        for name, section in root.section("payload").named_sections("mass").items()
    }
    gains = doc.get("observers", {})
    if not isinstance(gains, dict) or not all(isinstance(v, dict) for v in gains.values()):
        root.refuse("[observers] must hold sections, as [observers.gmo] gain = 10.0", "observers")
    notes = doc.get("notes", ())
    sentences = (notes,) if isinstance(notes, str) else notes
    limits = {name: column(joints, name) for name in Limits.__dataclass_fields__}
    noise = {name: column(joints, f"noise_{name}") for name in SensorNoise.__dataclass_fields__}
    return Robot(
        name=str(doc.get("name", path.stem)),
        title=str(doc.get("title", doc.get("name", path.stem))),
        chain=chain,
        torque_source=source,
        torque_constant=checked_torque_constant(joints, source),
        friction=checked_friction(joints),
        limits=Limits(**limits),
        noise=SensorNoise(**noise),
        sample_rate_hz=root.number("sample_rate_hz", math.nan),
        ros_state=str(doc.get("ros_state", "")),
        payload=payloads.pop("", None),
        payloads=payloads,
        gains=gains,
        tools=checked_poses(root.section("tool")),
        sensors=checked_poses(root.section("sensor")),
        admittance=root.section("admittance").values,
        sources=tuple(s for s in doc.get("sources", ()) if isinstance(s, dict)),
        published=root.section("published").values,
        document=doc,
        remarks=tuple(fact("robot-file-note", text=text) for text in sentences if text),
        path=path,
    )


def checked_joints(root: Section) -> list[Section]:
    """Return the ``[[joints]]`` tables, as many as `dof` says."""
    joints = root.values.get("joints")
    if not isinstance(joints, list) or not joints or not all(isinstance(j, dict) for j in joints):
        root.refuse("there are no [[joints]] tables; a robot file has one for each joint")
    dof = root.values.get("dof", len(joints))
    if dof != len(joints):
        root.refuse(f"dof is {dof} but the file has {len(joints)} [[joints]] tables", "dof")
    return [Section(root.file, joint, "joints", j) for j, joint in enumerate(joints)]


def checked_kinematics(root: Section, joints: Sequence[Section]) -> Kinematics:
    """Return the chain's frames, once every joint has the keys that the file's convention needs."""
    name = root.values.get("convention")
    if name not in CONVENTIONS:
        root.refuse(f"convention is {name!r}; it is one of {', '.join(CONVENTIONS)}", "convention")
    convention = CONVENTIONS[name]
    for joint in joints:
        for key in convention.numbers:
            joint.number(key)
        for key in convention.vectors:
            joint.vector(key, 3)
    return convention.kinematics([joint.values for joint in joints], root.values)


def build_chain(root: Section, joints: Sequence[Section], kinematics: Kinematics) -> Chain:
    """Move the inertials into the chain's frames and check that a body can have them."""
    masses, coms, inertias = [], [], []
    for joint, frame in zip(joints, kinematics.inertial_frames, strict=True):
        mass, com, tensor = checked_body(joint)
        masses.append(mass)
        coms.append(frame.rotation @ com + frame.translation)
        inertias.append(frame.rotation @ tensor @ frame.rotation.T)
    rotor = column(joints, "rotor_inertia", default=0.0)
    for joint, inertia in zip(joints, rotor, strict=True):
        if inertia < 0:
            message = f"rotor_inertia is {inertia:g} kg·m²; it must not be negative"
            joint.refuse(message, "rotor_inertia")
    return Chain(
        names=tuple(str(j.values.get("name", f"joint{i}")) for i, j in enumerate(joints, start=1)),
        rotation=np.array([p.rotation for p in kinematics.placements]),
        translation=np.array([p.translation for p in kinematics.placements]),
        mass=np.array(masses),
        com=np.array(coms),
        inertia=np.array(inertias),
        rotor_inertia=rotor,
        gravity=root.vector("gravity", 3, UPRIGHT),
        flange_rotation=kinematics.tip.rotation,
        flange_translation=kinematics.tip.translation,
    )


def checked_body(
    table: Section, default: Sequence[float] | None = None
) -> tuple[float, Array, Array]:
    """Return mass [kg], centre of mass (3,) [m] and tensor (3, 3) [kg·m²] that a body can have.

    Args:
        table: Where they stand.
        default: Six numbers to take for the tensor, and three for the centre, where they are left
            out; None if they must be given.
    """
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
    constants = column(joints, "torque_constant")
    for joint, constant in zip(joints, constants, strict=True):
        if constant <= 0:
            message = f"torque_constant is {constant:g} N·m/A; it must be positive"
            joint.refuse(message, "torque_constant")
    return constants


def checked_friction(joints: Sequence[Section]) -> tuple[JointFriction, ...]:
    """Return one friction model a joint; a joint without one has the model "none"."""
    models = []
    for joint in joints:
        values = joint.values.get("friction", {"model": "none"})
        section = Section(joint.file, values, "joints.friction", joint.joint)
        name = values.get("model") if isinstance(values, dict) else None
        if name == "none":
            models.append(JointFriction())
            continue
        if name not in FRICTION_KEYS:
            section.refuse(
                f"friction model is {name!r}; it is one of {', '.join(FRICTION_KEYS)}", "model"
            )
        required, optional = FRICTION_KEYS[name]
        keys = (*required, *(key for key in optional if key in values))
        parameters = {key: section.number(key) for key in keys}
        for key in ("smoothing", "stribeck_velocity"):
            if parameters.get(key, 1.0) <= 0:
                section.refuse(f"{key} must be positive [rad/s]", key)
        confidence = str(values.get("confidence", ""))
        models.append(JointFriction(model=name, parameters=parameters, confidence=confidence))
    return tuple(models) if any(m.model != "none" for m in models) else ()


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
