"""From a log to its numbers, in the order of the data; long logs in blocks."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from vftcli.analysis import Analysis
from vftcli.bias import RefinementChoice
from vftcli.doctor.examination import Examiner, stretches
from vftcli.free_motion import FreeChoice
from vftcli.free_motion.free_motion import FreeMotion, FreeRun
from vftcli.observers import ObserverChoice
from vftcli.observers.paper import BlockObserver
from vftcli.observers.table import BEST, OBSERVERS, LogSpectra
from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import Library
from vftcli.readers.references import refuse_estimates
from vftcli.robots import Robot, RobotChoice
from vftcli.robots.run import Run
from vftcli.robots.terms import RunningTerms, check_joints
from vftcli.signals.arrays import clock_of
from vftcli.signals.errors import MissingSignalError, ParameterError, VftError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.option import Asked
from vftcli.signals.progress import stage
from vftcli.signals.recording import Recording, refuse_repeated_logs
from vftcli.signals.remarks import Remark, caution
from vftcli.signals.steady_filter import PIECE

if TYPE_CHECKING:
    from vftcli.bias.baseline import Baselines
    from vftcli.contacts.contact_list import ContactList
    from vftcli.doctor.examination import Examination
    from vftcli.evaluation import ReferenceChoice
    from vftcli.wrench import WrenchChoice
    from vftcli.wrench.detection import ContactInterval

WRITING = 0.7  # share of a log's work before its files are written


@dataclass(frozen=True, kw_only=True)
class AnalysisChoice:
    """Choices that estimate, compare and report share, one a room."""

    #: Reading of the log, and its part.
    read: ReadChoice = field(default_factory=ReadChoice)
    #: Its arm and model.
    robot: RobotChoice = field(default_factory=RobotChoice)
    #: The observers and their gains.
    observers: ObserverChoice = field(default_factory=ObserverChoice)
    #: Motion that nobody touched, and its alignment with the log.
    free: FreeChoice = field(default_factory=FreeChoice)
    #: Corrections by the whole log.
    refinement: RefinementChoice = field(default_factory=RefinementChoice)
    #: The virtual force/torque sensor's, None for joint torques alone.
    wrench: "WrenchChoice | None" = None
    #: The reference, or None.
    reference: "ReferenceChoice | None" = None
    #: Whether to list contacts, if the complete log may be used.
    contacts: bool = True
    #: Called with the contacts of one log before any observer runs; `sense` then makes the
    #: unasked wrench of `best`. None: nobody waits for the first lines.
    answered: "Callable[[Analysis], None] | None" = field(default=None, compare=False)
    #: The logs of the command, each read once.
    library: Library = field(default_factory=Library, repr=False, compare=False)
    #: Examines them, each once, and refuses meaningless results.
    examiner: Examiner = field(default_factory=Examiner, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.observers.causal and self.refinement.corrects_all:
            raise ParameterError(
                "bias.method=whole-log needs the complete log, which --causal leaves out; "
                "give one of them"
            )
        if self.observers.causal and self.wrench is not None and self.wrench.looks_back:
            raise ParameterError(
                "virtual-sensor.solver=smoother needs the complete log, which --causal leaves out; "
                "give another solver, as pinv"
            )

    @property
    def looks_back(self) -> bool:
        """Whether anything needs the complete log and its free part."""
        asked = self.free.is_given or self.free.period is not None
        return asked or self.refinement.corrects_all or self.observers.from_spectra

    @property
    def is_plain(self) -> bool:
        """Whether no option can be refused once the contacts are known."""
        return self.wrench is None and self.observers.of_robot_file

    @property
    def lists_contacts(self) -> bool:
        """Whether contacts are listed, from the complete log."""
        return self.contacts and not self.observers.causal


def choice_of(
    asked: Asked, library: Library, examiner: Examiner, observers: ObserverChoice | None = None
) -> AnalysisChoice:
    """The choice of a command or a call, with `observers` if given."""
    from vftcli.evaluation import ReferenceChoice
    from vftcli.wrench import WrenchChoice

    wrench = asked.words.get("wrench") or asked.states(WrenchChoice)
    reference, refinement = None, asked.of(RefinementChoice)
    if asked.words.get("reference") is not None:
        reference = replace(asked.of(ReferenceChoice), contacts=bool(asked.words.get("details")))
    return AnalysisChoice(
        read=asked.of(ReadChoice),
        robot=asked.of(RobotChoice),
        observers=observers or asked.of(ObserverChoice),
        free=asked.of(FreeChoice),
        refinement=refinement,
        wrench=asked.of(WrenchChoice) if wrench else None,
        reference=reference,
        contacts=refinement.contacts,
        library=library,
        examiner=examiner,
    )


def for_estimates(choice: AnalysisChoice) -> AnalysisChoice:
    """A choice for estimates: contacts are listed if `best` runs."""
    return replace(choice, contacts=choice.contacts and BEST in choice.observers.names)


def for_comparison(choice: AnalysisChoice) -> AnalysisChoice:
    """A choice for errors: contacts for a wrench or a score."""
    judged = choice.reference is not None and choice.reference.contacts
    return replace(choice, contacts=choice.contacts and (choice.wrench is not None or judged))


def list_touches(log: Run, choice: AnalysisChoice) -> Analysis:
    """The contacts along a log, without any observer."""
    from vftcli.contacts.listing import list_contacts

    motion = read(log, choice)
    examinations = examine(motion, choice)
    stage(f"{log.name}: listing contacts", 0.3, 1.0)
    found = list_contacts(motion).weighed(examinations[0].load, examinations[0].doubts)
    return listed_alone(motion, examinations, found)


def touches(log: Run, choice: AnalysisChoice) -> "ContactList | None":
    """The contacts along a log, None where none can be listed."""
    try:
        return list_touches(log, choice).contacts
    except VftError:
        return None


def listed_alone(
    motion: FreeMotion, examinations: "tuple[Examination, ...]", found: "ContactList"
) -> Analysis:
    """The contacts of a log, before any observer."""
    none = Analysis(motion=motion, observers=(), estimates=(), tunings={})
    return replace(none, contacts=found, examinations=examinations)


def prepared(recording: Recording, choice: AnalysisChoice) -> Run:
    """A log with its robot; the model names its effort if asked."""
    robot = choice.examiner.robot(recording, choice.robot)
    if choice.observers.causal:
        check_logged(recording, "--causal leaves out what looks ahead")
    return run_of(choice.examiner.read_as(recording, robot, choice.read), robot, choice)


def run_of(recording: Recording, robot: Robot, choice: AnalysisChoice) -> Run:
    """A log with a robot, as the chosen observers have it; made once."""
    check_joints(recording, robot)
    run = Run(recording=recording, robot=robot, literal=choice.observers.as_printed)
    return choice.examiner.runs.setdefault((id(recording), id(robot), run.literal), run)


def check_logged(recording: Recording, why: str) -> None:
    """Raise if a signal was derived from the complete log."""
    if recording.source.derived:
        raise MissingSignalError(
            f"{recording.name}: joint velocities (dq) that are derived from positions need the "
            f"complete log; {why}. Record the velocities"
        )


def analyse(log: Run, choice: AnalysisChoice) -> Analysis:
    """Estimates of a log, and their errors if asked for."""
    name = log.name
    stage(f"{name}: examining", 0.05, 0.15)
    motion = read(log, choice)
    examinations = examine(motion, choice)
    stage(f"{name}: looking for free motion", 0.15, 0.25)
    baselines = model(motion, choice)
    # Before the estimates: both of a long log do not fit at once.
    contacts, unlisted = find_contacts(motion, baselines, examinations, choice)
    stage(f"{name}: running observers", 0.4, 0.5)
    analysis = refine(observe(motion, baselines, choice), baselines, choice)
    remarks = (*analysis.remarks, *unlisted)
    analysis = replace(analysis, contacts=contacts, examinations=examinations, remarks=remarks)
    analysis = sense(analysis, choice, unasked=choice.answered is None)
    stage(f"{name}: comparing", 0.5, WRITING)
    analysis.spare()
    return judge(analysis, choice)


#: The work on each log of a command.
Analyser = Callable[[Run, AnalysisChoice], Analysis]
#: Called with a log that cannot be analysed, and why.
Failed = Callable[[Any, VftError], None]


def analyse_logs(
    logs: Iterable[Path | Recording],
    choice: AnalysisChoice,
    failed: Failed | None = None,
    work: Analyser = analyse,
) -> Iterator[Analysis]:
    """Analyses of a command's logs, one after the other; common parts are made once.

    A log that cannot be analysed goes to `failed` if given, else raises a VftError.
    """
    recordings: list[tuple[Path | Recording, Recording]] = []
    for path in logs:
        stage(f"reading {path.name}", 0.0, 0.05)
        try:
            if choice.read.columns is None and isinstance(path, Path):
                refuse_estimates(path)
            recordings += [(path, r) for r in choice.library.open_each([path], choice.read)]
        except VftError as error:
            if failed is None:
                raise
            failed(path, error)
    refuse_repeated_logs([recording for _, recording in recordings])
    if len(recordings) > 1:  # the first lines of one say nothing of all
        choice = replace(choice, answered=None)
    for path, recording in recordings:
        try:
            made = work(prepared(recording, choice), choice)
        except VftError as error:
            if failed is None:
                raise
            failed(path, error)
        else:
            yield made


def read(log: Run, choice: AnalysisChoice) -> FreeMotion:
    """Read the log's free runs, each once."""
    runs = []
    for path in choice.free.logs:
        free = choice.library.open(path, choice.read.whole)
        free = choice.examiner.read_as(free, log.robot, choice.read)
        runs.append(FreeRun(run=run_of(free, log.robot, choice), log=log))
    return FreeMotion(log=log, choice=choice.free, runs=tuple(runs))


