"""One cause for a log that its arm does not explain: each is tried, the best one wins.

A turned sign, two joints that changed places, a torque without gravity, a hanging base and a load
all look alike in one number. So every cause gets its own fit, and only one that leaves much less
than the arm as it is, and less than every other cause, is told.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from vftcli.doctor.case import Case
from vftcli.doctor.drives import scales
from vftcli.doctor.effort import CLEAR, RANGE, Reading, readings
from vftcli.doctor.order import SUSPECT, crossed_rests
from vftcli.doctor.robust import RobustFit, solve, terms
from vftcli.doctor.windows import spread, windows_of
from vftcli.robots import Robot
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

EXPLAINED = 0.6  #: Share of the misfit that a cause may leave.
#: How much better another reading must explain even a log that is explained as it is called.
#:
#: Taken for currents, torques without gravity are so large that a UR5 leaves only 16 % of them
#: open; read right it leaves 1.5 %.
OVERWHELMING = 5.0
#: Share of one joint's misfit, or of two joints', that turning or exchanging them may leave.
TURNED = 0.5
AMBIGUOUS = 1.25  #: A cause that explains less by a smaller factor is named beside the best.
#: Misfits below which an effort is what its name says, and a base as the robot file says.
#:
#: Read as something else it leaves 16 % and more on real logs; a tilt of 10° leaves 8 %.
READ_RIGHT, UPRIGHT = 0.1, 0.05
#: Misfit that no cause may leave: 37 % are left of an effort without gravity where a hand is.
OPEN = 0.45
SLIGHT = 0.75  #: The same for an offset, which is a smaller thing than a turned sign.
#: Travel from which a joint's friction and gravity tell its sign and its place. [rad]
TRAVEL = 0.05
GOOD = 0.03  #: Misfit below which nothing is left for a cause that costs much to look for.
OFFSET = 0.1  #: Offset from which a joint's effort counts as shifted, relative to the effort.
FEW = 60  #: Windows by which every pair of joints is tried: each pair needs the model anew.
#: Angle between the fitted "up" and the robot file's from which a base counts as tilted. [rad]
TILTED = np.deg2rad(10.0)


class Vertical(NamedTuple):
    """The direction that is up, as a log's effort says."""

    #: It, in axes whose third is the robot file's own; its length is 1 where the masses fit. (3,)
    up: Array
    solution: RobustFit  #: The fit.

    @property
    def angle(self) -> float:
        """Angle to the robot file's "up". [rad]"""
        return float(np.arctan2(np.linalg.norm(self.up[:2]), self.up[2]))

    @property
    def length(self) -> float:
        """Weight that the effort carries, relative to the robot file's."""
        return float(np.linalg.norm(self.up))


class Cause(NamedTuple):
    """What may be wrong with a log."""

    code: str  #: The finding it would be.
    joints: tuple[int, ...]  #: The joints it is about, from zero.
    case: Case  #: The log with it put right.
    vertical: Vertical | None = None  #: The gravity that was fitted, where that is the cause.
    offset: float = 0.0  #: The constant that was fitted, where that is the cause. [N·m]
    sd: float = 0.0  #: Standard deviation of that, or of the factor. [N·m or 1]
    factor: float = 1.0  #: What the effort is multiplied with, where that is the cause.

    @property
    def misfit(self) -> float:
        """What stays unexplained once it is put right."""
        return self.case.misfit


class Diagnosis(NamedTuple):
    """The cause that explains a log, and what was compared."""

    case: Case  #: The log as its names say.
    cause: Cause | None  #: What is wrong, None where nothing explains more.
    rival: Cause | None  #: A second cause that explains nearly as much.
    #: Another reading of the effort that leaves less than what its name says, where no cause is
    #: told.
    unclear: Reading | None = None

    @property
    def healed(self) -> Case:
        """The log with its cause put right."""
        return self.case if self.cause is None else self.cause.case


def diagnose(recording: Recording, robot: Robot, ignored: Sequence[int] = ()) -> Diagnosis | None:
    """Look for the one cause that explains a log by an arm; None without an effort to judge."""
    windows = windows_of(recording, robot)
    told = list(readings(recording, robot, windows, ignored))
    if not told:
        return None
    case = told[0].case
    found = [
        *read_otherwise(told),
        *turned_base(case),
        *turned_or_swapped(case),
    ]
    found += offset_joint(case)
    if case.gravity_range >= RANGE:
        found += [
            Cause("drive-scale", scale.joints, scale.healed, sd=scale.sd, factor=scale.factor)
            for scale in scales(case)
        ]
    best = min((cause.misfit for cause in found), default=np.inf)
    plain = any(is_plain(case, cause) for cause in found)
    open_still = best > GOOD or (best > EXPLAINED * case.misfit and not plain)
    if open_still and case.gravity_range >= RANGE:
        found += exchanged_joints(case)
    made = chosen(case, found)
    if made.cause is None and case.gravity_range >= RANGE and case.misfit > READ_RIGHT:
        # Gravity that is counted twice may look like a load: none is taken off here.
        least = min(told, key=lambda reading: reading.case.bare.size / reading.case.size)
        made = made._replace(unclear=None if least is told[0] else least)
    return made


def chosen(case: Case, found: list[Cause]) -> Diagnosis:
    """The cause that leaves least, if it leaves little, and the next."""
    found = sorted((c for c in found if is_accepted(case, c)), key=lambda cause: cause.misfit)
    if not found:
        return Diagnosis(case, None, None)
    best = found[0]
    if best.code == "joint-sign" and 2 * len(best.joints) > len(case.constant):
        # Of most joints it is the sign of all: joints that rub or carry nothing do not show it.
        all_turned = (c for c in found if c.code == "effort-sign")
        best = next((c for c in all_turned if c.misfit < AMBIGUOUS * best.misfit), best)
    # The sign of all says that of single joints too.
    implied = {"effort-sign": "joint-sign"}.get(best.code)
    near = (c for c in found if c.misfit < AMBIGUOUS * best.misfit and c.code != best.code)
    return Diagnosis(case, best, next((c for c in near if c.code != implied), None))


