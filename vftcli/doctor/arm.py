"""Whether an arm explains a log, and what is wrong where it does not: findings from the model."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from vftcli.doctor.case import Case, size_of
from vftcli.doctor.diagnosis import AMBIGUOUS, Cause, Diagnosis, diagnose
from vftcli.doctor.effort import RANGE, case_of, is_modelled
from vftcli.doctor.findings import on_joints
from vftcli.doctor.fit import (
    APART,
    GUESSED,
    RobotMatch,
    is_judgeable,
    maker_case,
    match,
    match_of,
    profiles,
    ranking,
)
from vftcli.doctor.lateness import MISTIMED
from vftcli.doctor.load import declared_payload, load_remarks
from vftcli.doctor.signals import inverted_effort
from vftcli.doctor.windows import up_axes, windows_of
from vftcli.robots import PROFILES, Robot, load_robot
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact, warning

#: Misfit of a measured effort that no friction of a sound log makes; they stay below .12.
#:
#: Load and contact are left out of it, and a log in which gravity hardly varies is not judged.
NO_FIT = 0.35
DOUBTFUL = 0.15  #: Misfit from which other arms are compared.
ANOTHER = 0.6  #: Share of the misfit that another profile may leave to be the log's own.
GENERATION = 1.5  #: A load from which another generation of the arm is looked at first. [kg]
MISTAKEN = 0.1  #: Misfit up to which a cause is believed where nobody said which arm it is.
#: Share of what one sign leaves that the other may leave at most to be the right one.
CLEARLY = 0.6
FELT = 0.02  #: Size of the vendor's torque, relative to the effort, from which it tells its sign.


class ArmFindings(NamedTuple):
    """What the model says of a log."""

    findings: tuple[Remark, ...]  #: The remarks.
    robots: tuple[RobotMatch, ...]  #: The arms that were compared, best fit first.


#: Findings after which a joint's effort is no evidence.
EFFORT = frozenset({"stuck-effort", "zero-effort", "saturation", "stuck-position"})


def arm_findings(
    recording: Recording, robot: Robot | None, known: Iterable[Remark] = ()
) -> ArmFindings:
    """Hold a log against its arm, or against the profiles where nobody says which it is."""
    known = tuple(known)
    if MISTIMED & {finding.code for finding in known} and recording.dq is not None:
        # From the positions, so that the velocity hides nothing else.
        recording = replace(recording, dq=np.gradient(recording.q, recording.t, axis=0))
    ignored = sorted({j - 1 for f in known if f.code in EFFORT for j in f.where.joints})
    if robot is None and recording.robot_hint in PROFILES:
        robot = load_robot(str(recording.robot_hint))
    if robot is not None:
        if robot.joints != recording.joints or not is_judgeable(recording):
            return ArmFindings((), ())
        return of_known_arm(recording, robot, ignored)
    return of_unknown_arm(recording, ignored)


def of_known_arm(recording: Recording, robot: Robot, ignored: Sequence[int]) -> ArmFindings:
    """Findings on a log whose arm the user knows."""
    diagnosis = diagnose(recording, robot, ignored)
    if diagnosis is None:
        return ArmFindings((), ())
    case = maker_case(recording, diagnosis.case.windows)
    own = match(robot.name, case or diagnosis.case, by_maker=case is not None)
    heavy = diagnosis.case.carries_load and diagnosis.case.loaded.values[0] > GENERATION
    refuted = diagnosis.cause is not None and diagnosis.cause.code != "effort-offset"
    doubtful = diagnosis.case.misfit > DOUBTFUL or heavy or refuted
    if (own.by_maker and own.misfit > GUESSED) or doubtful:
        others = [
            found
            for name, other in profiles().items()
            if name != robot.name
            and other.joints == recording.joints
            and (found := match_of(recording, name, other)) is not None
        ]
        others.sort(key=lambda found: (not found.fits, found.misfit))
        if (
            others
            and is_rather(others[0], own, diagnosis)
            and (robot.path in PROFILES.values() or is_driven_by(recording, others[0], diagnosis))
        ):
            remark = warning(
                "other-robot", own=str(own), best=str(others[0]), robot=others[0].robot
            )
            return ArmFindings((remark,), (others[0], replace(own, fits=False), *others[1:]))
        robots = (own, *(replace(other, fits=False) for other in others))
    else:
        robots = (own,)
    return ArmFindings(tuple(explained(recording, robot, diagnosis, robots)), robots)


def is_rather(other: RobotMatch, own: RobotMatch, diagnosis: Diagnosis) -> bool:
    """Whether a log is another profile's: no load, contact or other cause explains it as well."""
    if other.by_maker:
        return other.misfit < GUESSED and own.misfit > APART * other.misfit
    if diagnosis.cause is not None and diagnosis.cause.code == "drive-scale" and not other.load:
        share = AMBIGUOUS  # a factor disguises another generation's masses as a load does
    else:
        share = 1 / AMBIGUOUS if own.load > other.load + GENERATION else ANOTHER
    return other.fits and other.misfit < share * diagnosis.healed.misfit


def is_driven_by(recording: Recording, other: RobotMatch, diagnosis: Diagnosis) -> bool:
    """Whether another arm explains the measured effort much better too.

    A user's own file, identified or measured, may well be nearer to the arm than its maker's model:
    it is not refused for differing from that.
    """
    robot = load_robot(other.robot)
    case = case_of(recording, robot, windows_of(recording, robot))
    return case is not None and case.misfit < ANOTHER * diagnosis.healed.misfit


