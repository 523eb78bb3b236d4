"""Findings on signals: missing, odd units or signs, stuck, zero, clipped, coarse.

A signal is stuck if it repeats to the last bit for half a second while the joint's other
signals show that it has to change.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from vftcli.signals.arrays import Array, Indices, Mask, integral, runs_of
from vftcli.signals.recording import EFFORTS, Recording
from vftcli.signals.remarks import Remark, fact, on_joints, warning
from vftcli.signals.rest import HELD, NONZERO

#: Net share of work that shows an inverted effort: gravity moves energy between joints.
STRONG = -0.4
ALONE = -0.85  #: `STRONG` for a joint among sound neighbours.
#: No measurement is this large, in whatever unit, and no time. [-, s]
ABSURD, FARTHEST = (1e9, 1e18)
#: Sample times between which every recorder's lies, read in whatever unit. [s]
STEPS = (1e-13, 1e10)
SOME = 5000  #: Samples for the usual size of a signal.
#: Share of straight samples in an interpolated signal; change of slope that is none,
#: relative to it; and share of values that have to change.
STRAIGHT, BEND, MOVED = 0.6, 1e-3, 0.1
#: Two turns and a little: no joint of these arms goes further from its zero. [rad]
LARGE_ANGLE = 13.0
LARGE_CURRENT = 60.0  #: No joint of these arms draws this much; readings in mA do. [A]
#: Time, and steps, of a stuck signal's repeat; and the way of a joint that surely moves,
#: at 20 mrad/s. [s, -, rad]
LONG, MANY, WAY = 0.5, 10, 0.01
#: Ratio of a stuck stretch to nearly all other repeats of its signal.
UNUSUAL = 10.0
#: Deviation from constant acceleration of a bent speed. [rad/s]
BENT = 0.005
TRAVEL = 0.05  #: Least travel to judge a joint by its own data. [rad]
#: Steps of the positions in a finding: .02 rad/s at 100 Hz. [rad]
COARSE = 2e-4
FEW = 2000  #: Samples for a first look at a column.
ONCE = 0.2  #: Longest stretch of an effort at its limit, as a share of the log.
CLIPPED = 0.1  #: Time at its extreme of a clipped effort. [s]
#: Signals that may be stuck, and the finding then.
STUCK = {
    "q": "stuck-position",
    "dq": "stuck-velocity",
    "current": "stuck-effort",
    "torque": "stuck-effort",
}
#: Signals that may be zero throughout, and the level of the finding.
LEVELS = {"tau_ext": warning, "wrench": warning, "target_torque": fact, "dq": fact}


def unusable_findings(recording: Recording) -> Iterator[Remark]:
    """Numbers of no clock and no robot: nothing else is examined then."""
    t = recording.t
    if recording.samples < 3:
        yield warning("too-short", samples=recording.samples)
    elif abs(t).max() > FARTHEST:
        yield warning("absurd-clock", least_s=t[0], largest_s=t[-1])
    elif not STEPS[0] < recording.median_step < STEPS[1]:
        yield warning("absurd-steps", step_s=recording.median_step)
    for name in recording.signals:
        largest = abs(getattr(recording, name)).max(initial=0.0)
        if largest > ABSURD:
            yield warning("absurd-values", signal=name, largest=largest)


def signal_findings(recording: Recording) -> Iterator[Remark]:
    """Signals that are missing, of odd units or interpolated."""
    if recording.dq is None:
        yield warning("no-velocity")
    if not efforts_of(recording):
        yield warning("no-effort")
    # No radians or amperes are so large; last joints turn freely.
    largest = abs(recording.q[:, : max(1, recording.joints - 1)]).max()
    if largest > LARGE_ANGLE:
        yield warning("degrees", largest_rad=largest)
    if recording.current is not None:
        typical = np.quantile(abs(recording.current[thinly(recording, SOME)]), 0.99)
        if typical > LARGE_CURRENT:
            yield warning("milliamperes", typical_A=typical)
    if (effort := effort_of(recording)) is not None:
        middle = slice(max(0, (recording.samples - SOME) // 2), (recording.samples + SOME) // 2)
        t = recording.t[middle]
        straight, _ = bends_of(t, recording.q[middle])
        share, bends = bends_of(t, effort[1][middle])
        knots = t[1:-1][bends]
        if min(straight, share) >= STRAIGHT and len(knots) > 2:
            rate = 1 / np.median(np.diff(knots))
            yield warning("interpolated", rate_Hz=rate, logged_Hz=1 / recording.median_step)


def thinly(recording: Recording, count: int) -> slice:
    """Some `count` rows, evenly spread over a log."""
    return slice(None, None, max(1, recording.samples // count))


def bends_of(t: Array, value: Array) -> tuple[float, Mask]:
    """Share of a signal's samples (T, n) in straight motion, and bends. (T - 2,)

    The share is 0 if hardly one moves; the bends are of samples 2 to T − 1.
    """
    slope = np.diff(value, axis=0) / np.diff(t)[:, None]
    bent = abs(np.diff(slope, axis=0)) > BEND * (abs(slope[1:]) + abs(slope[:-1]))
    moves = (slope[1:] != 0) & (slope[:-1] != 0)
    enough = moves.sum() > MOVED * moves.size
    return np.mean(~bent[moves]) if enough else 0.0, (bent & moves).any(axis=1)


def effort_of(recording: Recording) -> tuple[str, Array] | None:
    """Name and values of the log's effort: torque before current."""
    efforts = dict(efforts_of(recording))
    name = "torque" if "torque" in efforts else "current"
    return (name, efforts[name]) if name in efforts else None


