"""Findings about the signals: units, signs, saturation, joints that never move, empty fields."""

from collections.abc import Iterator

import numpy as np

from vftcli.doctor.findings import on_joints
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact, warning
from vftcli.signals.series import runs_of

MOVING = 1e-3
"""Speed from which a joint counts as moving. [rad/s]"""
TRAVEL = 0.05
"""Travel from which a joint's own data tell anything. [rad]"""
STRONG = -0.4
"""Net share of work from which a joint's effort counts as inverted.

Joints hand energy to one another through gravity, so a single joint may well give some back.
"""
ALONE = -0.85
"""The same for a joint whose neighbours' effort is sound."""
DEGREES = 57.3
"""Degrees in a radian."""
LARGE_ANGLE = 13.0
"""Two turns and a little: no joint of these arms goes further from its zero. [rad]"""
LARGE_CURRENT = 60.0
"""No joint of these arms draws this much; readings in mA do. [A]"""


def signal_findings(recording: Recording) -> Iterator[Remark]:
    """Findings about the signals, each check independent of the others."""
    if recording.dq is None:
        yield warning("no-velocity")
    if recording.current is None and recording.torque is None:
        yield warning("no-effort")
    yield from odd_units(recording)
    yield from odd_velocities(recording)
    yield from inverted_effort(recording)
    yield from still_joints(recording)
    yield from saturated_effort(recording)
    yield from zero_signals(recording)


def odd_units(recording: Recording) -> Iterator[Remark]:
    """Positions and currents too large for radians and ampere."""
    largest = float(np.max(np.abs(recording.q)))
    if largest > LARGE_ANGLE:
        yield warning("degrees", largest_rad=largest)
    if recording.current is not None:
        typical = float(np.percentile(np.abs(recording.current), 99))
        if typical > LARGE_CURRENT:
            yield warning("milliamperes", typical_A=typical)


