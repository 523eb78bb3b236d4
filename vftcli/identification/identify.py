"""Logs in, a robot out: the whole way of `vftcli identify`, in the order the data flows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.identification.base_parameters import BaseParameters
from vftcli.identification.friction_fit import ShapeChoice
from vftcli.identification.friction_method import friction_method
from vftcli.identification.method_result import MethodResult
from vftcli.identification.payload import (
    LoadFit,
    NotSameMotionError,
    payload_from_pair,
    payload_from_poses,
)
from vftcli.identification.processing import PreparedLog, Processing, prepare
from vftcli.identification.provenance import Provenance, with_provenance
from vftcli.identification.result import (
    BASE,
    PARAMETERS,
    RESIDUALS,
    SHAPE_CHOICES,
    Identification,
    Number,
    Trace,
    number,
)
from vftcli.identification.scoring import (
    REPEATED,
    held_out_remarks,
    predicted_torque,
    repeated_share,
    rms,
)
from vftcli.identification.target_method import targets_method
from vftcli.identification.training import Training, prepare_training
from vftcli.identification.whole_arm import base_method, consistent_method
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.errors import IdentificationError, ParameterError
from vftcli.signals.identity import refuse_repeated_logs
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, Where, caution, fact

METHODS: dict[str, Callable[[Training], MethodResult]] = {
    "friction": friction_method,
    "base": base_method,
    "consistent": consistent_method,
    "targets": targets_method,
}
"""Name at the command line → method."""


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
        method, result = "payload", MethodResult(robot, [], [], None, [])
    else:
        method = task.method or "payload"
        data = prepare_training(train, robot, task.processing, task.fit_constants)
        result = METHODS[method](data)
    new, numbers, remarks = result.robot, [*result.numbers], [*result.remarks]
    scored = [
        ScoredLog.of(log, role, robot, new, task.processing)
        for role, some in (("train", train), ("held-out", held_out))
        for log in some
    ]
    remarks += score_remarks(new, scored)
    if load is not None:
        new, numbers = with_load(new, load, numbers)
        remarks.append(load.origin)
    processing = task.processing.settings_record(logs[0].median_step)
    rows = [row for k, log in enumerate(scored, start=1) for row in log.rows(k)]
    residuals = pl.DataFrame(rows, schema=RESIDUALS, orient="row")
    made = Provenance(
        profile=robot,
        name=task.name,
        method=method,
        logs=tuple(logs) if free is None else (*logs, free),
        trained=train,
        processing=processing,
        residuals=residuals,
        result=result,
        load=load,
    )
    return Identification(
        robot=with_provenance(new, made),
        profile=robot,
        method=method,
        residuals=residuals,
        parameters=pl.DataFrame(numbers, schema=PARAMETERS, orient="row"),
        shape_choices=shape_choice_table(result.shape_choices),
        base=base_table(result.base),
        traces=tuple(log.trace for log in scored if log.trace is not None),
        processing=processing,
        remarks=tuple(remarks),
    )


def find_load(logs: Sequence[Recording], robot: Robot, free: Recording | None) -> LoadFit:
    """Find the load: from a pair if there is one, else from poses at rest."""
    bare = robot.with_payload(None)
    if free is not None:
        fit = payload_from_pair(logs[0], free, bare)
        if fit.carried_by(free):
            raise IdentificationError(
                f"{free.name}, given as free of load, is the heavier one; swap the two logs"
            )
        return fit
    if len(logs) == 2 and all(joints_travel(r) for r in logs):
        try:
            return payload_from_pair(logs[0], logs[1], bare)
        except NotSameMotionError:
            pass  # two different motions with the load: their poses at rest may still tell it
    return payload_from_poses(logs, bare)


def joints_travel(recording: Recording) -> bool:
    """Whether some joint travels further than it would at rest."""
    return bool(np.max(np.ptp(recording.q, axis=0)) > 0.05)


def free_logs(
    logs: Sequence[Recording], free: Recording | None, load: LoadFit | None
) -> tuple[Recording, ...]:
    """The logs that carry no unknown load: what the arm itself is identified from."""
    if load is None:
        return tuple(logs)
    if free is not None:
        return (free,)
    return tuple(log for log in logs if not load.carried_by(log))


class ScoredLog(NamedTuple):
    """A log scored under the profile and under the identified robot.

    Attributes:
        motion: The prepared log.
        role: "train" or "held-out".
        trace: Measured and predicted torque; None where nothing moves.
        before: RMS under the profile. (n,) [N·m]
    """

    motion: PreparedLog
    role: str
    trace: Trace | None
    before: Array

    @classmethod
    def of(
        cls, log: Recording, role: str, profile: Robot, robot: Robot, processing: Processing
    ) -> "ScoredLog":
        """Score a log."""
        motion = prepare(log, profile, processing)
        if motion.samples < 2:
            return cls(motion, role, None, np.zeros(motion.joints))
        expected = predicted_torque(robot, motion)
        measured = motion.tau * constant_ratio(profile, robot, motion)
        trace = Trace(log, role, motion.t, motion.dq, measured, expected)
        return cls(motion, role, trace, rms(motion.tau - predicted_torque(profile, motion)))

    def rows(self, index: int) -> list[tuple[str, int, str, str, int, float, int]]:
        """Rows of `RESIDUALS`; none where nothing moves."""
        if self.trace is None:
            return []
        sizes = {"identified": rms(self.trace.residual), "profile": self.before}
        name, samples = self.trace.recording.name, self.motion.samples
        return [
            (name, index, self.role, model, j, float(value), samples)
            for model, values in sizes.items()
            for j, value in enumerate(values, start=1)
        ]


def constant_ratio(profile: Robot, robot: Robot, motion: PreparedLog) -> Array | float:
    """New over old drive constants, for torque that was made from currents with the old. (n,)"""
    old, new = profile.torque_constant, robot.torque_constant
    if old is None or new is None or motion.recording.current is None:
        return 1.0
    from vftcli.robots.drive import uses_current

    ratio: Array = new / old
    return ratio if uses_current(motion.recording, profile) else 1.0


def score_remarks(robot: Robot, scored: Sequence[ScoredLog]) -> list[Remark]:
    """What the scores mean: repeated trajectories, and joints that are much worse elsewhere."""
    train = [log for log in scored if log.role == "train"]
    held_out = [log for log in scored if log.role == "held-out"]
    remarks = []
    for test in held_out:
        for other in train:
            if (share := repeated_share(other.motion, test.motion)) >= REPEATED:
                where, name = Where(test.motion.recording.name), other.motion.recording.name
                values = {"training_log": name, "share_percent": 100.0 * share}
                remarks.append(caution("repeated-trajectory", where, **values))
    levels = [rms(log.trace.residual) for log in train if log.trace is not None]
    if not levels:
        return remarks
    level = np.mean(levels, axis=0)
    for test in held_out:
        if test.trace is not None:
            remarks += held_out_remarks(robot, test.motion, test.trace.residual, level)
    return [*remarks, fact("training-residual", mean_Nm=float(np.mean(level)))]


def with_load(robot: Robot, load: LoadFit, numbers: list[Number]) -> tuple[Robot, list[Number]]:
    """The robot with the found load mounted, and its numbers beside the others."""
    last, nothing, found = robot.joints - 1, float("nan"), load.payload
    known = load.mass_sd < 0.2 * found.mass
    more = [number(last, "mass", found.mass, load.mass_sd, nothing, known)]
    for key, value, sd in zip(("com_x", "com_y", "com_z"), found.com, load.com_sd, strict=True):
        more.append(number(last, key, value, sd, nothing, bool(sd < 0.05)))
    return robot.with_payload(found), [*numbers, *more]


def shape_choice_table(choices: Sequence[ShapeChoice]) -> pl.DataFrame:
    """The friction candidates and their errors, by `SHAPE_CHOICES`."""
    rows = [(c.joint, c.shape.words, c.error, c.chosen) for c in choices]
    return pl.DataFrame(rows, schema=SHAPE_CHOICES, orient="row")


def base_table(base: BaseParameters | None) -> pl.DataFrame | None:
    """Base parameters by `BASE`; None for a method that has none."""
    if base is None:
        return None
    rows = zip(base.names, base.values.tolist(), base.sd.tolist(), base.determined, strict=True)
    return pl.DataFrame(list(rows), schema=BASE, orient="row")
