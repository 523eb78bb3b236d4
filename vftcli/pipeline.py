"""The whole way from a log to its numbers, in the order the data flows."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vftcli.doctor.examiner import Examiner
from vftcli.observers.choice import ObserverChoice
from vftcli.observers.table import BEST, NOT_SHOWN
from vftcli.readers.library import Library
from vftcli.readers.reader import ReadChoice
from vftcli.refinement.choice import RefinementChoice
from vftcli.repetition.choice import FreeChoice
from vftcli.repetition.free_motion import FreeMotion
from vftcli.repetition.free_run import FreeRun, Models
from vftcli.robots import Robot
from vftcli.robots.choice import RobotChoice
from vftcli.signals.errors import ParameterError, VftError
from vftcli.signals.recording import Recording

if TYPE_CHECKING:
    from vftcli.analysis import Analysis
    from vftcli.contacts.contact_list import ContactList
    from vftcli.doctor.examination import Examination
    from vftcli.evaluation.reference_choice import ReferenceChoice
    from vftcli.refinement.baseline import Baseline
    from vftcli.virtual_sensor.choice import WrenchChoice
    from vftcli.virtual_sensor.detection import ToldContacts
    from vftcli.virtual_sensor.smoother.observer_wrench import Gate


@dataclass(frozen=True, kw_only=True)
class AnalysisChoice:
    """What a user asks of one log, as estimate, compare and report share it: a choice a room.

    Attributes:
        read: How the log is read, and which part of it is used.
        robot: Which arm made it, and how it is modelled.
        observers: Which observers run, and with which gains.
        free: What motion nobody touched, and how the two-cycle difference lays it under the log.
        refinement: What is done with the estimates once the whole log is known.
        wrench: What is asked of the virtual force/torque sensor, None for joint torques alone.
        reference: What the estimates are compared with, or None.
        contacts: Whether what touched the arm is listed, where the complete log may be used.
        library: Where the logs of the command are read, each once.
        examiner: Who examines them, each once, and says whether results mean anything.
    """

    read: ReadChoice = field(default_factory=ReadChoice)
    robot: RobotChoice = field(default_factory=RobotChoice)
    observers: ObserverChoice = field(default_factory=ObserverChoice)
    free: FreeChoice = field(default_factory=FreeChoice)
    refinement: RefinementChoice = field(default_factory=RefinementChoice)
    wrench: "WrenchChoice | None" = None
    reference: "ReferenceChoice | None" = None
    contacts: bool = True
    library: Library = field(default_factory=Library, repr=False, compare=False)
    examiner: Examiner = field(default_factory=Examiner, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.zero_log is not None and self.refinement.removes_bias:
            raise ParameterError(
                "--zero LOG and --remove-bias each take off what the observers read untouched, "
                "together they would take it off twice; give one of them"
            )
        if self.observers.causal and self.refinement.corrects_all:
            raise ParameterError(
                "--remove-bias whole-log needs the complete log, which --causal leaves out; "
                "give one of them"
            )
        if self.observers.causal and self.wrench is not None and self.wrench.looks_back:
            raise ParameterError(
                "--solver smoother needs the complete log, which --causal leaves out; "
                "give another solver, as pinv"
            )

    @property
    def zero_log(self) -> Path | None:
        """The free run whose torque is the zero of the wrench, None without one."""
        return self.wrench.zero.log if self.wrench is not None else None

    @property
    def looks_back(self) -> bool:
        """Whether anything is asked that needs the complete log and its free part."""
        asked = self.refinement.looks_back or self.free.is_asked
        return asked or self.observers.from_spectra

    @property
    def lists_contacts(self) -> bool:
        """Whether what touched the arm is listed: that needs the complete log."""
        return self.contacts and not self.observers.causal


def analyse_logs(logs: Iterable[Path], choice: AnalysisChoice) -> Iterator["Analysis"]:
    """Analyse the logs of a command one after the other; what they share is made once.

    Raises:
        ParameterError: If two of them are the same run.
    """
    models = Models()
    for recording in choice.library.open_logs(list(logs), choice.read):
        yield analyse(*prepared(recording, choice), choice, models)


def contact_lists(logs: Iterable[Path], choice: AnalysisChoice) -> Iterator["ContactList"]:
    """What touched the arm along each log, without any observer's estimate.

    Raises:
        VftError: If a log cannot be read, is meaningless with this robot, or named twice.
    """
    from vftcli.contacts.listing import list_contacts

    models = Models()
    for recording in choice.library.open_logs(list(logs), choice.read):
        motion = read(*prepared(recording, choice), choice, models)
        examine(motion, choice)
        yield list_contacts(motion)


def prepared(recording: Recording, choice: AnalysisChoice) -> tuple[Recording, Robot]:
    """A log with its robot, its effort taken for what it is where the robot's model shall say.

    Raises:
        RobotError: If no robot is chosen and the log does not settle it.
    """
    robot = choice.examiner.robot(recording, choice.robot)
    return choice.examiner.taken(recording, robot, choice.read), robot


def analyse_log(path: Path, choice: AnalysisChoice) -> "Analysis":
    """Read a log, choose its robot, and analyse it."""
    return next(analyse_logs([path], choice))


def analyse(
    recording: Recording, robot: Robot, choice: AnalysisChoice, models: Models | None = None
) -> "Analysis":
    """Go from a recording to estimates and, if a reference is asked for, their errors.

    Args:
        recording: The log.
        robot: The arm, its payload mounted.
        choice: What is asked of it.
        models: What the command has modelled so far, for several logs that share a free run.
    """
    motion = read(recording, robot, choice, models or Models())
    examinations = examine(motion, choice)
    baseline = model(motion, choice)
    analysis = replace(observe(motion, baseline, choice), examinations=examinations)
    analysis = refine(analysis, baseline, choice)
    analysis = find_contacts(analysis, choice)
    analysis = sense(analysis, choice)
    return judge(analysis, choice)


def read(recording: Recording, robot: Robot, choice: AnalysisChoice, models: Models) -> FreeMotion:
    """Read the log's free runs, each once."""
    literal = choice.observers.as_printed
    log = models.of(recording, robot, literal=literal)
    runs: dict[Path | None, FreeRun] = {}
    # One file may be the free run of several options.
    for path in {*choice.free.logs, choice.zero_log}:
        if path is not None:
            free = choice.library.open(path, choice.read.whole)
            free = choice.examiner.taken(free, robot, choice.read)
            runs[path] = FreeRun(run=models.of(free, robot, literal=literal), log=log)
    given = tuple(runs[path] for path in choice.free.logs)
    return FreeMotion(log=log, choice=choice.free, runs=given, zero=runs.get(choice.zero_log))


