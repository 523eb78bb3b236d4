"""When two logs of one trajectory are at the same place: a time shift found on joint positions."""

from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.intervals import covered, intervals
from vftcli.signals.lag import lag_fit
from vftcli.signals.least_squares import robust_sd
from vftcli.signals.recording import Recording
from vftcli.signals.series import resample_columns

LEAST_OVERLAP = 0.3  #: Share of the shorter log that must overlap at an admissible shift.
#: Positions that differ by more than this after alignment are another trajectory. [rad]
SAME_TRAJECTORY = 0.05
#: Clocks whose rates differ by more than this share are refused, by less corrected.
SAME_RATE = 0.01
#: A shift is worth refining if the logs lie within this share of the motion's own spread.
SHORTLIST = 0.15
#: A shift fits as well as the closest if the logs lie no more than so many times farther apart.
ALIKE = 3.0
#: Or within this share of the motion's own spread, which no servo repeats better.
LEAST_ALIKE = 0.001
RIVALS = 40  #: Shifts with a longer overlap that are tried, at most.
COARSE = 300  #: Instants at which a recording is compared while the shared part is looked for.

#: At another speed or on another clock a motion lies within this share of its own spread.
#:
#: Of true pairs .003 is left, of other motions that a rate seemed to explain 1.3 and more.
SAME_PATH = 0.1

#: Length of the pieces over which logged velocities are compared with the way travelled. [s]
TRAVEL = 1.0
#: Clock rates tried to explain why two logs do not fit.
RATES = np.concatenate([np.linspace(0.5, 2.0, 61), [1e-3, 1e3]])


class Alignment(NamedTuple):
    """How one log lies on another."""

    shift: float  #: The other log's clock reads rate·t + shift at the same place. [s]
    rate: float  #: Rate of the other log's clock against this one's, 1 for equal clocks.
    #: Root mean square of the remaining position difference over all joints. [rad]
    deviation: float
    overlap: Mask  #: Samples of the log whose partner lies within the other. (T,)


def align(recording: Recording, free: Recording) -> Alignment:
    """Find the shift at which `free` passes through the recording's joint positions.

    A coarse shift minimises the mean squared position difference over all overlaps of at least
    `LEAST_OVERLAP`, by FFT on a common uniform clock; it and the ratio of the clocks' rates are
    then refined on the logs' own clocks by Gauss–Newton steps, robust against contacts. A motion
    that repeats fits at every whole period alike: of these shifts the one with most overlap counts.
    """
    check_same_arm(recording, free)
    closest = lying_at(recording, free, *best_fit(recording, free))
    fits = closest.deviation <= SAME_TRAJECTORY
    found = closest if fits else shared_part(recording, free)
    if found is not None and abs(found.rate - 1.0) <= SAME_RATE:
        return found
    found = found or explained_by_rate(recording, free)
    if found is None or not is_same_path(recording, found):
        # A rate that explains nothing is none: how far they are apart is said of equal clocks.
        middle = 0.5 * (recording.t[0] + recording.t[-1])
        shift = closest.shift + (closest.rate - 1.0) * middle
        apart_by = lying_at(recording, free, float(shift), 1.0).deviation
        raise ReferenceTorqueError(
            f"{free.name} is not a free run of the trajectory in {recording.name}: at the best "
            f"shift ({shift:.3f} s) the joint positions still differ by {apart_by:.3g} rad rms; "
            "give a log of the same motion with --free"
        )
    raise ReferenceTorqueError(why_slower(recording, free, found.rate))


def is_same_path(recording: Recording, found: Alignment) -> bool:
    """Whether what overlaps at some rate is one path, and not two small motions near each other."""
    spread = np.sqrt(np.mean(np.var(recording.q[found.overlap], axis=0)))
    return bool(found.deviation <= SAME_PATH * spread)


def why_slower(recording: Recording, free: Recording, rate: float) -> str:
    """Why one motion takes `rate` times as long in the free run: its speed, or a clock; a remedy.

    The logged velocities tell: a wrong clock disagrees with them, a slower motion does not.
    """
    longer = f"the same motion takes {rate:.4g} times as long in {free.name}"
    speed = f"{100.0 * abs(rate - 1.0):.2g} % {'slower' if rate > 1.0 else 'faster'}"
    again = (
        "friction and inertia differ with the speed, so record it as fast as the log (on a UR: the "
        "same speed slider)"
    )
    paces = [pace(log) for log in (recording, free)]
    if None in paces:
        return (
            f"{longer} as in {recording.name}: it ran {speed}, or a clock is wrong, which only "
            f"logged velocities tell. If its speed: {again}. If a clock: correct the time stamps, "
            "or state them with --columns (t@125Hz, t[ms], t[ns])"
        )
    own, theirs = (float(np.log(each)) for each in paces if each is not None)
    if abs(theirs - own) < 0.5 * abs(float(np.log(rate))):
        return (
            f"{free.name} is the motion of {recording.name}, but ran {speed}, as its own "
            f"velocities say too: {again}"
        )
    off, wrong = (theirs, free) if abs(theirs) > abs(own) else (own, recording)
    true = float(np.exp(off)) / wrong.median_step
    return (
        f"the clocks of {recording.name} and {free.name} run at different rates: {longer}, and the "
        f"velocities in {wrong.name} say that its clock is wrong: its rows come at {true:.4g} Hz; "
        f"correct its time stamps, or state them with --columns (t@{true:.4g}Hz, t[ms], t[ns])"
    )


