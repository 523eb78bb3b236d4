"""Logs in, a robot out: the whole way of `vftcli identify`, in the order the data flows."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import polars as pl

from vftcli.identification.friction_method import friction_method
from vftcli.identification.links_choice import chosen_method
from vftcli.identification.method_result import MethodResult
from vftcli.identification.payload import (
    LoadFit,
    NotSameMotionError,
    TooFewPosesError,
    payload_from_pair,
    payload_from_poses,
)
from vftcli.identification.payload_in_motion import payload_from_motion
from vftcli.identification.processing import Processing
from vftcli.identification.provenance import with_provenance
from vftcli.identification.result import (
    BASE,
    PARAMETERS,
    RESIDUALS,
    SHAPE_CHOICES,
    Identification,
    Number,
    number,
)
from vftcli.identification.scoring import score, score_remarks
from vftcli.identification.target_method import targets_method
from vftcli.identification.training import Training, prepare_training
from vftcli.identification.whole_arm import whole_arm
from vftcli.robots.robot import Robot
from vftcli.signals.errors import IdentificationError, ParameterError
from vftcli.signals.identity import refuse_repeated_logs
from vftcli.signals.recording import Recording

#: Name at the command line → method.
METHODS: dict[str, Callable[[Training], MethodResult]] = {
    "friction": friction_method,
    "base": whole_arm,
    "targets": targets_method,
}
#: Name of the choice between "friction" and "base" by what the profile's links leave.
AUTO = "auto"


@dataclass(frozen=True, kw_only=True)
class Task:
    """What shall be identified."""

    method: str | None = "friction"  #: A name in `METHODS`, `AUTO`, or None for a payload alone.
    name: str = ""  #: Name of the new robot.
    find_payload: bool = False  #: Whether a load on the flange is sought.
    fit_constants: bool = False  #: Whether the friction method also fits drive constants.
    #: Whether the joints have friction to be fitted; a simulator's may have none.
    friction: bool = True
    processing: Processing = field(default_factory=Processing)  #: Filters and decimation.

    def __post_init__(self) -> None:
        if self.method is not None and self.method not in (*METHODS, AUTO):
            there = ", ".join((*METHODS, AUTO))
            raise ParameterError(f"--method {self.method!r}; there is {there}")
        if self.method is None and not self.find_payload:
            raise ParameterError(f"nothing to identify: give --method {'|'.join(METHODS)}")
        if self.fit_constants and self.method != "friction":
            raise ParameterError("--fit-constants is an option of --method friction")
        if self.method == "targets" and not self.friction:
            raise ParameterError(
                "--method targets reads the controller's friction; leave out --friction none"
            )


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
        data = prepare_training(train, robot, task.processing, task.fit_constants, task.friction)
        method, result = chosen_method(data) if method == AUTO else (method, METHODS[method](data))
    new, numbers, remarks = result.robot, [*result.numbers], [*result.remarks]
    scored = [
        score(log, role, robot, new, task.processing)
        for role, some in (("train", train), ("held-out", held_out))
        for log in some
    ]
    traces = tuple(trace for trace in scored if trace.motion.samples > 1)
    remarks += score_remarks(new, traces)
    if load is not None:
        new, numbers = with_load(new, load, numbers)
        remarks.append(load.origin)
    rows = [row for k, trace in enumerate(traces, start=1) for row in trace.rows(k)]
    choices = [(c.joint, c.shape.words, c.error, c.chosen) for c in result.shape_choices]
    base = None
    if result.base is not None:
        base = pl.DataFrame(result.base.rows(), schema=BASE, orient="row")
    found = Identification(
        robot=new,
        profile=robot,
        method=method,
        residuals=pl.DataFrame(rows, schema=RESIDUALS, orient="row"),
        parameters=pl.DataFrame(numbers, schema=PARAMETERS, orient="row"),
        shape_choices=pl.DataFrame(choices, schema=SHAPE_CHOICES, orient="row"),
        base=base,
        traces=traces,
        processing=task.processing.settings_record(logs[0].median_step),
        remarks=tuple(remarks),
    )
    sources = logs if free is None else [*logs, free]
    return replace(found, robot=with_provenance(found, task.name, sources, train, load))


def find_load(logs: Sequence[Recording], robot: Robot, free: Recording | None) -> LoadFit:
    """Find the load: from a pair if there is one, else from poses at rest, else from motion."""
    bare = robot.with_payload(None)
    if free is not None:
        fit = payload_from_pair(logs[0], free, bare)
        if fit.carried_by(free):
            raise IdentificationError(
                f"{free.name}, given as free of load, is the heavier one; swap the two logs"
            )
        return fit
    # A pair repeats a motion: in both logs some joint travels further than it would at rest. Two
    # episodes of a dataset carry the same.
    moved = all(np.ptp(r.q, axis=0).max() > 0.05 for r in logs)
    if len(logs) == 2 and moved and not all(r.source.part for r in logs):
        try:
            return payload_from_pair(logs[0], logs[1], bare)
        except NotSameMotionError:
            pass  # two different motions with the load may still tell it
    try:
        return payload_from_poses(logs, bare)
    except TooFewPosesError:
        return payload_from_motion(logs, bare)


def free_logs(
    logs: Sequence[Recording], free: Recording | None, load: LoadFit | None
) -> tuple[Recording, ...]:
    """The logs that carry no unknown load: what the arm itself is identified from."""
    if load is None:
        return tuple(logs)
    if free is not None:
        return (free,)
    return tuple(log for log in logs if not load.carried_by(log))


def with_load(robot: Robot, load: LoadFit, numbers: list[Number]) -> tuple[Robot, list[Number]]:
    """The robot with the found load mounted, and its numbers beside the others."""
    last, nothing, found = robot.joints - 1, float("nan"), load.payload
    known = load.mass_sd < 0.2 * found.mass
    more = [number(last, "mass", found.mass, load.mass_sd, nothing, known)]
    for key, value, sd in zip(("com_x", "com_y", "com_z"), found.com, load.com_sd, strict=True):
        more.append(number(last, key, value, sd, nothing, bool(sd < 0.05)))
    return robot.with_payload(found), [*numbers, *more]
