"""Samples that no arm can have made: they are cut out of a log like a gap in its clock.

Each rule looks at single samples or spans, never at the log as a whole, and its limits are the
arm's own. Every consumer knows gaps. Where two recordings meet the gap is made so long that no
filter runs across.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.robots.drive import effort_name
from vftcli.robots.kernels import momentum_terms
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array, Indices, Mask, median
from vftcli.signals.errors import ExaminationError
from vftcli.signals.intervals import runs_of
from vftcli.signals.names import EFFORTS
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, Where, fact, warning
from vftcli.signals.rest import REST
from vftcli.signals.source import Cut

#: Times its largest torque that no drive gives: the slack is that of drive constants. [1]
BEYOND = 1.5
#: A sample that differs from its neighbours by this share of the joint's largest torque, and by so
#: many robust deviations of their noise, is none of the arm's. [1, -]
AWAY, FAR = 0.5, 25.0
FAST = 0.25  #: The same for velocities: share of the joint's largest speed. [1]
#: Such samples come at most so many in a row, within so long; more may be a blow. [-, s]
FEW, BRIEF = 3, 0.03
#: Bend of a joint's speed across such samples that shows a blow: the arm felt it. [rad/s]
BLOW = 0.05
#: Share of a joint's largest torque from which its effort does not jump to exactly 0. [1]
ZERO = 0.05
SLIPPED = 5e-3  #: Change of position beyond what the velocities say that is a jump. [rad]
#: A jump by whole turns, up to so many, within this much: a count began anew. [rad, -, rad]
TURN, TURNS, NEAR = 2 * np.pi, 3, 0.1
#: A stamp may be off by so much: a sample that a recorder lost or held back is no jump. [s]
LATE = 0.01
APART = 0.25  #: Time that is cut on both sides of where two recordings meet. [s]
#: Time for which rows that all repeat one another are no late packets, and how many times as many
#: rows they are as the log's usual repeats. [s, -]
FROZEN, UNUSUAL = 0.25, 10
GAP_STEPS = 4.0  #: A step of more than this many usual ones is a gap: what lies in it is not known.
#: Share of gravity's torque that the drives of an arm on its brakes carry at most, and that they
#: carry at least without. [1]
LET_GO, HELD = 0.2, 0.5
#: Windows in which that is weighed, and gravity's torque from which on it can be. [s, N·m]
WEIGHED, HEAVY = 0.5, 10.0
#: Share of a log from which on bad samples, and bad spans, are what the log is like. [1]
SHARE, MOST = 0.05, 0.5


class Bad(NamedTuple):
    """What one rule finds."""

    code: str  #: The finding.
    samples: Mask  #: The samples, joint by joint. (T, n)
    #: By how much, in the unit of the finding's words; None where it has none. (T, n)
    sizes: Array | None = None
    most: float = SHARE  #: Share of the log that may be cut for it. [1]


def without_bad_samples(recording: Recording, robot: Robot) -> Recording:
    """The recording less what no arm can have made; the log itself where it holds none of it."""
    if recording.joints != robot.joints or recording.dq is None or recording.samples < 20:
        return recording
    log = without_turns(recording)
    rows = np.zeros(log.samples, dtype=bool)
    cuts = list[Cut]()
    for bad in rules(log, robot):
        fresh = bad.samples & ~rows[:, None]
        if 0 < np.mean(fresh.any(axis=1)) <= bad.most:
            cuts += cuts_of(log.t, bad._replace(samples=fresh))
            rows |= fresh.any(axis=1)
    kept = log.without(rows, cuts) if cuts and np.count_nonzero(~rows) > 2 else log
    if recording.long is None:
        return kept
    return kept.changed(lambda: lambda block: sound_block(block, robot))


def sound_block(block: Recording, robot: Robot) -> Recording:
    """A block of a long log as it is."""
    sound = without_bad_samples(block, robot)
    if sound is block:
        return block
    found = next(iter((*cut_findings(sound), *reversed(sound.source.remarks))))
    raise ExaminationError(
        f"{block.name}: {found}. A log that is read in blocks cannot be mended: leave out "
        "--causal, or leave that part out with --interval."
    )


def cut_findings(recording: Recording) -> Iterator[Remark]:
    """One warning a rule on what was cut out of a log, with the place and the largest of it."""
    cuts = recording.source.cuts
    for code in dict.fromkeys(cut.code for cut in cuts):
        some = [cut for cut in cuts if cut.code == code]
        worst = max(some, key=lambda cut: cut.size)
        joints = sorted({joint for cut in some for joint in cut.joints})
        where = Where(recording.name, tuple(joints), (some[0].start, some[-1].stop))
        yield warning(
            code,
            where._replace(about=""),
            rows=sum(cut.rows for cut in some),
            spans=len(some),
            at_s=0.5 * (worst.start + worst.stop),
            from_s=worst.start,
            until_s=worst.stop,
            size=worst.size,
        )


def cuts_of(t: Array, bad: Bad) -> Iterator[Cut]:
    """The spans that a rule cuts out."""
    for start, stop in runs_of(np.asarray(bad.samples.any(axis=1))):
        here = bad.samples[start:stop]
        sizes = None if bad.sizes is None else np.abs(bad.sizes[start:stop][here])
        yield Cut(
            code=bad.code,
            start=float(t[start]),
            stop=float(t[stop - 1]),
            rows=stop - start,
            joints=tuple(int(j) + 1 for j in np.flatnonzero(here.any(axis=0))),
            size=float(t[stop - 1] - t[start] if sizes is None else np.max(sizes)),
        )


def rules(recording: Recording, robot: Robot) -> Iterator[Bad]:
    """What each rule finds in a log."""
    dq, frozen = recording.require("dq"), frozen_rows(recording)
    yield Bad("frozen-rows", np.repeat(frozen[:, None], recording.joints, axis=1), None, MOST)
    yield from position_jumps(recording, frozen)
    fast = FAST * np.nan_to_num(robot.limits.qd_max, nan=2.0)
    yield Bad("isolated-velocity", isolated(recording, dq, fast), dq)
    if not any(getattr(recording, name) is not None for name in EFFORTS):
        return
    name = effort_name(recording, robot)
    effort: Array | None = getattr(recording, name)
    constant = np.ones(robot.joints) if name != "current" else robot.torque_constant
    if effort is None or constant is None:
        return
    torque, limit = effort * constant, np.nan_to_num(robot.limits.tau_max, nan=np.inf)
    beyond = np.abs(torque) > BEYOND * limit
    yield Bad("effort-beyond-drive", beyond, torque)
    alone = isolated(recording, torque, AWAY * limit) & ~beyond
    yield Bad("isolated-effort", alone & ~blows(dq, np.asarray(alone.any(axis=1)))[:, None], torque)
    yield Bad("zero-burst", zero_bursts(torque, ZERO * limit))
    if name != "torque_without_gravity":
        yield from braked(recording, robot, torque)


def isolated(recording: Recording, x: Array, away: Array) -> Mask:
    """Samples far from the median of the nine around them, a few in a row at most. (T, n)

    Args:
        recording: The log.
        x: A signal. (T, n)
        away: Least distance, joint by joint. (n,)
    """
    found, step = np.zeros(x.shape, dtype=bool), recording.median_step
    for j in range(x.shape[1]):
        change = np.abs(np.diff(x[:, j]))
        if not np.max(change) > 0.5 * away[j]:
            continue
        # Only beside a step of half the distance can a sample be so far away.
        steps = np.flatnonzero(change > 0.5 * away[j])
        near = np.unique(steps[:, None] + np.arange(-FEW + 1, FEW + 1))
        near = near[(near >= 0) & (near < len(x))]
        around = np.clip(near[:, None] + np.arange(-4, 5), 0, len(x) - 1)
        noise = FAR * median(change) / (0.6745 * np.sqrt(2.0))
        off = np.abs(x[near, j] - np.median(x[around, j], axis=1)) > max(away[j], noise)
        column = np.zeros(len(x), dtype=bool)
        column[near[off]] = True
        for start, stop in runs_of(column):
            if stop - start <= FEW and (stop - start) * step <= BRIEF:
                found[start:stop, j] = True
    return found


def blows(dq: Array, rows: Mask) -> Mask:
    """Samples across which a joint's speed bends as it does where something hits the arm. (T,)"""
    found = np.zeros(len(dq), dtype=bool)
    for start, stop in runs_of(rows):
        before, behind = max(start - 1, 0), min(stop, len(dq) - 1)
        trend = dq[before] - dq[max(before - 2, 0)] + dq[min(behind + 2, len(dq) - 1)] - dq[behind]
        bend = np.abs(dq[behind] - dq[before] - 0.5 * trend)
        found[start:stop] = np.max(bend) > BLOW
    return found


