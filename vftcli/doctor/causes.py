"""The cause of a log that its arm does not explain: the best of all tries.

Each cause corrects the log in its own way, and the log is fitted again. One is named if
it leaves much less than the log and all others.

Drivers publish currents, torques, or torques less gravity under one name, some with the
sign reversed. A reading's rest is relative to the column as logged, or a slow arm's
currents would pass for torques without gravity.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from vftcli.doctor.windows import SHED, Case, Terms, Windows, solve, spread, up_axes, windows_of
from vftcli.robots.friction import steady_torque
from vftcli.robots.robot import Robot
from vftcli.robots.terms import effort_name
from vftcli.signals.arrays import root_mean_square, root_mean_squares
from vftcli.signals.recording import Recording

#: Least range of gravity's torque that shows the kind of an effort: right in all 105
#: readings of logs with 24 N·m and more, wrong in 3 of 10 below. [N·m]
RANGE = 10.0
EXPLAINED = 0.6  #: Most of the misfit that a cause leaves.
SLIGHT = 0.75  #: That of an offset: it lowers the misfit less than a sign.
OPEN = 0.45  #: Largest misfit that a cause leaves; no gravity beside a hand leaves .37.
GOOD = 0.03  #: Below this misfit the costly swap of two joints is not tried.
AMBIGUOUS = 1.25  #: A second cause nearer than this ratio of misfits is named too.
CLEAR = 1.5  #: Ratio of misfits by which another reading beats the second best.
#: Ratio of misfits by which another reading beats one that fits: currents read as
#: torques leave 16 % of a UR5, read right 1.5 %.
OVERWHELMING = 5.0
#: Misfits below which an effort is as named, and a base as in the robot file: a wrong
#: name leaves 16 % and more on real logs, a tilt of 10° 8 %.
READ_RIGHT, UPRIGHT = 0.1, 0.05
SUSPECT = 0.35  #: Least misfit of a joint to try its sign and place.
#: Most of the misfit after one joint's sign change, and after two joints' exchange.
TURNED, SWAPPED = 0.5, 0.7
#: Causes on single joints, or in the links' masses.
ON_JOINTS = frozenset({"joint-sign", "effort-order", "effort-offset", "drive-scale"})
#: Largest share that any other cause leaves of the rest of a rough description: true
#: ones .02–.76 of it, those that a rough description made up .94 and more.
EVIDENT = 0.8
FEW = 60  #: Windows for every pair of joints: each pair evaluates the model again.
CARRIES = 0.25  #: Least share of gravity in an effort that shows the joint's place.
OFFSET = 0.1  #: Least offset of a joint's effort, relative to the effort.
#: Windows of a joint's motion, each way and both, for an offset beyond stiction.
FORTH_AND_BACK, BOTH = 8, 30
#: Angle between the fitted "up" and the robot file's of a tilted base [rad], and its
#: weight relative to the file's.
TILTED, WEIGHT = np.deg2rad(10.0), (0.6, 1.7)
#: Least deviation of a drive's factor from 1, of all joints (sound logs: .06) and of one,
#: which a load moves too.
OFF, ALONE = 0.08, 0.1
OTHERS = 0.05  #: Largest error of the other joints' factors beside one wrong one.
LEAST, MOST = 0.6, 1.7  #: Factors beyond these: another unit or arm.
SURE = 4.0  #: Least SDs of an offset, a factor or missing friction.
KNOWN = 0.05  #: Largest SD of a factor from motion.
CLEARER = 1.5  #: Ratio of misfits by which a factor beats a load.
#: Misfit of one model to another; real efforts leave 1.3 % or more.
MODELLED = 0.02
#: Least share of the robot file's friction in any arm, and joints that judge it.
RUBS, WITHOUT = 0.1, 3


class Reading(NamedTuple):
    """An effort that differs from its name."""

    kind: str  #: Its kind, of `vftcli.signals.recording.EFFORTS`; "" for the named one.
    factor: float = 1.0  #: Factor on its values.


#: Finding on a misnamed effort → its correction.
CORRECTIONS = {
    "effort-sign": Reading("", -1.0),
    "current-as-torque": Reading("torque"),
    "current-as-turned-torque": Reading("torque", -1.0),
    "milliamperes": Reading("current", 1e-3),
    "torque-as-current": Reading("current"),
    "torque-as-turned-current": Reading("current", -1.0),
    "torque-with-gravity": Reading("torque"),
    "torque-without-gravity": Reading("torque_without_gravity"),
}
#: Name of an effort → its possible kinds, the named first.
MAY_BE = {
    "current": (
        "", "current-as-torque", "milliamperes", "effort-sign", "current-as-turned-torque",
        "torque-without-gravity", "current-without-gravity",
    ),
    "torque": (
        "", "effort-sign", "torque-without-gravity", "torque-as-current",
        "torque-as-turned-current",
    ),
    "torque_without_gravity": (
        "", "effort-sign", "torque-with-gravity", "torque-as-current", "torque-as-turned-current",
    ),
}  # fmt: skip


class Cause(NamedTuple):
    """A possible fault of a log."""

    code: str  #: Its finding; "" of the log as named.
    case: Case  #: The log after its correction.
    joints: tuple[int, ...] = ()  #: Its joints, from zero; () for all or none.
    values: Mapping[str, Any] = {}  #: Its numbers in the finding.

    @property
    def misfit(self) -> float:
        """Share of the effort that its correction leaves."""
        return self.case.misfit


class Diagnosis(NamedTuple):
    """The cause that explains a log, and its rivals."""

    case: Case  #: The log as its names say.
    cause: Cause | None = None  #: The best one, None if none explains more.
    rival: Cause | None = None  #: A second cause, nearly as good.
    #: A reading that leaves less than the named one, if no cause is named.
    unclear: Cause | None = None

    @property
    def healed(self) -> Case:
        """The log with its cause corrected."""
        return self.case if self.cause is None else self.cause.case


def diagnose(recording: Recording, robot: Robot, ignored: Sequence[int] = ()) -> Diagnosis | None:
    """The cause of a log's misfit with its arm; None without an effort to judge."""
    may_be = list(readings(windows_of(recording, robot, ignored)))
    if not may_be:
        return None
    case, found = may_be[0].case, list[Cause]()
    tells = case.gravity_range >= RANGE
    if tells:
        best, second, *_ = sorted(may_be, key=lambda cause: cause.misfit)
        # Gravity counted twice may look like a load: none is subtracted.
        right = case.bare.size < READ_RIGHT * case.size
        if best.code and second.misfit > (OVERWHELMING if right else CLEAR) * best.misfit:
            found.append(best)
    for trial in TRIALS if tells else (turned_or_swapped,):
        found += trial(case)
    best_misfit = min((cause.misfit for cause in found), default=np.inf)
    plain = any(is_plain(case, cause) for cause in found)
    if tells and (best_misfit > GOOD or (best_misfit > EXPLAINED * case.misfit and not plain)):
        found += swapped(case)
    diagnosis = chosen(case, found)
    if tells and diagnosis.cause is None and case.misfit > READ_RIGHT:
        least = min(may_be, key=lambda other: other.case.bare.size / other.case.size)
        return diagnosis._replace(unclear=least if least.code else None)
    return diagnosis


