"""Findings on signals that hold, are zero, reach a limit or move coarsely.

A signal is stuck where it repeats itself to the last bit for half a second while the joint's other
signals show that it has to change.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from vftcli.doctor.findings import on_joints
from vftcli.signals.arrays import Array, Indices, Mask
from vftcli.signals.recording import EFFORTS, Recording
from vftcli.signals.remarks import Remark, fact, warning
from vftcli.signals.rest import HELD
from vftcli.signals.series import runs_of

LONG = 0.5  #: Time for which a signal has to repeat itself. [s]
MANY = 10  #: Steps for which it has to.
#: Way within that time by which a joint surely moves, at 20 mrad/s. [rad]
WAY = 0.01
#: A signal's stuck stretch is this many times as long as nearly all its other repeats.
UNUSUAL = 10.0
#: Deviation of a speed from a constant acceleration, beyond which its effort changes. [rad/s]
BENT = 0.005
TRAVEL = 0.05  #: Travel from which a joint's own data tell anything. [rad]
#: Steps of the positions that are worth telling: .02 rad/s at 100 Hz. [rad]
COARSE = 2e-4
SOME = 2000  #: Samples that tell most of what a column is like.
ONCE = 0.2  #: Share of a log that no effort stays at its limit in one go.
CLIPPED = 0.1  #: Time at the very extreme from which an effort is clipped. [s]
#: Signals that may be stuck, and the finding then.
STUCK = {
    "q": "stuck-position",
    "dq": "stuck-velocity",
    "current": "stuck-effort",
    "torque": "stuck-effort",
}


def stuck_findings(recording: Recording) -> Iterator[Remark]:
    """Joints without motion, and signals that hold, are zero, clipped or coarse."""
    t, travel = recording.t, travel_of(recording)
    still = np.flatnonzero(travel < HELD)
    if still.size == recording.joints:
        yield fact("at-rest", travel_mrad=1e3 * float(travel.max()))
    elif still.size:
        yield fact("still-joints" if still.size > 1 else "still-joint", on_joints(still))
    for name, code in STUCK.items():
        if stretches := stuck_stretches(recording, name):
            _, first, last = max(stretches, key=lambda found: t[found[2]] - t[found[1]])
            joints = sorted({joint for joint, _, _ in stretches})
            values = {"longest_s": float(t[last] - t[first]), "at_s": float(t[first])}
            yield warning(code, on_joints(joints), signal=name, **values)
    yield from zero_signals(recording)
    yield from saturated_effort(recording)
    yield from coarse_positions(recording)


def travel_of(recording: Recording) -> Array:
    """Travel of each joint in a part of the samples. (n,) [rad]"""
    return np.asarray(np.ptp(recording.q[:: max(1, recording.samples // SOME)], axis=0))


def repeated_rows(recording: Recording, names: Iterable[str]) -> Indices:
    """Rows before those that repeat all of some signals, positions among them. (K,)"""
    # One column rules most rows out, and the others are compared in what is left.
    rows = np.flatnonzero(recording.q[1:, 0] == recording.q[:-1, 0])
    for name in names:
        if (value := getattr(recording, name)) is not None:
            rows = rows[(value[rows + 1] == value[rows]).all(axis=1)]
    return rows


def stuck_joints(recording: Recording, name: str) -> list[int]:
    """Joints of which a signal is stuck somewhere."""
    return sorted({joint for joint, _, _ in stuck_stretches(recording, name)})


def stuck_stretches(recording: Recording, name: str) -> list[tuple[int, int, int]]:
    """Joint, first and last sample where a signal wrongly repeats itself."""
    t, dq, value = recording.t, recording.dq, getattr(recording, name)
    if dq is None or value is None or recording.samples < 3:
        return []
    found = []
    for j, first, last in long_repeats(recording, name):
        rows, column = slice(first, last + 1), value[:, j]
        time, turned, speed = t[rows], recording.q[rows, j], dq[rows, j]
        way = np.append(0.0, np.cumsum((speed[1:] + speed[:-1]) / 2 * np.diff(time)))
        if name == "q":
            steps = np.abs(np.diff(column))
            least = 3 * np.min(steps[steps > 0]) if steps.any() else 0.0
            stuck = farthest(time, way) > max(WAY, least)
        elif name == "dq":
            stuck = farthest(time, turned - way) > WAY
        else:
            stuck = (
                farthest(time, turned) > WAY
                and is_bent(time, speed)
                and not is_extreme(column, rows)
                and bool(np.any(column))  # zero throughout is a finding of its own
            )
        if stuck:
            found.append((j, first, last))
    return found


def long_repeats(recording: Recording, name: str) -> Iterator[tuple[int, int, int]]:
    """Long repeats of one joint's signal while its others change, as above."""
    t, value = recording.t, getattr(recording, name)
    same = value[1:] == value[:-1]
    names = [n for n in ("q", "dq", *EFFORTS) if n != name]
    others = [x for n in names if (x := getattr(recording, n)) is not None]
    for j in range(value.shape[1]):
        # A run of steps that change nothing ends with the sample behind its last step.
        first, last = np.array(runs_of(same[:, j]), dtype=np.intp).reshape(-1, 2).T
        lengths = last - first
        long = (t[last] - t[first] >= LONG) & (lengths >= MANY)
        if not long.any():
            continue
        # Repeats of a coarse resolution come in all lengths, those of a stuck signal stand out.
        usual = np.sort(lengths[~long])
        least = UNUSUAL * usual[int(0.95 * len(usual))] if usual.size else 0.0
        for a, b in zip(first[long].tolist(), last[long].tolist(), strict=True):
            changes = (np.mean(np.diff(x[a : b + 1, j]) != 0) > 0.5 for x in others)
            if b - a >= least and any(changes):
                yield j, a, b


