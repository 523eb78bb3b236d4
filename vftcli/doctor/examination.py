"""The examination of a log: all findings, and which robot it is from."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from vftcli.doctor.clock import clock_findings
from vftcli.doctor.findings import Finding
from vftcli.doctor.fit import CLOSE, Evidence, RobotMatch, best_fit, measured, ranking
from vftcli.doctor.load import load_findings
from vftcli.doctor.signals import inverted_joints, signal_findings
from vftcli.robots import PROFILES, Robot, load_robot
from vftcli.signals.recording import Recording

MISTAKEN = 0.08
"""Misfit up to which an effort counts as something else than it was taken for.

Lower than for what the log says it is: a small arm's torques times a drive constant resemble a
large arm's.
"""
TOOL = 0.4
"""Mass of a load from which it is worth telling. [kg]"""


@dataclass(frozen=True, kw_only=True)
class Examination:
    """What the doctor found.

    Attributes:
        recording: The log.
        findings: Warnings before notes.
        robots: The profiles with as many joints, best fit first.
    """

    recording: Recording
    findings: tuple[Finding, ...]
    robots: tuple[RobotMatch, ...]

    @property
    def warnings(self) -> tuple[Finding, ...]:
        """The findings that can make results wrong."""
        return tuple(finding for finding in self.findings if finding.severity == "warning")


def examine(recording: Recording, robots: Mapping[str, Robot] | None = None) -> Examination:
    """Examine a log; it is not changed.

    Args:
        recording: The log.
        robots: Profiles to rank; None for the built-in ones.
    """
    if robots is None:
        robots = {name: load_robot(name) for name in PROFILES}
    fits = ranking(recording, robots)
    best = robots[fits[0].robot] if fits and fits[0].fits else None
    findings = [
        *clock_findings(recording),
        *signal_findings(recording),
        *load_findings(recording, best),
        *robot_findings(recording, fits, robots),
    ]
    findings.sort(key=lambda finding: finding.severity != "warning")
    return Examination(recording=recording, findings=tuple(findings), robots=fits)


def robot_findings(
    recording: Recording, fits: tuple[RobotMatch, ...], robots: Mapping[str, Robot]
) -> Iterator[Finding]:
    """Which profile fits, whether the log says another one, or that none does."""
    if not fits:
        counts = sorted({robot.joints for robot in robots.values()})
        if recording.joints not in counts:
            yield Finding(
                name="no-profile",
                severity="warning",
                evidence=f"the log has {recording.joints} joints; profiles have {counts}",
                consequence="No built-in profile can be used",
                remedy="Describe the arm in a TOML file or give its URDF with --robot",
            )
        return
    if not fits[0].fits:
        yield from mistaken_effort(recording, robots)
        yield _none_fits(recording, fits)
        return
    yield from _contradicted(recording, fits)
    yield from _load(recording, fits[0], robots[fits[0].robot])


def _load(recording: Recording, fit: RobotMatch, robot: Robot) -> Iterator[Finding]:
    """A load that the drives carry and the profile does not know."""
    drives = best_fit(recording, fit.robot, robot, measured(recording, robot))
    carried = max(fit.load, drives.load if drives is not None else 0.0)
    if carried > TOOL:
        told = ""
        if fit.load == 0.0 and recording.target_torque is not None:
            told = ", of which the controller's own model knows nothing"
        yield Finding(
            name="unmodelled-load",
            severity="warning" if told else "note",
            evidence=f"the drives carry about {carried:.2g} kg on the flange of {fit.robot}{told}",
            consequence="Without it a torque that changes with the pose appears as contact",
            remedy="Describe it in a [payload] section of the robot file",
        )


def _contradicted(recording: Recording, fits: tuple[RobotMatch, ...]) -> Iterator[Finding]:
    hint = recording.robot_hint
    hinted = next((fit for fit in fits if fit.robot == hint), None)
    if hinted is not None and hinted.misfit > CLOSE * fits[0].misfit:
        yield Finding(
            name="other-robot",
            severity="warning",
            evidence=f"the joints are {hint}'s by name but the torques fit {fits[0]}, not {hinted}",
            consequence="The wrong profile shows gravity as contact",
            remedy=f"Check the arm; use --robot {fits[0].robot}",
        )


def mistaken_effort(recording: Recording, robots: Mapping[str, Robot]) -> Iterator[Finding]:
    """An effort that fits a profile once it is taken for something else."""
    for name, robot in robots.items():
        if robot.joints != recording.joints:
            continue
        fit = best_fit(recording, name, robot, hypotheses(recording, robot))
        if fit is not None and fit.fits:
            yield Finding(
                name="effort-unit",
                severity="warning",
                evidence=f"as {fit.evidence} the log fits {name} ({100 * fit.misfit:.2g} %)",
                consequence="Taken as it is, every torque is wrong by that factor",
                remedy="Say what it is with --columns, as in current=effort or -tau=effort",
            )


def hypotheses(recording: Recording, robot: Robot) -> Iterator[Evidence]:
    """What the effort may be besides what it was taken for."""
    torque, current, constant = recording.torque, recording.current, robot.torque_constant
    if torque is not None:
        yield Evidence("torque of the other sign", -torque, MISTAKEN, friction=True)
        if constant is not None:
            yield Evidence("motor current [A]", torque * constant, MISTAKEN, friction=True)
            yield Evidence("motor current [mA]", torque * constant / 1e3, MISTAKEN, friction=True)
    elif current is not None:
        yield Evidence("joint torque [N·m]", current, MISTAKEN, friction=True)
        if constant is not None:
            yield Evidence(
                "current of the other sign", -current * constant, MISTAKEN, friction=True
            )
            yield Evidence("current in mA", current * constant / 1e3, MISTAKEN, friction=True)


def _none_fits(recording: Recording, fits: tuple[RobotMatch, ...]) -> Finding:
    ranked = "; ".join(str(fit) for fit in fits)
    still = float(np.max(np.ptp(recording.q, axis=0))) < 0.05
    inverted, judged = inverted_joints(recording)
    reason = "The arm has no profile, its effort is not what it is taken for, or it carries a load"
    if inverted and len(inverted) >= max(2, round(0.6 * judged)):
        reason = "The effort's sign is inverted, or the arm has no profile"
    elif still:
        reason = "In a single pose an unknown load cannot be told from another arm"
    return Finding(
        name="no-robot-fits",
        severity="warning",
        evidence=f"no profile explains the torques: {ranked}",
        consequence="With any of them gravity appears as contact",
        remedy=f"{reason}. Give the arm's own TOML or URDF with --robot",
    )