def zero_bursts(torque: Array, least: Array) -> Mask:
    """Efforts that are exactly 0 between two that are not small. (T, n)

    Of one joint three samples in a row, of all joints at once any.
    """
    zero = torque == 0.0
    found = np.zeros(torque.shape, dtype=bool)
    if not zero.any():
        return found
    every = zero.all(axis=1)
    for j in range(torque.shape[1]):
        for start, stop in runs_of(zero[:, j]):
            if start == 0 or stop == len(torque):
                continue
            enough = stop - start >= FEW or every[start:stop].all()
            if enough and min(abs(torque[start - 1, j]), abs(torque[stop, j])) > least[j]:
                found[start:stop, j] = True
    return found


def frozen_rows(recording: Recording) -> Mask:
    """Rows that repeat the row before in all that is measured while the arm moves. (T,)"""
    found = np.zeros(recording.samples, dtype=bool)
    dq = recording.require("dq")
    same = recording.q[1:, 0] == recording.q[:-1, 0]
    for name in ("q", "dq", *EFFORTS):
        if (value := getattr(recording, name)) is not None and same.any():
            rows = np.flatnonzero(same)
            same[rows] = (value[rows + 1] == value[rows]).all(axis=1)
    runs = runs_of(same)
    if not runs:
        return found
    lengths = np.array([stop - start for start, stop in runs])
    long = np.array([recording.t[stop] - recording.t[start] >= FROZEN for start, stop in runs])
    usual = float(np.median(lengths[~long])) if not long.all() else 1.0
    for (start, stop), enough in zip(runs, long & (lengths >= UNUSUAL * usual), strict=True):
        if enough and np.max(np.abs(dq[start])) > REST:
            found[start + 1 : stop + 1] = True
    return found