def inverted_effort(recording: Recording) -> Iterator[Remark]:
    """Effort of a turned sign: like friction it takes energy from a moving arm.

    Friction makes the drives put energy in; what gravity and inertia take they give back.
    """
    effort = effort_of(recording)
    if effort is None or recording.dq is None:
        return
    (name, value), rows = effort, thinly(recording, SOME)
    speed = recording.dq[rows]
    power = value[rows] * speed * np.gradient(recording.t[rows])[:, None]
    gross = abs(power).sum(axis=0)
    shares = power.sum(axis=0) / np.where(gross > 0, gross, 1.0)  # net over gross work
    travel = abs(np.diff(recording.q[rows], axis=0)).sum(axis=0)
    # In one direction gravity alone can take or give work.
    reversing = (speed.max(axis=0) > NONZERO) & (speed.min(axis=0) < -NONZERO)
    shares[(travel < 0.3) | ~reversing | (gross == 0)] = np.nan
    turned = shares < STRONG
    most = turned.sum() >= max(2, round(0.6 * np.isfinite(shares).sum()))
    if not most:  # a few joints only: nearly all their work
        turned = shares < ALONE
    if not turned.any():
        return
    first = turned.argmax()
    forward = value[recording.dq[:, first] > NONZERO, first]
    unit, column = ("A", "current") if name == "current" else ("N·m", "tau")
    yield warning(
        "effort-sign-by-work" if most else "effort-sign-of-some",
        on_joints(turned),
        signal=name,
        shares_percent=100 * shares[turned],
        mean=forward.mean() if forward.size else np.nan,
        unit=unit,
        first=first + 1,
        column=column,
        width=recording.joints,
    )


def stuck_findings(recording: Recording) -> Iterator[Remark]:
    """Joints without motion, and signals that hold, are zero, clipped or coarse."""
    t, travel = recording.t, travel_of(recording)
    still = travel < HELD
    if still.all():
        yield fact("at-rest", travel_mrad=1e3 * travel.max())
    elif still.any():
        yield fact("still-joints" if still.sum() > 1 else "still-joint", on_joints(still))
    for name, code in STUCK.items():
        if stretches := [(t[b] - t[a], t[a], j) for j, a, b in stuck_stretches(recording, name)]:
            longest, begun, _ = max(stretches, key=lambda found: found[0])
            where = on_joints(sorted({j for *_, j in stretches}))
            yield warning(code, where, signal=name, longest_s=longest, at_s=begun)
    yield from zero_signals(recording)
    least = max(10, round(CLIPPED / recording.median_step))
    for name, value in efforts_of(recording):
        joints, q = range(recording.joints), recording.q
        clipped = {j for j in joints if is_clipped(value[:, j], q[:, j], least)}
        clipped -= {j for j, *_ in stuck_stretches(recording, name)} if clipped else set()
        if clipped:
            yield warning("saturation", on_joints(sorted(clipped)), signal=name)
    yield from coarse_positions(recording)


def efforts_of(recording: Recording) -> list[tuple[str, Array]]:
    """Names and values of all efforts of a log."""
    return [(name, x) for name in EFFORTS if (x := getattr(recording, name)) is not None]


def travel_of(recording: Recording) -> Array:
    """Travel of each joint in a part of the samples. (n,) [rad]"""
    return np.asarray(np.ptp(recording.q[thinly(recording, FEW)], axis=0))


def repeated_rows(recording: Recording, names: Iterable[str]) -> Indices:
    """Rows before those that repeat all of some signals. (K,)"""
    there = [value for name in names if (value := getattr(recording, name)) is not None]
    # The first column excludes most rows.
    rows = np.flatnonzero(there[0][1:, 0] == there[0][:-1, 0])
    for value in there:
        rows = rows[(value[rows + 1] == value[rows]).all(axis=1)]
    return rows


