"""The examination of a log: findings, fit to its arm, and refusals."""

from collections.abc import Callable, Iterable, Set
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

from vftcli.doctor.causes import CORRECTIONS
from vftcli.doctor.cuts import cut_findings, without_bad_samples
from vftcli.doctor.fit import RobotMatch, arm_findings, guess_robot
from vftcli.doctor.lateness import LAGLESS, effort_lag
from vftcli.doctor.load import temperature_findings
from vftcli.doctor.signals import efforts_of, signal_findings, stuck_findings, unusable_findings
from vftcli.doctor.velocity import clock_findings, velocity_findings, velocity_fit
from vftcli.doctor.windows import spread
from vftcli.readers.reader import ReadChoice
from vftcli.robots import RobotChoice, choices_for, load_robot
from vftcli.robots.robot import Robot
from vftcli.robots.run import Run, paired, unwound
from vftcli.robots.terms import check_effort, check_joints, effort_name
from vftcli.signals.errors import ExaminationError, UnsettledRobotError
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, Remarks, as_record, fact, filled, sentence, words
from vftcli.signals.shown import Shown

#: Findings that an arm's model is another's, the case for identification.
NO_FIT = frozenset({"other-robot", "no-robot-fits", "no-robot-fits-any", "effort-unexplained"})
#: Findings that make every result meaningless. A load or a contact is never one of them.
REFUSING = NO_FIT | {
    "effort-sign", "effort-sign-by-work", "joint-sign", "effort-order", "joint-order",
    "torque-without-gravity", "torque-with-gravity", "current-without-gravity",
    "current-as-torque", "torque-as-current", "milliamperes",
    "current-as-turned-torque", "torque-as-turned-current",
    "upside-down", "tilted-base", "time-unit", "clock-rate",
    "velocity-unit", "velocity-of-another-kind", "velocity-sign", "no-friction-in-effort",
    "too-short",
}  # fmt: skip
#: Findings on the size of a current, which a model of the arm knows better.
SIZED = CORRECTIONS.keys() - {"torque-with-gravity"}


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Examination(Shown):
    """Findings of the doctor."""

    recording: Recording  #: The log.
    findings: tuple[Remark, ...]  #: Warnings before notes.
    robots: tuple[RobotMatch, ...]  #: The arms compared with the log, best first.

    @property
    def remarks(self) -> Remarks:
        """Remarks of the log's reader, then the findings."""
        return Remarks((*self.recording.source.remarks, *self.findings))

    def refusals(self, *, fitting: bool = True) -> tuple[Remark, ...]:
        """The findings that make every result meaningless.

        With `fitting` the arm must be the model's; identification makes it so.
        """
        codes = REFUSING if fitting else REFUSING - NO_FIT
        # Half of the joints' effort or more was not measured, if all efforts agree.
        zero, log = [f for f in self.warnings if f.code == "zero-effort"], self.recording
        half = [f for f in zero if 2 * len(f.where.joints) >= log.joints]
        unmeasured = half if len(half) == len(efforts_of(log)) else []
        return tuple(f for f in self.warnings if f.code in codes or f in unmeasured)

    @property
    def assumptions(self) -> tuple[Remark, ...]:
        """The findings on assumptions of the model, which every command reports."""
        return tuple(f for f in self.findings if f.code == "no-temperature")

    @cached_property
    def warnings(self) -> tuple[Remark, ...]:
        """The findings that can make results wrong."""
        return tuple(finding for finding in self.findings if finding.level == "warning")

    @property
    def doubts(self) -> Set[str]:
        """Codes of the findings by which no contact's size is reliable."""
        return (LAGLESS | {"zero-effort"}) & {finding.code for finding in self.warnings}

    @property
    def load(self) -> tuple[float, float] | None:
        """Mass and SD of a load that the model lacks, or None. [kg]"""
        loads = (r.values for r in self.findings if "load_kg" in r.values)
        return next(((load["load_kg"], load["sd_kg"]) for load in loads), None)


#: Most samples that are examined of a log in stretches, and samples of a stretch.
EXAMINED, STRETCH = 1 << 16, 1 << 10


