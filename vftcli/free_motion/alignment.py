"""Time shift and clock rate between two logs of one path, by positions."""

from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import (
    Array,
    Mask,
    covered,
    integral,
    intervals,
    resample_columns,
    root_mean_square,
)
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.estimation import robust_sd
from vftcli.signals.lag import lag_fit
from vftcli.signals.recording import Recording

LEAST_OVERLAP = 0.3  #: Least overlap, by the shorter log.
#: A larger difference after alignment means another trajectory. [rad]
SAME_TRAJECTORY = 0.05
#: A larger difference of clock rates is refused.
SAME_RATE = 0.01
#: Largest distance of a shift to refine, by the motion's own spread.
SHORTLIST = 0.15
#: Largest ratio of distances of two shifts that fit equally.
ALIKE = 3.0
#: Or this distance, by the motion's spread: no servo repeats better.
LEAST_ALIKE = 0.001
RIVALS = 40  #: Most shifts of longer overlap to try.
COARSE = 300  #: Instants in the search for a shared part.

#: Largest distance at another speed, by the motion's own spread: true pairs
#: leave .003, other motions with a fitting rate 1.3 and more.
SAME_PATH = 0.1

#: Length of pieces that compare velocities with the way. [s]
TRAVEL = 1.0
#: Clock rates to try on two logs that do not fit.
RATES = np.concatenate([np.linspace(0.5, 2.0, 61), [1e-3, 1e3]])


class Alignment(NamedTuple):
    """One log's alignment with another."""

    shift: float  #: The other clock at this place is rate·t + shift. [s]
    rate: float  #: The other log's clock rate over this one's.
    #: RMS of the position difference left, all joints. [rad]
    deviation: float
    overlap: Mask  #: Samples with a partner in the other log. (T,)


def align(recording: Recording, free: Recording) -> Alignment:
    """Shift at which `free` passes the recording's joint positions.

    An FFT on an even clock finds the coarse shift, Gauss–Newton refines it and the rates.
    Of a motion's whole periods the shift with most overlap wins.
    """
    problem, hints = "", (free.robot_hint, recording.robot_hint)
    if free.joints != recording.joints:
        problem = f"has {free.joints} joints, {recording.name} has {recording.joints}"
    elif None not in hints and hints[0] != hints[1]:
        problem = f"is a log of {hints[0]}, {recording.name} of {hints[1]}"
    if problem:
        raise ReferenceTorqueError(
            f"{free.name} {problem}: a free run must be of the same arm; give another log with "
            "--free"
        )
    closest = aligned_at(recording, free, *best_fit(recording, free))
    fits = closest.deviation <= SAME_TRAJECTORY
    found = closest if fits else shared_part(recording, free)
    if found is not None and abs(found.rate - 1.0) <= SAME_RATE:
        return found
    found = found or explained_by_rate(recording, free)
    if found is None or not is_same_path(recording, found):
        # A useless rate is no rate: report the distance at equal clocks.
        middle = 0.5 * (recording.t[0] + recording.t[-1])
        shift = closest.shift + (closest.rate - 1.0) * middle
        distance = aligned_at(recording, free, shift, 1.0).deviation
        raise ReferenceTorqueError(
            f"{free.name} is not a free run of the trajectory in {recording.name}: at the best "
            f"shift ({shift:.3f} s) the joint positions still differ by {distance:.3g} rad rms; "
            "give a log of this motion with --free"
        )
    raise ReferenceTorqueError(why_slower(recording, free, found.rate))


def is_same_path(recording: Recording, found: Alignment) -> bool:
    """Whether the overlap at a rate is one path, not two nearby."""
    spread = np.sqrt(recording.q[found.overlap].var(axis=0).mean())
    return bool(found.deviation <= SAME_PATH * spread)


