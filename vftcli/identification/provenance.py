"""Where every number of an identified robot comes from, as tables of its file."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import polars as pl

from vftcli.identification.base_parameters import BaseParameters
from vftcli.identification.method_result import MethodResult
from vftcli.identification.payload import LoadFit
from vftcli.robots.robot import Robot
from vftcli.robots.writing import robot_document
from vftcli.signals.recording import Recording


class Provenance(NamedTuple):
    """How a robot came about.

    Attributes:
        profile: The robot it started from.
        name: Its own name, or "".
        method: Name of the method.
        logs: Every log that was used.
        trained: Names of those the arm was identified from.
        processing: Filters and decimation.
        residuals: RMS per log and joint.
        outcome: What the method found.
        load: The load that was found, or None.
    """

    profile: Robot
    name: str
    method: str
    logs: Sequence[Recording]
    trained: Sequence[str]
    processing: Mapping[str, Any]
    residuals: pl.DataFrame
    outcome: MethodResult
    load: LoadFit | None


def documented(robot: Robot, story: Provenance) -> Robot:
    """The robot under its own name, its document telling where every number comes from."""
    profile, method, logs, load = story.profile, story.method, story.logs, story.load
    named = replace(
        robot,
        name=story.name or f"{profile.name}-identified",
        title=f"{profile.title or profile.name}, identified",
        path=None,
    )
    document = robot_document(named)
    words = f"identified ({method}) from " + ", ".join(story.trained)
    changed = {(n.joint, n.parameter) for n in story.outcome.numbers if n.determined}
    for j, table in enumerate(document["joints"], start=1):
        links = method in {"base", "consistent"}
        table["inertial_source"] = words if links else f"profile {profile.name}"
        for key in ("rotor_inertia", "torque_constant"):
            if key in table:
                new = (j, key) in changed or (links and key == "rotor_inertia")
                table[f"{key}_source"] = words if new else f"profile {profile.name}"
    sources = [*document.get("sources", ()), *(source_table(k, r) for k, r in enumerate(logs, 1))]
    account: dict[str, Any] = {
        "method": method,
        "profile": profile.name,
        "logs": [log.name for log in logs],
        "sha256": [log.source.sha256 or "unknown" for log in logs],
        "processing": dict(story.processing),
        "residuals": residual_tables(story.residuals),
    }
    if load is not None:
        document["payload"]["source"] = load.notes[0]
        account["payload"] = {
            "loaded": load.names,
            "mass_sd": load.mass_sd,
            "com_sd": load.com_sd.tolist(),
            "residual_Nm": load.residual.tolist(),
        }
    if story.outcome.base is not None:
        account["base_parameters"] = base_tables(story.outcome.base)
    return replace(named, document={**document, "sources": sources, "identification": account})


def source_table(index: int, recording: Recording) -> dict[str, Any]:
    """One log as a source."""
    return {
        "id": f"log-{index}",
        "what": "what `identification` and the joints' confidence name",
        "ref": f"{recording.name}, {recording.samples} samples, {recording.duration:.3f} s",
        "sha256": recording.source.sha256 or "unknown",
    }


def residual_tables(residuals: pl.DataFrame) -> list[dict[str, Any]]:
    """RMS per joint of each log under the identified robot."""
    tables = []
    for (log, role), rows in residuals.filter(pl.col("model") == "identified").group_by(
        ["log", "role"], maintain_order=True
    ):
        values = [round(v, 4) for v in rows["rms_Nm"].to_list()]
        tables.append({"log": log, "role": role, "rms_Nm": values})
    return tables


def base_tables(base: BaseParameters) -> list[dict[str, Any]]:
    """Base parameters as tables of the robot file; an unknown spread is infinite."""
    rows = zip(base.names, base.values, base.sd, base.determined, strict=True)
    return [
        {"parameter": name, "value": float(value), "sd": float(sd), "determined": ok}
        for name, value, sd, ok in rows
    ]
