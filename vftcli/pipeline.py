"""The whole way from a log to its numbers, in the order the data flows."""

from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from vftcli.observers import Observer
from vftcli.observers.choice import ObserverChoice
from vftcli.readers.library import Library
from vftcli.readers.reader import ReadChoice
from vftcli.refinement.choice import RefinementChoice
from vftcli.repetition.choice import FreeChoice
from vftcli.robots import Robot
from vftcli.robots.choice import RobotChoice
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.recording import Recording

if TYPE_CHECKING:
    from vftcli.analysis import Analysis
    from vftcli.evaluation.reference_choice import ReferenceChoice
    from vftcli.refinement.baseline import Baseline
    from vftcli.robots.terms import DynamicsTerms
    from vftcli.signals.external_torque import ExternalTorque
    from vftcli.virtual_sensor.choice import WrenchChoice
    from vftcli.virtual_sensor.detection import ContactScore
    from vftcli.virtual_sensor.frames import Mounting
    from vftcli.virtual_sensor.sensor_reading import FreeRunTorque, SensorReading


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
        library: Where the logs of the command are read, each once.
    """

    read: ReadChoice = field(default_factory=ReadChoice)
    robot: RobotChoice = field(default_factory=RobotChoice)
    observers: ObserverChoice = field(default_factory=ObserverChoice)
    free: FreeChoice = field(default_factory=FreeChoice)
    refinement: RefinementChoice = field(default_factory=RefinementChoice)
    wrench: "WrenchChoice | None" = None
    reference: "ReferenceChoice | None" = None
    library: Library = field(default_factory=Library, repr=False, compare=False)

    @property
    def looks_back(self) -> bool:
        """Whether anything is asked that needs the complete log and its free part."""
        asked = self.refinement.looks_back or self.free.is_asked
        return asked or self.observers.from_spectra


def look_over(
    recording: Recording, robot: Robot, terms: "DynamicsTerms", choice: AnalysisChoice
) -> "Baseline | None":
    """The log's free part and spectra, None where nothing asks for them."""
    if not choice.looks_back:
        return None
    from vftcli.refinement.baseline import survey, without_free_motion

    runs = tuple(choice.library.open(path, choice.read.whole) for path in choice.free.logs)
    found = survey(recording, robot, terms, choice.free, runs)
    if choice.refinement.remove_bias == "free-cycle":
        return replace(found, spectra=without_free_motion(found))
    return found


def analyse(recording: Recording, robot: Robot, choice: AnalysisChoice) -> "Analysis":
    """Go from a recording to estimates and, if a reference is asked for, their errors."""
    from vftcli.analysis import Analysis

    terms = dynamics_terms(recording, robot, literal=choice.observers.as_printed)
    survey = look_over(recording, robot, terms, choice)
    spectra = survey.spectra if survey is not None else None
    observers, notes = choice.observers.build(robot, recording.median_step, spectra)
    estimates = tuple(observer.estimate(terms) for observer in observers)
    workup = None
    if survey is not None:
        from vftcli.refinement.refine import work_up

        removal = choice.refinement.remove_bias
        estimates, workup = work_up(survey, recording, robot, observers, estimates, removal)
        notes = (*notes, *workup.notes)
    tunings = {o.name: o.tuning(recording.median_step, robot.joints) for o in observers}
    measured, mounting, sensed = sense(recording, robot, estimates, choice, terms, observers)
    reference, errors = None, None
    contacts: tuple[ContactScore, ...] = ()
    if choice.reference is not None:
        from vftcli.evaluation import evaluate, with_wrenches
        from vftcli.evaluation.reference_choice import ReferenceSource, make_reference
        from vftcli.virtual_sensor.frames import NOTHING

        wanted = choice.free.logs if choice.reference.name == "two-cycle" else ()
        free = tuple(choice.library.open(path, choice.read.whole) for path in wanted)
        source = ReferenceSource(
            recording=sensed,
            robot=robot,
            free=free,
            free_choice=choice.free,
            mounting=mounting or NOTHING,
        )
        judge = make_reference(source, choice.reference)
        reference = judge.torque
        errors = evaluate(recording.name, estimates, reference)
        if measured is not None:
            from vftcli.evaluation.reference_wrench import reference_wrench
            from vftcli.virtual_sensor.sensor_reading import referred

            theirs = reference_wrench(sensed, robot, judge, measured.sensor)
            measured = referred(measured, theirs)
            errors = with_wrenches(errors, recording.name, measured)
        if choice.reference.contacts:
            from vftcli.evaluation import with_contacts
            from vftcli.virtual_sensor.detection import judge_contacts

            contacts = judge_contacts(estimates, measured, reference)
            errors = with_contacts(errors, recording.name, reference.name, contacts)
    return Analysis(
        recording=recording,
        robot=robot,
        terms=terms,
        observers=observers,
        estimates=estimates,
        tunings=tunings,
        reference=reference,
        errors=errors,
        virtual_sensor=measured,
        contacts=contacts,
        workup=workup,
        notes=(*notes, *printed_note(choice)),
    )