def pace(recording: Recording) -> float | None:
    """Way by logged velocities over way by positions, 1 on a right clock; None without either.

    Over pieces of `TRAVEL`, in which the noise of neither counts.
    """
    if recording.dq is None or "dq" in recording.source.derived:
        return None
    t = recording.t
    steps = 0.5 * (recording.dq[1:] + recording.dq[:-1]) * np.diff(t)[:, None]
    summed = np.vstack([np.zeros(recording.joints), np.cumsum(steps, axis=0)])
    ends = np.searchsorted(t, np.arange(t[0], t[-1], TRAVEL))
    by_position, by_velocity = (np.diff(x[ends], axis=0) for x in (recording.q, summed))
    power = float(np.sum(by_position**2))
    along = float(np.sum(by_position * by_velocity))
    return along / power if power > 0.0 and along > 0.0 else None


def check_same_arm(recording: Recording, free: Recording) -> None:
    """Raise a ReferenceTorqueError if two logs cannot be of the same arm."""
    if free.joints != recording.joints:
        raise ReferenceTorqueError(
            f"{free.name} has {free.joints} joints, {recording.name} has {recording.joints}: "
            "a free run must be of the same arm; give another log with --free"
        )
    hints = (free.robot_hint, recording.robot_hint)
    if None not in hints and hints[0] != hints[1]:
        raise ReferenceTorqueError(
            f"{free.name} is a log of {hints[0]}, {recording.name} of {hints[1]}: a free run must "
            "be of the same arm; give another log with --free"
        )


def shared_part(recording: Recording, free: Recording) -> Alignment | None:
    """Where two logs share only a part of their motion: that part, None if it is too short.

    The shift is the one at which most of the recording's motion is within `SAME_TRAJECTORY`; it
    must be at least `LEAST_OVERLAP` of it. The partners are the unbroken stretches of a second or
    more.
    """
    t = np.linspace(recording.t[0], recording.t[-1], COARSE)
    q = resample_columns(t, recording.t, recording.q)
    path = np.append(np.max(np.abs(np.diff(q, axis=0)), axis=1), 0.0)
    span = recording.duration + free.duration
    step = max(0.02, span / 5000.0)
    shifts = free.t[0] - recording.t[-1] + np.arange(0.0, span, step)
    shared = [float(np.sum(path * near(t + shift, q, free))) for shift in shifts]
    best = float(shifts[int(np.argmax(shared))])
    if max(shared) < LEAST_OVERLAP * float(np.sum(path)):
        return None
    shift, rate = refined(recording, free, best, 1.0)
    matched = near(rate * recording.t + shift, recording.q, free)
    long = covered(intervals(recording.t, matched, least=1.0), recording.samples)
    found = lying_at(recording, free, shift, rate, long)
    return found if np.isfinite(found.deviation) else None


def apart(t: Array, q: Array, free: Recording) -> Array:
    """How far the free run is from positions q at instants t of its clock. (T, n) [rad]

    NaN before its first sample and after its last.
    """
    return resample_columns(t, free.t, free.q, np.nan) - q


def near(t: Array, q: Array, free: Recording) -> Mask:
    """Whether the free run lies within `SAME_TRAJECTORY` of positions q at its instants t. (T,)"""
    return np.asarray(np.max(np.abs(apart(t, q, free)), axis=1) <= SAME_TRAJECTORY)


def explained_by_rate(recording: Recording, free: Recording) -> Alignment | None:
    """How the two logs lie at the ratio of rates that makes them one trajectory, if there is one.

    The first of `RATES` that leaves half of what two trajectories may be apart.
    """
    for rate in RATES[np.abs(RATES - 1.0) > SAME_RATE]:
        lengths = (recording.duration * rate, free.duration)
        if min(lengths) < LEAST_OVERLAP * max(lengths):
            continue
        step = max(recording.median_step * rate, free.median_step, free.duration / 4000.0)
        fit = lag_fit(uniform(free, step), uniform(recording, step / rate), LEAST_OVERLAP)
        shift = fit.closest * step + float(free.t[0] - rate * recording.t[0])
        found = lying_at(recording, free, *refined(recording, free, shift, float(rate)))
        if found.deviation <= 0.5 * SAME_TRAJECTORY and is_same_path(recording, found):
            return found
    return None