def is_accepted(case: Case, cause: Cause) -> bool:
    """Whether a cause leaves little enough to be told."""
    limit = SLIGHT if cause.code == "effort-offset" else EXPLAINED
    if cause.misfit > OPEN:
        return False
    return cause.misfit < limit * case.misfit or is_plain(case, cause)


def is_plain(case: Case, cause: Cause) -> bool:
    """Whether a cause of single joints explains these joints, however little the rest changes."""
    if cause.code not in {"joint-sign", "effort-order"} or cause.misfit > case.misfit:
        return False
    joints = list(cause.joints)
    before, after = case.bare.by_joint[joints], cause.case.bare.by_joint[joints]
    return bool(np.linalg.norm(after) < TURNED * np.linalg.norm(before))


def offset_joint(case: Case) -> Iterator[Cause]:
    """A constant on one joint's effort."""
    if case.gravity_range < RANGE:
        return
    joints = np.arange(len(case.constant))
    tried: set[int] = set()
    for fit in (case.bare, case.loaded):
        share = np.abs(np.mean(fit.rest[fit.kept], axis=0)) / case.effort_sizes
        tried |= {int(j) for j in joints[share > OFFSET / 2]}
    by = case.windows.load.beside(case.windows.friction)
    for j in tried:
        column = np.zeros((*case.given.shape, 1))
        column[:, j] = 1.0
        fit = solve(case.given - case.needed, terms(column).beside(by))
        offset, sd = float(fit.values[0]), float(fit.sd[0])
        if abs(offset) < max(OFFSET * case.effort_sizes[j], 4 * sd):
            continue
        direction = case.windows.motion[0, :, j]
        forth, back = np.sum(direction > 0.8), np.sum(direction < -0.8)
        # Without enough motion to and fro an offset may be stiction.
        if min(forth, back) < 8 or forth + back < 30:
            continue
        if case.lasts(fit, offset * column[:, :, 0]):
            healed = case.with_effort(case.given - offset * column[:, :, 0])
            yield Cause("effort-offset", (j,), healed, offset=offset, sd=sd)


def read_otherwise(readings: Sequence[Reading]) -> Iterator[Cause]:
    """The effort taken for something else than its name says."""
    told, *others = readings
    case = told.case
    if case.gravity_range < RANGE or not others:
        return
    others.sort(key=lambda reading: reading.case.misfit)
    best = others[0]
    second = min(told.case.misfit, *(other.case.misfit for other in others[1:]), np.inf)
    # Gravity that is counted twice may look like a load, so none is taken off here.
    clear = OVERWHELMING if case.bare.size < READ_RIGHT * case.size else CLEAR
    if second > clear * best.case.misfit:
        yield Cause(best.code, (), best.case)


def turned_base(case: Case) -> Iterator[Cause]:
    """A base that is tilted or hangs."""
    if case.gravity_range < RANGE or case.misfit < UPRIGHT:
        return
    windows = case.windows
    # No load beside gravity, for the two trade.
    fit = solve(case.given - windows.inertial, terms(windows.gravity).beside(windows.friction))
    vertical = Vertical(fit.values[:3], fit)
    if vertical.angle > TILTED and 0.6 < vertical.length < 1.7:
        code = "upside-down" if vertical.angle > np.pi - 2 * TILTED else "tilted-base"
        change = windows.gravity @ (vertical.up - case.up)
        if not case.lasts(vertical.solution, change):
            return
        yield Cause(code, (), replace(case, up=vertical.up / vertical.length), vertical)


def turned_or_swapped(case: Case) -> Iterator[Cause]:
    """Single joints whose effort is turned, and two whose efforts changed places."""
    moving = np.ptp(case.windows.q, axis=(0, 1)) > TRAVEL
    suspects = np.flatnonzero((case.by_joint > SUSPECT) & moving)
    if not suspects.size:
        return
    rests = crossed_rests(case)
    straight, turned = np.diagonal(rests[0]), np.diagonal(rests[1])
    wrong = [int(j) for j in suspects if turned[j] < TURNED * straight[j]]
    for joints in {tuple(wrong), *((j,) for j in wrong)} - {()}:
        sign = np.ones(len(straight))
        sign[list(joints)] = -1.0
        yield Cause("joint-sign", joints, case.with_effort(case.given * sign))
    for i, j in combinations(range(len(straight)), 2):
        if not (moving[i] and moving[j] and (i in suspects or j in suspects)):
            continue
        before = np.hypot(straight[i], straight[j])
        if np.hypot(rests[0, i, j], rests[0, j, i]) < 0.7 * before:
            yield Cause("effort-order", (i, j), case.exchanged(i, j))


def exchanged_joints(case: Case) -> Iterator[Cause]:
    """Two joints of which all signals changed places: the model is asked anew for each pair."""
    far = case.by_joint > SUSPECT
    gravity = np.sqrt(np.mean((case.windows.gravity @ case.up) ** 2, axis=0))
    if not np.any(far & (gravity > 0.25 * case.effort_sizes)):
        return  # gravity asks nothing of any joint that is far from the model
    few = spread(len(case.given), FEW)
    for i, j in combinations(np.flatnonzero(far).tolist(), 2):
        windows = case.windows.exchanged(i, j, FEW)
        swapped = case.exchanged(i, j)
        yield Cause(
            "joint-order", (i, j), replace(swapped, windows=windows, given=swapped.given[few])
        )