def sense(
    recording: Recording,
    robot: Robot,
    estimates: tuple["ExternalTorque", ...],
    choice: AnalysisChoice,
    terms: "DynamicsTerms",
    observers: tuple[Observer, ...],
) -> "tuple[SensorReading | None, Mounting | None, Recording]":
    """What the virtual sensor measures, where things sit, and the log with its sensor relieved."""
    if choice.wrench is None:
        return None, None, recording
    from vftcli.virtual_sensor.mounting import find_mounting, without_tool_weight
    from vftcli.virtual_sensor.sensor_reading import measure
    from vftcli.virtual_sensor.torque_error import Disturbance

    mounting, notes = find_mounting(recording, robot, estimates, choice.wrench)
    unloaded = unloaded_run(recording, robot, choice, observers)
    free = unloaded.terms if unloaded is not None else None
    raw = Disturbance(terms=terms, observers=observers, free=free)
    measured = measure(recording, robot, estimates, choice.wrench, unloaded, mounting, raw)
    if choice.wrench.sensor_weight:
        recording, found = without_tool_weight(recording, robot.chain, mounting, measured.free)
        notes += found
    return replace(measured, notes=(*map(str, notes), *measured.notes)), mounting, recording


def unloaded_run(
    recording: Recording, robot: Robot, choice: AnalysisChoice, observers: tuple[Observer, ...]
) -> "FreeRunTorque | None":
    """What the observers read in the free run of ``--zero LOG``, None if none is given.

    Where it is the same trajectory, their torque at the same place of it is taken; else its mean.
    """
    if choice.wrench is None or choice.wrench.zero.log is None:
        return None
    from vftcli.repetition.alignment import align
    from vftcli.signals.errors import ReferenceTorqueError
    from vftcli.virtual_sensor.sensor_reading import unloaded_from

    free = choice.library.open(choice.wrench.zero.log, choice.read.whole)
    terms = dynamics_terms(free, robot, literal=choice.observers.as_printed)
    estimates = tuple(observer.estimate(terms) for observer in observers)
    shift: float | None = None
    with suppress(ReferenceTorqueError):
        shift = align(recording, free).shift
    read = unloaded_from(free.name, estimates, shift, recording.t)
    return replace(read, terms=terms)


def analyse_log(path: Path, choice: AnalysisChoice) -> "Analysis":
    """Read a log, choose its robot, and analyse it."""
    recording = choice.library.open(path, choice.read)
    return analyse(recording, choice.robot.load(recording), choice)


def printed_note(choice: AnalysisChoice) -> tuple[str, ...]:
    """A note on the printed formulas, if they are used."""
    if not choice.observers.as_printed:
        return ()
    return ("as printed: the paper's formulas with their errata (docs/errata.md)",)