def velocity_slopes(recording: Recording) -> Array:
    """Slope of the logged velocity against the change of position; NaN at rest. (n,)

    Both are taken over stretches of a tenth of a second, in which jitter and quantisation of
    single samples cancel.
    """
    if recording.dq is None or recording.samples < 20:
        return np.full(recording.joints, np.nan)
    t, length = recording.t, max(1, round(0.1 / recording.median_step))
    length = min(length, (recording.samples - 1) // 4)
    first = np.arange(0, recording.samples - length, length)
    steps = np.diff(t)[:, None]
    ways = np.cumsum((recording.dq[1:] + recording.dq[:-1]) / 2 * steps, axis=0)
    ways = np.vstack([np.zeros(recording.joints), ways])
    by_velocity = ways[first + length] - ways[first]
    by_position = recording.q[first + length] - recording.q[first]
    # A stretch across a gap mixes motion that was not recorded.
    even = (t[first + length] - t[first] < 2 * length * recording.median_step)[:, None]
    weight = np.sum(even * by_position**2, axis=0)
    slopes = np.sum(even * by_position * by_velocity, axis=0) / np.where(weight > 0, weight, 1.0)
    slopes[np.ptp(recording.q, axis=0) < TRAVEL] = np.nan
    return np.asarray(slopes)


def odd_velocities(recording: Recording) -> Iterator[Remark]:
    """Logged velocity in another unit than the positions, or of another size or sign."""
    slopes = velocity_slopes(recording)
    known = np.flatnonzero(np.isfinite(slopes))
    if known.size == 0:
        return
    found = slopes[known]
    if np.all(np.abs(found - DEGREES) < 10) or np.all(np.abs(found - 1 / DEGREES) < 0.01):
        yield warning("velocity-unit", slope=float(np.median(found)))
        return
    wrong = known[np.abs(found - 1) > 0.3]
    if wrong.size:
        yield warning("velocity-mismatch", on_joints(wrong), slopes=slopes[wrong].tolist())


def work_shares(recording: Recording, effort: Array) -> Array:
    """Net work of each joint's effort over its gross work; NaN where it hardly moved. (n,)

    Friction makes the drives put energy in; what gravity and inertia take they give back.
    """
    if recording.dq is None:
        return np.full(recording.joints, np.nan)
    steps = np.gradient(recording.t)[:, None]
    power = effort * recording.dq * steps
    gross = np.sum(np.abs(power), axis=0)
    share = np.sum(power, axis=0) / np.where(gross > 0, gross, 1.0)
    travel = np.sum(np.abs(np.diff(recording.q, axis=0)), axis=0)
    # One way only, gravity alone can take or give work.
    reversing = (recording.dq.max(axis=0) > MOVING) & (recording.dq.min(axis=0) < -MOVING)
    share[(travel < 0.3) | ~reversing | (gross == 0)] = np.nan
    return np.asarray(share)


def effort_of(recording: Recording) -> tuple[str, Array] | None:
    """The log's effort and its name."""
    for name in ("torque", "current"):
        if (value := getattr(recording, name)) is not None:
            return name, value
    return None


def inverted_joints(recording: Recording) -> tuple[list[int], int]:
    """Joints whose effort opposes friction, and how many joints could be judged."""
    if (effort := effort_of(recording)) is None:
        return [], 0
    shares = work_shares(recording, effort[1])
    judged = np.flatnonzero(np.isfinite(shares))
    found = [int(j) for j in judged if shares[j] < STRONG]
    if not is_most(len(found), judged.size):  # a few joints only: nearly all their work
        found = [j for j in found if shares[j] < ALONE]
    return found, int(judged.size)


def is_most(count: int, judged: int) -> bool:
    """Whether so many joints are most of those that could be judged, and not one by chance."""
    return count >= max(2, round(0.6 * judged))


def inverted_effort(recording: Recording) -> Iterator[Remark]:
    """Effort that takes energy out of a moving arm: friction only takes, so its sign is turned."""
    found, judged = inverted_joints(recording)
    effort = effort_of(recording)
    if not found or effort is None or recording.dq is None:
        return
    name, value = effort
    is_current = name == "current"
    forward = recording.dq[:, found[0]] > MOVING
    yield warning(
        "effort-sign" if is_most(len(found), judged) else "effort-sign-of-some",
        on_joints(found),
        signal=name,
        shares_percent=(100 * work_shares(recording, value)[found]).tolist(),
        mean=float(np.mean(value[forward, found[0]])) if forward.any() else float("nan"),
        unit="A" if is_current else "N·m",
        first=found[0] + 1,
        column="current" if is_current else "tau",
        width=recording.joints,
    )


def still_joints(recording: Recording) -> Iterator[Remark]:
    """Joints that never move, or an arm that does not."""
    travel = np.ptp(recording.q, axis=0)
    still = np.flatnonzero(travel < 1e-3)
    if still.size == recording.joints:
        yield fact("at-rest", travel_mrad=1e3 * float(travel.max()))
    elif still.size:
        yield fact("still-joints" if still.size > 1 else "still-joint", on_joints(still))


def saturated_effort(recording: Recording) -> Iterator[Remark]:
    """Effort that stays at its very extreme."""
    for name in ("current", "torque"):
        if (value := getattr(recording, name)) is not None:
            joints = [j for j in range(recording.joints) if is_clipped(value[:, j])]
            if joints:
                yield warning("saturation", on_joints(joints), signal=name)


def is_clipped(value: Array, least: int = 10) -> bool:
    """Whether an effort that varies stays exactly at its extreme for several samples in a row."""
    if np.ptp(value) == 0:
        return False
    for extreme in (value.max(), value.min()):
        at = value == extreme
        # A drive saturates far from zero; one that often reads the same small value rests.
        if abs(extreme) < 0.5 * np.ptp(value) or at.sum() < least or at.mean() > 0.5:
            continue
        if max(stop - start for start, stop in runs_of(at)) >= least:
            return True
    return False


def zero_signals(recording: Recording) -> Iterator[Remark]:
    """Signals that are zero in every sample, so were not measured."""
    for name in ("current", "torque", "tau_ext", "wrench", "target_torque", "dq"):
        value = getattr(recording, name)
        if value is None or np.any(value):
            continue
        level = fact if name in {"target_torque", "dq"} else warning
        others = recording.tau_ext is not None and bool(np.any(recording.tau_ext))
        beside = "-beside-tau-ext" if name == "wrench" and others else ""
        yield level(f"zero-{name.replace('_', '-')}{beside}")
