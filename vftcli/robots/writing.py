"""Robot files as text: schema 1, written so that `load_robot` reads the same robot back."""

import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from datetime import date, time
from typing import Any

import numpy as np

from vftcli.robots.chain import CONVENTIONS, Chain, Payload, kinematics
from vftcli.robots.profile import SCHEMA
from vftcli.robots.robot import Robot
from vftcli.signals.errors import RobotError
from vftcli.signals.pose import rpy_angles

Table = dict[str, Any]

AGREES = 1e-12  #: Relative difference below which a number of the file is taken to be unchanged.


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
    update_inertials(tables, old, robot.chain)
    for j, table in enumerate(tables):
        table["rotor_inertia"] = float(robot.chain.rotor_inertia[j])
        if robot.torque_constant is not None:
            table["torque_constant"] = float(robot.torque_constant[j])
        table.pop("friction", None)
        if robot.friction and (friction := robot.friction[j].table):
            table["friction"] = friction
    document = {**old, "schema": SCHEMA, "name": robot.name, "title": robot.title or robot.name}
    document |= {"torque_source": robot.torque_source, "gravity": robot.chain.gravity.tolist()}
    document |= {"dof": robot.joints, "joints": tables, "payload": payload_tables(robot)}
    return {key: value for key, value in document.items() if value != {}}


def update_inertials(tables: list[Table], document: Mapping[str, Any], chain: Chain) -> None:
    """Put the chain's inertials into the joint tables, in their frames."""
    _, frames, _ = kinematics(document["convention"], tables, document)
    for j, (table, frame) in enumerate(zip(tables, frames, strict=True)):
        R = frame.rotation
        tensor = R.T @ chain.inertia[j] @ R
        values = {
            "mass": np.array(chain.mass[j]),
            "com": R.T @ (chain.com[j] - frame.translation),
            "inertia": tensor[np.triu_indices(3)],
        }
        for key, value in values.items():
            scale = float(np.max(np.abs(value), initial=1e-12))
            before = table.get(key)
            if before is None or not np.allclose(before, value, rtol=0, atol=AGREES * scale):
                table[key] = value.tolist()


def payload_tables(robot: Robot) -> Table:
    """The ``[payload]`` section: what is mounted, and the loads that can be named."""
    old = robot.document.get("payload", {})
    tables = {} if robot.payload is None else kept_or_new(old, robot.payload)
    for name, load in robot.payloads.items():
        tables[name] = kept_or_new(old.get(name, {}), load)
    return tables


def kept_or_new(old: Table, payload: Payload) -> Table:
    """The file's own section if it says the same mass, else a new one in flange axes."""
    if old.get("mass") == payload.mass:
        return {key: value for key, value in old.items() if not is_table(value)}
    tensor = payload.inertia[np.triu_indices(3)].tolist()
    return {"mass": payload.mass, "com": payload.com.tolist(), "inertia": tensor}


def xyz_rpy_document(robot: Robot) -> Table:
    """A document for a robot that came from a URDF: its chain, stated as xyz and rpy."""
    chain = robot.chain
    joints: list[Table] = []
    figures = {**vars(robot.limits), **{f"noise_{k}": v for k, v in vars(robot.noise).items()}}
    for j, name in enumerate(chain.names):
        rpy = list(rpy_angles(chain.rotation[j]))
        known = {key: float(of[j]) for key, of in figures.items() if math.isfinite(of[j])}
        joints.append({"name": name, "xyz": chain.translation[j].tolist(), "rpy": rpy, **known})
        if name in robot.endless:
            joints[-1]["endless"] = True
    # Which arm of a description it is and what is locked is settled: the chain is the arm's.
    settled = {"joints", "tip", "lock"}
    return {
        **{key: value for key, value in robot.document.items() if key not in settled},
        "convention": "xyz-rpy",
        "ee_xyz": chain.flange_translation.tolist(),
        "ee_rpy": list(rpy_angles(chain.flange_rotation)),
        "joints": joints,
    }


def lines_of(document: Mapping[str, Any], path: tuple[str, ...] = ()) -> Iterator[str]:
    """The lines of a table: values, then tables, then arrays of tables."""
    for key, value in document.items():
        if not is_table(value) and not is_tables(value):
            yield f"{bare(key)} = {value_text(value, '.'.join((*path, key)))}\n"
    for key, value in document.items():
        here = (*path, key)
        name = ".".join(map(bare, here))
        if is_table(value):
            if any(not is_table(v) and not is_tables(v) for v in value.values()):
                yield f"\n[{name}]\n" if path != ("joints",) else f"[{name}]\n"
            yield from lines_of(value, here)
        elif is_tables(value):
            for table in value:
                yield f"\n[[{name}]]\n"
                yield from lines_of(table, here)


def is_table(value: object) -> bool:
    """Whether a value is a table."""
    return isinstance(value, Mapping)


def is_tables(value: object) -> bool:
    """Whether a value is a list of tables, which may not be empty."""
    return isinstance(value, list | tuple) and bool(value) and all(map(is_table, value))


def bare(key: str) -> str:
    """A key as TOML writes it: bare where it may be, else quoted."""
    return key if re.fullmatch(r"[A-Za-z0-9_-]+", key) else quoted(key)


def quoted(text: str) -> str:
    """A string in TOML's double quotes, with the escapes that these need."""
    out = json.dumps(text, ensure_ascii=False)
    return "".join(c if c.isprintable() else f"\\U{ord(c):08x}" for c in out)


def value_text(value: Any, key: str) -> str:  # noqa: ANN401 - whatever TOML can hold
    """A value as TOML; floats with as many digits as tell them apart."""
    match value:
        case str():
            return quoted(value)
        case int():  # true and false too
            return json.dumps(value)
        case float():
            return repr(value) if math.isfinite(value) else str(value)
        case list() | tuple():
            return f"[{', '.join(value_text(item, key) for item in value)}]"
        case Mapping():
            pairs = (f"{bare(name)} = {value_text(item, key)}" for name, item in value.items())
            return f"{{{', '.join(pairs)}}}"
        case date() | time():  # a datetime is a date
            return value.isoformat()
        case np.ndarray() | np.generic():
            return value_text(value.tolist(), key)
    raise RobotError(f"{key}: a robot file cannot hold a {type(value).__name__}")
