"""The examination of a log: all findings, and whether its arm explains it."""

from dataclasses import dataclass
from typing import Any

from vftcli.doctor.causes import CORRECTIONS
from vftcli.doctor.clock import clock_findings
from vftcli.doctor.cuts import cut_findings
from vftcli.doctor.fit import RobotMatch, arm_findings, profiles
from vftcli.doctor.lateness import LAGLESS, MISTIMED, effort_lag
from vftcli.doctor.load import controller_findings
from vftcli.doctor.signals import signal_findings, unusable_findings
from vftcli.doctor.temperature import temperature_findings
from vftcli.doctor.velocity import velocity_fit
from vftcli.doctor.windows import spread
from vftcli.robots import Robot
from vftcli.signals.names import EFFORTS
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact
from vftcli.signals.shown import Shown

#: Findings that an arm's model is another's: what identification is for.
NO_FIT = frozenset({"other-robot", "no-robot-fits", "no-robot-fits-any", "no-robot-fits-at-rest"})
#: Findings that make every result meaningless. A load or a contact is never one of them.
REFUSING = NO_FIT | {
    "effort-sign", "effort-sign-by-work", "joint-sign", "effort-order", "joint-order",
    "torque-without-gravity", "torque-with-gravity", "current-without-gravity",
    "current-as-torque", "torque-as-current", "milliamperes",
    "current-as-turned-torque", "torque-as-turned-current",
    "upside-down", "tilted-base", "time-unit", "clock-rate",
    "velocity-unit", "velocity-of-another-kind", "velocity-sign", "no-friction-in-effort",
}  # fmt: skip
#: Findings that say how large a current is: a model of the arm knows better than its numbers.
SIZED = CORRECTIONS.keys() - {"torque-with-gravity"}
#: Findings that every command says: nothing is wrong, and results stand on what is assumed.
ASSUMPTIONS = frozenset({"no-temperature", "temperature-gaps"})


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Examination(Shown):
    """What the doctor found."""

    recording: Recording  #: The log.
    findings: tuple[Remark, ...]  #: Warnings before notes.
    robots: tuple[RobotMatch, ...]  #: The arms compared with the log, best first.

    def refusals(self, *, fitting: bool = True) -> tuple[Remark, ...]:
        """The findings with which no result means anything.

        Args:
            fitting: Whether the arm must be the one of the model; identification makes it so.
        """
        codes = REFUSING if fitting else REFUSING - NO_FIT
        # At least half of the joints' effort was not measured, if all efforts agree.
        joints, efforts = self.recording.joints, set(EFFORTS) & set(self.recording.signals)
        zero = [f for f in self.warnings if f.code == "zero-effort"]
        half = [f for f in zero if 2 * len(f.where.joints) >= joints]
        unmeasured = half if len(half) == len(efforts) else []
        return tuple(f for f in self.warnings if f.code in codes or f in unmeasured)

    @property
    def assumptions(self) -> tuple[Remark, ...]:
        """The findings on what the model assumes where the log says nothing."""
        return tuple(finding for finding in self.findings if finding.code in ASSUMPTIONS)

    @property
    def warnings(self) -> tuple[Remark, ...]:
        """The findings that can make results wrong."""
        return tuple(finding for finding in self.findings if finding.level == "warning")

    @property
    def distrusts(self) -> bool:
        """Whether the velocities are not the motion's, so no contact's size is reliable."""
        return any(finding.code in MISTIMED for finding in self.warnings)

    @property
    def load(self) -> tuple[float, float] | None:
        """Mass and standard deviation of a load that the model lacks, or None. [kg]"""
        for remark in self.findings:
            if "load_kg" in remark.values:
                return float(remark.values["load_kg"]), float(remark.values["sd_kg"])
        return None


#: Samples at most that are examined of a log in stretches, and samples of such a stretch.
EXAMINED, STRETCH = 1 << 16, 1 << 10


def stretches(recording: Recording) -> Recording:
    """Stretches of a long log, evenly spread from start to end; a short one as it is."""
    rows = spread(recording.samples, EXAMINED, STRETCH)
    part = recording if len(rows) == recording.samples else recording.rows(rows)
    recording.release()
    return part


def examine(
    recording: Recording,
    robot: Robot | None = None,
    *,
    in_stretches: bool = False,
) -> Examination:
    """Examine a log; it is not changed.

    Args:
        recording: The log.
        robot: The arm it is from, its payload mounted; None to take the one that the log settles,
            or to look for it among the profiles.
        in_stretches: Whether `stretches` of a long log are examined, and all of its clock, where
            all of it has no room.
    """
    part = stretches(recording) if in_stretches else recording
    if unusable := tuple(unusable_findings(part)):
        return Examination(recording=recording, findings=unusable, robots=())
    velocities = velocity_fit(part)
    by_clock = clock_findings(recording, velocities, part)
    by_signal = (*by_clock, *signal_findings(part, velocities))
    by_arm, fits = arm_findings(part, robot, by_signal)
    best = robot
    if best is None and fits and fits[0].fits:
        best = profiles()[fits[0].robot]
    if any(finding.code in SIZED for finding in by_arm):
        by_signal = tuple(f for f in by_signal if f.code != "milliamperes")
    findings = [
        *cut_findings(recording),
        *by_signal,
        *controller_findings(part, best),
        *by_arm,
    ]
    said = {finding.code for finding in findings}
    if best is not None and not (LAGLESS | REFUSING) & said:
        findings += effort_lag(part, best)
    if best is not None:
        findings += temperature_findings(part, best)
    if part is not recording:
        counts: dict[str, Any] = {"examined": part.samples, "samples": recording.samples}
        findings.append(fact("examined-in-stretches", **counts))
    findings.sort(key=lambda finding: finding.level != "warning")
    return Examination(recording=recording, findings=tuple(findings), robots=fits)
