"""Findings on the clock, and on the logged velocity: unit, order, lateness.

Short windows fit the logged velocity as q̇(t) ≈ a·v(t) − a·τ·v̇(t): v is the derivative
of the position, a the gain, τ the delay. Both sides get Hann's weights φ; by ∫φ v̇
dt = −∫φ' v dt nothing is resampled and no noise amplified.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vftcli.doctor.signals import TRAVEL, repeated_rows, stuck_stretches, travel_of
from vftcli.doctor.windows import spread
from vftcli.signals.arrays import Array, Mask, gaps_of, median, runs_of
from vftcli.signals.recording import JOINT_SIGNALS, Recording
from vftcli.signals.remarks import Remark, fact, on_joints, warning
from vftcli.signals.rest import MOVES, NONZERO

#: Window: short beside motion, long beside noise. [s]
WINDOW = 0.2
#: Steps of a window of a slow log, and of a fast one after thinning.
LEAST_STEPS, MOST_STEPS = 8, 40
#: Sample times beyond which the clock's unit is in doubt [s]; steps of a window then.
USUAL, UNUSUAL_STEPS = (2e-4, 0.05), 50
#: Most windows; those of a short log; least windows with motion.
WINDOWS, WANTED, LEAST = 600, 12, 8
#: Least windows of a joint's motion, and turns: one or two show no error.
SPREAD, TURNS = 5.0, 3.0
#: Least share of the position's turns in the velocity, for its lag.
TELLING = 0.1
#: Deviation of the gain from 1 that is named; sound logs stay within 0.004.
GAIN = 0.02
SURE = 4.0  #: Standard errors, too, that a deviation must exceed.
#: Least lag of a finding; robots' filters have 2–3 ms, stamps 6. [s]
LATE = 0.008
#: Ratio of open shares at which another joint's position beats its own with a lag, and the
#: own's largest gain error for this.
ANOTHER, ALIKE = 0.25, 0.3
OPEN = 0.1  #: Largest open share of a velocity for its gain to count.
DAMPED_MOST = 0.15  #: Below this gain a velocity is not late: its size differs.
#: Least visible loss of a velocity's square by a filter; sound logs lose up to 0.0065.
DAMPED = 0.01
WIDE = 0.15  #: Tolerance of a factor between units.
#: Degrees in a radian, and tolerance: gears of 50 and 51 are common.
DEGREES, CLOSE = 180 / np.pi, 0.06
#: Gain, or its inverse, of another quantity: no filter, no clock.
BEYOND = 1.5
#: Gain of a gear, not of a clock: arms have 30 to 160.
GEARED = 10.0
#: Gain of the derivative → unit of the stamps.
UNITS = {1e3: "ms", 1e6: "us", 1e9: "ns", 1e-3: "s", 1e-6: "s", 1e-9: "s"}
#: Share of moving steps with a repeated velocity that is held: half the rate repeats one in
#: two, sound logs up to a third.
HELD = 0.55
TINY = 1e-300  #: Least divisor; the dividend is 0 too.
STEPS, BLOCK = 8000, 500  #: Most steps, in blocks.
CRUISE = 0.2  #: Longer repeats may be a constant velocity. [s]


class VelocityFit(NamedTuple):
    """Gain and lag of logged velocities against positions; NaN at rest."""

    gain: Array  #: Logged velocity over the derivative, a. (n,)
    lag: Array  #: Delay of the logged velocity, τ. (n,) [s]
    gain_error: Array  #: Standard error of the gain. (n,)
    lag_error: Array  #: Standard error of the lag. (n,) [s]
    open: Array  #: Open share of the velocity's square. (n,)
    amplitude: Array  #: Size of the velocity over the derivative's. (n,)
    rate: Array  #: Rate of the motion, rms v̇ over rms v. (n,) [1/s]
    #: Every velocity over every position's derivative: row i by column j. (n, n)
    factor: Array
    share: Array  #: Open share of its square then. (n, n)

    @property
    def known(self) -> Mask:
        """Joints with enough motion. (n,)"""
        return np.isfinite(self.gain)


def velocity_fit(recording: Recording) -> VelocityFit | None:
    """Fit of velocities by positions; None for a short log or none logged."""
    if recording.dq is None or recording.samples <= LEAST * LEAST_STEPS:
        return None
    means = weighed_means(recording)
    positions, logged = means[:2]
    moved = (travel_of(recording) >= TRAVEL) & (spread_of(positions) >= SPREAD)
    if len(logged) < LEAST or not moved.any():
        return None
    alone = np.full((7, recording.joints), np.nan)
    for j in np.flatnonzero(moved):
        alone[:, j] = joint_fit(*means[:, :, j])
    product = logged.T @ positions
    whole = np.sum(logged**2, axis=0)[:, None]
    factor = product / np.maximum(np.sum(positions**2, axis=0), TINY)
    explained = factor * product / np.maximum(whole, TINY)
    return VelocityFit._make([*alone, factor, np.maximum(1 - explained, 0.0)])


def joint_fit(v: Array, logged: Array, w: Array, logged_w: Array) -> Array:
    """The first seven fields of `VelocityFit`, from one joint's `weighed_means`. (7,)"""
    size, total = v @ v, logged @ logged
    rest, turn, tool = (x - v * (v @ x) / size for x in (logged, w, logged_w))
    # Positions' noise would hide a lag; velocities' is independent.
    if (tool @ turn) ** 2 < TELLING * (tool @ tool) * (turn @ turn):
        tool = turn
    common = tool @ turn
    delay = tool @ rest / common if common else 0.0
    gain = v @ (logged - delay * w) / size
    left = logged - gain * v - delay * w

    def error(x: Array) -> float:
        """Standard error of x·left; fast windows may be worse."""
        each = x * left
        return float(np.sqrt(np.maximum(left @ left * (x @ x) / (len(v) - 2), each @ each)))

    # In a short log v and v̇ may explain one part twice.
    apart = max(float(turn @ turn / (w @ w or 1.0)), 1e-6)
    # One hard stop shows no lag.
    tells = common * gain and spread_of(turn) > TURNS
    return np.array(
        [
            gain,
            delay / gain if gain else 0.0,
            error(v) / size / apart**0.5,
            error(tool) / abs(common * gain) if tells else np.inf,
            left @ left / total if total > 0 else 1.0,
            (total / size) ** 0.5,
            (abs(logged_w @ w / (gain or 1.0)) / size) ** 0.5,
        ]
    )


