"""Findings from the logged velocity beside the change of position: unit, clock, order, lateness.

Over short windows the logged velocity is fitted as q̇(t) ≈ a·v(t) − a·τ·v̇(t), where v is the
derivative of the position: a is its gain and τ the time by which it runs behind. Both sides are
weighed with a Hann window, and the derivatives fall on the window instead of on the data
(∫φ v̇ dt = −∫φ' v dt), so that uneven steps need no resampling and noise is not amplified.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from vftcli.doctor.findings import on_joints
from vftcli.doctor.stuck import stuck_joints, travel_of
from vftcli.signals.arrays import Array, Mask, median
from vftcli.signals.intervals import runs_of
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, warning
from vftcli.signals.rest import MOVES

#: Length of a window: short beside motion, long beside the noise of single samples and an arm's
#: vibration. [s]
WINDOW = 0.2
#: Steps of a window of a slow log, and of a fast one, which is thinned.
LEAST_STEPS, MOST_STEPS = 8, 40
#: Sample times beyond which the clock's unit may be another one than it was taken for [s], and the
#: steps of a window then.
USUAL, UNUSUAL_STEPS = (2e-4, 0.05), 50
#: Windows that are looked at, at most: spread evenly, they tell as much as all; how many a short
#: log is cut into, and how many tell anything.
WINDOWS, WANTED, LEAST = 600, 12, 8
#: Windows that a joint's motion has to be spread over, and its turns: one or two tell no error.
SPREAD, TURNS = 5.0, 3.0
TRAVEL = 0.05  #: Travel from which a joint's own data tell anything. [rad]
#: Share of the turns of a position that the logged velocity has to show to tell its lag by them.
TELLING = 0.1
#: Deviation of the gain from 1 that is told; sound logs, real and simulated, stay within 0.004.
GAIN = 0.02
SURE = 4.0  #: Standard errors by which a deviation has to exceed its limit as well.
#: Lag that is told, or a sample time where that is longer: a robot's own velocity filter takes
#: 2–3 ms, a host's stamps up to 6. [s]
LATE = 0.008
#: What another joint's position may leave open beside what the joint's own leaves with a lag, and
#: how far the gain of the joint's own may be off for that to count.
ANOTHER, ALIKE = 0.25, 0.3
OPEN = 0.1  #: Share of a velocity that its own position may leave open for its gain to count.
DAMPED_MOST = 0.15  #: Gain below which a velocity is no late one but of another size.
#: Loss of a velocity's square by a filter that can be seen: sound logs lose up to 0.0065.
DAMPED = 0.01
WIDE = 0.15  #: Deviation from a factor between units by which it still is that factor.
#: Degrees in a radian; by which a factor still is that: gears of 50 and 51 are common.
DEGREES, CLOSE = 180 / np.pi, 0.06
#: Gain, or its inverse, from which a velocity is another quantity: no filter and no clock of a
#: robot is so far off.
BEYOND = 1.5
#: Gain from which a gear, and no clock, makes the velocities too large: arms have 30 to 160.
GEARED = 10.0
#: Ticks a second → the unit of the stamps that were read as seconds.
UNITS = {1e3: "ms", 1e6: "us", 1e9: "ns"}
#: Share of the moving steps in which a velocity repeats itself, from which it is held: one in two
#: are those of half the rate, and sound logs repeat up to a third.
HELD = 0.55
STEPS, BLOCK = 8000, 500  #: Steps that are looked at, at most, in blocks.
CRUISE = 0.2  #: A velocity that repeats itself for longer may be a constant one. [s]


class VelocityFit(NamedTuple):
    """The logged velocities as gain and lag of the positions' derivative; NaN where at rest."""

    gain: Array  #: Logged velocity over the derivative of the position, a. (n,)
    lag: Array  #: How much later the logged velocity is, τ. (n,) [s]
    gain_error: Array  #: Standard error of the gain. (n,)
    lag_error: Array  #: Standard error of the lag. (n,) [s]
    open: Array  #: Share of the logged velocity that the fit leaves open, by its square. (n,)
    amplitude: Array  #: Size of the logged velocity over that of the derivative. (n,)
    rate: Array  #: Typical rate of change of the motion, rms v̇ over rms v. (n,) [1/s]
    #: Every logged velocity over every position's derivative: row i by column j. (n, n)
    factor: Array
    share: Array  #: What is left open of the velocity then, by its square. (n, n)

    @property
    def known(self) -> Mask:
        """Joints that moved enough to be judged. (n,)"""
        return np.isfinite(self.gain)


