"""Which robot a log is from: every profile's dynamics against the torques of the log.

The controller's own model (target_torque, or torque less the vendor's residual) tells most; a
measured torque or current comes second, for friction changes from day to day and leaves several per
cent open. An unknown load on the flange is fitted where the poses vary enough to tell one.
"""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from vftcli.doctor.case import Case, size_of
from vftcli.doctor.effort import case_of
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
    fits = ranking(recording, profiles())
    best = fits[0] if fits else None
    if best is None or not best.by_maker or best.misfit > GUESSED:
        return None, fits
    if len(fits) > 1 and fits[1].misfit < APART * best.misfit:
        return None, fits
    return best, fits


def ranking(recording: Recording, robots: Mapping[str, Robot]) -> tuple[RobotMatch, ...]:
    """Robots with as many joints as the log, best fit first."""
    if not is_judgeable(recording):
        return ()
    fits = []
    for name, robot in robots.items():
        with suppress(RobotError):  # joints of other names are another arm's
            log = paired(recording, robot)
            if log.joints == robot.joints and (fit := match_of(log, name, robot)):
                fits.append(fit)
    fits.sort(key=lambda fit: (not fit.fits, fit.misfit))
    return tuple(
        replace(fit, fits=fit.fits and fit.misfit <= CLOSE * fits[0].misfit) for fit in fits
    )


def is_judgeable(recording: Recording) -> bool:
    """Whether a log is long enough, and its numbers those of an arm, to be held against a model."""
    if recording.dq is None or recording.samples < 10:
        return False
    span = recording.duration
    effort = [x for name in EFFORTS if (x := getattr(recording, name)) is not None]
    return bool(
        1e-2 < span < 1e9
        and np.abs(recording.q).max() < 1e4
        and np.abs(recording.dq).max() < 1e4
        and all(1e-9 < np.abs(x).max() < 1e9 for x in effort)
    )


def match_of(recording: Recording, name: str, robot: Robot) -> RobotMatch | None:
    """A robot's fit to the most telling torque of the log, or None without any."""
    windows = windows_of(recording, robot)
    case = maker_case(recording, windows)
    by_maker = case is not None
    if case is None:
        case = case_of(recording, robot, windows)
    return None if case is None else match(name, case, by_maker=by_maker)


def match(name: str, case: Case, *, by_maker: bool = False) -> RobotMatch:
    """What a case says of its robot."""
    load = float(case.loaded.values[0]) if case.carries_load else 0.0
    fits = case.misfit < (MAKER_LIMIT if by_maker else MEASURED_LIMIT)
    measured = RESIDUAL if by_maker and case.rubs else MEASURED
    return RobotMatch(
        robot=name,
        misfit=case.misfit,
        fits=fits and (by_maker or load < HEAVY),
        evidence=measured if case.rubs else MAKER,
        load=load,
        by_maker=by_maker,
    )


def maker_case(recording: Recording, windows: Windows) -> Case | None:
    """The maker's own model of the arm as a log holds it, None where it does not."""
    target, torque, vendor = recording.target_torque, recording.torque, recording.tau_ext
    if target is not None and np.any(target):
        given, rubs = windows.mean(target), False
    elif torque is not None and vendor is not None and np.any(vendor):
        # Friction between motor and sensor is in the torque; the vendor's model has none of it.
        given, rubs = windows.mean(torque + vendor), True
    else:
        return None
    size = size_of(given)
    if not 0 < size < 1e9:
        return None
    return Case(
        windows=windows, given=given, size=size, constant=np.ones(recording.joints), rubs=rubs
    )
