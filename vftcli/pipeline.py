"""The whole way from a log to its numbers, in the order the data flows."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from vftcli.observers import (
    DEFAULT,
    OBSERVERS,
    Observer,
    Setup,
    build_observers,
    observer_settings,
)
from vftcli.readers.library import Library
from vftcli.repetition.choice import FreeChoice
from vftcli.robots import PROFILES, Robot, load_robot
from vftcli.robots.terms import dynamics_terms
from vftcli.signals.errors import ParameterError, RobotError
from vftcli.signals.identity import refuse_repeated_logs
from vftcli.signals.parsing import interval
from vftcli.signals.recording import Recording

if TYPE_CHECKING:
    from vftcli.analysis import Analysis
    from vftcli.refinement.baseline import Baseline
    from vftcli.robots.terms import DynamicsTerms
    from vftcli.signals.external_torque import ExternalTorque
    from vftcli.virtual_sensor.choice import WrenchChoice
    from vftcli.virtual_sensor.detection import ContactScore
    from vftcli.virtual_sensor.frames import Mounting
    from vftcli.virtual_sensor.sensor_reading import FreeRunTorque, SensorReading

FRICTION = ("profile", "none")


@dataclass(frozen=True, kw_only=True)
class AnalysisChoice:
    """What a user asks of one log: the options that estimate, compare and report share.

    Attributes:
        format: Name of the log's format, or None to recognise it.
        columns: Description of a table's columns, or None.
        robot: Profile name, TOML or URDF file, or None to take what the log settles.
        interval: Span of the log to use, ``A:B`` in seconds from its first sample, or None.
        observers: Names of the observers to run.
        settings: ``observer.parameter=VALUE`` assignments.
        friction: "profile" or "none".
        payload: Name of a payload in the robot file, or None.
        as_printed: Use the paper's printed formulas, and its numeric dynamics.
        reference: Name of the reference, or None.
        free: What motion nobody touched, and how the two-cycle difference lays it under the log.
        reference_columns: Column description of a reference file.
        match: ``delay=S`` or ``bandwidth=HZ`` for all observers alike, or None.
        contacts: Whether to judge each observer's contacts by the reference's.
        wrench: What is asked of the virtual force/torque sensor, None for joint torques alone.
        bands: Whether to measure on the free part how far the estimates may be off.
        remove_bias: "none", "free-cycle" or "model".
        gains_file: A file of gains that go before the robot's own, or None.
        library: Where the logs of the command are read, each once.
    """

    format: str | None = None
    columns: str | None = None
    robot: str | None = None
    interval: str | None = None
    observers: tuple[str, ...] = DEFAULT
    settings: tuple[str, ...] = ()
    friction: str = "profile"
    payload: str | None = None
    as_printed: bool = False
    reference: str | None = None
    free: FreeChoice = field(default_factory=FreeChoice)
    reference_columns: str | None = None
    match: str | None = None
    contacts: bool = False
    wrench: "WrenchChoice | None" = None
    bands: bool = False
    remove_bias: str = "none"
    gains_file: Path | None = None
    library: Library = field(default_factory=Library, repr=False, compare=False)

    @property
    def looks_back(self) -> bool:
        """Whether anything is asked that needs the complete log and its free part."""
        tuned = any(name in OBSERVERS and OBSERVERS[name].from_spectra for name in self.observers)
        return tuned or self.bands or self.remove_bias != "none" or self.free.is_asked


def open_log(path: Path, request: AnalysisChoice) -> Recording:
    """Read a log and cut it to the asked interval."""
    read = request.library.read(path, format=request.format, columns=request.columns)
    return cut(read, request)


def open_logs(paths: Sequence[Path], request: AnalysisChoice) -> tuple[Recording, ...]:
    """Read the logs of a command.

    Raises:
        ParameterError: If two of them are the same run.
    """
    logs = tuple(open_log(path, request) for path in paths)
    refuse_repeated_logs(logs)
    return logs


def cut(recording: Recording, request: AnalysisChoice) -> Recording:
    """The part of a log that the request's interval names, or all of it."""
    if request.interval is None:
        return recording
    start, stop = interval(request.interval)
    return recording.between(start, stop)