def farthest(t: Array, way: Array) -> float:
    """The longest way within half a second. [rad]"""
    behind = np.searchsorted(t, t - LONG * (1 + 1e-9))
    return float(np.max(np.abs(way - way[behind])))


def is_bent(t: Array, speed: Array) -> bool:
    """Whether a speed is no straight line of time."""
    time = t - t.mean()
    slope = time @ speed / (time @ time)
    return bool(np.std(speed - slope * time) > max(BENT, 0.03 * np.ptp(speed)))


def is_extreme(value: Array, rows: slice) -> bool:
    """Whether a stretch is at the extreme of a varying effort: saturation.

    One that is long and the only time at its value is none: the effort came to stand there.
    """
    stretch, low, high = value[rows], value.min(), value.max()
    at = stretch[0]
    if len(stretch) > ONCE * len(value) + 1 and np.count_nonzero(value == at) == len(stretch):
        return False
    return bool(low < high and at in (low, high) and abs(at) >= 0.5 * (high - low))


def zero_signals(recording: Recording) -> Iterator[Remark]:
    """Signals that are zero in every sample, so were not measured."""
    zeros = {name: zero_columns(getattr(recording, name)) for name in recording.signals}
    for name in EFFORTS:
        # Without noise a joint that never moves may need no torque at all.
        if name in zeros and (zero := zeros[name]).any():
            measured = zero.all() or is_noisy(getattr(recording, name)[:, ~zero])
            odd = zero if measured else zero & (travel_of(recording) >= TRAVEL)
            if odd.any():
                yield warning("zero-effort", on_joints(np.flatnonzero(odd)), signal=name)
    for name in ("tau_ext", "wrench", "target_torque", "dq"):
        if name in zeros and zeros[name].all():
            level = fact if name in {"target_torque", "dq"} else warning
            others = "tau_ext" in zeros and not zeros["tau_ext"].all()
            beside = "-beside-tau-ext" if name == "wrench" and others else ""
            yield level(f"zero-{name.replace('_', '-')}{beside}")


def zero_columns(value: Array) -> Mask:
    """Whether each column is zero in every sample. (n,)"""
    # Nearly every column has another number among its first samples.
    zero = np.asarray(~value[:SOME].any(axis=0))
    return zero & ~value.any(axis=0) if zero.any() else zero


def is_noisy(value: Array) -> bool:
    """Whether most columns of a signal are rougher than motion: they were measured.

    Steps of white noise differ by √3 times their own size.
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
            if clipped and (joints := sorted(clipped - set(stuck_joints(recording, name)))):
                yield warning("saturation", on_joints(joints), signal=name)


def is_clipped(value: Array, position: Array, least: int = 10) -> bool:
    """Whether an effort stays exactly at its extreme while the joint moves.

    Args:
        value: An effort that may vary. (T,)
        position: The joint's position: a joint that is held needs one effort. (T,) [rad]
        least: Samples in a row.
    """
    size = np.ptp(value)
    for up in (value, -value):
        extreme = up.max()
        at = up == extreme
        count = np.count_nonzero(at)
        # A drive saturates far from zero; one that often repeats a small value rests.
        if size == 0 or abs(extreme) < 0.5 * size or count < least:
            continue
        # The rounded top of a smooth effort of coarse resolution is wide on the next level too.
        if np.count_nonzero(up == np.max(up[~at])) > 0.2 * count:
            continue
        long = (position[a:b] for a, b in runs_of(at) if b - a >= least)
        if any(np.ptp(way) > HELD for way in long):
            return True
    return False


def coarse_positions(recording: Recording) -> Iterator[Remark]:
    """Positions that move in steps that are large beside what encoders resolve."""
    sizes = {}
    thinned = recording.q[:: max(1, recording.samples // SOME)]
    for j in range(recording.joints):
        steps = np.diff(np.unique(thinned[:, j]))
        if steps.size < 20 or (size := float(steps.min())) < COARSE:
            continue
        whole = steps / size
        if np.all(np.abs(whole - np.round(whole)) < 1e-3 * np.maximum(whole, 10)):
            sizes[j] = 1e3 * size
    if sizes:
        yield fact("coarse-positions", on_joints(sizes), steps_mrad=list(sizes.values()))