def examine(motion: FreeMotion, choice: AnalysisChoice) -> tuple["Examination", ...]:
    """Examinations of the log, then of its free runs."""
    runs = [motion.log, *(free.run for free in motion.runs)]
    found = [choice.examiner.examine(run.recording, run.robot) for run in runs]
    motion.log.recording.release()  # much of it is only examined
    return tuple(dict.fromkeys(found))


def model(motion: FreeMotion, choice: AnalysisChoice) -> "Baselines | None":
    """The log's free part, spectra and bias, None if not needed."""
    if not choice.looks_back:
        return None
    from vftcli.bias.baseline import find_baselines

    return find_baselines(motion, choice.refinement, best=BEST in choice.observers.names)


def observe(
    motion: FreeMotion,
    baselines: "Baselines | None",
    choice: AnalysisChoice,
    *,
    running: bool = True,
) -> Analysis:
    """Run the observers along the log, or only build them for it."""
    log, run, step = motion.log, choice.observers.run, motion.log.recording.median_step
    own = choice.observers.gains_of_log
    shown = LogSpectra() if baselines is None else baselines.spectra(gains=own)
    observers, remarks = choice.observers.build(log.robot, step, shown)
    printed = (caution("as-printed"),) if choice.observers.as_printed else ()
    ran = observers if running else ()
    runs = [log if baselines is None else baselines.of(o.name).of(log) for o in ran]
    estimates = tuple(run(o, given.terms) for o, given in zip(ran, runs, strict=True))
    for given in runs:
        given.spare()
    return Analysis(
        motion=motion,
        observers=observers,
        estimates=estimates,
        tunings={o.name: o.tuning(step, log.robot.joints) for o in observers},
        of_robot_file=choice.observers.of_robot_file,
        remarks=(*remarks, *printed),
    )