def stuck_stretches(recording: Recording, name: str) -> Iterator[tuple[int, int, int]]:
    """Joint, first and last sample where a signal wrongly repeats itself."""
    t, dq, value = recording.t, recording.dq, getattr(recording, name)
    if dq is None or value is None:
        return
    for j, first, last in long_repeats(recording, name):
        rows, column = slice(first, last + 1), value[:, j]
        time, turned, speed = t[rows], recording.q[rows, j], dq[rows, j]
        way = integral(time, speed)
        if name == "q":
            steps = abs(np.diff(column))
            least = 3 * steps[steps > 0].min() if steps.any() else 0.0
            stuck = farthest(time, way) > max(WAY, least)
        elif name == "dq":
            stuck = farthest(time, turned - way) > WAY
        else:
            since = time - time.mean()
            slope = since @ speed / (since @ since)
            # An effort follows an acceleration that changes.
            bent = np.std(speed - slope * since) > max(BENT, 0.03 * np.ptp(speed))
            varies = column.any()  # zero throughout is a finding of its own
            stuck = (
                farthest(time, turned) > WAY and bent and not is_extreme(column, rows) and varies
            )
        if stuck:
            yield j, first, last


def long_repeats(recording: Recording, name: str) -> Iterator[tuple[int, int, int]]:
    """Long repeats of one joint's signal while its others change."""
    t, value = recording.t, getattr(recording, name)
    same = value[1:] == value[:-1]
    signals = (getattr(recording, n) for n in ("q", "dq", *EFFORTS) if n != name)
    others = [x for x in signals if x is not None]
    for j in range(recording.joints):
        # A run of unchanged steps ends with the sample behind it.
        first, last = np.array(runs_of(same[:, j]), int).reshape(-1, 2).T
        lengths = last - first
        long = (t[last] - t[first] >= LONG) & (lengths >= MANY)
        # Repeats of a coarse signal vary in length.
        usual = np.sort(lengths[~long])
        least = UNUSUAL * usual[int(0.95 * len(usual))] if usual.size else 0.0
        for a, b in zip(first[long].tolist(), last[long].tolist(), strict=True):
            changes = (np.mean(np.diff(x[a : b + 1, j]) != 0) > 0.5 for x in others)
            if b - a >= least and any(changes):
                yield j, a, b


def farthest(t: Array, way: Array) -> float:
    """The longest way within half a second. [rad]"""
    behind = t.searchsorted(t - LONG * (1 + 1e-9))
    return float(abs(way - way[behind]).max())


def is_extreme(value: Array, rows: slice) -> bool:
    """Whether a stretch is at the extreme of a varying effort: saturation.

    Not so one that is long and the only time at its value: the effort stays there.
    """
    stretch, low, high = value[rows], value.min(), value.max()
    at = stretch[0]
    if len(stretch) > ONCE * len(value) + 1 and np.count_nonzero(value == at) == len(stretch):
        return False
    return low < high and at in (low, high) and abs(at) >= 0.5 * (high - low)


def zero_signals(recording: Recording) -> Iterator[Remark]:
    """Signals that are zero in every sample, so were not measured."""
    zeros = {}
    for name in recording.signals:
        value = getattr(recording, name)
        # Nearly every column is nonzero among its first samples.
        zeros[name] = zero = ~value[:FEW].any(axis=0)
        if zero.any():
            zero &= ~value.any(axis=0)
    for name, value in efforts_of(recording):
        zero = zeros[name]
        # Sensors are rougher than motion: steps of white noise differ by √3 times.
        steps = np.diff(value[:, ~zero], axis=0)
        rough = np.sum(np.diff(steps, axis=0) ** 2, axis=0) > 0.5 * np.sum(steps**2, axis=0)
        measured = zero.all() or rough.mean() > 0.5
        odd = zero if measured else zero & (travel_of(recording) >= TRAVEL)
        if odd.any():
            yield warning("zero-effort", on_joints(odd), signal=name)
    for name, level in LEVELS.items():
        if name in zeros and zeros[name].all():
            others = name == "wrench" and not zeros.get("tau_ext", np.True_).all()
            yield level(f"zero-{name.replace('_', '-')}{'-beside-tau-ext' * others}")


def is_clipped(value: Array, position: Array, least: int) -> bool:
    """Whether an effort (T,) stays at its extreme for `least` samples of motion."""
    size = np.ptp(value)
    for up in (value, -value):
        extreme = up.max()
        at = up == extreme
        count = np.count_nonzero(at)
        # A drive saturates far from zero.
        if size == 0 or abs(extreme) < 0.5 * size or count < least:
            continue
        # A smooth effort of coarse resolution is wide a level below too.
        if np.count_nonzero(up == up[~at].max()) > 0.2 * count:
            continue
        long = (position[a:b] for a, b in runs_of(at) if b - a >= least)
        if any(np.ptp(way) > HELD for way in long):
            return True
    return False


def coarse_positions(recording: Recording) -> Iterator[Remark]:
    """Positions in steps far above the resolution of encoders."""
    sizes = {}
    for j, column in enumerate(recording.q[thinly(recording, FEW)].T):
        steps = np.diff(np.unique(column))
        if steps.size < 20 or (size := steps.min()) < COARSE:
            continue
        whole = steps / size
        if np.all(abs(whole - whole.round()) < 1e-3 * np.maximum(whole, 10)):
            sizes[j] = 1e3 * size
    if sizes:
        yield fact("coarse-positions", on_joints(sizes), steps_mrad=list(sizes.values()))
