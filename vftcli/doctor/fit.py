"""The robot of a log, and findings where it does not explain the log.

Every profile's dynamics are compared with the torques of the log.

The controller's own model (target_torque, or torque less the vendor's residual) shows most;
friction leaves several per cent of a measured effort open.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.doctor.causes import (
    AMBIGUOUS,
    RANGE,
    Cause,
    Diagnosis,
    case_of,
    diagnose,
    is_modelled,
)
from vftcli.doctor.lateness import MISTIMED
from vftcli.doctor.load import load_remarks
from vftcli.doctor.signals import efforts_of, inverted_effort
from vftcli.doctor.windows import Case, Windows, windows_of
from vftcli.robots import NAMES, PROFILES, Robot, load_robot, profiles_of
from vftcli.robots.run import paired
from vftcli.signals.arrays import root_mean_square
from vftcli.signals.errors import RobotError
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact, on_joints, warning

CLOSE = 1.3  #: Smaller ratios of misfits do not distinguish profiles.
#: Misfit up to which a profile fits: the maker's own model (real logs of its arm: .1–1.1 %),
#: and a measured effort (1.3–12 %).
MAKER_LIMIT, MEASURED_LIMIT = 0.02, 0.15
#: Misfit to the maker's own model up to which a profile settles the arm, and ratio to the
#: next: UR10e logs fit theirs to .1–.26 %, the next 30 times worse; FR3 and Panda 2.
GUESSED, APART = 0.012, 5.0
HEAVY = 5.0  #: A load from which a measured effort is another arm's. [kg]
#: Torques that a model should explain, the clearest first.
MAKER, RESIDUAL, MEASURED = (
    "the controller's own model",
    "torque less the vendor's residual",
    "measured effort",
)
#: Misfit of a measured effort beyond friction's (sound logs: .12), load and contact apart.
NO_FIT = 0.35
DOUBTFUL = 0.15  #: Misfit from which other arms are compared.
ANOTHER = 0.6  #: Share of the misfit that another profile may leave to be the log's own.
#: A load from which another generation of the arm is tried first. [kg]
GENERATION = 1.5
#: Misfit up to which a cause is believed if nobody named the arm.
MISTAKEN = 0.1
#: Largest share of the rest by one sign that the other, right one leaves.
CLEARLY = 0.6
#: Size of the vendor's torque, relative to the effort, that shows its sign.
FELT = 0.02
NAMED = 3  #: Arms that a finding names.
#: Findings after which a joint's effort is no evidence.
EFFORT = frozenset({"stuck-effort", "zero-effort", "saturation", "stuck-position"})


class RobotMatch(NamedTuple):
    """Fit of a profile to a log."""

    robot: str  #: The profile's name.
    misfit: float  #: Share of the torques that it cannot explain; 0 is perfect.
    fits: bool  #: Whether that is as good as the kind of evidence allows.
    evidence: str  #: The torque that was explained, in words.
    load: float  #: Mass fitted beyond the mounted payload, 0 if none. [kg]
    #: Whether the maker's own model was explained, not a measured effort.
    by_maker: bool = False

    def __str__(self) -> str:
        """The fit and its evidence."""
        return self.in_short.replace("(", "(model error ").replace(")", f", by {self.evidence})")

    @property
    def in_short(self) -> str:
        """Its name and model error, as ``ur10 with 0.19 kg (0.50 %)``."""
        less = " less" if self.load < 0 else ""
        load = f" with {abs(self.load):.2g} kg{less}" if self.load else ""
        percent = f"{100 * self.misfit:{'.0f' if self.misfit > 0.1 else '#.2g'}}".rstrip(".")
        return f"{self.robot}{load} ({percent} %)"


class ArmFindings(NamedTuple):
    """Findings by the model of an arm."""

    findings: tuple[Remark, ...] = ()  #: The remarks.
    robots: tuple[RobotMatch, ...] = ()  #: The arms that were compared, best fit first.


def guess_robot(recording: Recording) -> tuple[RobotMatch | None, tuple[RobotMatch, ...]]:
    """Profile of a log if the maker's own model settles it, and all fits.

    A measured effort settles nothing: friction and loads leave too much open.
    """
    fits = ranking(recording)
    if not fits or not fits[0].by_maker or fits[0].misfit > GUESSED:
        return None, fits
    close = any(fit.misfit < APART * fits[0].misfit for fit in fits[1:2])
    return None if close else fits[0], fits


def ranking(recording: Recording) -> tuple[RobotMatch, ...]:
    """Profiles with as many joints as the log, best fit first."""
    fits = []
    for robot in map(load_robot, profiles_of(recording.joints)):
        with suppress(RobotError):  # joints of other names are another arm's
            fits.append(match_of(paired(recording, robot), robot))
    found = sorted(filter(None, fits), key=by_fit)
    return tuple(
        fit._replace(fits=fit.fits and fit.misfit <= CLOSE * found[0].misfit) for fit in found
    )


def by_fit(match: RobotMatch) -> tuple[bool, float]:
    """Key by which matches are sorted, the best first."""
    return not match.fits, match.misfit


def is_judgeable(recording: Recording) -> bool:
    """Whether a log is long enough, and its numbers are those of an arm."""
    if recording.dq is None or recording.samples < 10 or not 1e-2 < recording.duration < 1e9:
        return False
    sizes = [abs(x).max() for _, x in efforts_of(recording)]
    motion = max(abs(recording.q).max(), abs(recording.dq).max())
    return motion < 1e4 and all(1e-9 < size < 1e9 for size in sizes)


def match_of(
    recording: Recording, robot: Robot, ignored: Sequence[int] = ()
) -> RobotMatch | None:
    """Robot's fit to the log's best torque without ignored joints, None without any."""
    if recording.joints != robot.joints or not is_judgeable(recording):
        return None
    windows = windows_of(recording, robot, ignored)
    evidence, case = maker_case(windows)
    by_maker = case is not None
    case = case or case_of(windows)
    if case is None:
        return None
    load = case.loaded.values[0] if case.carries_load else 0.0
    light = by_maker or load < HEAVY
    return RobotMatch(
        robot=robot.name,
        misfit=case.misfit,
        fits=light and case.misfit < (MAKER_LIMIT if by_maker else MEASURED_LIMIT),
        evidence=evidence,
        load=load,
        by_maker=by_maker,
    )


def maker_case(windows: Windows) -> tuple[str, Case | None]:
    """The maker's model of the arm in a log, and its evidence; None without one.

    A rigid-body model has no friction; torque less the residual has it before the sensor.
    """
    log = windows.recording
    target, torque, vendor = log.target_torque, log.torque, log.tau_ext
    if target is not None and target.any():
        evidence, windows = MAKER, replace(windows, motion=0.0 * windows.motion)
    elif torque is not None and vendor is not None and vendor.any():
        evidence, target = RESIDUAL, torque + vendor
    else:
        return MEASURED, None
    given = windows.mean(target)
    if not 0 < (size := root_mean_square(given)) < 1e9:
        return MEASURED, None
    return evidence, Case(windows, given, size, np.ones(log.joints))


def arm_findings(
    recording: Recording, robot: Robot | None, known: Iterable[Remark] = ()
) -> ArmFindings:
    """Compare a log with its arm, or with all profiles if nobody names one."""
    known = tuple(known)
    if MISTIMED & {finding.code for finding in known} and recording.dq is not None:
        # From the positions, so that the velocity hides nothing else.
        recording = replace(recording, dq=np.gradient(recording.q, recording.t, axis=0))
    ignored = sorted({j - 1 for f in known if f.code in EFFORT for j in f.where.joints})
    if robot is None and recording.robot_hint in PROFILES:
        robot = load_robot(str(recording.robot_hint))
    if robot is None:
        return of_unknown_arm(recording, ignored)
    own = match_of(recording, robot, ignored)
    if own is None or (diagnosis := diagnose(recording, robot, ignored)) is None:
        return ArmFindings()
    case, cause, others = diagnosis.case, diagnosis.cause, list[RobotMatch]()
    heavy = case.carries_load and case.loaded.values[0] > GENERATION
    refuted = cause is not None and cause.code != "effort-offset"
    if (own.by_maker and own.misfit > GUESSED) or case.misfit > DOUBTFUL or heavy or refuted:
        names = (n for n in profiles_of(recording.joints) if PROFILES[n] != robot.path)
        each = (match_of(recording, load_robot(name)) for name in names)
        others = sorted(filter(None, each), key=by_fit)
        # If the profile of the same name fits best, the file is rough, the arm right.
        if others and others[0].robot != robot.name and is_rather(others[0], own, diagnosis):
            best, *more = others
            # A user's own file may be nearer to the arm than its maker's model.
            driven = case_of(windows_of(recording, load_robot(best.robot)))
            if robot.path in PROFILES.values() or (
                driven is not None and driven.misfit < ANOTHER * diagnosis.healed.misfit
            ):
                remark = warning(
                    "other-robot", own=own.in_short, best=str(best), robot=best.robot
                )
                return ArmFindings((remark,), (best, own._replace(fits=False), *more))
    others = [other._replace(fits=False) for other in others if other.robot != robot.name]
    robots = (own, *others)
    return ArmFindings(tuple(explained(diagnosis, robots)), robots)


def is_rather(other: RobotMatch, own: RobotMatch, diagnosis: Diagnosis) -> bool:
    """Whether a log is another profile's: nothing else explains it as well."""
    if other.by_maker:
        return other.misfit < GUESSED and own.misfit > APART * other.misfit
    if diagnosis.cause is not None and diagnosis.cause.code == "drive-scale" and not other.load:
        share = AMBIGUOUS  # a factor disguises another generation's masses as a load does
    else:
        share = 1 / AMBIGUOUS if own.load > other.load + GENERATION else ANOTHER
    # What a load explains is no other arm's.
    healed, load = diagnosis.healed, diagnosis.healed.loaded
    fit = load if 0 < load.values[0] < HEAVY else healed.best
    return other.fits and other.misfit < share * healed.left_by(fit)


