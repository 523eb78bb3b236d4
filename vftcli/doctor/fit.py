"""Which robot a log is from: every profile's dynamics against the torques of the log.

The controller's own model (target_torque, or torque less the vendor's residual) tells most; a
measured torque or current comes second, for friction changes from day to day and leaves several per
cent open. An unknown load on the flange is fitted where the poses vary enough to tell one.
"""

from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from vftcli.doctor.case import Case, size_of
from vftcli.doctor.causes import case_of
from vftcli.doctor.windows import Windows, windows_of
from vftcli.robots import PROFILES, Robot, load_robot
from vftcli.robots.pairing import paired
from vftcli.signals.errors import RobotError
from vftcli.signals.names import EFFORTS
from vftcli.signals.recording import Recording

CLOSE = 1.3  #: Profiles whose misfits differ by less than this factor are not told apart.
#: Misfit up to which a profile fits: the maker's own model, and a measured effort.
#:
#: Real logs fit their own arm to .1–1.1 % by the first and to 1.3–12 % by the second.
MAKER_LIMIT, MEASURED_LIMIT = 0.02, 0.15
#: Misfit to the maker's own model up to which a profile is taken, and how much worse the next is.
#:
#: UR10e logs fit their own profile to .1–.26 % and the next 30 times worse; FR3 and Panda are 2
#: apart.
GUESSED, APART = 0.012, 5.0
HEAVY = 5.0  #: A load from which a measured effort rather is another arm's. [kg]
#: Torques that a model should explain, the most telling first.
MAKER, RESIDUAL, MEASURED = (
    "the controller's own model",
    "torque less the vendor's residual",
    "measured effort",
)


@dataclass(frozen=True, kw_only=True)
class RobotMatch:
    """How well a profile explains a log."""

    robot: str  #: The profile's name.
    misfit: float  #: What it cannot explain, relative to the torques; 0 is perfect.
    fits: bool  #: Whether that is as good as the kind of evidence allows.
    evidence: str  #: Which torque was explained, in words.
    load: float  #: Mass of the unknown load that was fitted, 0 if none. [kg]
    #: Whether the maker's own model was explained rather than a measured effort.
    by_maker: bool = False

    def __str__(self) -> str:
        """The fit in a few words."""
        load = f" with {self.load:.2g} kg on the flange" if self.load else ""
        return f"{self.robot} {100 * self.misfit:.3g} %{load} ({self.evidence})"


def profiles() -> dict[str, Robot]:
    """The built-in profiles by name."""
    return {name: load_robot(name) for name in PROFILES}


def guess_robot(recording: Recording) -> tuple[RobotMatch | None, tuple[RobotMatch, ...]]:
    """The profile that a log is from where the maker's own model settles it, and all fits.

    A measured effort settles nothing: friction and loads leave several per cent of it open.
    """
    fits = ranking(recording, profiles().values())
    if not fits or not fits[0].by_maker or fits[0].misfit > GUESSED:
        return None, fits
    apart = len(fits) < 2 or fits[1].misfit >= APART * fits[0].misfit
    return fits[0] if apart else None, fits


def ranking(recording: Recording, robots: Iterable[Robot]) -> tuple[RobotMatch, ...]:
    """Robots with as many joints as the log, best fit first."""
    if not is_judgeable(recording):
        return ()
    fits = []
    for robot in robots:
        with suppress(RobotError):  # joints of other names are another arm's
            fits.append(match_of(paired(recording, robot), robot))
    found = sorted(filter(None, fits), key=by_fit)
    return tuple(
        replace(fit, fits=fit.fits and fit.misfit <= CLOSE * found[0].misfit) for fit in found
    )


def by_fit(match: RobotMatch) -> tuple[bool, float]:
    """What matches are sorted by, the best first."""
    return not match.fits, match.misfit


def is_judgeable(recording: Recording) -> bool:
    """Whether a log is long enough, and its numbers those of an arm, to be held against a model."""
    if recording.dq is None or recording.samples < 10 or not 1e-2 < recording.duration < 1e9:
        return False
    effort = [x for name in EFFORTS if (x := getattr(recording, name)) is not None]
    motion = max(np.abs(recording.q).max(), np.abs(recording.dq).max())
    return bool(motion < 1e4 and all(1e-9 < np.abs(x).max() < 1e9 for x in effort))


def match_of(recording: Recording, robot: Robot, ignored: Sequence[int] = ()) -> RobotMatch | None:
    """A robot's fit to the most telling torque of the log, None without any or of other joints.

    Args:
        recording: The log.
        robot: The robot.
        ignored: Joints, from zero, whose effort is no evidence.
    """
    if recording.joints != robot.joints:
        return None
    windows = windows_of(recording, robot)
    maker = maker_case(recording, windows)
    case = maker or case_of(recording, robot, windows, ignored)
    if case is None:
        return None
    load = float(case.loaded.values[0]) if case.carries_load else 0.0
    measured = RESIDUAL if maker else MEASURED
    return RobotMatch(
        robot=robot.name,
        misfit=case.misfit,
        fits=case.misfit < MAKER_LIMIT if maker else case.misfit < MEASURED_LIMIT and load < HEAVY,
        evidence=measured if case.rubs else MAKER,
        load=load,
        by_maker=maker is not None,
    )


def maker_case(recording: Recording, windows: Windows) -> Case | None:
    """The maker's own model of the arm as a log holds it, None where it does not."""
    target, torque, vendor = recording.target_torque, recording.torque, recording.tau_ext
    if rubs := target is None or not np.any(target):
        if torque is None or vendor is None or not np.any(vendor):
            return None
        # Friction between motor and sensor is in the torque; the vendor's model has none of it.
        target = torque + vendor
    given = windows.mean(target)
    unit = np.ones(recording.joints)
    size = size_of(given)
    if not 0 < size < 1e9:
        return None
    return Case(windows=windows, given=given, size=size, constant=unit, rubs=rubs)