def velocity_fit(recording: Recording) -> VelocityFit | None:
    """Fit the logged velocities to the positions; None where the log is too short or has none."""
    if recording.dq is None or recording.samples <= LEAST * LEAST_STEPS:
        return None
    windows = weighed_windows(recording)
    by_position, by_velocity = windows.by_position, windows.by_velocity
    n = recording.joints
    moved = travel_of(recording) >= TRAVEL
    moved &= spread_of(by_position) >= SPREAD
    if len(by_position) < LEAST or not moved.any():
        return None
    alone = {name: np.full(n, np.nan) for name in VelocityFit._fields[:-2]}
    factor, share = crossed(by_velocity, by_position)
    fit = VelocityFit(**alone, factor=factor, share=share)
    for j in np.flatnonzero(moved):
        columns = (part[:, j] for part in windows)
        for of, value in zip(fit, joint_fit(*columns), strict=False):
            of[j] = value
    return fit


def joint_fit(v: Array, logged: Array, w: Array, logged_w: Array) -> tuple[float, ...]:
    """Gain and lag of one joint, their errors and what else `VelocityFit` holds of each joint.

    Args:
        v: The derivative of the position. (W,) [rad/s]
        logged: The logged velocity. (W,) [rad/s]
        w: −v̇ by the position. (W,) [rad/s²]
        logged_w: −q̈ by the logged velocity. (W,) [rad/s²]
    """
    size = float(v @ v)

    def without(x: Array) -> Array:
        return np.asarray(x - v * float(v @ x) / size)

    rest, turn, tool = without(logged), without(w), without(logged_w)
    # Noise of the positions would hide a lag; that of the logged velocities is another one.
    if float(tool @ turn) ** 2 < TELLING * float(tool @ tool) * float(turn @ turn):
        tool = turn
    common = float(tool @ turn)
    delay = float(tool @ rest) / common if common != 0 else 0.0
    gain = float(v @ (logged - delay * w)) / size
    left = logged - gain * v - delay * w

    def error(x: Array) -> float:
        """Standard error of x·left, where the fast windows may be the worse ones as well."""
        alike = float(left @ left) * float(x @ x) / (len(v) - 2)
        return float(np.sqrt(max(alike, float((x * left) @ (x * left)))))

    # What v and v̇ have in common, in a short log, both may explain.
    apart = max(float(turn @ turn) / (float(w @ w) or 1.0), 1e-6)
    total = float(logged @ logged)
    return (
        gain,
        delay / gain if gain else 0.0,
        error(v) / size / apart**0.5,
        # One hard stop tells no lag, however little it leaves open.
        error(tool) / abs(common * gain) if common * gain and spread_of(turn) > TURNS else np.inf,
        float(left @ left) / total if total > 0 else 1.0,
        (total / size) ** 0.5,
        (abs(float(logged_w @ w)) / abs(gain or 1) / size) ** 0.5,
    )


def spread_of(v: Array) -> Array:
    """Over how many windows a motion is spread, (Σv²)²/Σv⁴, column by column."""
    fourth = np.sum(v**4, axis=0)
    square = np.sum(v**2, axis=0) ** 2
    return np.asarray(np.divide(square, fourth, out=np.zeros_like(square), where=fourth > 0))


class WeighedWindows(NamedTuple):
    """Means over windows by Hann's weights, joint by joint."""

    by_position: Array  #: v, the derivative of the position. (W, n) [rad/s]
    by_velocity: Array  #: The logged velocity. (W, n) [rad/s]
    slope: Array  #: −v̇ by the position. (W, n) [rad/s²]
    logged_slope: Array  #: −q̈ by the logged velocity. (W, n) [rad/s²]