def refine(analysis: Analysis, baselines: "Baselines | None", choice: AnalysisChoice) -> Analysis:
    """The estimates with the complete log's bands."""
    if baselines is None:
        return analysis
    from vftcli.bias import refine as room

    bias = choice.refinement.bias
    made = room.refine(baselines, analysis.observers, analysis.estimates, bias)
    remarks = (*analysis.remarks, *made.remarks)
    return replace(analysis, estimates=made.estimates, refinement=made, remarks=remarks)


def find_contacts(
    motion: FreeMotion,
    baselines: "Baselines | None",
    examinations: "tuple[Examination, ...]",
    choice: AnalysisChoice,
) -> "tuple[ContactList | None, tuple[Remark, ...]]":
    """The contacts, if asked for; None and the reason if unknown."""
    if not choice.lists_contacts:
        return None, ()
    from vftcli.contacts.listing import list_contacts

    stage(f"{motion.log.name}: listing contacts", 0.25, 0.4)
    try:
        bias = None if baselines is None else baselines.best.correction
        referenced = choice.reference is not None
        found = list_contacts(unloaded_motion(motion, choice), bias, referenced=referenced)
    except VftError as error:
        return None, (caution("contacts-not-listed", reason=str(error)),)
    found = found.weighed(examinations[0].load, examinations[0].doubts)
    if choice.answered is not None:
        choice.answered(listed_alone(motion, examinations, found))
    return found, ()


def unloaded_motion(motion: FreeMotion, choice: AnalysisChoice) -> FreeMotion:
    """The log with its free motion, or its unloaded spans."""
    return motion if choice.wrench is None else motion.unloaded(choice.wrench.zero.spans)


def sense(analysis: Analysis, choice: AnalysisChoice, *, unasked: bool = True) -> Analysis:
    """The analysis with wrenches: as asked, or `unasked` of `best`."""
    if analysis.virtual_sensor is not None or (choice.wrench is None and not unasked):
        return analysis
    asked, names = choice.wrench, tuple(o.name for o in analysis.observers)
    if asked is None:
        if analysis.contacts is None or BEST not in names or analysis.robot.joints < 6:
            return analysis
        names = (BEST,)
    from vftcli.wrench import WrenchChoice, sensing

    listed, gate = analysis.contacts, None
    # Outside the contacts nothing touches, unless the whole log may be one.
    if listed is not None and listed.tells_untouched and not (asked and asked.looks_back):
        prior = listed.model.prior and listed.model.prior.looser
        gate = sensing.Gate([(contact.start, contact.stop) for contact in listed.contacts], prior)
    observers = [o for o in analysis.observers if o.name in names]
    estimates = [e for e in analysis.estimates if e.name in names]
    found = sensing.sense(
        analysis.motion,
        observers,
        estimates,
        asked or WrenchChoice(),
        analysis.free_log(),
        {name: analysis.free_log(name) for name in names},
        gate,
    )
    analysis.spare()
    return replace(analysis, virtual_sensor=found)


