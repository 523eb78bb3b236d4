"""One call a question, for notebooks: what a command answers, as objects.

A log is a file, a bag's folder or a `Recording`; a robot is a profile's name, a file, or a `Robot`.
What comes back shows itself as one line and as a small table, and has ``to_polars()``.
"""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from vftcli.pipeline import Analyser, AnalysisChoice, analyse, list_touches, prepared
from vftcli.readers.estimates import refuse_estimates
from vftcli.readers.library import Library
from vftcli.readers.reader import ReadChoice
from vftcli.repetition.choice import FreeChoice
from vftcli.robots.choice import RobotChoice
from vftcli.robots.robot import Robot
from vftcli.robots.run import Run, Runs
from vftcli.signals.errors import ParameterError
from vftcli.signals.recording import EFFORTS, Recording
from vftcli.signals.remarks import Remark, Remarks, Where, caution

if TYPE_CHECKING:
    from vftcli.analysis import Analysis
    from vftcli.contacts.contact_list import ContactList
    from vftcli.contacts.thresholds import Thresholds

Log = str | Path | Recording  #: A log as a user names it.
#: A robot as a user names it; None where the log settles it.
NamedRobot = str | Path | Robot | None


def report(
    log: Log,
    robot: NamedRobot = None,
    *,
    observers: Sequence[str] = (),
    reference: str | None = None,
    free: Sequence[str | Path] = (),
    columns: str | None = None,
    interval: str | None = None,
    output: str | Path | None = None,
    force: bool = False,
) -> "Analysis":
    """Everything about one log, as `vftcli report` has it.

    Args:
        log: The log.
        robot: The arm.
        observers: Which run, as "best" and "gmo"; the default of the command if none.
        reference: What the estimates are compared with: zero, two-cycle, vendor, sensor, file:PATH.
        free: Motion that nobody touched: other logs, or spans ``A:B`` of this one. [s]
        columns: Columns of a table, as ``--columns``.
        interval: The span ``A:B`` to use. [s]
        output: A folder for page, recording and tables; None to write nothing.
        force: Whether what is in the folder may be overwritten.

    Returns:
        The analysis, its `remarks` those of the log, of every estimate and of the run together.

    Raises:
        VftError: If the log cannot be read, or is meaningless with this robot.
    """
    from vftcli.evaluation.reference_choice import ReferenceChoice
    from vftcli.observers.choice import ObserverChoice
    from vftcli.outputs.log.run_record import all_remarks

    choice = replace(
        log_choice(log, robot, free, columns, interval),
        observers=ObserverChoice.parsed(observer=words_of(observers, "observers")),
        reference=None if reference is None else ReferenceChoice(name=reference),
    )
    made = answered(log, robot, choice, analyse)
    if output is not None:
        from vftcli.outputs.log.report import write_report

        command = f"vftcli.report({str(log)!r}, robot={made.robot.name!r})"
        write_report(Path(output), made, command=command, force=force)
    remarks = (*made.recording.source.remarks, *all_remarks(made))
    return replace(made, remarks=Remarks(remarks))


def contacts(
    log: Log,
    robot: NamedRobot = None,
    *,
    free: Sequence[str | Path] = (),
    columns: str | None = None,
    interval: str | None = None,
) -> "ContactList":
    """What touched the arm along a log.

    Args:
        log: The log.
        robot: The arm.
        free: Motion that nobody touched: other logs, or spans ``A:B`` of this one. [s]
        columns: Columns of a table, as ``--columns``.
        interval: The span ``A:B`` to use. [s]

    Raises:
        VftError: If the log cannot be read, or is meaningless with this robot.
    """
    choice = log_choice(log, robot, free, columns, interval)
    found = answered(log, robot, choice, list_touches).contacts
    assert found is not None, "a log that tells no contacts raises"
    return found


def thresholds(
    free: Log | Sequence[Log],
    robot: NamedRobot = None,
    *,
    rate: float = 1.0,
    columns: str | None = None,
    interval: str | None = None,
) -> "Thresholds":
    """Thresholds that motion like that of free logs passes at a rate.

    Args:
        free: One log or several that nobody touched.
        robot: The arm.
        rate: False alarms of all joints together; of all axes likewise. [1/h]
        columns: Columns of a table, as ``--columns``.
        interval: The span ``A:B`` to use. [s]

    Raises:
        VftError: If a log cannot be read, is meaningless with this robot, or all are too short.
    """
    from vftcli.contacts.thresholds import compared_signals, find_thresholds

    logs = [free] if isinstance(free, Log) else list(free)
    if not logs:
        raise ParameterError("no log is given; thresholds are learned from motion nobody touches")
    models, runs = Runs(), []
    for log in logs:
        choice = log_choice(log, robot, (), columns, interval)
        runs.append(modelled(*laid(log, robot, choice), choice, models))
    found = find_thresholds([compared_signals(run) for run in runs], rate)
    return replace(found, remarks=(*found.remarks, *(r for run in runs for r in touched(run))))


