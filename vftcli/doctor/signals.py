"""Findings on clock and signals: rate, jitter, gaps, missing ones, units, signs."""

from collections.abc import Iterator

import numpy as np

from vftcli.doctor.findings import on_joints
from vftcli.doctor.stuck import repeated_rows, stuck_findings
from vftcli.doctor.velocity import VelocityFit, common_cause, velocity_findings
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.recording import EFFORTS, JOINT_SIGNALS, Recording
from vftcli.signals.remarks import Remark, fact, warning
from vftcli.signals.rest import NONZERO
from vftcli.signals.series import gaps_of

SLOW_RATE = 50.0  #: Rate below which a contact of .1 s is a handful of samples. [Hz]
#: Spread of nine steps in ten, relative to their median, at which a fixed step is visibly wrong.
JITTER = 0.05
GAP_STEPS = 4.0  #: A step this many times the median is a gap.
LONG_GAP = 0.1  #: A gap longer than this can hide a whole contact. [s]
MISSED = (1.6, 3.4)  #: Steps over the median where one or two samples were missed.
SHORT = 2.0  #: Shorter logs tell little of noise and nothing of repeated motion. [s]
STALE = 0.003  #: Share of rows that repeat the one before, from which it is worth telling.


def clock_findings(
    recording: Recording,
    fit: VelocityFit | None,
    part: Recording | None = None,
) -> Iterator[Remark]:
    """Findings about the clock, each check independent of the others.

    Args:
        recording: The log.
        fit: How its velocities fit its positions.
        part: Stretches of it where all signals have no room; None for all of it.
    """
    common = common_cause(fit)
    if common is not None and common.code in {"time-unit", "clock-rate"}:
        yield common
        if common.code == "time-unit":
            return  # what else is odd about its steps is this
    if recording.duration < SHORT:
        yield fact("short", duration_s=recording.duration)
    rate = 1 / recording.median_step
    if rate < SLOW_RATE:
        yield warning("slow-rate", rate_Hz=rate)
    yield from uneven_steps(recording)
    yield from long_steps(recording)
    source = recording.source
    if source.duplicates:
        share = 100 * source.duplicates / max(source.rows, 1)
        level = warning if share > 10 else fact
        yield level(
            "repeated-stamps", repeats=source.duplicates, rows=source.rows, share_percent=share
        )
    yield from stale_rows(part or recording)


def uneven_steps(recording: Recording) -> Iterator[Remark]:
    """Samples that were missed, and steps that vary."""
    usual = recording.median_step
    steps = np.diff(recording.t)
    missed = int(np.sum((steps > MISSED[0] * usual) & (steps < MISSED[1] * usual)))
    if missed > 0.001 * len(steps):
        yield fact("missing-samples", missed=missed, steps=len(steps))
    # A gap is no jitter: it has its own finding.
    steps = steps[steps < GAP_STEPS * usual]
    low, high = np.percentile(steps, [5, 95], overwrite_input=True)
    spread = float(high - low) / usual
    if spread > JITTER:
        yield fact(
            "jitter",
            spread_percent=100 * spread,
            low_ms=1e3 * float(low),
            high_ms=1e3 * float(high),
            clock=recording.source.clock,
        )


def long_steps(recording: Recording) -> Iterator[Remark]:
    """Gaps, with the longest of them."""
    t, at = recording.t, gaps_of(recording.t, GAP_STEPS)
    gaps = np.column_stack([t[at + 1] - t[at], t[at]])
    for cut in recording.source.cuts:  # has a finding of its own
        gaps = gaps[(gaps[:, 1] > cut.start) | (gaps.sum(axis=1) < cut.start)]
    if len(gaps):
        longest, begun = gaps[np.argmax(gaps[:, 0])].tolist()
        level = warning if longest > LONG_GAP else fact
        yield level("gaps", gaps=len(gaps), steps=GAP_STEPS, longest_s=longest, at_s=begun)


def stale_rows(recording: Recording) -> Iterator[Remark]:
    """Rows that repeat the row before under a new stamp: a packet that was late."""
    last = repeated_rows(recording, JOINT_SIGNALS)
    share = len(last) / (recording.samples - 1)
    # Nearly all rows alike is an arm at rest, and so are alike rows without velocity.
    if recording.dq is None or share < STALE or share > 0.9:
        return
    if np.abs(recording.dq[last]).max() >= NONZERO:
        yield fact("stale-rows", stale=len(last), share_percent=100 * share)


#: Net share of work from which a joint's effort counts as inverted.
#:
#: Through gravity joints hand energy to one another.
STRONG = -0.4
ALONE = -0.85  #: `STRONG` for a joint among sound neighbours.
ABSURD, FARTHEST = 1e9, 1e18  #: No measurement is this large, in whatever unit, and no time. [-, s]
#: Sample times between which every recorder's lies, read in whatever unit. [s]
STEPS = (1e-13, 1e10)
SOME = 5000  #: Samples that tell how large a signal usually is.
#: Share of the samples at which an interpolated signal runs straight on; change of slope that
#: is none, relative to it; and share of values that have to change.
STRAIGHT, BEND, MOVED = 0.6, 1e-3, 0.1
#: Two turns and a little: no joint of these arms goes further from its zero. [rad]
LARGE_ANGLE = 13.0
LARGE_CURRENT = 60.0  #: No joint of these arms draws this much; readings in mA do. [A]


