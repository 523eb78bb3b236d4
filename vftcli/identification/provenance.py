"""Where every number of an identified robot comes from, as tables of its file."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import polars as pl

from vftcli.identification.base_parameters import BaseParameters
from vftcli.identification.method_result import MethodResult
from vftcli.identification.payload import LoadFit, names_of
from vftcli.robots.robot import Robot
from vftcli.robots.writing import robot_document
from vftcli.signals.recording import Recording

LINK_METHODS = frozenset({"base", "consistent"})
"""Methods that identify the links too."""


class Provenance(NamedTuple):
    """How a robot came about.

    Attributes:
        profile: The robot it started from.
        name: Its own name, or "".
        method: Name of the method.
        logs: Every log that was used.
        trained: Those the arm was identified from.
        processing: Filters and decimation.
        residuals: RMS per log and joint (`RESIDUALS`).
        result: What the method found.
        load: The load that was found, or None.
    """

    profile: Robot
    name: str
    method: str
    logs: Sequence[Recording]
    trained: Sequence[Recording]
    processing: Mapping[str, Any]
    residuals: pl.DataFrame
    result: MethodResult
    load: LoadFit | None


def with_provenance(robot: Robot, made: Provenance) -> Robot:
    """The robot under its own name, its document telling where every number comes from."""
    profile, load = made.profile, made.load
    named = replace(
        robot,
        name=made.name or f"{profile.name}-identified",
        title=f"{profile.title or profile.name}, identified",
        path=None,
    )
    document = robot_document(named)
    new = f"identified ({made.method}) from {', '.join(r.name for r in made.trained)}"
    old = f"profile {profile.name}"
    determined = {(n.joint, n.parameter) for n in made.result.numbers if n.determined}
    links = made.method in LINK_METHODS
    for j, table in enumerate(document["joints"], start=1):
        table["inertial_source"] = new if links else old
        for key in ("rotor_inertia", "torque_constant"):
            if key in table:
                changed = (j, key) in determined or (links and key == "rotor_inertia")
                table[f"{key}_source"] = new if changed else old
    account: dict[str, Any] = {
        "method": made.method,
        "profile": profile.name,
        "logs": [log.name for log in made.logs],
        "sha256": [log.source.sha256 or "unknown" for log in made.logs],
        "processing": dict(made.processing),
        "residuals": residual_tables(made.residuals),
    }
    if load is not None:
        document["payload"]["source"] = str(load.origin)
        account["payload"] = {
            "loaded": names_of(load.loaded),
            "mass_sd": load.mass_sd,
            "com_sd": load.com_sd.tolist(),
            "residual_Nm": load.residual.tolist(),
        }
    if made.result.base is not None:
        account["base_parameters"] = base_tables(made.result.base)
    sources = [source_table(k, log) for k, log in enumerate(made.logs, start=1)]
    tables = {"sources": [*document.get("sources", ()), *sources], "identification": account}
    return replace(named, document={**document, **tables})


def source_table(index: int, recording: Recording) -> dict[str, Any]:
    """One log as a source."""
    return {
        "id": f"log-{index}",
        "what": "what `identification` and the joints' confidence name",
        "ref": f"{recording.name}, {recording.samples} samples, {recording.duration:.3f} s",
        "sha256": recording.source.sha256 or "unknown",
    }


def residual_tables(residuals: pl.DataFrame) -> list[dict[str, Any]]:
    """RMS per joint of each log under the identified robot, one table a log. [N·m]"""
    tables = []
    # By index, not by name: two files called log.csv are two logs.
    identified = residuals.filter(pl.col("model") == "identified")
    for _, rows in identified.group_by("log_index", maintain_order=True):
        log, role = rows.row(0, named=True)["log"], rows.row(0, named=True)["role"]
        tables.append({"log": log, "role": role, "rms_Nm": [round(v, 4) for v in rows["rms_Nm"]]})
    return tables


def base_tables(base: BaseParameters) -> list[dict[str, Any]]:
    """Base parameters as tables of the robot file; an unknown spread is infinite."""
    rows = zip(base.names, base.values, base.sd, base.determined, strict=True)
    return [
        {"parameter": name, "value": float(value), "sd": float(sd), "determined": ok}
        for name, value, sd, ok in rows
    ]