def case_of(windows: Windows) -> Case | None:
    """The log with its effort as named, None without any."""
    return next((named.case for named in readings(windows)), None)


def readings(windows: Windows) -> Iterator[Cause]:
    """Readings of a log's effort, the named one first."""
    robot, idle = windows.robot, list(windows.ignored)
    name = effort_name(windows.recording, robot)
    value, constant = getattr(windows.recording, name), robot.torque_constant
    if value is None or (name == "current" and constant is None):
        return
    mean = windows.mean(value)
    mean[:, idle] = 0.0
    if not (mean.any() and np.isfinite(mean).all()):
        return
    gravity, unit = windows.gravity[:, :, 2], np.ones(mean.shape[1])
    # Relative to the whole torque, mostly gravity.
    whole = root_mean_square(mean + gravity) if name == "torque_without_gravity" else 0.0
    for code in MAY_BE[name]:
        # Nothing corrects currents without gravity.
        reading = CORRECTIONS.get(code, Reading("current_without_gravity" if code else ""))
        kind = reading.kind or name
        drives = constant if kind.startswith("current") else unit
        if drives is None:
            continue
        given = reading.factor * mean * drives
        size = root_mean_square(given)
        if drives is not constant:
            size = max(root_mean_square(mean), whole)
        if kind.endswith("without_gravity"):
            given += gravity
        given[:, idle] = (windows.inertial + gravity)[:, idle]
        per_unit = constant if name == "current" and constant is not None else unit
        yield Cause(code, Case(windows, given, size, per_unit))


