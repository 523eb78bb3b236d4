"""Where every number of an identified robot comes from, as tables of its file."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import polars as pl

from vftcli.identification.payload import LoadFit, names_of
from vftcli.identification.result import Identification
from vftcli.robots.robot import Robot
from vftcli.robots.writing import robot_document
from vftcli.signals.recording import Recording


def with_provenance(
    found: Identification,
    name: str,
    logs: Sequence[Recording],
    trained: Sequence[Recording],
    load: LoadFit | None,
) -> Robot:
    """The identified robot under its own name, its document telling the source of every number."""
    profile = found.profile
    named = replace(
        found.robot,
        name=name or f"{profile.name}-identified",
        title=f"{profile.title or profile.name}, identified",
        path=None,
        published={},
    )
    document = robot_document(named)
    # The profile's published numbers are those of the arm of the paper, not of this one.
    document.pop("published", None)
    new = f"identified ({found.method}) from {names_of(trained)}"
    old = f"profile {profile.name}"
    sure = found.parameters.filter("determined")
    determined = set(zip(sure["joint"], sure["parameter"], strict=True))
    links = found.method == "base"
    for j, table in enumerate(document["joints"], start=1):
        table["inertial_source"] = new if links else old
        for key in ("rotor_inertia", "torque_constant"):
            if key in table:
                changed = (j, key) in determined or (links and key == "rotor_inertia")
                table[f"{key}_source"] = new if changed else old
    account: dict[str, Any] = {
        "method": found.method,
        "profile": profile.name,
        "logs": [log.name for log in logs],
        "sha256": [log.source.sha256 or "unknown" for log in logs],
        "processing": dict(found.processing),
        "residuals": residual_tables(found.residuals),
    }
    if load is not None:
        document["payload"]["source"] = str(load.origin)
        account["payload"] = {
            "loaded": names_of(load.loaded),
            "mass_sd": load.mass_sd,
            "com_sd": load.com_sd.tolist(),
            "residual_Nm": load.residual.tolist(),
        }
    if found.base is not None:
        account["base_parameters"] = found.base.to_dicts()
    sources = [source_table(k, log) for k, log in enumerate(logs, start=1)]
    tables = {"sources": [*document.get("sources", ()), *sources], "identification": account}
    return replace(named, document={**document, **tables})


def source_table(index: int, recording: Recording) -> dict[str, Any]:
    """One log as an entry of the robot file's ``[[sources]]``, numbered from 1."""
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