class Slips(NamedTuple):
    """Changes of position beyond what the velocities say."""

    steps: Indices  #: The steps at which one may be a jump, by the sample before. (K,)
    sizes: Array  #: How large they are. (K, n) [rad]
    jumps: Mask  #: Which are jumps. (K, n)


def slips_of(recording: Recording) -> Slips:
    """Where positions change otherwise than the velocities say, and which of it are jumps.

    A step of time may be off by what the steps around it are, and by a sample that was late.
    """
    t, q, dq = recording.t, recording.q, recording.require("dq")
    steps, usual = np.diff(t), recording.median_step
    near, noise = steps <= GAP_STEPS * usual, np.zeros(recording.joints)
    large = np.zeros(len(steps), dtype=bool)
    for j in range(recording.joints):
        change = np.diff(q[:, j])
        fastest = float(np.max(np.abs(dq[:, j]))) * GAP_STEPS * usual
        if max(float(np.max(change)), -float(np.min(change))) + fastest > SLIPPED:
            slip = np.abs(change - 0.5 * (dq[1:, j] + dq[:-1, j]) * steps)
            large |= slip > SLIPPED
            noise[j] = FAR / 0.6745 * median(slip)
    at: Indices = np.flatnonzero(large & near)
    mean, dt = 0.5 * (dq[at + 1] + dq[at]), steps[at][:, None]
    slips = q[at + 1] - q[at] - mean * dt
    around = np.clip(at[:, None] + np.arange(-1, 2), 0, len(steps) - 1)
    off = np.max(np.abs(steps[around] - usual), axis=1, initial=0.0)[:, None]
    slack = 0.5 * np.abs(dq[at + 1] - dq[at]) * dt + np.abs(mean) * np.maximum(off + usual, LATE)
    return Slips(at, slips, np.abs(slips) > np.maximum(SLIPPED + slack, noise))


