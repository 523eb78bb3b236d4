"""Answers that commands and notebooks share, beyond one log's `pipeline`."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from vftcli.admittance import ControlChoice, released_robot
from vftcli.analysis import Analysis
from vftcli.identification import Task
from vftcli.observers import LOG_GAINS, GoalChoice, ObserverChoice
from vftcli.pipeline import (
    AnalysisChoice,
    analyse,
    check_logged,
    examine,
    model,
    prepared,
    read,
    touches,
)
from vftcli.readers.references import estimates_columns
from vftcli.robots.run import Run
from vftcli.signals.errors import ParameterError
from vftcli.signals.option import FILE, Asked
from vftcli.signals.recording import Recording, refuse_repeated_logs
from vftcli.signals.remarks import Remark, Where, caution, fact
from vftcli.wrench import WrenchChoice

if TYPE_CHECKING:
    import polars as pl

    from vftcli.admittance.closed_loop import Replayed
    from vftcli.admittance.replay import DrivingForce
    from vftcli.contacts.thresholds import ComparedSignals, Thresholds
    from vftcli.doctor.examination import Examination
    from vftcli.identification.fitting import Identification
    from vftcli.observers.tuning import Goal, Tuned

Opened = Path | Recording  #: A log of a call: a file, or already read.
OpenedLogs = Sequence[Opened]  #: Several such logs.


def errors_of(
    analyses: Sequence[Analysis], others: "Sequence[pl.DataFrame]" = ()
) -> "pl.DataFrame":
    """The errors of several logs and of others, pooled rows last."""
    import polars as pl

    from vftcli.evaluation.errors import PoolMember, evaluate_pooled
    from vftcli.outputs.error_tables import marked

    judged = [
        PoolMember(a.robot.name, a.estimates, a.reference)
        for a in analyses
        if a.reference is not None
    ]
    errors = (*(made.errors for made in analyses), *others, evaluate_pooled(judged))
    return marked(pl.concat([e for e in errors if e is not None], how="diagonal"), analyses)


def free_thresholds(
    logs: OpenedLogs, choice: AnalysisChoice, rate: float
) -> "tuple[list[Run], list[ComparedSignals], Thresholds]":
    """Contact-free logs, their signals, thresholds for a rate. [1/h]"""
    from vftcli.contacts.threshold_check import compared_signals
    from vftcli.contacts.thresholds import find_thresholds

    opened = list(choice.library.open_each(logs, choice.read))
    refuse_repeated_logs(opened)
    runs = [modelled(log, choice) for log in opened]
    shown = [remark for run in runs for remark in touched(run, choice)]
    signals = [compared_signals(run) for run in runs]
    found = find_thresholds(signals, rate)
    return runs, signals, replace(found, remarks=(*found.remarks, *shown))


def modelled(recording: Recording, choice: AnalysisChoice) -> Run:
    """A log with its robot, examined; meaningless results raise."""
    run = prepared(recording, choice)
    choice.examiner.examine(run.recording, run.robot)
    return run


def touched(run: Run, choice: AnalysisChoice) -> tuple[Remark, ...]:
    """A remark if a log that should be free shows contact.

    Raises:
        ParameterError: If it shows contact plainly, without `anyway`.
    """
    from vftcli.contacts.thresholds import SETTLING

    listed = touches(run, choice)
    rows = listed.contacts if listed else ()
    found = [row for row in rows if row.stop > run.t[0] + SETTLING]
    if not found:
        return ()
    worst = max(found, key=lambda row: (row.trust != "weak", row.peak_force or 0.0))
    where = Where(run.name, span=(worst.start, worst.stop))
    remark = caution("free-log-touched", where, size=worst.size, count=len(found))
    if worst.trust != "weak" and not choice.examiner.anyway:
        raise ParameterError(
            f"{remark}. Give motion that nobody touches, a part of this log with --interval, or "
            "take it all with --anyway"
        )
    return (remark,)


def identified(
    logs: OpenedLogs,
    check: OpenedLogs,
    choice: AnalysisChoice,
    task: Task,
    tell: Callable[[Recording], None] | None = None,
) -> "Identification":
    """The robot from logs, tried on those to `check`."""
    from vftcli.identification.fitting import identify

    examiner, library = choice.examiner, choice.library
    profile = examiner.robot(next(library.open_each(logs, choice.read)), choice.robot)
    # An episode is one of LOG's; the others are separate logs.
    whole = choice.read.whole
    held_out, unloaded = (
        replace(whole, interval=span) for span in (task.check_interval, choice.read.interval)
    )
    every: list[list[Recording]] = []
    for paths, how in ((logs, choice.read), (check, held_out), (choice.free.logs, unloaded)):
        opened = library.open_each(paths, how, whole=paths is logs and task.method == "payload")
        every.append([examiner.read_as(log, profile, how) for log in opened])
    for recording in (one for some in every for one in some):
        if tell is not None:
            tell(recording)
        examiner.examine(recording, profile)
    train, tried, free = every
    task = replace(task, friction=choice.robot.friction != "none")
    return identify(train, profile, task, tried, free[0] if free else None)


#: Observers for the spectra from which gains are found.
TUNED = ObserverChoice(gains=LOG_GAINS, causal=True)


class FoundGains(NamedTuple):
    """Gains for a goal, and their basis."""

    run: Run  #: The log and its arm.
    goal: "Goal"
    tuned: "Sequence[Tuned]"  #: The gains of every observer.
    remarks: tuple[Remark, ...]
    examinations: "tuple[Examination, ...]"  #: Findings on the log and its free runs.


def gains_of(log: Opened, choice: AnalysisChoice, asked: GoalChoice) -> FoundGains:
    """The gains for a goal, by the spectra of a log."""
    from vftcli.observers.tuning import bounds_reached, parse_goal, tune_all

    goal = parse_goal(asked.gains, asked.threshold)
    run = prepared(choice.library.open(log, choice.read), choice)
    motion = read(run, choice)
    examinations = examine(motion, choice)
    found = model(motion, choice)
    if found is None or (spectra := found.plain.spectra) is None:
        why = found.plain.missing if found else "no free part"
        raise ParameterError(f"gains cannot be found: {why}")
    tuned = tune_all(spectra, goal)
    remarks = (*found.remarks, *bounds_reached(tuned, spectra, goal))
    return FoundGains(run, goal, tuned, remarks, examinations)


#: Default observer of the force: the paper's controller's.
DRIVER = "kfo-fe"


def replayed(
    log: Opened | None,
    asked: Asked,
    choice_of: Callable[[Asked], AnalysisChoice],
    release: Sequence[str] = (),
    seed: int | None = None,
) -> "Replayed":
    """A log's force, a scenario in the loop, or a release through every controller.

    A release has no log and begins as ``x=0.3``; the seed is a scenario's.
    """
    from vftcli.admittance.closed_loop import Replayed
    from vftcli.admittance.replay import release_deviation, replay, replay_release
    from vftcli.signals.packages import check_installed

    check_installed("pinocchio", "vftcli admit")
    named = asked.words.get("observer") or [DRIVER]
    if len(named) > 1:
        raise ParameterError("one observer's force drives the replay; give --observer once")
    stored = None
    if isinstance(log, Path) and asked.words.get("columns") is None:
        stored = estimates_columns(log, named[0]) if log.exists() else None
    # A table of estimates may hold a foreign observer's.
    words = {"observer": named} if stored is None else {"observer": [DRIVER], "columns": stored}
    choice = choice_of(asked.but(**words))
    anyway = choice.examiner.anyway
    if stored is not None and choice.robot.name is None:
        raise ParameterError(f"{log} does not settle which arm it is of; name it with --robot")
    if asked.words.get("frame") not in {None, "base"}:
        raise ParameterError(
            "the replay is in base axes about the flange point; leave --frame out"
        )
    choice = replace(choice, wrench=replace(choice.wrench or WrenchChoice(), frame="base"))
    control = replace(asked.of(ControlChoice), as_printed=choice.observers.as_printed)
    if log is None:
        deviation, arm = release_deviation(release), released_robot(choice.robot)
        made = replay_release(
            deviation,
            arm,
            control.controllers(arm),
            start=control.start_pose(arm),
            duration=control.duration,
            anyway=anyway,
        )
        return Replayed(made)
    # A scenario's file, or a name without ending that is no file.
    is_file = isinstance(log, Recording) or log.exists() or log.suffix or len(log.parts) > 1
    if isinstance(log, Path) and (log.suffix == ".toml" or not is_file):
        return looped(str(log), seed, choice, control, anyway=anyway)
    run = prepared(choice.library.open(log, choice.read), choice)
    recording, arm = run.recording, run.robot
    check_logged(recording, "admit runs a controller that must not see the future")
    if stored is None:  # an earlier run examined its estimates
        choice.examiner.examine(recording, arm)
    controllers = control.controllers(arm)
    force = force_of(run, choice, control.force, named[0] if stored else None)
    made = replay(force.wrench, recording.q, arm, controllers, source=force.source, anyway=anyway)
    return Replayed(made, recording, None, choice.examiner.examinations)


def force_of(
    log: Run, choice: AnalysisChoice, source: str | None, stored: str | None
) -> "DrivingForce":
    """The force of a replay: the log's, a file's, stored or new."""
    from vftcli.admittance import replay

    assert choice.wrench is not None, "`replayed` asks for one"
    of = log.recording, log.robot, choice.wrench
    if source == "sensor":
        return replay.sensor_force(*of)
    if source is not None:
        return replay.truth_force(*of, Path(source.removeprefix(FILE)))
    if stored is not None:
        return replay.stored_force(*of, stored)
    reading = analyse(log, choice).virtual_sensor
    assert reading is not None, "a wrench was asked for"
    wrench = replace(reading.wrenches[0], remarks=reading.remarks)
    code = "force-smoothed" if wrench.name in reading.smoothed else "force-of-observer"
    return replay.DrivingForce(wrench, fact(code, observer=wrench.name))


def looped(
    name: str, seed: int | None, choice: AnalysisChoice, control: ControlChoice, *, anyway: bool
) -> "Replayed":
    """A scenario in the loop, its force through all controllers."""
    from vftcli.admittance.closed_loop import UNLOADED, Replayed, loop_of
    from vftcli.admittance.replay import replay

    assert choice.wrench is not None, "`replayed` asks for one"
    zero = choice.wrench.zero
    if zero.start:
        raise ParameterError("the closed loop holds still over a span: give it as --zero A:B")
    still = zero.spans[0] if zero.spans else UNLOADED
    run, arm = loop_of(name, control, choice.observers, seed=seed, zero=still, anyway=anyway)
    laws, source = control.controllers(arm), fact("force-of-loop")
    return Replayed(replay(run.wrench, run.q, arm, laws, source=source, anyway=anyway), run=run)
