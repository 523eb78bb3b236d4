"""Samples that no arm makes, cut out of a log like a gap in its clock.

Each rule looks at single samples or spans, within the arm's limits. Where two recordings
meet the gap is too long for a filter to run across.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.doctor.signals import WAY, repeated_rows, stuck_stretches, travel_of
from vftcli.doctor.velocity import GAP_STEPS
from vftcli.robots.robot import Robot
from vftcli.robots.terms import effort_name, gravity_torque
from vftcli.signals.arrays import Array, Indices, Mask, covered, median, runs_of, summed
from vftcli.signals.recording import EFFORTS, Cut, Recording
from vftcli.signals.remarks import Remark, Where, fact, on_joints, warning
from vftcli.signals.repairs import derived_velocity
from vftcli.signals.rest import REST

#: Multiple of its largest torque that no drive gives. [1]
BEYOND = 1.5
#: Share of the joint's largest torque, and robust deviations of noise, between a bad
#: sample and its neighbours. [1, -]
AWAY, FAR = 0.5, 25.0
FAST = 0.25  #: `AWAY` for velocities, by the joint's largest speed. [1]
#: Most such samples in a row, and their time; more may be a blow. [-, s]
FEW, BRIEF = 3, 0.03
#: Window of velocities against positions [s], least mean difference and jump [rad/s], and
#: largest lag of a sound velocity [s].
WHILE, ASTRAY, JUMP, LAG = 0.04, 0.03, 0.08, 0.02
#: Bend of a joint's speed across such samples that shows a blow. [rad/s]
BLOW = 0.05
#: Share of a joint's largest torque from which no effort jumps to exactly 0. [1]
ZERO = 0.05
SLIPPED = 5e-3  #: Least jump of position beyond the velocities. [rad]
#: A jump by whole turns, at most so many, within this: a new count. [rad, -, rad]
TURN, TURNS, NEAR = 2 * np.pi, 3, 0.1
#: Error of a stamp: a lost or late sample is no jump. [s]
LATE = 0.01
APART = 0.25  #: Time cut on both sides where two recordings meet. [s]
#: Least time of repeated rows beyond late packets, and ratio to usual repeats. [s, -]
FROZEN, UNUSUAL = 0.25, 10
#: Most of gravity's torque that drives carry on brakes, and least without brakes. [1]
LET_GO, HELD = 0.2, 0.5
#: Windows of that test, and its least gravity torque. [s, N·m]
WEIGHED, HEAVY = 0.5, 10.0
#: Share of a log from which bad samples, and bad spans, are normal for it. [1]
SHARE, MOST = 0.05, 0.5


class Bad(NamedTuple):
    """Bad samples by one rule."""

    code: str  #: The finding.
    samples: Mask  #: The samples, joint by joint or of all. (T, n) or (T, 1)
    #: By how much, in the unit of the finding's words; None without one. (T, n)
    sizes: Array | None = None
    most: float = SHARE  #: Most of the log to cut for it. [1]


#: Sample before each change of position (K,), sizes [rad] and jumps (K, n).
Slips = tuple[Indices, Array, Mask]


def without_bad_samples(recording: Recording, robot: Robot) -> Recording:
    """The recording less impossible samples, or the log itself."""
    if recording.joints != robot.joints or recording.dq is None or recording.samples < 20:
        return recording
    log = without_turns(recording)
    rows = np.zeros(log.samples, bool)
    cuts = list[Cut]()
    for bad in rules(log, robot):
        samples = np.broadcast_to(bad.samples, log.q.shape) & ~rows[:, None]
        fresh = np.any(samples, axis=1)
        if not 0 < np.mean(fresh) <= bad.most:
            continue
        rows |= fresh
        for start, stop in runs_of(fresh):
            here, (first, last) = samples[start:stop], log.t[[start, stop - 1]].tolist()
            joints, size = on_joints(np.any(here, axis=0)).joints, last - first
            if bad.sizes is not None:
                size = abs(bad.sizes[start:stop][here]).max()
            cuts.append(Cut(bad.code, first, last, stop - start, joints, size))
    if not cuts or np.count_nonzero(~rows) < 3:
        return log
    left = log.without(rows, cuts)
    # A filter has spread what is cut out.
    return replace(left, dq=derived_velocity(left)[0]) if left.source.derived else left


def cut_findings(recording: Recording) -> Iterator[Remark]:
    """One warning a rule on its cuts, with their place and the largest."""
    cuts = recording.source.cuts
    for code in dict.fromkeys(cut.code for cut in cuts):
        some = [cut for cut in cuts if cut.code == code]
        worst = max(some, key=lambda cut: cut.size)
        joints = tuple(sorted({joint for cut in some for joint in cut.joints}))
        yield warning(
            code,
            Where(joints=joints, span=(some[0].start, some[-1].stop)),
            rows=sum(cut.rows for cut in some),
            spans=len(some),
            at_s=0.5 * (worst.start + worst.stop),
            from_s=worst.start,
            until_s=worst.stop,
            size=worst.size,
        )


def rules(recording: Recording, robot: Robot) -> Iterator[Bad]:
    """Bad samples of a log, rule by rule."""
    dq, step = recording.require("dq"), recording.median_step
    frozen = frozen_rows(recording, ("q", "dq", *EFFORTS))
    yield Bad("frozen-rows", frozen[:, None], None, MOST)
    held = stuck_samples(recording, "q")
    yield Bad("frozen-position", held, None, MOST)
    slips = slips_of(recording)
    yield from position_jumps(recording, frozen | held.any(axis=1), slips)
    fast = FAST * np.nan_to_num(robot.limits.qd_max, nan=2.0)
    alone = isolated(dq, fast, step) | contradicted_velocities(recording, slips)
    yield Bad("isolated-velocity", alone, dq)
    name = effort_name(recording, robot)
    effort: Array | None = getattr(recording, name)
    constant = np.ones(robot.joints) if name != "current" else robot.torque_constant
    if effort is None or constant is None:
        return
    stuck = stuck_samples(recording, name)
    for start, stop in runs_of(frozen_rows(recording, (name,))):
        stuck[start:stop] |= np.ptp(recording.q[start:stop], axis=0).max() > WAY
    # Of one joint a finding is enough; of most nothing can be estimated.
    moving = np.count_nonzero(travel_of(recording) > WAY)
    most = stuck.sum(axis=1) > moving / 2
    yield Bad("frozen-effort", stuck & most[:, None], None, MOST)
    torque, limit = effort * constant, np.nan_to_num(robot.limits.tau_max, nan=np.inf)
    beyond = abs(torque) > BEYOND * limit
    yield Bad("effort-beyond-drive", beyond, torque)
    alone = isolated(torque, AWAY * limit, step) & ~beyond
    yield Bad(
        "isolated-effort", alone & ~blows(dq, np.asarray(alone.any(axis=1)))[:, None], torque
    )
    yield Bad("zero-burst", zero_bursts(torque, ZERO * limit))
    if name != "torque_without_gravity":
        yield from braked(recording, robot, torque)


def isolated(x: Array, away: Array, step: float) -> Mask:
    """Samples (T, n), few in a row, over `away` (n,) from the median of nine."""
    found = np.zeros(x.shape, bool)
    for j, column in enumerate(x.T):
        change = abs(np.diff(column))
        # A far sample needs a step of half the distance.
        steps = np.flatnonzero(change > 0.5 * away[j])
        if not steps.size:
            continue
        near = np.unique(np.clip(steps[:, None] + np.arange(1 - FEW, FEW + 1), 0, len(x) - 1))
        around = np.clip(near[:, None] + np.arange(-4, 5), 0, len(x) - 1)
        noise = FAR * median(change) / (0.6745 * np.sqrt(2.0))
        off = abs(column[near] - np.median(column[around], axis=1))
        found[near[off > max(away[j], noise)], j] = True
        for start, stop in runs_of(found[:, j]):
            if stop - start > FEW or (stop - start) * step > BRIEF:
                found[start:stop, j] = False
    return found


def contradicted_velocities(recording: Recording, slips: Slips) -> Mask:
    """Velocities that jump where positions do not. (T, n)"""
    t, q, step = recording.t, recording.q, recording.median_step
    dq, found = recording.require("dq"), np.zeros(q.shape, bool)
    width = min(max(round(WHILE / step), 4), (len(t) - 1) // 3)
    at, _, jumps = slips
    span = t[width:] - t[:-width]
    late = abs(span - width * step)
    for j in np.flatnonzero([abs(np.diff(column)).max() > JUMP for column in dq.T]):
        moved = (q[width:, j] - q[:-width, j]) / span
        total = summed(0.5 * (dq[1:, j] + dq[:-1, j]) * np.diff(t))
        off = abs((total[width:] - total[:-width]) / span - moved)
        # Stamps may be off by a step, and a velocity late.
        around = np.pad(moved, width, mode="edge")
        turn = abs(around[2 * width :] - around[: -2 * width])
        slack = ASTRAY + (abs(moved) * (step + late) + LAG * turn) / span
        bad = off > np.maximum(slack, FAR / 0.6745 * median(off))
        bad &= late < 0.5 * width * step
        for k in at[jumps[:, j]]:
            bad[max(k - width, 0) : k + 1] = False
        for start, stop in runs_of(bad):
            some = slice(start, stop + width)
            if abs(np.diff(dq[some, j])).max() > JUMP:
                middle = t[width // 2 :][: len(moved)]
                rest = abs(dq[some, j] - np.interp(t[some], middle, moved))
                found[some, j] = rest > 0.5 * rest.max()
    return found


def blows(dq: Array, rows: Mask) -> Mask:
    """Samples across which a joint's speed bends as in a blow. (T,)"""
    found = np.zeros(len(dq), bool)
    for start, stop in runs_of(rows):
        before, behind = max(start - 1, 0), min(stop, len(dq) - 1)
        trend = (
            dq[before] - dq[max(before - 2, 0)] + dq[min(behind + 2, len(dq) - 1)] - dq[behind]
        )
        found[start:stop] = abs(dq[behind] - dq[before] - 0.5 * trend).max() > BLOW
    return found