def spread_of(v: Array) -> Array:
    """Number of windows with the motion, (Σv²)²/Σv⁴, per column."""
    return np.asarray(np.sum(v**2, axis=0) ** 2 / np.maximum(np.sum(v**4, axis=0), TINY))


def weighed_means(recording: Recording) -> Array:
    """Hann-weighted means over windows spread over the log. (4, W, n)

    Of the position's derivative v, the logged velocity [rad/s], then −v̇ by each of them
    [rad/s²]. Windows across a gap or of tiny steps are left out.
    """
    t, dq, step = recording.t, recording.require("dq"), recording.median_step
    length = round(WINDOW / step) if USUAL[0] < step < USUAL[1] else UNUSUAL_STEPS
    length = max(LEAST_STEPS, min(length, (len(t) - 1) // WANTED))
    starts = np.arange(0, len(t) - length, length)
    starts = starts[spread(len(starts), WINDOWS)]
    spans = (t[starts + length] - t[starts]) / (length * step)
    starts = starts[(spans > 0.5) & (spans < 1.5)]
    rows = starts[:, None] + np.arange(0, length + 1, max(1, length // MOST_STEPS))
    times, logged = t[rows], dq[rows]
    span = times[:, -1:] - times[:, :1]
    phase = 2 * np.pi * ((times[:, 1:] + times[:, :-1]) / 2 - times[:, :1]) / span
    weights = np.stack([1 - np.cos(phase), 2 * np.pi / span * np.sin(phase)]) / span
    logged_way = (logged[:, 1:] + logged[:, :-1]) / 2 * np.diff(times, axis=1)[:, :, None]
    ways = np.stack([np.diff(recording.q[rows], axis=1), logged_way])
    means: Array = weights[:, None, :, None] @ ways
    return means.reshape(4, *logged[:, 0].shape)


def velocity_findings(recording: Recording, fit: VelocityFit | None) -> Iterator[Remark]:
    """Findings on the velocity; a single cause if one explains all."""
    common = common_cause(fit)
    if common is not None and common.code == "velocity-unit":
        yield common
    if fit is None or common is not None:
        return
    if swapped := exchanged(fit):
        yield warning("velocity-order", on_joints(swapped))
    if held := held_shares(recording):
        yield warning("velocity-held", on_joints(held), shares_percent=list(held.values()))
    judged = fit.known
    stuck = [j for j, *_ in stuck_stretches(recording, "dq")]
    judged[[*swapped, *held, *stuck]] = False
    gain, sure = fit.gain, SURE * fit.gain_error
    surely = abs(fit.lag) - SURE * fit.lag_error
    late = judged & (surely > max(LATE, recording.median_step)) & (gain > DAMPED_MOST)
    if late.any():
        # At rate ω a lag τ of first order leaves 1/(1 + ω²τ²), a delay all.
        share = median(fit.rate[late] * fit.lag[late]) ** 2
        lost = median(1 - fit.amplitude[late] ** 2)
        damped = median(fit.lag[late]) > 0 and share > DAMPED and lost > share / 2
        code = "velocity-filtered" if damped else "velocity-lag"
        yield warning(code, on_joints(late), lags_ms=1e3 * fit.lag[late])
    wrong = judged & ~late & (abs(gain - 1) - sure > GAIN)
    turned = wrong & (abs(gain + 1) < 0.3)
    beyond = wrong & ~turned & ((gain - sure > BEYOND) | (gain + sure < 1 / BEYOND))
    for code, mask in (
        ("velocity-sign", turned),
        ("velocity-mismatch", wrong & ~turned & ~beyond),
    ):
        if mask.any():
            yield warning(code, on_joints(mask), slopes=gain[mask])
    seen = {j: quantity_of(fit, j) for j in np.flatnonzero(beyond).tolist()}
    for quantity in dict.fromkeys(seen.values()):
        alike = [j for j in seen if seen[j] == quantity]
        values = {"slopes": gain[alike], "quantity": quantity}
        yield warning("velocity-of-another-kind", on_joints(alike), **values)


def quantity_of(fit: VelocityFit, joint: int) -> str:
    """Quantity logged as a joint's velocity, by its gain."""
    gain = fit.gain[joint]
    if abs(gain) * BEYOND < 1 and fit.share[joint, joint] > OPEN > fit.open[joint]:
        return "the joint's acceleration"
    if in_degrees(gain):
        return "deg/s" if gain > 1 else "rad/s, beside positions in degrees"
    return "the motor's side of the gear" if gain > GEARED else "another motion or unit"


def common_cause(fit: VelocityFit | None) -> Remark | None:
    """The fault of all velocities: clock's unit or rate, or degrees; else None."""
    if fit is None:
        return None
    known = fit.known & (fit.open < OPEN)
    if 2 * known.sum() <= fit.known.sum():
        return None  # most follow another motion
    gains, errors = fit.gain[known], fit.gain_error[known]
    factor = median(gains)
    if not np.all(abs(gains - factor) < GAIN * abs(factor) / 2 + SURE * errors):
        return None
    # A lag lowers the gain, as delay or filter: no clock's factor.
    lost = np.max((fit.rate * fit.lag)[known] ** 2) + SURE * median(errors)
    if abs(factor - 1) < lost:
        return None
    for ticks, unit in UNITS.items():
        if abs(factor / ticks - 1) < WIDE:
            return warning("time-unit", gain=factor, unit=unit)
    if in_degrees(factor):
        return warning("velocity-unit", slope=factor)
    if GEARED > factor > 0 and abs(factor - 1) > GAIN:
        pace = "fast" if factor > 1 else "slow"
        return warning("clock-rate", gain=factor, percent=100 * abs(factor - 1), pace=pace)
    return None


def in_degrees(factor: float) -> bool:
    """Whether a gain is degrees over radians, or its inverse."""
    return any(abs(factor / unit - 1) < CLOSE for unit in (DEGREES, 1 / DEGREES))


def exchanged(fit: VelocityFit) -> list[int]:
    """Joints with another joint's velocity, and those others."""
    close = abs(fit.gain - 1) < ALIKE
    own = np.where(close, fit.open, 1.0)
    fits = np.where(abs(fit.factor - 1) < 2 * GAIN, fit.share, 1.0)
    fits[:, ~fit.known] = 1.0
    np.fill_diagonal(fits, 1.0)
    others = np.flatnonzero(fits.min(axis=1) < np.minimum(ANOTHER * own, OPEN))
    # A joint at rest has no velocity to recognise elsewhere.
    written = fits[others].argmin(axis=1)
    found = np.union1d(others, written[~close[written]]).tolist()
    return found if len(found) > 1 else []


def held_shares(recording: Recording) -> dict[int, float]:
    """Joint → share of moving steps with a velocity held, then jumping. [%]"""
    t, q, dq = recording.t, recording.q, recording.require("dq")
    first = spread(recording.samples - 1, STEPS, BLOCK)
    moves = abs(q[first + 1] - q[first]) > MOVES * (t[first + 1] - t[first])[:, None]
    count = moves.sum(axis=0)
    shares = (moves & (dq[first + 1] == dq[first])).sum(axis=0) / np.maximum(count, 1)
    judged = (shares > HELD) & (count >= 20) & (travel_of(recording) >= TRAVEL)
    longest = max(2, round(CRUISE / recording.median_step))
    found = {}
    for j in np.flatnonzero(judged).tolist():
        change = np.diff(dq[:, j])
        same, jumps = change == 0, abs(change[change != 0])
        short = sum(stop - start for start, stop in runs_of(same) if stop - start <= longest)
        if jumps.size < 4 or short < HELD * same.sum():
            continue
        if np.mean(jumps < 1.5 * np.quantile(jumps, 0.05)) < 0.5:
            found[j] = 100 * shares[j]
    return found


SLOW_RATE = 50.0  #: Rate below which a contact of .1 s has few samples. [Hz]
#: Relative spread of nine steps in ten at which a fixed step is visibly wrong.
JITTER = 0.05
GAP_STEPS = 4.0  #: A step this many times the median is a gap.
LONG_GAP = 0.1  #: A gap longer than this can hide a whole contact. [s]
MISSED = (1.6, 3.4)  #: Ratio of steps to the median of one or two missed samples.
SHORT = 2.0  #: Shorter logs show little noise, no repeated motion. [s]
STALE = 0.003  #: Least share of repeated rows in a finding.


def clock_findings(
    recording: Recording, fit: VelocityFit | None, part: Recording | None = None
) -> Iterator[Remark]:
    """Findings on the clock, and on repeated rows in a part of the log."""
    common = common_cause(fit)
    if common is not None and common.code != "velocity-unit":
        yield common
        if common.code == "time-unit":
            return  # the cause of all odd steps
    if recording.duration < SHORT:
        yield fact("short", duration_s=recording.duration)
    if (rate := 1 / recording.median_step) < SLOW_RATE:
        yield warning("slow-rate", rate_Hz=rate)
    yield from uneven_steps(recording)
    source = recording.source
    if source.duplicates:
        share = 100 * source.duplicates / max(source.rows, 1)
        repeats, level = source.duplicates, warning if share > 10 else fact
        yield level("repeated-stamps", repeats=repeats, rows=source.rows, share_percent=share)
    # Rows repeated under a new stamp: a late packet.
    part = part or recording
    last = repeated_rows(part, JOINT_SIGNALS)
    share = len(last) / (part.samples - 1)
    # Nearly all rows repeat in an arm at rest, or without velocity.
    if part.dq is not None and STALE <= share <= 0.9 and abs(part.dq[last]).max() >= NONZERO:
        yield fact("stale-rows", stale=len(last), share_percent=100 * share)


def uneven_steps(recording: Recording) -> Iterator[Remark]:
    """Missed samples, varying steps, and gaps with the longest of them."""
    t, usual, source = recording.t, recording.median_step, recording.source
    steps = np.diff(t)
    missed = np.sum((steps > MISSED[0] * usual) & (steps < MISSED[1] * usual))
    if missed > 0.001 * len(steps):
        yield fact("missing-samples", missed=missed, steps=len(steps))
    # A gap is no jitter: it has its own finding.
    low, high = np.percentile(steps[steps < GAP_STEPS * usual], [5, 95], overwrite_input=True)
    if (width := (high - low) / usual) > JITTER:
        values = {"spread_percent": 100 * width, "low_ms": 1e3 * low, "high_ms": 1e3 * high}
        yield fact("jitter", **values, clock=source.clock)
    at = gaps_of(t, GAP_STEPS)
    for cut in source.cuts:  # has a finding of its own
        at = at[(t[at] > cut.start) | (t[at + 1] < cut.start)]
    if at.size:
        worst = at[steps[at].argmax()]
        values = {"longest_s": steps[worst], "at_s": t[worst]}
        level = warning if steps[worst] > LONG_GAP else fact
        yield level("gaps", gaps=at.size, steps=GAP_STEPS, **values)