def uniform(recording: Recording, step: float) -> Array:
    """Joint positions on a uniform clock. (N, n) [rad]"""
    t = np.arange(0.0, recording.duration + 0.5 * step, step)
    return resample_columns(t + recording.t[0], recording.t, recording.q)


def best_fit(recording: Recording, free: Recording) -> tuple[float, float]:
    """Shift [s] and clock rate at which two logs lie closest; of equal fits the longest overlap."""
    step = max(recording.median_step, free.median_step)
    offset = float(free.t[0] - recording.t[0])
    q = uniform(free, step)
    fit = lag_fit(q, uniform(recording, step), LEAST_OVERLAP)
    # The rate starts at that of equal clocks; the steps below find it wherever they start from.
    best = refined(recording, free, fit.closest * step + offset, 1.0)
    spread = float(np.sqrt(np.sum(np.var(q, axis=0))))
    limit = max(ALIKE * distance_moving(recording, free, *best), LEAST_ALIKE * spread)
    for lag in fit.rivals((SHORTLIST * spread) ** 2)[:RIVALS]:
        rival = refined(recording, free, lag * step + offset, 1.0)
        if distance_moving(recording, free, *rival) <= limit:
            return rival
    return best


def distance_moving(recording: Recording, free: Recording, shift: float, rate: float) -> float:
    """Lower quartile of the distance of two logs over the samples that move fast. [rad]

    A quarter, because contacts push an arm off its path; fast, because any two rests lie alike.
    """
    distance = np.linalg.norm(apart(rate * recording.t + shift, recording.q, free), axis=1)
    speed = np.linalg.norm(np.gradient(recording.q, recording.t, axis=0), axis=1)
    used = np.isfinite(distance) & (speed >= 0.5 * np.sqrt(np.mean(speed**2)))
    if np.count_nonzero(used) < 8:
        return float("inf")
    return float(np.quantile(distance[used], 0.25))


def refined(
    recording: Recording, free: Recording, shift: float, rate: float
) -> tuple[float, float]:
    """Refine shift [s] and clock rate on the logs' own clocks.

    Gauss–Newton on q_free(rate·t + shift) = q(t), each joint weighted by its own spread, samples
    by Cauchy's weight, so that contacts do not pull.
    """
    slope = np.gradient(free.q, free.t, axis=0)
    for _ in range(15):
        move = gauss_newton_step(recording, free, rate * recording.t + shift, slope)
        shift, rate = shift - move[0], rate - move[1]
        if abs(move[0]) < 1e-9 and abs(move[1]) < 1e-12:
            break
    return shift, rate


def gauss_newton_step(
    recording: Recording, free: Recording, t: Array, slope: Array
) -> tuple[float, float]:
    """How far shift [s] and rate are off, to first order; zeros where nothing tells.

    Args:
        recording: The log.
        free: The free run.
        t: Its clock at the log's samples, by shift and rate so far. (T,) [s]
        slope: Its velocities. (S, n) [rad/s]
    """
    distance = apart(t, recording.q, free)
    inside = np.isfinite(distance[:, 0])
    if np.count_nonzero(inside) < 8:
        return (0.0, 0.0)
    own, distance = recording.t[inside], distance[inside]
    middle = float(own.mean())
    speed = resample_columns(t[inside], free.t, slope)
    scale = robust_sd(distance) + 1e-7
    share = speed / (scale**2 + distance**2)
    arm = (own - middle)[:, None]
    a, b, c = (float(np.sum(share * speed * arm**k)) for k in range(3))
    e, f = float(np.sum(share * distance)), float(np.sum(share * distance * arm))
    determinant = a * c - b * b
    if not determinant > 1e-12 * max(a * c, 1e-300):
        return (0.0, 0.0)
    rate = (a * f - b * e) / determinant
    return (c * e - b * f) / determinant - rate * middle, rate


def lying_at(
    recording: Recording, free: Recording, shift: float, rate: float, within: Mask | None = None
) -> Alignment:
    """How two logs lie at a shift [s] and rate, over what overlaps, or only `within` of it. (T,)

    The deviation is infinite where fewer than two samples are left.
    """
    distance = apart(rate * recording.t + shift, recording.q, free)
    overlap = np.isfinite(distance[:, 0])
    if within is not None:
        overlap &= within
    deviation = float("inf")
    if np.count_nonzero(overlap) >= 2:
        deviation = float(np.sqrt(np.mean(distance[overlap] ** 2)))
    return Alignment(shift, rate, deviation, overlap)
