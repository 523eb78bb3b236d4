"""One call a question, for notebooks: a command's answer, as objects.

A log is a file, a bag's folder or a `Recording`; a robot is a profile's name, a file, or
a `Robot`. Keywords are the options of the command without their dashes, made of the
fields that own them; ``settings={"two-cycle.low-pass": 5}`` takes every setting. What
comes back shows itself as one line and as a small table. Nothing is printed, and nothing
is written without ``output=``.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from types import NoneType
from typing import TYPE_CHECKING, TypeVar, get_args

import polars as pl

from vftcli.admittance import ControlChoice
from vftcli.analysis import Analysis
from vftcli.answering import (
    TUNED,
    Opened,
    OpenedLogs,
    errors_of,
    free_thresholds,
    gains_of,
    identified,
    replayed,
)
from vftcli.bias import RefinementChoice
from vftcli.doctor.examination import Examination, Examiner, examine
from vftcli.evaluation import ReferenceChoice
from vftcli.free_motion import FreeChoice
from vftcli.identification import Task
from vftcli.observers import GoalChoice, ObserverChoice
from vftcli.pipeline import (
    AnalysisChoice,
    analyse_logs,
    choice_of,
    for_comparison,
    for_estimates,
    list_touches,
    prepared,
)
from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import Library, checked_call
from vftcli.robots import RobotChoice
from vftcli.robots.robot import Robot
from vftcli.signals.errors import ParameterError
from vftcli.signals.option import Anyway, Asked, Choice, settings_as_typed
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remarks
from vftcli.wrench import AlsoWrench, WrenchChoice

if TYPE_CHECKING:
    from vftcli.contacts.contact_list import ContactList
    from vftcli.contacts.thresholds import Thresholds

#: A robot's name by the user; None for the log's own.
NamedRobot = str | Path | Robot | None
Logs = Opened | OpenedLogs
R = TypeVar("R")

#: Choices that give the calls their options.
OF_LOG: tuple[type[Choice], ...] = (ReadChoice, RobotChoice, Anyway)
OF_CONTACTS = (*OF_LOG, FreeChoice)
OF_ESTIMATE: tuple[type[Choice], ...] = (
    *OF_CONTACTS,
    ObserverChoice,
    RefinementChoice,
    WrenchChoice,
)
OF_REPORT = (*OF_ESTIMATE, AlsoWrench, ReferenceChoice)


def choice_for(
    asked: Asked, logs: Iterable[Opened], observers: ObserverChoice | None = None
) -> AnalysisChoice:
    """The choice for some logs, with other observers if given."""
    library = Library(log for log in logs if not isinstance(log, Recording))
    return choice_of(asked, library, Examiner(anyway=asked.anyway), observers)


def call(
    *kinds: type[Choice], also: Sequence[str] = ()
) -> Callable[[Callable[..., R]], Callable[..., R]]:
    """Decorate a function of logs and `Asked` as a call with options as keywords.

    Args:
        kinds: The choices with its options.
        also: Options that may be positional, behind the robot.
    """
    options = {word: option for kind in kinds for word, (*_, option) in kind.options().items()}
    words = [word for word, each in options.items() if not each.is_setting and word != "robot"]

    def of(function: Callable[..., R]) -> Callable[..., R]:
        first, _, *own = signature(function).parameters.values()
        if NoneType in get_args(first.annotation):
            first = first.replace(default=None)
        robot = first.replace(name="robot", default=None, annotation=NamedRobot)
        named = [Parameter(w, Parameter.KEYWORD_ONLY, default=None) for w in (*words, "settings")]
        placed = [each.replace(kind=first.kind) if each.name in also else each for each in named]
        every = sorted([first, robot, *own, *placed], key=lambda each: each.kind)
        shown = Signature(every)
        name = function.__name__

        @wraps(function)
        def called(*places: object, **given: object) -> R:
            values = dict(shown.bind(*places, **given).arguments)
            said = ", ".join(f"{word}={value!r}" for word, value in values.items())
            log = opened(values.pop(first.name, None), first.annotation)
            arm = values.pop("robot", None)
            if not isinstance(arm, NamedRobot):
                raise ParameterError(f"robot is {arm!r}; expected 'ur5', a file, or a Robot")
            settings = settings_as_typed(values.pop("settings", None) or {}, kinds)
            typed = {
                w: options[w].keyword(values.pop(w), Recording) for w in words if w in values
            }
            if typed.get("columns") is not None and isinstance(log, Recording):
                raise ParameterError("columns are those of a file; this log is read already")
            typed["robot"] = str(arm) if isinstance(arm, Path) else arm
            asked = Asked(typed, settings, f"vftcli.{name}({said})")
            return function(log, asked, **values)

        vars(called)["__signature__"] = shown
        return checked_call(called)

    return of


def opened(logs: object, kind: object) -> object:
    """One log or several of a kind, names as paths. Others raise."""
    kinds = get_args(kind)
    each = logs if isinstance(logs, list | tuple) and OpenedLogs in kinds else [logs]
    for one in each:
        if not isinstance(one, str | Opened) and (one is not None or NoneType not in kinds):
            raise ParameterError(f"the log is {one!r}; expected a file's name or a Recording")
    paths = [Path(one) if isinstance(one, str) else one for one in each]
    return paths if each is logs else paths[0]


def several(logs: Logs) -> list[Opened]:
    """One log or several as a list."""
    found = [logs] if isinstance(logs, Opened) else list(logs)
    if not found:
        raise ParameterError("no log is given")
    return found


@call(*OF_LOG)
def inspect(log: Opened, asked: Asked) -> "Examination":
    """A log's content and findings: its `remarks`, and the `robots` that fit."""
    choice = choice_for(asked, [log])
    recording = choice.library.open(log, choice.read)
    if choice.robot.name is not None or choice.read.effort == "auto":
        run = prepared(recording, choice)
        return examine(run.recording, run.robot)
    return examine(recording, None)