def zero_bursts(torque: Array, least: Array) -> Mask:
    """Efforts of exactly 0 between two that are not small. (T, n)

    Of one joint three samples in a row, of all joints at once any.
    """
    zero = torque == 0.0
    every, found = zero.all(axis=1), np.zeros(zero.shape, bool)
    for j in np.flatnonzero(zero.any(axis=0)):
        for start, stop in runs_of(zero[:, j]):
            enough = stop - start >= FEW or every[start:stop].all()
            if start and stop < len(zero) and enough:
                found[start:stop, j] = abs(torque[[start - 1, stop], j]).min() > least[j]
    return found


def stuck_samples(recording: Recording, name: str) -> Mask:
    """Samples in which a signal wrongly repeats. (T, n)"""
    found = np.zeros(recording.q.shape, bool)
    for j, first, last in stuck_stretches(recording, name):
        found[first + 1 : last + 1, j] = True
    return found


def frozen_rows(recording: Recording, names: Sequence[str]) -> Mask:
    """Rows of a moving arm that repeat all values of some signals. (T,)"""
    t, dq = recording.t, recording.require("dq")
    same = np.zeros(recording.samples - 1, bool)
    same[repeated_rows(recording, names)] = True
    first, last = np.array(runs_of(same), int).reshape(-1, 2).T
    lengths, long = last - first, t[last] - t[first] >= FROZEN
    usual = np.median(lengths[~long]) if not long.all() else 1.0
    moves = abs(dq[first]).max(axis=1) > REST
    frozen = long & (lengths >= UNUSUAL * usual) & moves
    return covered(list(zip(first[frozen] + 1, last[frozen] + 1, strict=True)), len(t))