def examine(motion: FreeMotion, choice: AnalysisChoice) -> tuple["Examination", ...]:
    """Examine the log, then its free runs.

    Raises:
        ExaminationError: If a finding makes every result meaningless.
    """
    runs = [motion.log, *(free.run for free in (*motion.runs, motion.zero) if free is not None)]
    found = (choice.examiner.examine(run.recording, run.robot) for run in runs)
    return tuple(dict.fromkeys(found))


def model(motion: FreeMotion, choice: AnalysisChoice) -> "Baseline | None":
    """The log's free part, spectra and bias, None where nothing asks for them."""
    if not choice.looks_back:
        return None
    from vftcli.refinement.correction import baseline_for

    return baseline_for(motion, choice.refinement, best=BEST in choice.observers.names)


def observe(motion: FreeMotion, baseline: "Baseline | None", choice: AnalysisChoice) -> "Analysis":
    """Run the observers along the log."""
    from vftcli.analysis import Analysis, terms_of
    from vftcli.signals.remarks import caution

    log, step = motion.log, motion.log.recording.median_step
    shown = NOT_SHOWN
    if baseline is not None:
        shown = baseline.shown(gains=choice.observers.gains_of_log)
    observers, remarks = choice.observers.build(log.robot, step, shown)
    printed = (caution("as-printed"),) if choice.observers.as_printed else ()
    return Analysis(
        motion=motion,
        observers=observers,
        estimates=tuple(o.estimate(terms_of(baseline, o.name, log)) for o in observers),
        tunings={o.name: o.tuning(step, log.robot.joints) for o in observers},
        remarks=(*remarks, *printed),
    )


def refine(analysis: "Analysis", baseline: "Baseline | None", choice: AnalysisChoice) -> "Analysis":
    """Give the estimates what only the complete log allows: bands, and bias removal."""
    if baseline is None:
        return analysis
    from vftcli.refinement import refine as room

    bias, of_file = choice.refinement.remove_bias, choice.observers.of_robot_file
    made = room.refine(
        baseline, analysis.observers, analysis.estimates, bias, gains_of_file=of_file
    )
    remarks = (*analysis.remarks, *made.remarks)
    return replace(analysis, estimates=made.estimates, refinement=made, remarks=remarks)