def choose_robot(request: AnalysisChoice, recording: Recording) -> Robot:
    """Load the robot that is asked for, or the one the log settles.

    Raises:
        RobotError: If none is asked for and the log does not settle it.
    """
    name = request.robot or recording.robot_hint
    if name is None:
        fitting = [p for p in PROFILES if load_robot(p).joints == recording.joints]
        raise RobotError(
            f"{recording.name} does not say which arm it is; choose one with --robot: "
            f"{', '.join(fitting) or ', '.join(PROFILES)}, or a FILE.toml or FILE.urdf of "
            f"{recording.joints} joints"
        )
    robot = load_robot(name)
    if request.friction not in FRICTION:
        raise ParameterError(f"--friction {request.friction!r}; there is {', '.join(FRICTION)}")
    if request.payload is not None:
        robot = robot.with_payload(request.payload)
    return robot.without_friction() if request.friction == "none" else robot


def choose_observers(
    request: AnalysisChoice, robot: Robot, recording: Recording, survey: "Baseline | None" = None
) -> tuple[tuple[Observer, ...], tuple[str, ...]]:
    """Build the observers that are asked for, with notes on gains that nobody gave."""
    setup = Setup(
        gains=chosen_gains(request, robot),
        settings=observer_settings(request.settings),
        joints=robot.joints,
        step=recording.median_step,
        as_printed=request.as_printed,
        spectra=survey.spectra if survey is not None else None,
    )
    observers, notes = build_observers(request.observers, setup)
    if request.match is None:
        return observers, notes
    from vftcli.observers.matching import matched

    observers, remarks = matched(observers, request.match, setup)
    return observers, (*notes, *remarks)


def chosen_gains(request: AnalysisChoice, robot: Robot) -> Mapping[str, Mapping[str, Any]]:
    """The robot's gains, those of a gains file put over them."""
    if request.gains_file is None:
        return robot.gains
    from vftcli.observers import sections
    from vftcli.observers.gains_file import layered, load_gains

    return layered(robot.gains, load_gains(request.gains_file, sections()))


def look_over(
    recording: Recording, robot: Robot, terms: "DynamicsTerms", request: AnalysisChoice
) -> "Baseline | None":
    """The log's free part and spectra, None where nothing asks for them."""
    if not request.looks_back:
        return None
    from vftcli.refinement.baseline import survey, without_free_motion
    from vftcli.refinement.bias import check_removal

    check_removal(request.remove_bias)
    runs = tuple(open_log(path, without_interval(request)) for path in request.free.logs)
    found = survey(recording, robot, terms, request.free, runs)
    if request.remove_bias == "free-cycle":
        return replace(found, spectra=without_free_motion(found))
    return found