def slips_of(recording: Recording) -> Slips:
    """Changes of position beyond the velocities; stamps may be off."""
    q, dq = recording.q, recording.require("dq")
    steps, usual = np.diff(recording.t), recording.median_step
    large, noise = np.zeros(len(steps), bool), np.zeros(recording.joints)
    for j in range(recording.joints):  # all joints of a long log need too much room
        change = np.diff(q[:, j])
        fastest = abs(dq[:, j]).max() * GAP_STEPS * usual
        if abs(change).max() + fastest > SLIPPED:
            slip = abs(change - 0.5 * (dq[1:, j] + dq[:-1, j]) * steps)
            large |= slip > SLIPPED
            noise[j] = FAR / 0.6745 * median(slip)
    at = np.flatnonzero(large & (steps <= GAP_STEPS * usual))
    mean, dt = 0.5 * (dq[at + 1] + dq[at]), steps[at, None]
    slips = q[at + 1] - q[at] - mean * dt
    around = np.clip(at[:, None] + np.arange(-1, 2), 0, len(steps) - 1)
    off = abs(steps[around] - usual).max(axis=1, keepdims=True)
    slack = 0.5 * abs(dq[at + 1] - dq[at]) * dt + abs(mean) * np.maximum(off + usual, LATE)
    return at, slips, abs(slips) > np.maximum(SLIPPED + slack, noise)


