"""A repeated motion: its period, its cycles, and the contact-free among them."""

from typing import NamedTuple

import numpy as np

from vftcli.free_motion.alignment import robust_equations
from vftcli.free_motion.difference import PairedRuns, Pairing, difference, in_gap
from vftcli.robots.run import Run, signal_edge
from vftcli.signals.arrays import Array, Indices, Mask, resample_columns, summed
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.filters import low_pass
from vftcli.signals.lag import overlapping, parabola
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, fact
from vftcli.signals.rest import standing

LEAST_REPEATED = 0.15  #: Least share of the motion that must be there twice.

#: A quarter of the positions must return, within this share of their spread.
RETURNS = 0.015

#: A valley is refined if a quarter of the samples come back so near.
SHORTLIST = 0.15
CANDIDATES = 40  #: Valleys looked at, the deepest ones.
SEARCHED = 0.01  #: Finest clock on which a period is looked for. [s]
MULTIPLES = 12  #: Multiples of the period that refine it.
#: How far from a stated period the true one may be, relative.
AROUND = 0.03
ENOUGH = 2560  #: Samples that refine a period: more only take longer.
#: Spans so many times what the samples usually fill are gaps.
SPARSE = 10.0

#: How near a sample is to itself one period away. [rad]
ON_PATH = 0.1
COMPLETE = 0.97  #: Least share of a cycle that counts as whole.

#: Expected errors to the freest cycle within which one is free too.
ALIKE = 1.5
MOST_PAIRED = 8  #: Free cycles that are paired with the others, at most.
SETTLES = 2.0  #: Time around a cycle in which filters settle. [s]


class Period(NamedTuple):
    """A motion's period."""

    seconds: float  #: On the log's own clock. [s]
    #: Lower quartile of the distance after a period. [rad]
    deviation: float