def explained(
    recording: Recording, robot: Robot, diagnosis: Diagnosis, robots: Iterable[RobotMatch]
) -> Iterator[Remark]:
    """The cause that was found, or that there is none; then what is left once it is put right."""
    healed = diagnosis.healed
    if diagnosis.cause is None and is_modelled(healed, robot):
        yield warning("no-friction-in-effort", robot=robot.name)
        return
    if diagnosis.cause is not None:
        yield cause_remark(recording, diagnosis, diagnosis.cause)
    elif healed.gravity_range < RANGE:
        yield fact("effort-unchecked", range_Nm=healed.gravity_range, least_Nm=RANGE)
        yield from declared_payload(recording, robot)
        return
    if healed.misfit > NO_FIT and diagnosis.cause is None:
        yield warning(
            "no-robot-fits",
            robot=robot.name,
            misfit_percent=100 * healed.misfit,
            ranked="; ".join(str(found) for found in robots),
        )
        return
    if (other := diagnosis.unclear) is not None:
        yield warning(
            "effort-unclear",
            other=other.code,
            misfit_percent=100 * diagnosis.case.misfit,
            other_percent=100 * other.case.misfit,
        )
    yield from declared_payload(recording, robot)
    yield from load_remarks(recording, robot, healed)
    yield from vendor_sign(recording, healed)


def of_unknown_arm(recording: Recording, ignored: Sequence[int]) -> ArmFindings:
    """Findings on a log of which nobody says the arm: the profile that fits, or why none does."""
    robots = profiles()
    fits = ranking(recording, robots)
    if not fits:
        counts = sorted({robot.joints for robot in robots.values()})
        if recording.joints in counts:
            return ArmFindings((), ())
        return ArmFindings(
            (warning("no-profile", joint_count=recording.joints, counts=counts),), ()
        )
    if fits[0].fits:
        robot = robots[fits[0].robot]
        diagnosis = diagnose(recording, robot, ignored)
        if diagnosis is None:
            return ArmFindings((), fits)
        return ArmFindings(tuple(explained(recording, robot, diagnosis, fits)), fits)
    ranked = "; ".join(str(found) for found in fits)
    found = [
        (robots[found.robot], diagnosis)
        for found in fits
        if not found.by_maker  # a maker's own model that fits no profile is of another arm
        and (diagnosis := diagnose(recording, robots[found.robot], ignored)) is not None
        and diagnosis.cause is not None
        and diagnosis.healed.misfit < MISTAKEN
    ]
    if not found:
        still = float(np.max(np.ptp(recording.q, axis=0))) < 0.05
        code = "no-robot-fits-at-rest" if still else "no-robot-fits-any"
        # Without an arm the work of its effort is all that tells its sign.
        return ArmFindings((*inverted_effort(recording), warning(code, ranked=ranked)), fits)
    robot, diagnosis = min(found, key=lambda pair: pair[1].healed.misfit)
    return ArmFindings(tuple(explained(recording, robot, diagnosis, fits)), fits)


def cause_remark(recording: Recording, diagnosis: Diagnosis, cause: Cause) -> Remark:
    """The finding on the cause that explains a log."""
    rival = "nothing else"
    if diagnosis.rival is not None:
        joints = [f"J{j + 1}" for j in diagnosis.rival.joints]
        rival = " ".join([diagnosis.rival.code, *joints])
    robot_current = recording.current is not None and bool(np.any(cause.case.constant != 1))
    values: dict[str, Any] = {
        "misfit_percent": 100 * diagnosis.case.misfit,
        "healed_percent": 100 * cause.misfit,
        "rival": rival,
        "signal": "current" if robot_current else "torque",
        "column": "current" if robot_current else "tau",
        "width": recording.joints,
    }
    if cause.vertical is not None:
        gravity = -up_axes(cause.case.windows.chain.gravity) @ cause.case.up  # base axes [m/s²]
        values |= {
            "angle_deg": float(np.rad2deg(cause.vertical.angle)),
            "gravity": [round(float(component), 2) for component in gravity],
        }
    if cause.code == "milliamperes" and recording.current is not None:
        values = {"typical_A": float(np.percentile(np.abs(recording.current), 99))}
    if cause.code == "drive-scale":
        values |= {"factor": cause.factor, "sd": cause.sd}
    if cause.code == "effort-offset":
        values |= {"offset_Nm": cause.offset, "sd_Nm": cause.sd}
    return warning(cause.code, on_joints(cause.joints), **values)


def vendor_sign(recording: Recording, case: Case) -> Iterator[Remark]:
    """That the vendor's torque fits the arm's only with its sign turned.

    The effort plus the torque ON the robot is what moving and holding the arm takes; with the other
    sign the pushes stand in it twice.
    """
    if recording.tau_ext is None or recording.torque is None:
        return
    vendor = case.windows.mean(recording.tau_ext)
    # A load that the vendor's model knows and the robot file does not is in neither of them.
    vendor = vendor - np.median(vendor, axis=0)
    if size_of(vendor) < FELT * case.size:
        return
    # What the arm leaves over in all windows, contact among them.
    straight, turned = (
        size_of(replace(case, given=given).best.rest)
        for given in (case.given + vendor, case.given - vendor)
    )
    if turned < CLEARLY * straight:
        yield warning(
            "vendor-sign",
            straight_Nm=straight,
            turned_Nm=turned,
            width=recording.joints,
        )