def without_turns(recording: Recording) -> Recording:
    """The recording with whole turns unwrapped, and a remark on them."""
    steps, sizes, jumps = slips_of(recording)
    turns = np.round(sizes / TURN)
    whole = jumps & (abs(sizes - TURN * turns) < NEAR)
    whole &= (turns != 0) & (abs(turns) <= TURNS)
    if not whole.any() or len(steps) > SHARE * recording.samples:
        return recording
    shift = np.zeros(recording.q.shape)
    shift[steps + 1] = TURN * turns * whole
    first = recording.t[steps[whole.any(axis=1).argmax()] + 1]
    remark = fact("turn-unwrapped", on_joints(np.any(whole, axis=0)), at_s=first)
    source = replace(recording.source, remarks=(*recording.source.remarks, remark))
    return replace(recording, q=recording.q - shift.cumsum(axis=0), source=source)


def position_jumps(recording: Recording, frozen: Mask, changes: Slips) -> Iterator[Bad]:
    """Rows off the motion, and the time around where recordings meet."""
    steps, slips, jumps = changes
    real = jumps.any(axis=1) & ~(frozen[steps] | frozen[steps + 1])
    steps, slips, jumps = steps[real], slips[real], jumps[real]
    if not steps.size or steps.size > max(2.0, SHARE * recording.samples):
        return
    t, q, dq = recording.t, recording.q, recording.require("dq")
    rows, meets = np.zeros((2, *q.shape), bool)
    sizes = np.zeros(q.shape)
    for group in np.split(np.arange(len(steps)), np.flatnonzero(np.diff(steps) > FEW) + 1):
        first, last = steps[group[0]], steps[group[-1]] + 1
        joints, size = jumps[group].any(axis=0), abs(slips[group]).max(axis=0)
        lasts, speeds = t[last] - t[first], dq[[first, last]]
        over = q[last] - q[first] - speeds.mean(axis=0) * lasts
        slack = SLIPPED + np.ptp(speeds, axis=0) * lasts
        slack += abs(speeds).sum(axis=0) * max(recording.median_step, LATE)
        if last - first > 1 and (abs(over) < slack)[joints].all():
            span, into = slice(first + 1, last), rows  # a few bad rows
        else:
            span, into = slice(*t.searchsorted([t[first] - APART, t[last] + APART])), meets
        into[span, joints], sizes[span, joints] = True, size[joints]
    yield Bad("position-slip", rows, sizes)
    yield Bad("position-jump", meets, sizes, MOST)


def braked(recording: Recording, robot: Robot, torque: Array) -> Iterator[Bad]:
    """Spans of rest in which the drives do not carry the arm."""
    length = max(2, round(WEIGHED / recording.median_step))
    first = np.arange(0, recording.samples - length, length)
    if first.size < 3:
        return
    gravity = gravity_torque(robot, recording.q[first + length // 2])
    weight = np.sum(gravity**2, axis=1)
    rows = slice(len(first) * length)
    given = torque[rows].reshape(len(first), length, -1).mean(axis=1)
    share = np.sum(given * gravity, axis=1) / np.maximum(weight, 1e-12)
    speed = abs(recording.require("dq")[rows]).reshape(len(first), -1).max(axis=1)
    heavy = weight > HEAVY**2
    free = heavy & (speed < REST) & (abs(share) < LET_GO)
    if not free.any() or np.count_nonzero(heavy & (share > HELD)) <= np.count_nonzero(free):
        return
    # The drives release and grip in the windows beside.
    spans = [(start, start + length) for start in first[free]]
    yield Bad("brakes", covered(spans, recording.samples, length)[:, None], None, MOST)
