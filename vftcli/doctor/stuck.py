"""Findings about signals that stand still, are zero, reach a limit or move in coarse steps.

A signal is stuck where it repeats itself to the last bit for half a second while the joint's other
signals show that it has to change. An arm at rest, a held joint, a constant speed, a packet that
came late (all signals repeat) and a coarse resolution (short repeats everywhere) are none of that.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vftcli.doctor.findings import on_joints
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.intervals import runs_of
from vftcli.signals.names import EFFORTS
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact, warning
from vftcli.signals.rest import HELD

LONG = 0.5  #: Time for which a signal has to repeat itself. [s]
MANY = 10  #: Steps for which it has to.
#: Way within that time by which a joint surely moves: 20 mrad/s, beyond any offset of a velocity at
#: rest. [rad]
WAY = 0.01
#: A signal's stuck stretch is this many times as long as nearly all its other repeats.
UNUSUAL = 10.0
#: Deviation of a speed from a straight line of time, beyond which its effort has to change. [rad/s]
#:
#: Without noise a constant acceleration takes a constant torque.
BENT = 0.005
TRAVEL = 0.05  #: Travel of a joint whose effort cannot be zero throughout. [rad]
#: Steps of the positions that are worth telling: a velocity from them is off by 0.02 rad/s at
#: 100 Hz. [rad]
COARSE = 2e-4
SOME = 2000  #: Samples that tell most of what a column is like.
ONCE = 0.2  #: Share of a log that no effort stays at its limit in one go.
CLIPPED = 0.1  #: Time at the very extreme from which an effort is clipped. [s]


class Stretch(NamedTuple):
    """Samples in which one joint's signal repeats itself."""

    joint: int  #: Index of the joint.
    first: int  #: Index of its first sample.
    last: int  #: Index of its last sample.


def stuck_findings(recording: Recording) -> Iterator[Remark]:
    """Joints that never move, and signals that stand still, are zero, clipped or coarse."""
    yield from still_joints(recording)
    for code, name, stretches in stuck_signals(recording):
        joints = sorted({stretch.joint for stretch in stretches})
        t = recording.t
        longest = max(stretches, key=lambda s: float(t[s.last] - t[s.first]))
        yield warning(
            code,
            on_joints(joints),
            signal=name,
            longest_s=float(t[longest.last] - t[longest.first]),
            at_s=float(t[longest.first]),
        )
    yield from zero_signals(recording)
    yield from saturated_effort(recording)
    yield from coarse_positions(recording)