def explained(diagnosis: Diagnosis, robots: Sequence[RobotMatch]) -> Iterator[Remark]:
    """Findings on the cause, or on none; then on the log after its correction."""
    healed, cause = diagnosis.healed, diagnosis.cause
    robot = healed.windows.robot
    misfit = 100 * diagnosis.case.misfit
    if cause is None and is_modelled(healed):
        yield warning("no-friction-in-effort", robot=robot.name)
        return
    if cause is not None:
        yield cause_remark(diagnosis, cause)
    elif healed.gravity_range < RANGE:
        yield fact("effort-unchecked", range_Nm=healed.gravity_range, least_Nm=RANGE)
        yield from load_remarks(healed)
        return
    elif healed.misfit > NO_FIT:
        own, ranked = robots[0], "; ".join(map(str, robots[:NAMED]))
        code = "effort-unexplained" if own.by_maker and own.fits else "no-robot-fits"
        yield warning(code, robot=robot.name, misfit_percent=misfit, ranked=ranked)
        return
    if (other := diagnosis.unclear) is not None:
        left = 100 * other.misfit
        yield warning(
            "effort-unclear", other=other.code, misfit_percent=misfit, other_percent=left
        )
    yield from load_remarks(healed)
    yield from vendor_sign(healed)


def of_unknown_arm(recording: Recording, ignored: Sequence[int]) -> ArmFindings:
    """Findings on a log of an unknown arm: by the profile that fits, or why none does."""
    fits = ranking(recording)
    if not fits:
        counts = sorted(set(NAMES.values()))
        if recording.joints in counts:
            return ArmFindings()
        return ArmFindings((warning("no-profile", joint_count=recording.joints, counts=counts),))
    # A maker's own model that fits no profile is another arm's.
    is_known = fits[0].fits
    tried = fits[:1] if is_known else [fit for fit in fits if not fit.by_maker]
    each = (diagnose(recording, load_robot(fit.robot), ignored) for fit in tried)
    found = [
        one
        for one in filter(None, each)
        if is_known or (one.cause is not None and one.healed.misfit < MISTAKEN)
    ]
    if found:
        best = min(found, key=lambda one: one.healed.misfit)
        return ArmFindings(tuple(explained(best, fits)), fits)
    if is_known:
        return ArmFindings(robots=fits)
    # Without an arm only the work of its effort shows its sign.
    remark = warning("no-robot-fits-any", ranked="; ".join(map(str, fits[:NAMED])))
    return ArmFindings((*inverted_effort(recording), remark), fits)


