"""Logs in, a robot out: `vftcli identify` in the order of its data."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl

from vftcli.identification.choice import Task
from vftcli.identification.methods import chosen_method, friction_method, whole_arm
from vftcli.identification.payload import LoadFit, find_load, names_of
from vftcli.identification.result import (
    PARAMETERS,
    RESIDUALS,
    SHAPE_CHOICES,
    Identification,
    MethodResult,
    number,
    score,
    score_remarks,
)
from vftcli.identification.targets import targets_method
from vftcli.identification.training import Training, prepare_training, settings_record
from vftcli.robots.profile import robot_document
from vftcli.robots.robot import Robot
from vftcli.signals.recording import Recording, refuse_repeated_logs

#: Name at the command line → method; without a name the first two are chosen between.
FITS: dict[str | None, Callable[[Training], MethodResult]] = {
    "friction": friction_method,
    "base": whole_arm,
    "targets": targets_method,
    None: chosen_method,
}


def identify(
    logs: Sequence[Recording],
    robot: Robot,
    task: Task,
    held_out: Sequence[Recording] = (),
    free: Recording | None = None,
) -> Identification:
    """Identify a robot from logs of free motion, a load from logs that carry it.

    Args:
        logs: Training logs; for a payload the logs that carry the load, or the pair.
        robot: The profile to start from.
        task: What to identify.
        held_out: Logs to score on.
        free: The motion without the load.

    Raises:
        IdentificationError: If the logs do not determine it, or contradict the robot.
        MissingSignalError: If a signal is missing.
        ParameterError: If two logs are one run: it would count twice.
    """
    sources = logs if free is None else [*logs, free]
    refuse_repeated_logs(sources)
    refuse_repeated_logs(held_out, "--check")
    load = find_load(logs, robot, free) if task.method == "payload" else None
    train = logs if free is None or load is None else [free]
    train = [log for log in train if load is None or not load.carried_by(log)]
    result = MethodResult("payload", robot)
    if load is None:
        data = prepare_training(train, robot, task.cutoff, task.constants, task.friction)
        result = FITS[task.method](data)
    new, numbers, remarks = result.robot, [*result.numbers], [*result.remarks]
    scored = [
        score(log, role, robot, new, task.cutoff)
        for role, some in (("train", train), ("held-out", held_out))
        for log in some
    ]
    traces = tuple(trace for trace in scored if trace.motion.samples > 1)
    remarks += score_remarks(traces)
    if load is not None:
        new = new.with_payload(load.payload)
        last, mass, sd = robot.joints - 1, load.payload.mass, load.mass_sd
        numbers.append(number(last, "mass", mass, sd, np.nan, sd < 0.2 * mass))
        for axis, value, sd in zip("xyz", load.payload.com, load.com_sd, strict=True):
            numbers.append(number(last, f"com_{axis}", value, sd, np.nan, sd < 0.05))
        remarks.append(load.origin)
    rows = [row for k, trace in enumerate(traces, start=1) for row in trace.rows(k)]
    found = Identification(
        robot=new,
        profile=robot,
        method=result.method,
        residuals=pl.DataFrame(rows, schema=RESIDUALS, orient="row"),
        parameters=pl.DataFrame(numbers, schema=PARAMETERS, orient="row"),
        shape_choices=pl.DataFrame(result.shape_choices, schema=SHAPE_CHOICES, orient="row"),
        base=result.base,
        traces=traces,
        processing=settings_record(task.cutoff, logs[0].median_step),
        remarks=tuple(remarks),
    )
    return replace(found, robot=with_provenance(found, task.name, sources, train, load))


def with_provenance(
    found: Identification,
    name: str,
    logs: Sequence[Recording],
    trained: Sequence[Recording],
    load: LoadFit | None,
) -> Robot:
    """The identified robot under its own name, with the source of every number."""
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
    identified = found.residuals.filter(pl.col("model") == "identified")
    account: dict[str, Any] = {
        "method": found.method,
        "profile": profile.name,
        "logs": [log.name for log in logs],
        "sha256": [log.source.sha256 or "unknown" for log in logs],
        "processing": dict(found.processing),
        # By index, not by name: two files called log.csv are two logs.
        "residuals": [
            {
                "log": rows["log"][0],
                "role": rows["role"][0],
                "rms_Nm": [round(v, 4) for v in rows["rms_Nm"]],
            }
            for _, rows in identified.group_by("log_index", maintain_order=True)
        ],
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
    sources = [
        {
            "id": f"log-{k}",
            "what": "what `identification` and the joints' confidence name",
            "ref": f"{log.name}, {log.samples} samples, {log.duration:.3f} s",
            "sha256": log.source.sha256 or "unknown",
        }
        for k, log in enumerate(logs, start=1)
    ]
    tables = {"sources": [*document.get("sources", ()), *sources], "identification": account}
    return replace(named, document={**document, **tables})