@call(*OF_CONTACTS)
def contacts(log: Opened, asked: Asked) -> "ContactList":
    """The contacts along a log."""
    (made,) = analyse_logs([log], choice_for(asked, [log]), work=list_touches)
    assert made.contacts is not None, "a log that tells no contacts raises"
    return made.contacts


@call(*OF_ESTIMATE, AlsoWrench)
def estimate(log: Opened, asked: Asked) -> Analysis:
    """The external torques along a log, with the contacts and the wrench of ``best``."""
    return analysed(log, for_estimates(choice_for(asked, [log])), asked)


@call(*OF_REPORT)
def report(
    log: Opened, asked: Asked, *, output: str | Path | None = None, force: bool = False
) -> Analysis:
    """Everything about a log, as `vftcli report`; ``output=``: the folder to write."""
    made = analysed(log, choice_for(asked, [log]), asked)
    if output is not None:
        made.save(output, force=force)
    return made


def analysed(log: Opened, choice: AnalysisChoice, asked: Asked) -> Analysis:
    """The analysis of a log, with the remarks of log, estimates and run."""
    from vftcli.outputs.run_record import all_remarks

    (made,) = analyse_logs([log], choice)
    remarks = Remarks((*made.recording.source.remarks, *all_remarks(made)))
    return replace(made, remarks=remarks, run={"command": asked.line})


@call(*OF_REPORT, also=("reference",))
def compare(logs: Logs, asked: Asked) -> "pl.DataFrame":
    """Each observer's error against a reference, the columns those of ``errors.csv``."""
    if asked.words.get("reference") is None:
        raise ParameterError("compare needs reference=: two-cycle, sensor, vendor, zero, …")
    choice = for_comparison(choice_for(asked, several(logs)))
    return errors_of(list(analyse_logs(several(logs), choice)))


@call(*OF_LOG)
def thresholds(free: Logs, asked: Asked, rate: float = 1.0) -> "Thresholds":
    """Thresholds that motion like that of contact-free logs exceeds at a rate. [1/h]"""
    logs = several(free)
    return free_thresholds(logs, choice_for(asked, logs), rate)[2]


@call(*OF_CONTACTS, Task, GoalChoice, RefinementChoice, also=("method",))
def identify(logs: Logs, asked: Asked, *, check: OpenedLogs = ()) -> Robot:
    """The robot that logs of free motion show; `Robot.save` writes its file."""
    paths, task, goal = several(logs), asked.of(Task), asked.of(GoalChoice)
    if task.method == "gains":
        found = gains_of(paths[0], choice_for(asked, paths, TUNED), goal)
        robot = found.run.robot
        gains = {line.section: dict(line.gains) for line in found.tuned}
        document = {**robot.document, "observers": gains}
        return replace(robot, gains=gains, document=document)
    choice = choice_for(asked, [*paths, *check])
    examiner = Examiner(anyway=asked.anyway, fitting=task.keeps_links)
    return identified(paths, check, replace(choice, examiner=examiner), task).robot


@checked_call
def simulate(
    scenario: str | Path, *, seed: int | None = None, settings: Mapping[str, object] | None = None
) -> Recording:
    """The log of a simulated experiment, with true forces (polars) in its `truth`.

    Args:
        scenario: A scenario's name or file.
        seed: Seed of everything random; None for the scenario's own.
        settings: Keys of the scenario → their values, as ``{"duration": 8}``.
    """
    from vftcli.signals.packages import check_installed
    from vftcli.simulation import load_scenario
    from vftcli.simulation.experiment import simulate as run

    check_installed("pinocchio", "vft.simulate")
    changes = [f"{name}={value}" for name, value in (settings or {}).items()]
    made = run(load_scenario(scenario, changes), seed)
    return replace(made.recording, truth=pl.DataFrame(made.truth.columns()))


@call(*OF_ESTIMATE, ControlChoice, also=("alpha",))
def admit(
    log: Opened | None,
    asked: Asked,
    *,
    release: str | Sequence[str] = (),
    seed: int | None = None,
) -> "pl.DataFrame":
    """Admittance controllers on a log's force, a row a controller and axis."""
    release = [release] if isinstance(release, str) else list(release)
    logs = [] if log is None else [log]
    found = replayed(log, asked, lambda words: choice_for(words, logs), release, seed)
    return pl.DataFrame(found.replay.rows, infer_schema_length=None)