def stretches(recording: Recording) -> Recording:
    """Stretches of a long log, evenly spread from start to end; a short one as it is."""
    rows = spread(recording.samples, EXAMINED, STRETCH)
    part = recording if len(rows) == recording.samples else recording.rows(rows)
    recording.release()
    return part


def examine(
    recording: Recording, robot: Robot | None = None, *, in_stretches: bool = False
) -> Examination:
    """Examine a log; it is not changed.

    The arm has its payload mounted; None for the log's own, or a search. Examined
    `in_stretches` are those of a long log, and its whole clock.
    """
    part = stretches(recording) if in_stretches else recording
    if unusable := tuple(unusable_findings(part)):
        return Examination(recording=recording, findings=unusable, robots=())
    velocities = velocity_fit(part)
    by_signal = [
        *clock_findings(recording, velocities, part),
        *signal_findings(part),
        *velocity_findings(part, velocities),
        *stuck_findings(part),
    ]
    by_arm, fits = arm_findings(part, robot, by_signal)
    best = robot
    if best is None and fits and fits[0].fits:
        best = load_robot(fits[0].robot)
    if any(finding.code in SIZED for finding in by_arm):
        by_signal = [f for f in by_signal if f.code != "milliamperes"]
    findings = [*cut_findings(recording), *by_signal, *by_arm]
    if best is not None:
        if not (LAGLESS | REFUSING) & {finding.code for finding in findings}:
            findings += effort_lag(part, best)
        findings += temperature_findings(part, best)
    if part is not recording:
        examined, samples = part.samples, recording.samples
        findings.append(fact("examined-in-stretches", examined=examined, samples=samples))
    findings.sort(key=lambda finding: finding.level != "warning")
    return Examination(recording=recording, findings=tuple(findings), robots=fits)


#: Samples of a block of a long log in which bad ones are looked for.
BLOCK = 1 << 14


class Examiner:
    """Loads the robots of a command and examines its logs, each once.

    With `anyway` findings that make results meaningless stop nothing; `fitting` is as of
    `Examination.refusals`; `tell` hears of every examination that refuses nothing.
    """

    def __init__(
        self,
        *,
        anyway: bool = False,
        fitting: bool = True,
        tell: Callable[[Examination], None] | None = None,
    ) -> None:
        self.anyway, self._fitting, self._tell = anyway, fitting, tell
        #: The command's runs, by identity of recording and robot, and `literal`.
        self.runs: dict[tuple[int, int, bool], Run] = {}
        self._made: list[tuple[Recording, Robot, Examination]] = []
        self._robots: dict[tuple[str, RobotChoice, float | None, bool], Robot] = {}

    def robot(self, recording: Recording, choice: RobotChoice) -> Robot:
        """The robot by choice, by the log, or by its maker's own model.

        Raises:
            UnsettledRobotError: If none of these names one; with the profiles that fit best.
        """
        if isinstance(choice.name, Robot):
            return choice.load(recording)
        name, remarks = choice.name or recording.robot_hint, tuple[Remark, ...]()
        if name is None:
            name, remarks = guessed(recording)
        # The log may state the mounted load.
        key = (name, choice, recording.payload_mass, bool(remarks))
        if key not in self._robots:
            robot = choice.load(recording, name)
            self._robots[key] = replace(robot, remarks=(*robot.remarks, *remarks))
        return self._robots[key]

    @property
    def robots(self) -> tuple[Robot, ...]:
        """All that were loaded, in their order."""
        return tuple(self._robots.values())

    def read_as(
        self,
        recording: Recording,
        robot: Robot,
        choice: ReadChoice,
        *,
        in_stretches: bool = False,
    ) -> Recording:
        """A log in its robot's joints; an open effort is read by the model's best fit.

        Joints are matched by name, endless ones unwound, impossible samples cut out.

        Raises:
            RobotError: If the names of its joints, or their number, are not the robot's.
        """
        recording = paired(recording, robot)
        check_joints(recording, robot)
        recording = unwound(recording, robot)
        # Blocks of a long log show whether to clean all of it at once.
        blocks = recording.blocks(BLOCK) if in_stretches else ()
        if not in_stretches or any(without_bad_samples(b, robot) is not b for b in blocks):
            recording = without_bad_samples(recording, robot)
        if choice.effort != "auto":
            return recording
        for finding in examine(recording, robot, in_stretches=in_stretches).findings:
            if (right := CORRECTIONS.get(finding.code)) is not None:
                name = effort_name(recording, robot)
                return recording.with_effort(right.kind or name, source=name, factor=right.factor)
        return recording

    def examine(
        self, recording: Recording, robot: Robot, *, in_stretches: bool = False
    ) -> Examination:
        """The examination of a log as this arm's, made once.

        Raises:
            ExaminationError: If a finding makes every result meaningless, without `anyway`.
        """
        for known, arm, examination in self._made:
            if known is recording and arm is robot:
                return examination
        examination = examine(recording, robot, in_stretches=in_stretches)
        if not self.anyway:
            refuse(recording.name, examination.refusals(fitting=self._fitting))
        self._made.append((recording, robot, examination))
        if self._tell is not None:
            self._tell(examination)
        return examination

    @property
    def examinations(self) -> tuple[Examination, ...]:
        """All that were made, in their order."""
        return tuple(made for _, _, made in self._made)