def cause_remark(diagnosis: Diagnosis, cause: Cause) -> Remark:
    """The finding on the cause that explains a log."""
    recording, rival = diagnosis.case.windows.recording, diagnosis.rival
    if cause.code == "milliamperes":
        currents = abs(recording.require("current"))
        return warning(cause.code, typical_A=np.percentile(currents, 99))
    second = "nothing else"
    if rival is not None:
        second = " ".join([rival.code, *(f"J{j + 1}" for j in rival.joints)])
    by_current = recording.current is not None and np.any(cause.case.constant != 1)
    return warning(
        cause.code,
        on_joints(cause.joints),
        misfit_percent=100 * diagnosis.case.misfit,
        healed_percent=100 * cause.misfit,
        rival=second,
        signal="current" if by_current else "torque",
        column="current" if by_current else "tau",
        width=recording.joints,
        **cause.values,
    )


def vendor_sign(case: Case) -> Iterator[Remark]:
    """A finding if the vendor's torque fits the arm only with its sign turned.

    Moving the arm takes the effort plus the torque ON the robot.
    """
    recording = case.windows.recording
    if recording.tau_ext is None or recording.torque is None:
        return
    vendor = case.windows.mean(recording.tau_ext)
    # A load that only the vendor's model knows.
    vendor -= np.median(vendor, axis=0)
    if root_mean_square(vendor) < FELT * case.size:
        return
    # The rest in all windows, contact among them.
    straight, turned = (
        root_mean_square(replace(case, given=given).best.rest)
        for given in (case.given + vendor, case.given - vendor)
    )
    if turned < CLEARLY * straight:
        width = recording.joints
        yield warning("vendor-sign", straight_Nm=straight, turned_Nm=turned, width=width)