def why_slower(recording: Recording, free: Recording, rate: float) -> str:
    """Reason of `rate` times the duration: speed or a clock; a remedy."""
    longer = f"this motion takes {rate:.4g} times as long in {free.name}"
    speed = f"{100.0 * abs(rate - 1.0):.2g} % {'slower' if rate > 1.0 else 'faster'}"
    again = (
        "friction and inertia differ with the speed, so record it as fast as the log (on a UR: the "
        "same speed slider)"
    )
    paces = [pace(log) for log in (recording, free)]
    if None in paces:
        return (
            f"{longer} as in {recording.name}: it ran {speed}, or a clock is wrong; only "
            f"logged velocities would show which. If its speed: {again}. If a clock: correct the "
            "time stamps, or state them with --columns (t@125Hz, t[ms], t[ns])"
        )
    own, theirs = (np.log(each) for each in paces if each is not None)
    if abs(theirs - own) < 0.5 * abs(np.log(rate)):
        return (
            f"{free.name} is the motion of {recording.name}, but ran {speed}, as its own "
            f"velocities say too: {again}"
        )
    off, wrong = (theirs, free) if abs(theirs) > abs(own) else (own, recording)
    true = np.exp(off) / wrong.median_step
    return (
        f"the clocks of {recording.name} and {free.name} run at different rates: {longer}, and the "
        f"velocities in {wrong.name} say that its clock is wrong: its rows come at {true:.4g} Hz; "
        f"correct its time stamps, or state them with --columns (t@{true:.4g}Hz, t[ms], t[ns])"
    )


def pace(recording: Recording) -> float | None:
    """Distance by velocities over that by positions, or None."""
    if recording.dq is None or "dq" in recording.source.derived:
        return None
    t = recording.t
    ends, way = t.searchsorted(np.arange(t[0], t[-1], TRAVEL)), integral(t, recording.dq)
    by_position, by_velocity = (np.diff(x[ends], axis=0) for x in (recording.q, way))
    power = np.sum(by_position**2)
    along = np.sum(by_position * by_velocity)
    return along / power if power > 0.0 and along > 0.0 else None


def shared_part(recording: Recording, free: Recording) -> Alignment | None:
    """The shared part of two logs' motions, None if too short.

    `LEAST_OVERLAP` of the motion is within `SAME_TRAJECTORY`, for a second or more.
    """
    t = np.linspace(recording.t[0], recording.t[-1], COARSE)
    q = resample_columns(t, recording.t, recording.q)
    path = np.append(abs(np.diff(q, axis=0)).max(axis=1), 0.0)
    span = recording.duration + free.duration
    shifts = free.t[0] - recording.t[-1] + np.arange(0.0, span, max(0.02, span / 5000.0))
    shared = [np.sum(path * near(t + shift, q, free)) for shift in shifts]
    if max(shared) < LEAST_OVERLAP * path.sum():
        return None
    shift, rate = refined(recording, free, shifts[np.argmax(shared)], 1.0)
    matched = near(rate * recording.t + shift, recording.q, free)
    long = covered(intervals(recording.t, matched, least=1.0), recording.samples)
    found = aligned_at(recording, free, shift, rate, long)
    return found if np.isfinite(found.deviation) else None


def apart(t: Array, q: Array, free: Recording) -> Array:
    """Free run less q at times t of its clock, NaN beyond. (T, n) [rad]"""
    return resample_columns(t, free.t, free.q, np.nan) - q


def near(t: Array, q: Array, free: Recording) -> Mask:
    """Whether the free run is within `SAME_TRAJECTORY` of q at times t. (T,)"""
    return np.asarray(abs(apart(t, q, free)).max(axis=1) <= SAME_TRAJECTORY)


def explained_by_rate(recording: Recording, free: Recording) -> Alignment | None:
    """Alignment at a ratio of rates that makes two logs one path, if any."""
    for rate in RATES[abs(RATES - 1.0) > SAME_RATE]:
        lengths = (recording.duration * rate, free.duration)
        if min(lengths) < LEAST_OVERLAP * max(lengths):
            continue
        step = max(recording.median_step * rate, free.median_step, free.duration / 4000.0)
        fit = lag_fit(uniform(free, step), uniform(recording, step / rate), LEAST_OVERLAP)
        shift = fit.closest * step + (free.t[0] - rate * recording.t[0])
        found = aligned_at(recording, free, *refined(recording, free, shift, rate))
        if found.deviation <= 0.5 * SAME_TRAJECTORY and is_same_path(recording, found):
            return found
    return None