def tilted(case: Case) -> Iterator[Cause]:
    """A base that is tilted or hangs."""
    windows = case.windows
    if case.misfit < UPRIGHT:
        return
    # No load beside gravity: they trade.
    fit = solve(case.given - windows.inertial, Terms(windows.gravity), windows.friction)
    up = fit.values[:3]
    weight, angle = np.linalg.norm(up), np.arctan2(np.linalg.norm(up[:2]), up[2])
    if angle <= TILTED or not WEIGHT[0] < weight < WEIGHT[1]:
        return
    if case.lasts(fit, windows.gravity @ (up - case.up)):
        code = "upside-down" if angle > np.pi - 2 * TILTED else "tilted-base"
        gravity = -up_axes(windows.robot.chain.gravity) @ up / weight  # base axes [m/s²]
        values = {"angle_deg": np.rad2deg(angle), "gravity": gravity.round(2)}
        yield Cause(code, replace(case, up=up / weight), values=values)


def turned_or_swapped(case: Case) -> Iterator[Cause]:
    """Single joints with a reversed effort, pairs with exchanged efforts."""
    moving = case.windows.moves
    if case.gravity_range < RANGE:  # at rest friction has any sign
        moving &= case.windows.ways.sum(axis=0) >= FORTH_AND_BACK
    suspects = np.flatnonzero((case.by_joint > SUSPECT) & moving).tolist()
    if not suspects:
        return
    straight = [rest_of(case, j, j) for j in range(len(moving))]
    wrong = [j for j in suspects if rest_of(case, j, j, -1.0) < TURNED * straight[j]]
    for joints in {tuple(wrong), *((j,) for j in wrong)} - {()}:
        turned = case.given.copy()
        turned[:, joints] *= -1.0
        yield Cause("joint-sign", replace(case, given=turned), joints)
    for i, j in combinations(np.flatnonzero(moving).tolist(), 2):
        if {i, j}.isdisjoint(suspects):
            continue
        before = np.hypot(straight[i], straight[j])
        if np.hypot(rest_of(case, i, j), rest_of(case, j, i)) < SWAPPED * before:
            yield Cause("effort-order", case.exchanged(i, j), (i, j))


def rest_of(case: Case, i: int, j: int, sign: float = 1.0) -> float:
    """Rest of joint i's signed effort beside joint j's model. [N·m]"""
    given = sign * case.given[:, [i]] / case.constant[i] * case.constant[j]
    friction = case.windows.motion[:, :, [j]].swapaxes(1, 2)
    return solve(given - case.needed[:, [j]], Terms(friction, positive=True)).size


def shifted(case: Case) -> Iterator[Cause]:
    """A constant on one joint's effort."""
    rests = [fit.rest[fit.kept].mean(axis=0) for fit in (case.bare, case.loaded)]
    ways = case.windows.ways
    # With little motion to and fro an offset may be stiction.
    moves = (ways.min(axis=0) >= FORTH_AND_BACK) & (ways.sum(axis=0) >= BOTH)
    tried = np.abs(rests).max(axis=0) / case.effort_sizes > OFFSET / 2
    load, friction = case.windows.load, case.windows.friction
    for j in np.flatnonzero(tried & moves).tolist():
        column = np.zeros((*case.given.shape, 1))
        column[:, j] = 1.0
        fit = solve(case.given - case.needed, Terms(column), load, friction)
        offset, sd = fit.values[0], fit.sd[0]
        change = offset * column[:, :, 0]
        if abs(offset) >= max(OFFSET * case.effort_sizes[j], SURE * sd) and case.lasts(
            fit, change
        ):
            healed = replace(case, given=case.given - change)
            yield Cause("effort-offset", healed, (j,), {"offset_Nm": offset, "sd_Nm": sd})