def without_turns(recording: Recording) -> Recording:
    """The recording, positions that jump by whole turns unwrapped, which is said."""
    found = slips_of(recording)
    turns = np.round(found.sizes / TURN)
    whole = found.jumps & (np.abs(found.sizes - TURN * turns) < NEAR)
    whole &= (turns != 0) & (np.abs(turns) <= TURNS)
    if not whole.any() or len(found.steps) > SHARE * recording.samples:
        return recording
    q = recording.q.copy()
    for k, row in enumerate(found.steps.tolist()):
        q[row + 1 :] -= TURN * np.where(whole[k], turns[k], 0.0)
    joints = tuple(int(j) + 1 for j in np.flatnonzero(whole.any(axis=0)))
    first = float(recording.t[found.steps[np.argmax(whole.any(axis=1))] + 1])
    said = fact("turn-unwrapped", Where(joints=joints), at_s=first)
    source = replace(recording.source, remarks=(*recording.source.remarks, said))
    return replace(recording, q=q, source=source)


def position_jumps(recording: Recording, frozen: Mask) -> Iterator[Bad]:
    """Rows whose position is none of the motion's, and what lies around where recordings meet."""
    found = slips_of(recording)
    real = found.jumps.any(axis=1) & ~(frozen[found.steps] | frozen[found.steps + 1])
    steps, slips, jumps = found.steps[real], found.sizes[real], found.jumps[real]
    if not steps.size or steps.size > max(2.0, SHARE * recording.samples):
        return
    t, q, dq = recording.t, recording.q, recording.require("dq")
    rows, meets = np.zeros(q.shape, dtype=bool), np.zeros(q.shape, dtype=bool)
    sizes = np.zeros(q.shape)
    for group in np.split(np.arange(len(steps)), np.flatnonzero(np.diff(steps) > FEW) + 1):
        first, last = int(steps[group[0]]), int(steps[group[-1]]) + 1
        joints, size = jumps[group].any(axis=0), np.max(np.abs(slips[group]), axis=0)
        over = q[last] - q[first] - 0.5 * (dq[last] + dq[first]) * (t[last] - t[first])
        slack = SLIPPED + np.abs(dq[last] - dq[first]) * (t[last] - t[first])
        slack += (np.abs(dq[last]) + np.abs(dq[first])) * max(recording.median_step, LATE)
        if last - first > 1 and np.all((np.abs(over) < slack)[joints]):
            span, into = slice(first + 1, last), rows  # the motion goes on behind a few bad rows
        else:
            start, stop = np.searchsorted(t, [t[first] - APART, t[last] + APART])
            span, into = slice(int(start), int(stop)), meets
        into[span, joints], sizes[span, joints] = True, size[joints]
    yield Bad("position-slip", rows, sizes)
    yield Bad("position-jump", meets, sizes, MOST)


def braked(recording: Recording, robot: Robot, torque: Array) -> Iterator[Bad]:
    """Spans in which the arm rests and its drives do not carry it."""
    length = max(2, round(WEIGHED / recording.median_step))
    first = np.arange(0, recording.samples - length, length)
    if first.size < 3:
        return
    middle = recording.q[first + length // 2]
    gravity = momentum_terms(robot.loaded_chain, middle, np.zeros_like(middle)).gravity
    weight = np.sum(gravity**2, axis=1)
    given = torque[: len(first) * length].reshape(len(first), length, -1).mean(axis=1)
    share = np.sum(given * gravity, axis=1) / np.maximum(weight, 1e-12)
    fastest = np.max(np.abs(recording.require("dq")[: len(first) * length]), axis=1)
    speed = np.maximum.reduceat(fastest, first)
    heavy = weight > HEAVY**2
    held = heavy & (share > HELD)
    free = heavy & (speed < REST) & (np.abs(share) < LET_GO)
    if not free.any() or np.count_nonzero(held) <= np.count_nonzero(free):
        return
    rows = np.zeros(torque.shape, dtype=bool)
    for k in np.flatnonzero(free):
        # The drives let go and take hold again somewhere in the windows beside.
        rows[max(0, first[k] - length) : first[k] + 2 * length] = True
    yield Bad("brakes", rows, None, MOST)