def listed_contacts(analysis: Analysis) -> "list[ContactInterval] | None":
    """When the listed contacts are, None without a list."""
    from vftcli.wrench.detection import ContactInterval

    if analysis.contacts is None:
        return None
    return [ContactInterval(c.start, c.stop) for c in analysis.contacts.contacts]


def judge(analysis: Analysis, choice: AnalysisChoice) -> Analysis:
    """The analysis with errors against a reference, if any."""
    if choice.reference is None:
        return analysis
    from vftcli.evaluation import references

    sensed = analysis.virtual_sensor if choice.wrench is not None else None
    listed = listed_contacts(analysis) if choice.reference.contacts else None
    reference, errors, sensed = references.judge(
        analysis.motion, analysis.estimates, sensed, choice.reference, listed
    )
    if choice.reference.name == "zero" and (found := touches(analysis.motion.log, choice)):
        reference = replace(reference, remarks=(*reference.remarks, *found.not_free(analysis.t)))
    analysis = replace(analysis, reference=reference, errors=errors)
    if sensed is not None:
        analysis = replace(analysis, virtual_sensor=sensed)
    return analysis


#: Longer logs are analysed in blocks, to bound memory. [samples]
WHOLE_ROWS = 100_000


def comes_in_blocks(recording: Recording, choice: AnalysisChoice) -> bool:
    """Whether a log is long and nothing needs all of it at once."""
    if recording.samples <= WHOLE_ROWS or recording.dq is None or recording.source.derived:
        return False
    if choice.looks_back or choice.lists_contacts or choice.reference is not None:
        return False
    names, wrench = choice.observers.names, choice.wrench
    if wrench is not None:
        asked = (wrench.torque_sd, wrench.sensor_pose, wrench.zero.start, *wrench.zero.spans)
        if any(map(wrench.smooths, names)) or any(asked):
            return False
    return all(OBSERVERS[name].online for name in names)


def analysed_in_blocks(
    recording: Recording, choice: AnalysisChoice
) -> Iterator[tuple[Analysis, slice | None]]:
    """The analyses of a log's blocks, in order; the log's last, with None for rows.

    The last holds the estimates of the last block alone. The log is examined in stretches;
    its clock, its numbers and impossible samples are checked in all of it.
    """
    robot = choice.examiner.robot(stretches(recording), choice.robot)
    log = choice.examiner.read_as(recording, robot, choice.read, in_stretches=True)
    examined = choice.examiner.examine(log, robot, in_stretches=True)
    whole, part = (read(run_of(x, robot, choice), choice) for x in (log, stretches(log)))
    made = observe(whole, None, choice, running=False)
    sensed = sense(replace(made, motion=part), choice).virtual_sensor
    made = replace(made, examinations=(examined,))
    terms = RunningTerms(robot, clock_of(log.t), literal=choice.observers.as_printed)
    states: dict[str, Any] = {}
    estimates: list[ExternalTorque] = []
    masked, least, done = list[np.ndarray](), np.inf, 0
    for block in log.blocks(PIECE):
        of_block, estimates = terms.next(block), []
        for observer in made.observers:
            assert isinstance(observer, BlockObserver)
            estimate, states[observer.name] = observer.run(of_block, states.get(observer.name))
            estimates.append(estimate)
        if sensed is not None:
            wrenches = sensed.sensor.wrenches(estimates, block.q, robot.chain)
            sensed = replace(sensed, wrenches=wrenches)
            masked.append(wrenches[0].hidden)
            if wrenches[0].sigma_min is not None:
                least = min(least, np.min(wrenches[0].sigma_min))
        done += block.samples
        stage("estimating", done / log.samples)
        motion = replace(whole, log=Run(recording=block, robot=robot))
        own = replace(made, motion=motion, estimates=tuple(estimates), virtual_sensor=sensed)
        yield own, slice(None)
    if sensed is not None:
        from vftcli.wrench.sensing import mask_remark

        hidden = np.concatenate(masked)
        more = (*mask_remark(hidden, np.array([least])), caution("no-wrench-band"))
        sensed = replace(sensed, wrenches=(), masked=hidden, remarks=(*sensed.remarks, *more))
    yield replace(made, estimates=tuple(estimates), virtual_sensor=sensed), None