def scaled(case: Case) -> Iterator[Cause]:
    """An effort with a factor: of all joints, or of one.

    A wrong drive constant scales gravity and inertia; friction has any size beside it.
    """
    n, needed, friction = len(case.constant), case.needed[:, :, None], case.windows.friction
    fit = solve(case.given, Terms(needed), friction)
    factor, sd = fit.values[0], fit.sd[0]
    # A load explains a factor too: a heavy one, or one not carried.
    worth = CLEARER if case.loaded.values[0] > -SHED * case.mounted else 1 / CLEARER
    sure = abs(factor - 1) > OFF + SURE * sd and LEAST < factor < MOST
    if sure and worth * fit.size <= case.loaded.size:
        # The rest is relative to the effort as logged.
        healed = replace(case, given=case.given / factor, size=case.size / factor)
        yield Cause("drive-scale", healed, tuple(range(n)), {"factor": factor, "sd": sd})
    fit = solve(case.given, Terms(needed * np.eye(n)), friction)
    factors, sds = fit.values[:n], fit.sd[:n]
    off = abs(factors - 1)
    (wrong,) = np.nonzero((off > ALONE + SURE * sds) & (sds < KNOWN))
    others = np.delete(off < np.maximum(OTHERS, SURE * sds), wrong)
    if wrong.size == 1 and others.all() and LEAST < factors[wrong] < MOST:
        (j,), given = wrong.tolist(), case.given.copy()
        given[:, j] /= factors[j]
        values = {"factor": factors[j], "sd": sds[j]}
        yield Cause("drive-scale", replace(case, given=given), (j,), values)


def swapped(case: Case) -> Iterator[Cause]:
    """Two joints with all signals exchanged: each pair evaluates the model."""
    far = (case.by_joint > SUSPECT) & case.windows.moves
    if not np.any(far & (root_mean_squares(case.gravity) > CARRIES * case.effort_sizes)):
        return  # gravity loads none of the joints with a large misfit
    few = spread(len(case.given), FEW)
    for i, j in combinations(np.flatnonzero(far).tolist(), 2):
        given = case.exchanged(i, j).given[few]
        windows = case.windows.exchanged(i, j, few)
        yield Cause("joint-order", replace(case, windows=windows, given=given), (i, j))


#: Causes to try where gravity varies, each by its corrected cases.
TRIALS = (tilted, turned_or_swapped, shifted, scaled)


def chosen(case: Case, found: Sequence[Cause]) -> Diagnosis:
    """The cause that leaves least, if that is little, and the next."""

    def explains(cause: Cause) -> bool:
        less = cause.misfit < EXPLAINED * case.misfit
        if cause.code == "effort-offset":  # it is there at rest, too
            less = cause.case.best.size < SLIGHT * case.best.size
        little = less and (
            case.misfit > OPEN
            or cause.code in ON_JOINTS
            # No errors of a rough description explain as much.
            or cause.misfit < EVIDENT * case.left_by(case.rough)
        )
        return cause.misfit <= OPEN and (little or is_plain(case, cause))

    found = sorted(filter(explains, found), key=lambda cause: cause.misfit)
    if not found:
        return Diagnosis(case)
    best = found[0]
    if best.code == "joint-sign" and 2 * len(best.joints) > len(case.constant):
        # Most joints turned are all turned: friction hides the rest.
        all_turned = (c for c in found if c.code == "effort-sign")
        best = next((c for c in all_turned if c.misfit < AMBIGUOUS * best.misfit), best)
    # The sign of all covers that of single joints.
    implied = {best.code, "joint-sign" if best.code == "effort-sign" else ""}
    near = (c for c in found if c.misfit < AMBIGUOUS * best.misfit and c.code not in implied)
    return Diagnosis(case, best, next(near, None))


def is_plain(case: Case, cause: Cause) -> bool:
    """Whether a single-joint cause explains these, however little the rest changes."""
    if cause.code not in {"joint-sign", "effort-order"} or cause.misfit > case.misfit:
        return False
    before, after, rough = (
        np.linalg.norm(fit.by_joint[list(cause.joints)])
        for fit in (case.bare, cause.case.bare, case.rough)
    )
    return bool(after < TURNED * before < rough)


def is_modelled(case: Case) -> bool:
    """Whether an effort comes from a model, without the arm's own friction.

    Another model of its arm does not judge a simulation without friction.
    """
    n, friction = len(case.constant), case.windows.robot.friction
    if len(friction) != n:
        return False
    typical = root_mean_squares(case.windows.motion[:, 1])
    stated = abs(np.concatenate([*map(steady_torque, friction, typical[:, None])]))
    moving = (case.windows.ways.min(axis=0) >= FORTH_AND_BACK) & (stated > 0)
    if moving.sum() < WITHOUT:
        return False
    # A joint without information has the model's torque as its effort.
    tells = abs(case.given - case.needed).max(axis=0) > 1e-9 * case.size
    for fit in (case.bare, solve((case.given - case.gravity) * tells, case.windows.friction)):
        rubs = fit.values[:n] + fit.values[n:] * typical + SURE * fit.sd[:n]
        if fit.size < MODELLED * case.size and np.all(rubs[moving] < RUBS * stated[moving]):
            return True
    return False