def uniform(recording: Recording, step: float) -> Array:
    """Joint positions on a uniform clock. (N, n) [rad]"""
    t = np.arange(0.0, recording.duration + 0.5 * step, step)
    return resample_columns(t + recording.t[0], recording.t, recording.q)


def best_fit(recording: Recording, free: Recording) -> tuple[float, float]:
    """Shift [s] and clock rate of the best fit, of longest overlap."""
    step = max(recording.median_step, free.median_step)
    offset = free.t[0] - recording.t[0]
    q = uniform(free, step)
    fit = lag_fit(q, uniform(recording, step), LEAST_OVERLAP)
    # Start from equal clocks; the steps below converge anyway.
    best = refined(recording, free, fit.closest * step + offset, 1.0)
    spread = np.sqrt(q.var(axis=0).sum())
    limit = max(ALIKE * distance_moving(recording, free, *best), LEAST_ALIKE * spread)
    for lag in fit.rivals((SHORTLIST * spread) ** 2)[:RIVALS]:
        rival = refined(recording, free, lag * step + offset, 1.0)
        if distance_moving(recording, free, *rival) <= limit:
            return rival
    return best


def distance_moving(recording: Recording, free: Recording, shift: float, rate: float) -> float:
    """Lower quartile of two logs' distance over fast samples. [rad]

    A quarter: contacts push an arm off its path. Fast: any two rests are alike.
    """
    distance = np.linalg.norm(apart(rate * recording.t + shift, recording.q, free), axis=1)
    speed = np.linalg.norm(np.gradient(recording.q, recording.t, axis=0), axis=1)
    used = np.isfinite(distance) & (speed >= 0.5 * root_mean_square(speed))
    if np.count_nonzero(used) < 8:
        return float("inf")
    return float(np.quantile(distance[used], 0.25))


def refined(
    recording: Recording, free: Recording, shift: float, rate: float
) -> tuple[float, float]:
    """Shift [s] and clock rate by Gauss–Newton on q_free(rate·t + shift) = q(t)."""
    slope = np.gradient(free.q, free.t, axis=0)
    for _ in range(15):
        t = rate * recording.t + shift
        distance = apart(t, recording.q, free)
        inside = np.isfinite(distance[:, 0])
        if np.count_nonzero(inside) < 8:
            break
        own, distance = recording.t[inside], distance[inside]
        middle = own.mean()
        speed = resample_columns(t[inside], free.t, slope)
        slopes = np.array([speed, speed * (own - middle)[:, None]])
        gram, right = robust_equations(slopes, distance)
        if not np.linalg.det(gram) > 1e-12 * max(gram[0, 0] * gram[1, 1], 1e-300):
            break
        later, more = np.linalg.solve(gram, right)
        later -= more * middle
        shift, rate = shift - later, rate - more
        if abs(later) < 1e-9 and abs(more) < 1e-12:
            break
    return shift, rate


def robust_equations(slopes: Array, distance: Array) -> tuple[Array, Array]:
    """Matrix (k, k) and right side (k,) of a Gauss–Newton step on distances (T, n).

    Slopes by k unknowns (k, T, n); Cauchy's weights, so that pushes do not pull.
    """
    weighted = slopes / ((robust_sd(distance) + 1e-7) ** 2 + distance**2)
    return (
        np.einsum("atn,btn->ab", weighted, slopes),
        np.einsum("atn,tn->a", weighted, distance),
    )


def aligned_at(
    recording: Recording, free: Recording, shift: float, rate: float, within: Mask | None = None
) -> Alignment:
    """Alignment of two logs at a shift [s] and rate, perhaps `within`. (T,)"""
    distance = apart(rate * recording.t + shift, recording.q, free)
    overlap = np.isfinite(distance[:, 0])
    if within is not None:
        overlap &= within
    some = np.count_nonzero(overlap) >= 2
    deviation = root_mean_square(distance[overlap]) if some else float("inf")
    return Alignment(shift, rate, deviation, overlap)