def find_period(recording: Recording, stated: float | None = None) -> Period:
    """Find the time after which the joint positions return.

    The mean squared distance of the log to itself later has a valley at every multiple of
    the period. The first from which enough samples return is refined by Gauss–Newton on
    all its multiples, robust against contacts.
    """
    t, q = moving_part(recording)
    step, duration = recording.median_step, t[-1] - t[0]
    if stated is not None and stated > (1.0 - LEAST_REPEATED) * duration:
        raise ReferenceTorqueError(
            f"{recording.name}: a period of {stated:g} s does not fit into the {duration:.4g} s "
            "the arm moves, which must hold more than one cycle; give a shorter "
            "two-cycle.period, or in its place a free run in another log with --free"
        )
    if stated is not None and stated < 4.0 * step:
        raise ReferenceTorqueError(
            f"{recording.name}: a period of {stated:g} s is shorter than four samples "
            f"({step:g} s each); two-cycle.period is in seconds"
        )
    if duration > SPARSE * step * len(t):
        raise ReferenceTorqueError(
            f"{recording.name}: {len(t)} samples over {duration:.4g} s: nearly all of that is "
            "a gap, in which no repetition can be looked for; leave the gap out with --interval"
        )
    step *= max(1, int(SEARCHED / step))
    x = resample_columns(np.arange(t[0], t[-1], step), t, q)
    spread = np.sqrt(np.mean((x - x.mean(axis=0)) ** 2) * x.shape[1])
    closest = (float("nan"), float("inf"))
    for lag in valleys(x, step, stated):
        seconds, deviation = lag * step, returned(t, q, lag * step, -(-len(t) // ENOUGH))
        if deviation <= SHORTLIST * spread:
            seconds = refined_period(t, q, seconds)
            deviation = returned(t, q, seconds)
        # Within a few samples every motion returns: no refinement ends there.
        if deviation <= RETURNS * spread and seconds > 0.5 * lag * step:
            return Period(seconds, deviation)
        closest = min(closest, (seconds, deviation), key=lambda c: c[1])
    wanted = f" near {stated:g} s" if stated else ""
    seconds, deviation = closest
    near = (
        f" (closest after {seconds:.4g} s, where three quarters of them are more than "
        f"{deviation:.2g} rad off)"
    )
    raise ReferenceTorqueError(
        f"{recording.name}: no repetition found{wanted}: the joint positions do not return within "
        f"the log{near if np.isfinite(deviation) else ''}; give a free run of this motion "
        "with --free"
    )


def moving_part(recording: Recording) -> tuple[Array, Array]:
    """Clock [s] and positions [rad] from the first to the last motion."""
    t, q = recording.t, recording.q
    if recording.samples < 8:
        raise ReferenceTorqueError(
            f"{recording.name}: {recording.samples} samples are too few to find a period in, "
            "or to compare with a free run; record a longer log"
        )
    dq = recording.dq if recording.dq is not None else np.gradient(q, t, axis=0)
    moving = np.flatnonzero(~standing(t, dq).all(axis=1))
    if len(moving) < 8 or np.ptp(q[moving], axis=0).max() < 0.01:
        raise ReferenceTorqueError(
            f"{recording.name}: the arm does not move, so it repeats nothing; the two-cycle "
            "difference needs a repeated motion, or a free run of that motion: --free"
        )
    span = slice(moving[0], moving[-1] + 1)
    return t[span], q[span]


def valleys(x: Array, step: float, stated: float | None) -> list[float]:
    """Lags at which x is nearest to itself, shortest first. [samples]"""
    x, lags = x - x.mean(axis=0), np.arange(len(x))
    cross, behind, ahead = overlapping(x, x, lags)
    # Mean squared distance of x to x so many samples later.
    distance = np.maximum(behind + ahead - 2.0 * cross, 0.0) / (len(x) - lags)
    low, high = 4, int((1.0 - LEAST_REPEATED) * len(x))
    if stated is not None:
        low = max(2, int(np.floor((1.0 - AROUND) * stated / step)))
        high = min(high, int(np.ceil((1.0 + AROUND) * stated / step)) + 1)
    # None where a clock of bursts spans few median steps.
    lags = np.arange(low, high)
    before, here, after = distance[lags - 1], distance[lags], distance[lags + 1]
    found = lags[(here <= before) & (here <= after)]
    if stated is not None and len(lags) and not len(found):
        found = lags[[int(here.argmin())]]
    deep = np.sort(found[distance[found].argsort()[:CANDIDATES]]).tolist()
    moved = (parabola(*-distance[k - 1 : k + 2]) for k in deep)
    return [k + min(max(shift, -0.5), 0.5) for k, shift in zip(deep, moved, strict=True)]


def returned(t: Array, q: Array, seconds: float, every: int = 1) -> float:
    """Lower quartile of q's distance to itself `seconds` later. [rad]"""
    here, path = t[::every], q[::every]
    inside = here + seconds <= t[-1]
    distance = resample_columns(here[inside] + seconds, t, q) - path[inside]
    return float(np.quantile(np.sqrt(np.sum(distance**2, axis=1)), 0.25))


def refined_period(t: Array, q: Array, period: float) -> float:
    """A period refined by Gauss–Newton on q(t + mP) = q(t). [s]"""
    both, n = np.hstack([q, np.gradient(q, t, axis=0)]), q.shape[1]
    last = max(1, int((t[-1] - t[0]) / period - LEAST_REPEATED))
    several = np.unique(np.linspace(1, last, min(last, MULTIPLES)).astype(int))
    every = -(-len(t) // ENOUGH)
    here, path = t[::every], q[::every]
    for multiples in (several[:1], several):
        for _ in range(20):
            gram, right = np.zeros((1, 1)), np.zeros(1)
            for m in multiples:
                inside = here + m * period <= t[-1]
                there = here[inside] + m * period
                # One search for all columns is faster.
                after = np.minimum(t.searchsorted(there, "right"), len(t) - 1)
                share = (there - t[after - 1]) / (t[after] - t[after - 1])
                found = both[after - 1] + share[:, None] * (both[after] - both[after - 1])
                slope, distance = m * found[:, n:], found[:, :n] - path[inside]
                own, move = robust_equations(slope[None], distance)
                gram, right = gram + own, right + move
            step = right.item() / (gram.item() or np.inf)
            change = np.clip(step, -0.1 * period, 0.1 * period)
            period -= change
            if abs(change) < 1e-9 * period:
                break
    return period


class Cycles(NamedTuple):
    """The repeated part of a log."""

    period: float  #: Length of a cycle. [s]
    begin: float  #: First instant on the repeated path. [s]
    end: float  #: Last instant on it. [s]
    deviation: float = 0.0  #: That of its `Period`. [rad]

    @property
    def whole(self) -> int:
        """Whole cycles; the last may lack a few samples."""
        return max(int((self.end - self.begin) / self.period + 1.0 - COMPLETE), 0)

    def number(self, t: Array) -> Indices:
        """Cycle of each instant, from 0; −1 before and after all. (T,)"""
        cycle = np.floor((t - self.begin) / self.period).astype(np.int64)
        return np.where((t < self.begin) | (t > self.end), -1, cycle)

    def span(self, cycle: int) -> tuple[float, float]:
        """First and last instant of a cycle, counted from 0. [s]"""
        first = self.begin + cycle * self.period
        return first, min(first + self.period, self.end)


def segment(recording: Recording, period: Period) -> Cycles:
    """The repeated path's begin and end; the log may start amid a cycle.

    A sample is on the path if the arm is there a period later or earlier, or if the log
    holds neither. Contacts push it off, so three quarters of a cycle must be on it.
    """
    t, q = moving_part(recording)
    seconds = period.seconds
    on_path = (t + seconds > t[-1]) & (t - seconds < t[0])
    for shift in (seconds, -seconds):
        on_path |= abs(resample_columns(t + shift, t, q, np.nan) - q).max(axis=1) <= ON_PATH
    begin = settled(t, on_path, seconds)
    end = -settled(-t[::-1], on_path[::-1], seconds)
    if not end - begin > seconds:
        raise ReferenceTorqueError(
            f"{recording.name}: only {max(end - begin, 0.0):.4g} s of the motion repeat, less than "
            f"the period of {seconds:.4g} s; give a free run of this motion with --free"
        )
    return Cycles(seconds, begin, end, period.deviation)


def settled(t: Array, on_path: Mask, seconds: float) -> float:
    """First instant with most of the next cycle on the path. [s]"""
    count, stop = summed(on_path), t.searchsorted(t + seconds)
    here = np.arange(len(t))
    share = (count[stop] - count[here]) / np.maximum(stop - here, 1)
    good = np.flatnonzero(on_path & (share >= 0.75))
    return float(t[good[0]]) if len(good) else float(t[-1])


def pair_with_cycle(motion: Run, cycles: Cycles, free: int, period: float) -> Pairing:
    """A log paired with one of its cycles, from 0, by a period [s]."""
    t, number = motion.t, cycles.number(motion.t)
    first, last = cycles.span(free)
    times = t - np.rint((t - 0.5 * (first + last)) / period) * period
    usable = (number >= 0) & (number != free) & (times >= first) & (times <= last)
    return Pairing(motion, np.where(usable & ~in_gap(t, times), times, np.nan))


class FreeCycles(NamedTuple):
    """Cycles assumed free."""

    numbers: tuple[int, ...]  #: Counted from 0.
    #: Each whole cycle's, ∞ in a gap; None of stated ones. (cycles,)
    residuals: Array | None

    @property
    def drawn(self) -> tuple[int, ...]:
        """Cycles paired with the others: `MOST_PAIRED` at most."""
        if len(self.numbers) <= MOST_PAIRED:
            return self.numbers
        at = np.linspace(0, len(self.numbers) - 1, MOST_PAIRED).round().astype(int)
        return tuple(self.numbers[k] for k in at)

    def remarks(self, whole: int) -> list[Remark]:
        """Remarks on the free cycles, and on those paired if few."""
        count = len(self.numbers)
        named, drawn = ([k + 1 for k in numbers] for numbers in (self.numbers, self.drawn))
        if self.residuals is None:
            found = fact("free-cycles-given", cycles=named, whole=whole)
        else:
            residuals = self.residuals[np.isfinite(self.residuals)]
            found = fact("free-cycles-found", cycles=named, whole=whole, residuals=residuals)
        if count <= MOST_PAIRED:
            return [found]
        # The mean of k cycles adds 1/k of one cycle's noise power.
        wider = np.sqrt((1.0 + 1.0 / MOST_PAIRED) / (1.0 + 1.0 / count)) - 1.0
        return [found, fact("free-cycles-drawn", cycles=drawn, free=count, wider=wider)]


def find_free_cycles(motion: Run, cycles: Cycles) -> FreeCycles:
    """The cycle of smallest residual, and those that differ by noise alone.

    By the rms of torque less the model's, low-passed, over each joint's smallest.
    """
    number = cycles.number(motion.t)
    if cycles.whole < 1:
        raise ReferenceTorqueError(
            f"{motion.name}: no whole cycle of {cycles.period:.4g} s is in the log; give a free "
            "run with --free"
        )
    residual = residuals(motion, cycles)
    freest = int(residual.argmin())
    times = pair_with_cycle(motion, cycles, freest, cycles.period).times
    first, last = motion.t.searchsorted(np.add(cycles.span(freest), (-SETTLES, SETTLES)))
    free = motion.part(slice(first, last))
    also = [freest]
    for cycle in np.flatnonzero(np.isfinite(residual)).tolist():
        inside = np.flatnonzero(number == cycle)
        span = slice(inside[0], inside[-1] + 1)
        if cycle != freest:
            pair = PairedRuns(motion=motion.part(span), pairings=[Pairing(free, times[span])])
            found = difference(pair, "model", signal_edge(pair.motion.step))
            shown = found.error.rms_moving(found.tau)
            if np.all(shown <= ALIKE * found.error.floor_moving):
                also.append(cycle)
    if len(also) == cycles.whole > 1:
        # Something must be left that the free cycles can be paired with.
        also.remove(max(also))
    return FreeCycles(tuple(sorted(also)), residual)


def residuals(motion: Run, cycles: Cycles) -> Array:
    """Mean of the joints' residuals over their smallest. (cycles,)"""
    # Below 5 Hz a push exceeds the drives' ripple.
    cutoff = signal_edge(motion.step, 5.0)
    gap = low_pass(motion.t, motion.drive_torque - motion.model_torque, cutoff)
    number = cycles.number(motion.t)
    # A cycle of which a gap takes more than half has none: ∞.
    held = np.bincount(number[(number >= 0) & (number < cycles.whole)], minlength=cycles.whole)
    square = np.full((cycles.whole, gap.shape[1]), np.inf)
    for cycle in np.flatnonzero(2 * held >= held.max()).tolist():
        square[cycle] = np.mean(gap[number == cycle] ** 2, axis=0)
    relative = np.sqrt(square / np.maximum(square.min(axis=0), 1e-12))
    return np.asarray(relative.mean(axis=1))