def find_contacts(analysis: "Analysis", choice: AnalysisChoice) -> "Analysis":
    """List what touched the arm, where that is wanted; a log that tells none says why."""
    if not choice.lists_contacts:
        return analysis
    from vftcli.contacts.listing import list_contacts
    from vftcli.signals.remarks import caution

    try:
        return replace(analysis, contacts=list_contacts(unloaded_motion(analysis.motion, choice)))
    except VftError as error:
        reason = caution("contacts-not-told", reason=str(error))
        return replace(analysis, remarks=(*analysis.remarks, reason))


def unloaded_motion(motion: FreeMotion, choice: AnalysisChoice) -> FreeMotion:
    """The log with what is free of contact: where that is not said, what is said to be unloaded."""
    if motion.choice.is_given or choice.wrench is None:
        return motion
    spans, zero = choice.wrench.zero.spans, motion.zero
    if spans:
        return replace(motion, choice=replace(motion.choice, spans=spans))
    return motion if zero is None else replace(motion, runs=(zero,))


def sense(analysis: "Analysis", choice: AnalysisChoice) -> "Analysis":
    """Turn the estimates into wrenches: those asked for, and that of `best` beside its contacts."""
    asked, names = choice.wrench, tuple(o.name for o in analysis.observers)
    if asked is None:
        if analysis.contacts is None or BEST not in names or analysis.robot.joints < 6:
            return analysis
        names = (BEST,)
    from vftcli.virtual_sensor import sensing
    from vftcli.virtual_sensor.choice import WrenchChoice

    observers = [o for o in analysis.observers if o.name in names]
    estimates = [e for e in analysis.estimates if e.name in names]
    found = sensing.sense(
        analysis.motion,
        observers,
        estimates,
        asked or WrenchChoice(),
        analysis.terms_of,
        analysis.smoother_input,
        gate_of(analysis, asked),
    )
    return replace(analysis, virtual_sensor=found)


def gate_of(analysis: "Analysis", asked: "WrenchChoice | None") -> "Gate | None":
    """The contacts, outside of which nothing touches; None where the whole log may be one.

    That is so under a load, where no free motion tells what is no contact, and where the user asks
    for the smoother by its name.
    """
    found = analysis.contacts
    if found is None or not found.tells_untouched or (asked is not None and asked.looks_back):
        return None
    return [(contact.start, contact.stop) for contact in found.contacts]


def told_contacts(analysis: "Analysis", choice: AnalysisChoice) -> "ToldContacts":
    """What is known of the log's contacts: its list, and where nothing touches the arm."""
    from vftcli.contacts.untouched import free_part
    from vftcli.virtual_sensor.detection import ToldContacts, read_in_free_runs

    motion = unloaded_motion(analysis.motion, choice)
    part, rows = free_part(motion), analysis.contacts
    listed = {} if rows is None else {BEST: rows.contacts}
    if part is None:
        return ToldContacts(untouched=np.zeros(motion.log.recording.samples, bool), listed=listed)
    sensed = analysis.virtual_sensor if choice.wrench is not None else None
    others = [] if part.own.any() else [p for p in part.pieces if p.run is not motion.log]
    own = [o for o in analysis.observers if o.name not in listed]
    sensor = None if sensed is None else sensed.sensor
    beside = read_in_free_runs(others, own, analysis.terms_of, sensor)
    return ToldContacts(untouched=part.own, beside=beside, listed=listed)


def judge(analysis: "Analysis", choice: AnalysisChoice) -> "Analysis":
    """Compare the estimates with a reference, where one is asked for."""
    if choice.reference is None:
        return analysis
    from vftcli.evaluation import judgement

    sensed = analysis.virtual_sensor if choice.wrench is not None else None
    told = told_contacts(analysis, choice) if choice.reference.contacts else None
    found = judgement.judge(analysis.motion, analysis.estimates, sensed, choice.reference, told)
    if sensed is None:
        found = found._replace(virtual_sensor=analysis.virtual_sensor)
    remarks = analysis.remarks
    if choice.observers.of_robot_file:
        remarks = judgement.with_measured_gap(remarks, found.errors, analysis.tunings)
    return replace(analysis, **found._asdict(), remarks=remarks)