def weighed_windows(recording: Recording) -> WeighedWindows:
    """What position and logged velocity say over windows, spread over the log.

    A window across a gap mixes motion that was not recorded, one of tiny steps hardly lasts: both
    are left out.
    """
    t, dq = recording.t, recording.require("dq")
    step = recording.median_step
    usual = USUAL[0] < step < USUAL[1]
    length = round(WINDOW / step) if usual else UNUSUAL_STEPS
    length = max(LEAST_STEPS, min(length, (len(t) - 1) // WANTED))
    starts = np.arange(0, len(t) - length, length)
    if len(starts) > WINDOWS:
        starts = starts[np.linspace(0, len(starts) - 1, WINDOWS).astype(int)]
    spans = (t[starts + length] - t[starts]) / (length * step)
    starts = starts[(spans > 0.5) & (spans < 1.5)]
    rows = starts[:, None] + np.arange(0, length + 1, max(1, length // MOST_STEPS))
    times, steps = t[rows], np.diff(t[rows], axis=1)
    span = times[:, -1:] - times[:, :1]
    phase = 2 * np.pi * ((times[:, 1:] + times[:, :-1]) / 2 - times[:, :1]) / span
    hann, slope = 1 - np.cos(phase), 2 * np.pi / span * np.sin(phase)
    turned = np.diff(recording.q[rows], axis=1)
    logged = dq[rows]
    way = (logged[:, 1:] + logged[:, :-1]) / 2 * steps[:, :, None]

    def mean(weight: Array, of: Array) -> Array:
        return np.asarray((weight[:, None, :] @ of)[:, 0] / span)

    return WeighedWindows(
        mean(hann, turned), mean(hann, way), mean(slope, turned), mean(slope, way)
    )


def crossed(logged: Array, positions: Array) -> tuple[Array, Array]:
    """Factor and open share of every logged velocity by every position's derivative. (n, n) each"""
    product = logged.T @ positions
    size, whole = np.sum(positions**2, axis=0), np.sum(logged**2, axis=0)[:, None]
    factor = np.divide(product, size, out=np.zeros_like(product), where=size > 0)
    explained = np.divide(factor * product, whole, out=np.zeros_like(product), where=whole > 0)
    return factor, np.maximum(1 - explained, 0.0)


def velocity_findings(recording: Recording, fit: VelocityFit | None) -> Iterator[Remark]:
    """What is odd about the logged velocity, the likeliest cause alone where one explains all."""
    if fit is None:
        return
    factor = common_factor(fit)
    if factor is not None and (time_unit(factor) or is_clock(factor)):
        return
    if factor is not None and in_degrees(factor):
        yield warning("velocity-unit", slope=factor)
        return
    if swapped := exchanged(fit):
        yield warning("velocity-order", on_joints(swapped))
    shares = held_shares(recording)
    held = held_joints(recording, shares)
    if held.size:
        percent = 100 * shares[held]
        yield warning("velocity-held", on_joints(held), shares_percent=percent.tolist())
    explained = [*swapped, *held.tolist(), *stuck_joints(recording, "dq")]
    yield from late_velocities(recording, fit, np.setdiff1d(np.flatnonzero(fit.known), explained))


def late_velocities(recording: Recording, fit: VelocityFit, joints: Array) -> Iterator[Remark]:
    """Joints whose velocity runs behind, or is of another size, each joint by itself."""
    limit = max(LATE, recording.median_step)
    told = np.isin(np.arange(recording.joints), joints)
    late = told & (np.abs(fit.lag) - SURE * fit.lag_error > limit) & (fit.gain > DAMPED_MOST)
    if late.any():
        code = "velocity-filtered" if is_damped(fit, late) else "velocity-lag"
        lags = 1e3 * fit.lag[late]
        yield warning(code, on_joints(np.flatnonzero(late)), lags_ms=lags.tolist())
    wrong = told & ~late & (np.abs(fit.gain - 1) - SURE * fit.gain_error > GAIN)
    turned = wrong & (np.abs(fit.gain + 1) < 0.3)
    sure = SURE * fit.gain_error
    beyond = wrong & ~turned & ((fit.gain - sure > BEYOND) | (fit.gain + sure < 1 / BEYOND))
    for code, mask in (("velocity-sign", turned), ("velocity-mismatch", wrong & ~turned & ~beyond)):
        if mask.any():
            slopes = fit.gain[mask].tolist()
            yield warning(code, on_joints(np.flatnonzero(mask)), slopes=slopes)
    seen = {int(j): quantity_of(fit, int(j)) for j in np.flatnonzero(beyond)}
    for quantity in dict.fromkeys(seen.values()):
        alike = [j for j in seen if seen[j] == quantity]
        slopes = fit.gain[alike].tolist()
        yield warning(
            "velocity-of-another-kind", on_joints(alike), slopes=slopes, quantity=quantity
        )


def quantity_of(fit: VelocityFit, joint: int) -> str:
    """What a joint's logged velocity is, by its gain, where it is no velocity in rad/s."""
    gain = float(fit.gain[joint])
    if abs(gain) * BEYOND < 1 and fit.share[joint, joint] > OPEN > fit.open[joint]:
        return "the joint's acceleration"
    if in_degrees(gain):
        return "deg/s" if gain > 1 else "rad/s, beside positions in degrees"
    if gain > GEARED:
        return "the motor's side of the gear"
    return "another motion or unit"


def is_damped(fit: VelocityFit, late: Mask) -> bool:
    """Whether late velocities have lost the size that a filter takes, and a delay does not.

    Of the square of a motion of rate ω a first-order filter of time constant τ leaves 1/(1 + ω²τ²).
    """
    taken = median(fit.rate[late] * fit.lag[late]) ** 2
    lost = median(1 - fit.amplitude[late] ** 2)
    return median(fit.lag[late]) > 0 and taken > DAMPED and lost > taken / 2


def common_factor(fit: VelocityFit) -> float | None:
    """The gain that all joints share; None where they differ or a velocity is another motion's."""
    known = fit.known & (fit.open < OPEN)
    if 2 * known.sum() <= fit.known.sum():
        return None
    gains, errors = fit.gain[known], fit.gain_error[known]
    middle = median(gains)
    alike = np.abs(gains - middle) < GAIN * abs(middle) / 2 + SURE * errors
    if not np.all(alike):
        return None
    # What a lag takes from the gain, as a delay or as a filter, is no factor of the clock.
    lost = float(np.max((fit.rate * fit.lag)[known] ** 2)) + SURE * median(errors)
    return 1.0 if abs(middle - 1) < lost else middle


def time_unit(factor: float) -> str:
    """The unit that seconds were taken for by so large a gain, "" where it is none.

    Stamps of milliseconds that are read as seconds make the derivative a thousand times too small.
    """
    for ticks, unit in UNITS.items():
        if abs(factor / ticks - 1) < WIDE:
            return unit
        if abs(factor * ticks - 1) < WIDE:
            return "s"
    return ""


def is_clock(factor: float) -> bool:
    """Whether a gain that all joints share is that of a clock of another rate."""
    return GEARED > factor > 0 and abs(factor - 1) > GAIN and not in_degrees(factor)


def in_degrees(factor: float) -> bool:
    """Whether a gain is that of degrees beside radians."""
    return any(abs(factor / unit - 1) < CLOSE for unit in (DEGREES, 1 / DEGREES))


def exchanged(fit: VelocityFit) -> list[int]:
    """Joints whose logged velocity is that of another joint's position, and those others."""
    close = np.abs(fit.gain - 1) < ALIKE
    own = np.where(close, fit.open, 1.0)
    fits = np.where(np.abs(fit.factor - 1) < 2 * GAIN, fit.share, 1.0)
    fits[:, ~fit.known] = 1.0
    np.fill_diagonal(fits, 1.0)
    taken = np.flatnonzero(fits.min(axis=1) < np.minimum(ANOTHER * own, OPEN))
    # A joint that stands has no velocity to be recognised by where it was written instead.
    emptied = [j for j in np.argmin(fits[taken], axis=1) if not close[j]]
    found = sorted({*taken.tolist(), *map(int, emptied)})
    return found if len(found) > 1 else []


def held_shares(recording: Recording) -> Array:
    """Share of a joint's moving steps in which its velocity repeats itself; NaN at rest. (n,)"""
    first = np.arange(recording.samples - 1)
    if len(first) > STEPS:
        blocks = np.linspace(0, len(first) - BLOCK, STEPS // BLOCK).astype(int)
        first = (blocks[:, None] + np.arange(BLOCK)).ravel()
    t, q, dq = recording.t, recording.q, recording.require("dq")
    moves = np.abs(q[first + 1] - q[first]) > MOVES * (t[first + 1] - t[first])[:, None]
    same = moves & (dq[first + 1] == dq[first])
    count = moves.sum(axis=0)
    enough = (count >= 20) & (travel_of(recording) >= TRAVEL)
    return np.where(enough, same.sum(axis=0) / np.maximum(count, 1), np.nan)


def held_joints(recording: Recording, shares: Array) -> Array:
    """Joints whose velocity stays for some samples and then jumps, while the position moves on.

    A constant speed repeats for longer; one of coarse resolution mostly changes by a step of it.

    Args:
        recording: The log.
        shares: Share of each joint's moving steps in which its velocity repeats itself. (n,)
    """
    longest = max(2, round(CRUISE / recording.median_step))
    found = []
    for j in np.flatnonzero(shares > HELD):
        dq = recording.require("dq")[:, j]
        change = np.diff(dq)
        same = change == 0
        short = sum(stop - start for start, stop in runs_of(same) if stop - start <= longest)
        jumps = np.abs(change[~same])
        if jumps.size < 4 or short < HELD * same.sum():
            continue
        if np.mean(jumps < 1.5 * np.quantile(jumps, 0.05)) < 0.5:
            found.append(int(j))
    return np.array(found, dtype=int)
