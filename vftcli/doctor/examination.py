"""The examination of a log: all findings, and which robot it is from."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from vftcli.doctor.clock import clock_findings
from vftcli.doctor.fit import CLOSE, Evidence, RobotMatch, best_fit, measured, ranking
from vftcli.doctor.lateness import MISTIMED, effort_lag
from vftcli.doctor.load import load_findings
from vftcli.doctor.signals import (
    TRAVEL,
    inverted_joints,
    is_most,
    signal_findings,
    unusable_findings,
)
from vftcli.doctor.velocity import velocity_fit
from vftcli.robots import PROFILES, Robot, load_robot
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact, warning

MISTAKEN = 0.08
"""Misfit up to which an effort counts as something else than it was taken for.

Lower than for what the log says it is: a small arm's torques times a drive constant resemble a
large arm's.
"""
GUESSED, APART = 0.01, 5.0
"""Misfit to the maker's own model up to which a profile is taken, and how much worse the next is.

UR10e logs fit their own profile to .1–.26 % and the next 30 times worse; FR3 and Panda are 2 apart.
"""
TOOL = 0.4
"""Mass of a load from which it is worth telling. [kg]"""


NO_FIT = frozenset({"other-robot", "no-robot-fits", "no-robot-fits-at-rest"})
"""Findings that an arm's model is another's: what identification is for."""

REFUSING = NO_FIT | {
    "effort-sign", "joint-sign", "effort-order", "joint-order", "torque-without-gravity",
    "current-as-torque", "torque-as-current", "milliamperes", "upside-down", "tilted-base",
    "time-unit",
}  # fmt: skip
"""Findings that make every result meaningless. A load or a contact is never one of them."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Examination:
    """What the doctor found.

    Attributes:
        recording: The log.
        findings: Warnings before notes.
        robots: The arms that were compared with the log, best fit first.
    """

    recording: Recording
    findings: tuple[Remark, ...]
    robots: tuple[RobotMatch, ...]

    def refusals(self, *, fitting: bool = True) -> tuple[Remark, ...]:
        """The findings with which no result means anything.

        Args:
            fitting: Whether the arm must be the one of the model; identification makes it so.
        """
        codes = REFUSING if fitting else REFUSING - NO_FIT
        return tuple(finding for finding in self.warnings if finding.code in codes)

    @property
    def warnings(self) -> tuple[Remark, ...]:
        """The findings that can make results wrong."""
        return tuple(finding for finding in self.findings if finding.level == "warning")


def examine(recording: Recording, robot: Robot | None = None) -> Examination:
    """Examine a log; it is not changed.

    Args:
        recording: The log.
        robot: The arm it is from, its payload mounted; None to look for it among the profiles.
    """
    if unusable := tuple(unusable_findings(recording)):
        return Examination(recording=recording, findings=unusable, robots=())
    robots = profiles() if robot is None else {robot.name: robot}
    fits = ranking(recording, robots)
    best = robots[fits[0].robot] if fits and fits[0].fits else None
    velocities = velocity_fit(recording)
    timed = [
        *clock_findings(recording, velocities),
        *signal_findings(recording, velocities),
    ]
    arm = best if robot is None else robot
    if arm is not None and not MISTIMED & {finding.code for finding in timed}:
        timed.extend(effort_lag(recording, arm))
    findings = [
        *timed,
        *load_findings(recording, best),
        *robot_findings(recording, fits, robots),
    ]
    findings.sort(key=lambda finding: finding.level != "warning")
    return Examination(recording=recording, findings=tuple(findings), robots=fits)


def profiles() -> dict[str, Robot]:
    """The built-in profiles by name."""
    return {name: load_robot(name) for name in PROFILES}


def guess_robot(recording: Recording) -> tuple[RobotMatch | None, tuple[RobotMatch, ...]]:
    """The profile that a log is from where the maker's own model settles it, and all fits.

    A measured effort settles nothing: friction and loads leave several per cent of it open.
    """
    fits = ranking(recording, profiles())
    best = fits[0] if fits else None
    if best is None or not best.by_maker or best.misfit > GUESSED:
        return None, fits
    if len(fits) > 1 and fits[1].misfit < APART * best.misfit:
        return None, fits
    return best, fits


def robot_findings(
    recording: Recording, fits: tuple[RobotMatch, ...], robots: Mapping[str, Robot]
) -> Iterator[Remark]:
    """Which profile fits, whether the log says another one, or that none does."""
    if not fits:
        counts = sorted({robot.joints for robot in robots.values()})
        if recording.joints not in counts:
            yield warning("no-profile", joint_count=recording.joints, counts=counts)
        return
    best = fits[0]
    if not best.fits:
        yield from mistaken_effort(recording, robots)
        found = no_fit(recording, fits)
        # Friction and pushes alone leave much of a sound log's measured effort open.
        told = len(robots) > 1 or best.by_maker
        yield found if told else replace(found, level="fact")
        return
    hint = recording.robot_hint
    hinted = next((fit for fit in fits if fit.robot == hint), None)
    if hinted is not None and hinted.misfit > CLOSE * best.misfit:
        yield warning(
            "other-robot", hint=hint, robot=best.robot, best=str(best), hinted=str(hinted)
        )
    yield from unmodelled_load(recording, best, robots[best.robot])


def unmodelled_load(recording: Recording, fit: RobotMatch, robot: Robot) -> Iterator[Remark]:
    """A load that the drives carry and the profile does not know."""
    drives = best_fit(recording, fit.robot, robot, measured(recording, robot))
    carried = max(fit.load, drives.load if drives is not None else 0.0)
    if carried > TOOL:
        # Where the controller's own model needs no load and the drives carry one, nobody told it.
        untold = fit.load == 0.0 and recording.target_torque is not None
        level = warning if untold else fact
        code = "unmodelled-load-untold" if untold else "unmodelled-load"
        yield level(code, load_kg=carried, robot=fit.robot)


def mistaken_effort(recording: Recording, robots: Mapping[str, Robot]) -> Iterator[Remark]:
    """An effort that fits a profile once it is taken for something else."""
    for name, robot in robots.items():
        if robot.joints != recording.joints:
            continue
        fit = best_fit(recording, name, robot, hypotheses(recording, robot))
        if fit is not None and fit.fits:
            misfit = 100 * fit.misfit
            yield warning("effort-unit", evidence=fit.evidence, robot=name, misfit_percent=misfit)


def hypotheses(recording: Recording, robot: Robot) -> Iterator[Evidence]:
    """What the effort may be besides what it was taken for."""
    torque, current, constant = recording.torque, recording.current, robot.torque_constant
    found: dict[str, Array] = {}
    if torque is not None:
        found["torque of the other sign"] = -torque
        if constant is not None:
            found["motor current [A]"] = torque * constant
            found["motor current [mA]"] = torque * constant / 1e3
    elif current is not None:
        found["joint torque [N·m]"] = current
        if constant is not None:
            found["current of the other sign"] = -current * constant
            found["current in mA"] = current * constant / 1e3
    for name, taken in found.items():
        yield Evidence(name, taken, MISTAKEN, friction=True)


def no_fit(recording: Recording, fits: tuple[RobotMatch, ...]) -> Remark:
    """That no profile explains the torques, with the likeliest reason."""
    inverted, judged = inverted_joints(recording)
    code = "no-robot-fits"
    if inverted and is_most(len(inverted), judged):
        code = "no-robot-fits-inverted"
    elif float(np.max(np.ptp(recording.q, axis=0))) < TRAVEL:
        code = "no-robot-fits-at-rest"
    return warning(code, ranked="; ".join(str(fit) for fit in fits))