NEAREST = 2  #: Profiles in the error where none is settled.
BRIEF = 0.5  #: A shorter log tells no arm from another. [s]


def guessed(recording: Recording) -> tuple[str, tuple[Remark, ...]]:
    """The profile by the maker's own model in a log, and the grounds."""
    check_effort(recording)  # no arm would help
    found, fits = guess_robot(recording)
    if found is None:
        near = fits[:NEAREST] if recording.duration > BRIEF else ()
        words = choices_for(recording)
        if near:
            good = [f"--robot {fit.robot}" for fit in near if fit.fits]
            words = f"No profile fits; nearest is {near[0].robot}. Give a URDF: --robot FILE"
            if good:
                best = ", ".join(fit.in_short for fit in near)
                words = f"Best fits: {best}. Add {' or '.join(good)}"
            elif wrong := examine(recording, in_stretches=True).refusals(fitting=False):
                cause = in_words(wrong[0])
                words = f"No profile fits: {cause.evidence}. {cause.remedy}"
        raise UnsettledRobotError(f"Which arm? {words}", recording)
    others = [fit.in_short for fit in fits[:3] if fit is not found]
    remark = fact("robot-guessed", robot=found.robot, fit=str(found), others=others or ["none"])
    return found.robot, (remark,)


def refuse(name: str, findings: Iterable[Remark]) -> None:
    """Raise an error on the first of some findings with its remedy, if any."""
    if found := [in_words(finding) for finding in findings]:
        others = ", ".join(dict.fromkeys(other.name for other in found[1:]))
        more = f" Also: {others}." if others else ""
        raise ExaminationError(f"{name}: {found[0]}{more} --anyway continues despite this.")


class FindingWords(NamedTuple):
    """Text of a finding."""

    name: str  #: Short name; variants of one finding share it.
    #: A note informs; a warning can make results wrong and fails ``--strict``.
    severity: str
    evidence: str  #: The evidence, with numbers.
    consequence: str  #: Its effect on the results.
    remedy: str  #: Its remedy.

    def __str__(self) -> str:
        """The finding on one line."""
        parts = (self.evidence, self.consequence, self.remedy)
        return f"{self.name}: {'. '.join(part for part in parts if part)}."


def doubt(findings: str) -> str:
    """The line above results that findings make meaningless."""
    return f"MEANINGLESS if this finding is right (you chose --anyway): {findings}"


def in_words(finding: Remark) -> FindingWords:
    """A finding's words, its numbers filled in."""
    entry = words(finding.code)
    return FindingWords(
        name=entry.get("name", finding.code),
        severity="warning" if finding.level == "warning" else "note",
        evidence=sentence(finding),
        consequence=filled(entry.get("consequence", ""), finding),
        remedy=filled(entry.get("remedy", ""), finding),
    )


def finding_record(finding: Remark) -> dict[str, Any]:
    """A finding for machines: its code and values, and its words."""
    said = in_words(finding)
    return {**as_record(finding), **said._asdict(), "message": str(said)}
