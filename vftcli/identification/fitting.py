"""Logs in, a robot out: `vftcli identify` in the order of its data, and checks.

A log is scored filtered and in motion, from its first to its last sample that moves.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, get_type_hints

import numpy as np
import polars as pl

from vftcli.identification import Task
from vftcli.identification.methods import (
    MethodResult,
    Number,
    chosen_method,
    friction_method,
    number,
    whole_arm,
)
from vftcli.identification.payload import LoadFit, find_load, names_of
from vftcli.identification.targets import targets_method
from vftcli.identification.training import (
    PreparedLog,
    Training,
    prepare,
    prepare_training,
    settings_record,
)
from vftcli.robots.profile import robot_document
from vftcli.robots.robot import Robot
from vftcli.robots.terms import effort_name
from vftcli.signals.arrays import Array, resample_columns, root_mean_squares
from vftcli.signals.recording import Recording, refuse_repeated_logs
from vftcli.signals.remarks import Remark, Where, caution, fact

#: Name at the command line → method; None chooses between the first two.
FITS: dict[str | None, Callable[[Training], MethodResult]] = {
    "friction": friction_method,
    "base": whole_arm,
    "targets": targets_method,
    None: chosen_method,
}
#: A row per log, model and joint: RMS of measured less predicted torque in motion.
#: `log_index` counts logs from 1, training first.
RESIDUALS = pl.Schema(
    {"log": str, "log_index": int, "role": str, "model": str}
    | {"joint": int, "rms_Nm": float, "samples": int}
)
#: Least ratio of the model's rest of a log to the profile's in a remark.
BEHIND = 1.01
NEAR = 0.01  #: Largest joint distance of samples at one place. [rad]
SLOWNESS = 0.1  #: Time that makes a velocity difference a distance. [s]
#: Share of a log's samples on another's trajectory from which it repeats it.
REPEATED = 0.8
#: One row a number: value, SD, the profile's.
PARAMETERS = pl.Schema(get_type_hints(Number))
#: One row a friction candidate: its cross-validated error.
SHAPE_CHOICES = pl.Schema({"joint": int, "friction": str, "cv_rms_Nm": float, "chosen": bool})


class Trace(NamedTuple):
    """Measured and predicted torque of one log, filtered alike."""

    motion: PreparedLog  #: The prepared log.
    role: str  #: "train" or "held-out".
    measured: Array  #: Drive torque, by the new constants. (M, n) [N·m]
    predicted: Array  #: Torque that the identified robot expects. (M, n) [N·m]
    residual: Array  #: Measured less predicted. (M, n) [N·m]
    rms: Array  #: RMS of that. (n,) [N·m]
    before: Array  #: RMS that the profile leaves. (n,) [N·m]

    @property
    def where(self) -> Where:
        """The log as a remark's place."""
        return Where(self.motion.recording.name)

    def rows(self, index: int) -> list[tuple[str, int, str, str, int, float, int]]:
        """Rows of `RESIDUALS` of this log and index."""
        name, samples = self.motion.recording.name, self.motion.samples
        return [
            (name, index, self.role, model, j, value, samples)
            for model, values in (("identified", self.rms), ("profile", self.before))
            for j, value in enumerate(values, start=1)
        ]


class Identification(NamedTuple):
    """A robot made from logs, with its provenance."""

    robot: Robot  #: The identified robot; its document carries the sources.
    profile: Robot  #: The robot it started from.
    method: str  #: Name of the method.
    residuals: pl.DataFrame  #: RMS per log, model and joint (`RESIDUALS`).
    parameters: pl.DataFrame  #: Identified numbers (`PARAMETERS`).
    #: Friction candidates (`SHAPE_CHOICES`), empty without competition.
    shape_choices: pl.DataFrame
    base: pl.DataFrame | None  #: Base parameters (`BASE`), None without any.
    traces: tuple[Trace, ...]  #: Measured and predicted torque of every log.
    #: Filters, differentiation, decimation and band, by name.
    processing: Mapping[str, Any] = {}
    remarks: tuple[Remark, ...] = ()  #: Limits of the numbers.


def score(log: Recording, role: str, profile: Robot, robot: Robot, cutoff: float) -> Trace | None:
    """Torque of a log: measured, new robot's, profile's; None at rest."""
    motion = prepare(log, profile, cutoff)
    if motion.samples < 2:
        return None
    before = root_mean_squares(motion.tau - motion.predicted)
    old, new, measured = profile.torque_constant, robot.torque_constant, motion.tau
    # Torque from currents with the old constants gets the new.
    if old is not None and new is not None and effort_name(log, profile) == "current":
        measured = measured * (new / old)
    predicted = motion.with_robot(robot).predicted
    residual = measured - predicted
    return Trace(motion, role, measured, predicted, residual, root_mean_squares(residual), before)


def score_remarks(traces: Sequence[Trace]) -> Iterator[Remark]:
    """Remarks on worse or repeated logs, and the training residual."""
    train, held_out = ([t for t in traces if t.role == role] for role in ("train", "held-out"))
    for trace in traces:
        left, before = trace.rms.mean(), trace.before.mean()
        if left > BEHIND * before > 0.0:
            yield caution(
                "worse-than-profile", trace.where, identified_Nm=left, profile_Nm=before
            )
    for test in held_out:
        for other in (trace.motion for trace in train):
            if (share := repeated_share(other, test.motion)) >= REPEATED:
                values = {"training_log": other.recording.name, "share_percent": 100.0 * share}
                yield caution("repeated-trajectory", test.where, **values)
    if train:
        level = np.mean([trace.rms for trace in train])
        yield fact("training-residual", mean_Nm=level)


