"""Logs in, a robot out: the whole way of `vftcli identify`, in the order the data flows."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import polars as pl

from vftcli.identification.base_parameters import BaseParameters
from vftcli.identification.friction_fit import ShapeChoice
from vftcli.identification.method_result import MethodResult
from vftcli.identification.methods import METHODS
from vftcli.identification.payload import LoadFit, payload_from_pair, payload_from_poses
from vftcli.identification.processing import PreparedLog, Processing, prepare
from vftcli.identification.provenance import Provenance, documented
from vftcli.identification.repeats import repeated_share, repeats
from vftcli.identification.result import (
    BASE,
    CONTESTS,
    PARAMETERS,
    RESIDUALS,
    Identification,
    Number,
    Trace,
)
from vftcli.identification.scoring import diagnosis, mean_text, predicted_torque, rms
from vftcli.identification.training import training
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError, ParameterError
from vftcli.signals.identity import refuse_repeated_logs
from vftcli.signals.recording import Recording


@dataclass(frozen=True, kw_only=True)
class Task:
    """What shall be identified.

    Attributes:
        method: A name in `METHODS`, or None for a payload alone.
        name: Name of the new robot.
        find_payload: Whether a load on the flange is sought.
        fit_constants: Whether the friction method also fits drive constants.
        processing: Filters and decimation.
    """

    method: str | None = "friction"
    name: str = ""
    find_payload: bool = False
    fit_constants: bool = False
    processing: Processing = field(default_factory=Processing)

    def __post_init__(self) -> None:
        if self.method is not None and self.method not in METHODS:
            raise ParameterError(f"--method {self.method!r}; there is {', '.join(METHODS)}")
        if self.method is None and not self.find_payload:
            raise ParameterError(f"nothing to identify: give --method {'|'.join(METHODS)}")
        if self.fit_constants and self.method != "friction":
            raise ParameterError("--fit-constants is an option of --method friction")


def identify(
    logs: Sequence[Recording],
    robot: Robot,
    task: Task,
    held_out: Sequence[Recording] = (),
    free: Recording | None = None,
) -> Identification:
    """Identify a robot from logs of free motion, a load from logs that carry it.

    Args:
        logs: Training logs; with `find_payload` the logs that carry the load, or the pair.
        robot: The profile to start from.
        task: What to identify.
        held_out: Logs to score on.
        free: The same motion without the load.

    Raises:
        IdentificationError: If the logs do not determine it, or contradict the robot.
        MissingSignalError: If a signal is missing.
        ParameterError: If two logs are the same run: it would count as two.
    """
    refuse_repeated_logs(logs if free is None else [*logs, free])
    refuse_repeated_logs(held_out, "--validate")
    load = find_load(logs, robot, free) if task.find_payload else None
    train = free_logs(logs, free, load)
    if load is not None and (task.method is None or not train):
        method, outcome = "payload", MethodResult(robot, [], [], None, [])
    else:
        method = task.method or "payload"
        data = training(train, robot, task.processing, task.fit_constants)
        outcome = METHODS[method](data)
    new, numbers, notes = outcome.robot, [*outcome.numbers], [*outcome.notes]
    scored = [prepare(r, robot, task.processing) for r in (train or ())]
    others = [prepare(r, robot, task.processing) for r in held_out]
    rows, traces = residual_rows(scored, "train", robot, new)
    more, tested = residual_rows(others, "held-out", robot, new)
    notes += remarks(new, scored, others, traces, tested)
    if load is not None:
        new, numbers, notes = with_load(new, load, numbers, notes)
    processing = task.processing.described(logs[0].median_step)
    table = pl.DataFrame([*rows, *more], schema=RESIDUALS, orient="row")
    sources = tuple(logs) if free is None else (*logs, free)
    story = Provenance(
        profile=robot,
        name=task.name,
        method=method,
        logs=sources,
        trained=[r.name for r in train],
        processing=processing,
        residuals=table,
        outcome=outcome,
        load=load,
    )
    new = documented(new, story)
    return Identification(
        robot=new,
        profile=robot,
        method=method,
        residuals=table,
        parameters=pl.DataFrame([n.row for n in numbers], schema=PARAMETERS, orient="row"),
        contests=contest_table(outcome.contests),
        base=base_table(outcome.base),
        traces=(*traces, *tested),
        processing=processing,
        notes=tuple(dict.fromkeys(notes)),
    )


def find_load(logs: Sequence[Recording], robot: Robot, free: Recording | None) -> LoadFit:
    """Find the load: from a pair if there is one, else from poses at rest."""
    bare = robot.with_payload(None)
    if free is not None:
        fit = payload_from_pair(logs[0], free, bare)
        if fit.loaded[0] is free:
            raise IdentificationError(
                f"{free.name}, given as free of load, is the heavier one; swap the two logs"
            )
        return fit
    if len(logs) == 2 and all(moves(r) for r in logs):
        try:
            return payload_from_pair(logs[0], logs[1], bare)
        except IdentificationError as error:
            if "not the same motion" not in str(error):
                raise
    return payload_from_poses(logs, bare)


def moves(recording: Recording) -> bool:
    """Whether some joint travels."""
    return bool(np.max(np.ptp(recording.q, axis=0)) > 0.05)


def free_logs(
    logs: Sequence[Recording], free: Recording | None, load: LoadFit | None
) -> tuple[Recording, ...]:
    """The logs that carry no unknown load: what the arm itself is identified from."""
    if load is None:
        return tuple(logs)
    if free is not None:
        return (free,)
    return tuple(log for log in logs if not any(log is loaded for loaded in load.loaded))


def residual_rows(
    motions: Sequence[PreparedLog], role: str, profile: Robot, robot: Robot
) -> tuple[list[tuple[str, str, str, int, float, int]], list[Trace]]:
    """Score logs under the profile and the identified robot."""
    rows, traces = [], []
    for motion in motions:
        if motion.samples < 2:
            continue
        name = motion.recording.name
        expected = predicted_torque(robot, motion)
        measured = motion.tau * constant_ratio(profile, robot, motion)
        for model, left in (
            ("identified", measured - expected),
            ("profile", motion.tau - predicted_torque(profile, motion)),
        ):
            for j, value in enumerate(rms(left), start=1):
                rows.append((name, role, model, j, float(value), motion.samples))
        traces.append(Trace(motion.recording, role, motion.t, motion.dq, measured, expected))
    return rows, traces


def constant_ratio(profile: Robot, robot: Robot, motion: PreparedLog) -> Array | float:
    """New over old drive constants, for torque that was made from currents with the old. (n,)"""
    old, new = profile.torque_constant, robot.torque_constant
    if old is None or new is None or motion.recording.current is None:
        return 1.0
    from vftcli.robots.drive import uses_current

    ratio: Array = new / old
    return ratio if uses_current(motion.recording, profile) else 1.0


def remarks(
    robot: Robot,
    train: Sequence[PreparedLog],
    test: Sequence[PreparedLog],
    trained: Sequence[Trace],
    tested: Sequence[Trace],
) -> list[str]:
    """What the scores mean: repeated trajectories, and joints that are much worse elsewhere."""
    notes = []
    for motion in test:
        for other in train:
            if repeats(other, motion):
                share = 100.0 * repeated_share(other, motion)
                notes.append(
                    f"{motion.recording.name} repeats the trajectory of {other.recording.name} "
                    f"({share:.0f} % of it): its score says nothing about other motions"
                )
    if trained and tested:
        level = np.mean([rms(trace.residual) for trace in trained], axis=0)
        for motion, trace in zip([m for m in test if m.samples > 1], tested, strict=True):
            notes += diagnosis(robot, motion, trace.residual, level)
    if trained:
        mean = mean_text(np.mean([rms(trace.residual) for trace in trained], axis=0))
        notes.append(f"training residual {mean}, mean of the joints, contacts if any included")
    return notes


def with_load(
    robot: Robot, load: LoadFit, numbers: list[Number], notes: list[str]
) -> tuple[Robot, list[Number], list[str]]:
    """The robot with the found load mounted, and its numbers."""
    known = load.mass_sd < 0.2 * load.payload.mass
    nothing = float("nan")
    values = zip(("com_x", "com_y", "com_z"), load.payload.com, load.com_sd, strict=True)
    found = [
        Number(robot.joints, "mass", load.payload.mass, load.mass_sd, nothing, known),
        *(Number(robot.joints, k, float(v), float(sd), nothing, sd < 0.05) for k, v, sd in values),
    ]
    return robot.with_payload(load.payload), [*numbers, *found], [*notes, *load.notes]


def contest_table(contests: Sequence[ShapeChoice]) -> pl.DataFrame:
    """The friction candidates as a table."""
    rows = [(c.joint, c.shape.words, c.error, c.chosen) for c in contests]
    return pl.DataFrame(rows, schema=CONTESTS, orient="row")


def base_table(base: BaseParameters | None) -> pl.DataFrame | None:
    """Base parameters as a table."""
    if base is None:
        return None
    rows = zip(base.names, base.values.tolist(), base.sd.tolist(), base.determined, strict=True)
    return pl.DataFrame(list(rows), schema=BASE, orient="row")