def log_choice(
    log: Log,
    robot: NamedRobot,
    free: Sequence[str | Path],
    columns: str | None,
    interval: str | None,
) -> AnalysisChoice:
    """What the words of a call ask of a log.

    Raises:
        ParameterError: If they are of another kind than is expected.
    """
    words = {"columns": columns, "interval": interval}
    for key, word in words.items():
        if not isinstance(word, str | None):
            raise ParameterError(f"{key} is {word!r}; expected a text, as interval='0:4'")
    if not isinstance(robot, NamedRobot):
        raise ParameterError(f"robot is {robot!r}; expected a name as 'ur5', a file, or a Robot")
    if not isinstance(log, Log):
        raise ParameterError(f"the log is {log!r}; expected a file's name or a Recording")
    if columns is not None and isinstance(log, Recording):
        raise ParameterError("columns are those of a file; this log is read already")
    name = str(robot) if isinstance(robot, str | Path) else None
    return AnalysisChoice(
        read=ReadChoice.parsed(columns=columns, interval=interval),
        robot=RobotChoice.parsed(robot=name),
        free=FreeChoice.parsed(free=words_of(free, "free")),
        library=Library([] if isinstance(log, Recording) else [log]),
    )


def words_of(words: "Sequence[str | Path] | str | Path", name: str) -> list[str]:
    """Several words, or the one that is given for them.

    Raises:
        ParameterError: If they are no words.
    """
    several = list(words) if isinstance(words, list | tuple) else [words]
    if wrong := [word for word in several if not isinstance(word, str | Path)]:
        raise ParameterError(f"{name} has {wrong[0]!r}; expected texts or paths")
    return [str(word) for word in several]


def laid(log: Log, robot: NamedRobot, choice: AnalysisChoice) -> tuple[Recording, Robot]:
    """A log, read unless it is, and its robot, loaded unless it is, laid on each other."""
    if isinstance(log, Recording):
        recording = choice.read.within(log)
    else:
        if choice.read.columns is None:
            refuse_estimates(Path(log))
        recording = choice.library.open(log, choice.read)
    if isinstance(robot, Robot):
        return choice.examiner.taken(recording, robot, choice.read), robot
    return prepared(recording, choice)


def answered(log: Log, robot: NamedRobot, choice: AnalysisChoice, work: Analyser) -> "Analysis":
    """What is asked of one log."""
    return work(*laid(log, robot, choice), choice, Runs())


def modelled(recording: Recording, robot: Robot, choice: AnalysisChoice, models: Runs) -> Run:
    """A log laid on its robot, examined.

    Raises:
        ExaminationError: If a finding makes every result meaningless.
    """
    run = models.of(recording, robot)
    choice.examiner.examine(run.recording, run.robot)
    return run


def touched(run: Run, *, anyway: bool = False) -> tuple[Remark, ...]:
    """A remark where a log that is to be free shows contact.

    Raises:
        ParameterError: If it shows contact plainly, unless it shall be used `anyway`.
    """
    from vftcli.contacts.tail import SETTLING
    from vftcli.evaluation.references import PLAIN, touches

    known = touches(run) if set(EFFORTS) & set(run.recording.signals) else ()
    found = [touch for touch in known if touch.stop > run.t[0] + SETTLING]
    if not found:
        return ()
    worst = max(found, key=lambda touch: touch.excess)
    where = Where(run.name, (worst.joint + 1,), (worst.start, worst.stop))
    sizes = {"torque_Nm": worst.torque, "quiet_Nm": worst.quiet}
    remark = caution("free-log-touched", where, count=len(found), **sizes)
    if worst.excess > PLAIN and not anyway:
        raise ParameterError(
            f"{remark}. Give motion that nobody touches, a part of this log with --interval, or "
            "take it all with --anyway"
        )
    return (remark,)