def repeated_share(train: PreparedLog, test: PreparedLog) -> float:
    """Share of the test's moving samples on the training's path."""
    from scipy.spatial import cKDTree

    if train.samples == 0 or test.samples == 0:
        return 0.0
    path, points = (np.hstack([log.q, SLOWNESS * log.dq]) for log in (train, test))
    # Interpolated between samples, so that points lie nearer than `NEAR`.
    index = np.arange(0, len(path) - 1 + 1e-9, 0.25)
    tree = cKDTree(resample_columns(index, np.arange(float(len(path))), path))
    distance, _ = tree.query(points, p=np.inf, distance_upper_bound=NEAR)
    return float(np.isfinite(distance).mean())


def identify(
    logs: Sequence[Recording],
    robot: Robot,
    task: Task,
    held_out: Sequence[Recording] = (),
    free: Recording | None = None,
) -> Identification:
    """A robot from logs of free motion, a load from logs that carry it.

    For a payload the logs are those that carry it, or the pair, and `free` the motion
    without it; held-out logs are only scored.

    Raises:
        IdentificationError: If the logs do not determine it, or contradict the robot.
        MissingSignalError: If a signal is missing.
        ParameterError: If two logs are one run: it would count twice.
    """
    sources = logs if free is None else [*logs, free]
    refuse_repeated_logs(sources)
    refuse_repeated_logs(held_out, "--check")
    load, train = None, logs
    if task.method == "payload":
        load, result = find_load(logs, robot, free), MethodResult("payload", robot)
        train = [log for log in (logs if free is None else [free]) if not load.carried_by(log)]
    else:
        data = prepare_training(logs, robot, task.cutoff, task.constants, task.friction)
        result = FITS[task.method](data)
    new, numbers, remarks = result.robot, [*result.numbers], [*result.remarks]
    traces = tuple(
        trace
        for role, some in (("train", train), ("held-out", held_out))
        for log in some
        if (trace := score(log, role, robot, new, task.cutoff)) is not None
    )
    remarks += score_remarks(traces)
    if load is not None:
        new = new.with_payload(load.payload)
        last, mass, sd = robot.joints - 1, load.payload.mass, load.mass_sd
        numbers.append(number(last, "mass", mass, sd, np.nan, sd < 0.2 * mass))
        for axis, value, sd in zip("xyz", load.payload.com, load.com_sd, strict=True):
            numbers.append(number(last, f"com_{axis}", value, sd, np.nan, sd < 0.05))
        remarks.append(load.origin)
    rows = [row for k, trace in enumerate(traces, start=1) for row in trace.rows(k)]
    choices = [
        (j + 1, shape.words, error, shape == fit.shape)
        for j, fit in result.fits.items()
        for shape, error in fit.scores.items()
    ]
    found = Identification(
        robot=new,
        profile=robot,
        method=result.method,
        residuals=pl.DataFrame(rows, schema=RESIDUALS, orient="row"),
        parameters=pl.DataFrame(numbers, schema=PARAMETERS, orient="row"),
        shape_choices=pl.DataFrame(choices, schema=SHAPE_CHOICES, orient="row"),
        base=result.base,
        traces=traces,
        processing=settings_record(task.cutoff, logs[0].median_step),
        remarks=tuple(remarks),
    )
    return found._replace(robot=with_provenance(found, task.name, sources, train, load))


def with_provenance(
    found: Identification,
    name: str,
    logs: Sequence[Recording],
    trained: Sequence[Recording],
    load: LoadFit | None,
) -> Robot:
    """The identified robot, with the source of every number."""
    profile = found.profile
    named = replace(
        found.robot,
        name=name or f"{profile.name}-identified",
        title=f"{profile.title or profile.name}, identified",
        path=None,
    )
    document = robot_document(named)
    new = f"identified ({found.method}) from {names_of(trained)}"
    old = f"profile {profile.name}"
    sure = found.parameters.filter("determined").select("joint", "parameter")
    determined, links = set(sure.rows()), found.method == "base"
    for j, table in enumerate(document["joints"], start=1):
        table["inertial_source"] = new if links else old
        for key in ("rotor_inertia", "torque_constant"):
            if key in table:
                changed = (j, key) in determined or (links and key == "rotor_inertia")
                table[f"{key}_source"] = new if changed else old
    digests = [log.source.sha256 or "unknown" for log in logs]
    account: dict[str, Any] = {
        "method": found.method,
        "profile": profile.name,
        "logs": [log.name for log in logs],
        "sha256": digests,
        "processing": dict(found.processing),
        "residuals": [
            {"log": x.where.about, "role": x.role, "rms_Nm": x.rms.round(4).tolist()}
            for x in found.traces
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
            "sha256": digest,
        }
        for k, (log, digest) in enumerate(zip(logs, digests, strict=True), start=1)
    ]
    tables = {"sources": [*document.get("sources", ()), *sources], "identification": account}
    return replace(named, document={**document, **tables})