def travel_of(recording: Recording) -> Array:
    """How far each joint goes, as a part of the samples tells. (n,) [rad]"""
    return np.asarray(np.ptp(recording.q[:: max(1, recording.samples // SOME)], axis=0))


def still_joints(recording: Recording) -> Iterator[Remark]:
    """Joints that never move, or an arm that does not."""
    travel = travel_of(recording)
    still = np.flatnonzero(travel < HELD)
    if still.size == recording.joints:
        yield fact("at-rest", travel_mrad=1e3 * float(travel.max()))
    elif still.size:
        yield fact("still-joints" if still.size > 1 else "still-joint", on_joints(still))


#: Signals that may be stuck, and what that is called.
STUCK = {
    "q": "stuck-position",
    "dq": "stuck-velocity",
    "current": "stuck-effort",
    "torque": "stuck-effort",
}


def stuck_signals(recording: Recording) -> Iterator[tuple[str, str, list[Stretch]]]:
    """Code, signal and stretches of every signal that is stuck somewhere."""
    for name, code in STUCK.items():
        if stretches := stuck_stretches(recording, name):
            yield code, name, stretches


def stuck_joints(recording: Recording, name: str) -> list[int]:
    """Joints of which a signal is stuck somewhere."""
    return sorted({stretch.joint for stretch in stuck_stretches(recording, name)})


def stuck_stretches(recording: Recording, name: str) -> list[Stretch]:
    """Stretches in which a signal stands still although it has to change."""
    dq, value = recording.dq, getattr(recording, name)
    if dq is None or value is None or recording.samples < 3:
        return []
    t, q = recording.t, recording.q
    found = []
    for stretch in long_repeats(recording, name):
        j = stretch.joint
        rows = slice(stretch.first, stretch.last + 1)
        turned, way = q[rows, j], path_of(t[rows], dq[rows, j])
        if name == "q":
            stuck = farthest(t[rows], way) > max(WAY, 3 * resolution(q[:, j]))
        elif name == "dq":
            stuck = farthest(t[rows], turned - way) > WAY
        else:
            stuck = (
                farthest(t[rows], turned) > WAY
                and is_bent(t[rows], dq[rows, j])
                and not is_extreme(value[:, j], stretch)
                and bool(np.any(value[:, j]))  # zero throughout is a finding of its own
            )
        if stuck:
            found.append(stretch)
    return found


def path_of(t: Array, speed: Array) -> Array:
    """The way that a speed makes from its first sample on. (T,) [rad]"""
    return np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(t))])


def long_repeats(recording: Recording, name: str) -> Iterator[Stretch]:
    """Stretches in which one joint's signal repeats itself for long while its others do not."""
    t, value = recording.t, getattr(recording, name)
    same = value[1:] == value[:-1]
    others = [n for n in ("q", "dq", *EFFORTS) if n != name]
    for j in range(value.shape[1]):
        # A run of steps that change nothing ends with the sample behind its last step.
        first, last = np.array(runs_of(same[:, j]), dtype=np.intp).reshape(-1, 2).T
        long = (t[last] - t[first] >= LONG) & (last - first >= MANY)
        if not long.any():
            continue
        lengths = last - first
        # Repeats of a coarse resolution come in all lengths, those of a stuck signal stand out.
        usual = np.sort(lengths[~long])
        least = UNUSUAL * usual[int(0.95 * len(usual))] if usual.size else 0.0
        for a, b in zip(first[long].tolist(), last[long].tolist(), strict=True):
            if b - a >= least and varies(recording, others, j, slice(a, b + 1)):
                yield Stretch(j, a, b)


def varies(recording: Recording, names: list[str], joint: int, rows: slice) -> bool:
    """Whether one of a joint's signals changes in most steps of a stretch."""
    for name in names:
        if (value := getattr(recording, name)) is not None:
            column = value[rows, joint]
            if np.mean(column[1:] != column[:-1]) > 0.5:
                return True
    return False


def farthest(t: Array, way: Array) -> float:
    """The longest way within half a second. [rad]"""
    behind = np.searchsorted(t, t - LONG * (1 + 1e-9))
    return float(np.max(np.abs(way - way[behind])))


def is_bent(t: Array, speed: Array) -> bool:
    """Whether a speed is no straight line of time."""
    time, rest = t - t.mean(), speed - speed.mean()
    rest = rest - time * float(time @ rest) / float(time @ time)
    return float(np.sqrt(np.mean(rest**2))) > max(BENT, 0.03 * float(np.ptp(speed)))


def resolution(position: Array) -> float:
    """The smallest step of a joint's position, 0 where it has none. [rad]"""
    steps = np.abs(np.diff(position))
    moved = steps[steps > 0]
    return float(moved.min()) if moved.size else 0.0


def is_extreme(value: Array, stretch: Stretch) -> bool:
    """Whether a stretch is at the extreme of an effort that varies: that is saturation.

    One that is long and the only time at its value is none: the effort came to stand there.
    """
    at, low, high = value[stretch.first], value.min(), value.max()
    alone = np.count_nonzero(value == at) == stretch.last + 1 - stretch.first
    if alone and stretch.last - stretch.first > ONCE * len(value):
        return False
    return bool(low < high and at in (low, high) and abs(at) >= 0.5 * (high - low))


def zero_signals(recording: Recording) -> Iterator[Remark]:
    """Signals that are zero in every sample, so were not measured."""
    for name in EFFORTS:
        if (value := getattr(recording, name)) is not None:
            zero = zero_columns(value)
            # Without noise a joint that never moves may need no torque at all.
            if not zero.any():
                continue
            odd = zero & (travel_of(recording) >= TRAVEL)
            if zero.all() or is_noisy(value[:, ~zero]):
                odd = zero
            if odd.any():
                yield warning("zero-effort", on_joints(np.flatnonzero(odd)), signal=name)
    for name in ("tau_ext", "wrench", "target_torque", "dq"):
        value = getattr(recording, name)
        if value is None or not zero_columns(value).all():
            continue
        level = fact if name in {"target_torque", "dq"} else warning
        others = recording.tau_ext is not None and not zero_columns(recording.tau_ext).all()
        beside = "-beside-tau-ext" if name == "wrench" and others else ""
        yield level(f"zero-{name.replace('_', '-')}{beside}")


def zero_columns(value: Array) -> Mask:
    """Whether each column is zero in every sample. (n,)"""
    # Nearly every column has another number among its first samples.
    zero = np.asarray(~value[:SOME].any(axis=0))
    if zero.any():
        zero &= ~value.any(axis=0)
    return zero


def is_noisy(value: Array) -> bool:
    """Whether most columns of a signal are rougher than motion: they were measured.

    White noise gives steps whose differences are √3 times as large as they are.
    """
    steps = np.diff(value, axis=0)
    if len(steps) < 2:
        return False
    rough = np.sum(np.diff(steps, axis=0) ** 2, axis=0) > 0.5 * np.sum(steps**2, axis=0)
    return bool(np.mean(rough) > 0.5)


def saturated_effort(recording: Recording) -> Iterator[Remark]:
    """Effort that stays at its very extreme."""
    if recording.samples < 3:
        return
    least = max(10, round(CLIPPED / recording.median_step))
    for name in EFFORTS:
        if (value := getattr(recording, name)) is not None:
            columns = zip(value.T, recording.q.T, strict=True)
            clipped = {j for j, (x, q) in enumerate(columns) if is_clipped(x, q, least)}
            joints = sorted(clipped - set(stuck_joints(recording, name))) if clipped else []
            if joints:
                yield warning("saturation", on_joints(joints), signal=name)


def is_clipped(value: Array, position: Array, least: int = 10) -> bool:
    """Whether an effort stays exactly at its extreme for several samples while the joint moves.

    Args:
        value: An effort that may vary. (T,)
        position: The joint's position: a joint that is held needs one effort. (T,) [rad]
        least: Samples in a row.
    """
    highest, lowest = float(value.max()), float(value.min())
    for extreme, sign in ((highest, 1.0), (lowest, -1.0)):
        at = value == extreme
        count = int(at.sum())
        # A drive saturates far from zero; one that often reads the same small value rests.
        if highest == lowest or abs(extreme) < 0.5 * (highest - lowest) or count < least:
            continue
        # The rounded top of a smooth effort of coarse resolution is wide on the next level too.
        below = float(np.max(sign * value[~at]))
        if np.count_nonzero(sign * value == below) > 0.2 * count:
            continue
        long = [slice(*run) for run in runs_of(at) if run[1] - run[0] >= least]
        if any(np.ptp(position[run]) > HELD for run in long):
            return True
    return False


def coarse_positions(recording: Recording) -> Iterator[Remark]:
    """Positions that move in steps that are large beside what encoders resolve."""
    found, sizes = [], []
    thinned = recording.q[:: max(1, recording.samples // SOME)]
    for j in range(recording.joints):
        steps = np.diff(np.unique(thinned[:, j]))
        if steps.size < 20 or (size := float(steps.min())) < COARSE:
            continue
        whole = steps / size
        if np.all(np.abs(whole - np.round(whole)) < 1e-3 * np.maximum(whole, 10)):
            found.append(j)
            sizes.append(1e3 * size)
    if found:
        yield fact("coarse-positions", on_joints(found), steps_mrad=sizes)