def unusable_findings(recording: Recording) -> Iterator[Remark]:
    """Numbers that no clock and no robot gives: nothing else is examined then."""
    t = recording.t
    if recording.samples < 3:
        yield warning("too-short", samples=recording.samples)
    elif np.max(np.abs(t)) > FARTHEST:
        yield warning("absurd-clock", least_s=float(t[0]), largest_s=float(t[-1]))
    elif not STEPS[0] < recording.median_step < STEPS[1]:
        yield warning("absurd-steps", step_s=recording.median_step)
    for name in recording.signals:
        largest = float(np.max(np.abs(getattr(recording, name)), initial=0.0))
        if largest > ABSURD:
            yield warning("absurd-values", signal=name, largest=largest)


def signal_findings(recording: Recording, fit: VelocityFit | None) -> Iterator[Remark]:
    """Findings about the signals, each check independent of the others."""
    if recording.dq is None:
        yield warning("no-velocity")
    if all(getattr(recording, name) is None for name in EFFORTS):
        yield warning("no-effort")
    yield from odd_units(recording)
    yield from interpolated(recording)
    yield from velocity_findings(recording, fit)
    yield from stuck_findings(recording)


def odd_units(recording: Recording) -> Iterator[Remark]:
    """Positions and currents too large for radians and ampere."""
    # The last joint of some arms turns without end.
    largest = float(np.max(np.abs(recording.q[:, : max(1, recording.joints - 1)])))
    if largest > LARGE_ANGLE:
        yield warning("degrees", largest_rad=largest)
    if recording.current is not None:
        thinned = recording.current[:: max(1, recording.samples // SOME)]
        typical = float(np.quantile(np.abs(thinned), 0.99))
        if typical > LARGE_CURRENT:
            yield warning("milliamperes", typical_A=typical)


def interpolated(recording: Recording) -> Iterator[Remark]:
    """Positions and effort interpolated between few measured samples."""
    if (effort := effort_of(recording)) is None:
        return
    middle = slice(max(0, (recording.samples - SOME) // 2), (recording.samples + SOME) // 2)
    t = recording.t[middle]
    shares, bends = zip(*(bends_of(t, x[middle]) for x in (recording.q, effort[1])), strict=True)
    knots = t[1:-1][bends[1]]
    if min(shares) >= STRAIGHT and len(knots) > 2:
        rate = 1 / float(np.median(np.diff(knots)))
        yield warning("interpolated", rate_Hz=rate, logged_Hz=1 / recording.median_step)


def bends_of(t: Array, value: Array) -> tuple[float, Mask]:
    """Share of a signal's samples (T, n) in straight motion, and where any bends.

    The share is 0 where hardly one moves; the samples are those from the second to the last but
    one. (T - 2,)
    """
    slope = np.diff(value, axis=0) / np.diff(t)[:, None]
    bent = np.abs(np.diff(slope, axis=0)) > BEND * (np.abs(slope[1:]) + np.abs(slope[:-1]))
    moves = (slope[1:] != 0) & (slope[:-1] != 0)
    enough = moves.sum() > MOVED * moves.size
    return float(np.mean(~bent[moves])) if enough else 0.0, (bent & moves).any(axis=1)


def work_shares(recording: Recording, effort: Array) -> Array:
    """Net over gross work of each joint's effort; NaN with little motion. (n,)

    Friction makes the drives put energy in; what gravity and inertia take they give back.
    """
    if recording.dq is None:
        return np.full(recording.joints, np.nan)
    rows = slice(None, None, max(1, recording.samples // SOME))
    speed = recording.dq[rows]
    power = effort[rows] * speed * np.gradient(recording.t[rows])[:, None]
    gross = np.sum(np.abs(power), axis=0)
    share = np.sum(power, axis=0) / np.where(gross > 0, gross, 1.0)
    travel = np.sum(np.abs(np.diff(recording.q[rows], axis=0)), axis=0)
    # One way only, gravity alone can take or give work.
    reversing = (speed.max(axis=0) > NONZERO) & (speed.min(axis=0) < -NONZERO)
    share[(travel < 0.3) | ~reversing | (gross == 0)] = np.nan
    return np.asarray(share)


def effort_of(recording: Recording) -> tuple[str, Array] | None:
    """Name and values of the log's effort: torque before current."""
    for name in ("torque", "current"):
        if (value := getattr(recording, name)) is not None:
            return name, value
    return None


def inverted_effort(recording: Recording) -> Iterator[Remark]:
    """Effort of a turned sign: it takes energy out of a moving arm as friction does."""
    effort = effort_of(recording)
    if effort is None or recording.dq is None:
        return
    name, value = effort
    shares = work_shares(recording, value)
    (found,) = np.nonzero(shares < STRONG)
    most = found.size >= max(2, round(0.6 * np.isfinite(shares).sum()))
    if not most:  # a few joints only: nearly all their work
        (found,) = np.nonzero(shares < ALONE)
    if not found.size:
        return
    forward = recording.dq[:, found[0]] > NONZERO
    yield warning(
        "effort-sign-by-work" if most else "effort-sign-of-some",
        on_joints(found),
        signal=name,
        shares_percent=(100 * shares[found]).tolist(),
        mean=float(np.mean(value[forward, found[0]])) if forward.any() else float("nan"),
        unit="A" if name == "current" else "N·m",
        first=int(found[0]) + 1,
        column="current" if name == "current" else "tau",
        width=recording.joints,
    )