def analyse(recording: Recording, robot: Robot, request: AnalysisChoice) -> "Analysis":
    """Go from a recording to estimates and, if a reference is asked for, their errors."""
    from vftcli.analysis import Analysis

    terms = dynamics_terms(recording, robot, literal=request.as_printed)
    survey = look_over(recording, robot, terms, request)
    observers, notes = choose_observers(request, robot, recording, survey)
    estimates = tuple(observer.estimate(terms) for observer in observers)
    workup = None
    if survey is not None:
        from vftcli.refinement.refine import work_up

        removal = request.remove_bias
        estimates, workup = work_up(survey, recording, robot, observers, estimates, removal)
        notes = (*notes, *workup.notes)
    tunings = {o.name: o.tuning(recording.median_step, robot.joints) for o in observers}
    measured, mounting, sensed = sense(recording, robot, estimates, request, terms, observers)
    reference, errors = None, None
    contacts: tuple[ContactScore, ...] = ()
    if request.reference is not None:
        from vftcli.evaluation import evaluate, with_wrenches
        from vftcli.evaluation.reference_choice import (
            ReferenceChoice,
            ReferenceSource,
            make_reference,
        )
        from vftcli.virtual_sensor.frames import NOTHING

        wanted = request.free.logs if request.reference == "two-cycle" else ()
        free = tuple(open_log(path, without_interval(request)) for path in wanted)
        asked = ReferenceChoice(
            name=request.reference,
            columns=request.reference_columns,
        )
        source = ReferenceSource(
            recording=sensed,
            robot=robot,
            free=free,
            free_choice=request.free,
            mounting=mounting or NOTHING,
        )
        judge = make_reference(source, asked)
        reference = judge.torque
        errors = evaluate(recording.name, estimates, reference)
        if measured is not None:
            from vftcli.evaluation.reference_wrench import reference_wrench
            from vftcli.virtual_sensor.sensor_reading import referred

            theirs = reference_wrench(sensed, robot, judge, measured.sensor)
            measured = referred(measured, theirs)
            errors = with_wrenches(errors, recording.name, measured)
        if request.contacts:
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
        notes=(*notes, *printed_note(request)),
    )


def sense(
    recording: Recording,
    robot: Robot,
    estimates: tuple["ExternalTorque", ...],
    request: AnalysisChoice,
    terms: "DynamicsTerms",
    observers: tuple[Observer, ...],
) -> "tuple[SensorReading | None, Mounting | None, Recording]":
    """What the virtual sensor measures, where things sit, and the log with its sensor relieved."""
    if request.wrench is None:
        return None, None, recording
    from vftcli.virtual_sensor.mounting import placed, weighed
    from vftcli.virtual_sensor.sensor_reading import measure
    from vftcli.virtual_sensor.torque_error import Disturbance

    mounting, notes = placed(recording, robot, estimates, request.wrench)
    unloaded = unloaded_run(recording, robot, request, observers)
    free = unloaded.terms if unloaded is not None else None
    raw = Disturbance(terms=terms, observers=observers, free=free)
    measured = measure(recording, robot, estimates, request.wrench, unloaded, mounting, raw)
    if request.wrench.sensor_weight:
        recording, found = weighed(recording, robot.chain, mounting, measured.free)
        notes += found
    return replace(measured, notes=(*notes, *measured.notes)), mounting, recording


def unloaded_run(
    recording: Recording, robot: Robot, request: AnalysisChoice, observers: tuple[Observer, ...]
) -> "FreeRunTorque | None":
    """What the observers read in the free run of ``--zero LOG``, None if none is given.

    Where it is the same trajectory, their torque at the same place of it is taken; else its mean.
    """
    if request.wrench is None or request.wrench.zero.log is None:
        return None
    from vftcli.repetition.alignment import align
    from vftcli.signals.errors import ReferenceTorqueError
    from vftcli.virtual_sensor.sensor_reading import unloaded_from

    free = open_log(request.wrench.zero.log, without_interval(request))
    terms = dynamics_terms(free, robot, literal=request.as_printed)
    estimates = tuple(observer.estimate(terms) for observer in observers)
    shift: float | None = None
    with suppress(ReferenceTorqueError):
        shift = align(recording, free).shift
    read = unloaded_from(free.name, estimates, shift, recording.t)
    return replace(read, terms=terms)


def analyse_log(path: Path, request: AnalysisChoice) -> "Analysis":
    """Read a log, choose its robot, and analyse it."""
    recording = open_log(path, request)
    return analyse(recording, choose_robot(request, recording), request)


def without_interval(request: AnalysisChoice) -> AnalysisChoice:
    """The same request for a free run, which is read whole."""
    return replace(request, interval=None)


def printed_note(request: AnalysisChoice) -> tuple[str, ...]:
    """A note on the printed formulas, if they are used."""
    if not request.as_printed:
        return ()
    return ("as printed: the paper's formulas with their errata (docs/errata.md)",)
