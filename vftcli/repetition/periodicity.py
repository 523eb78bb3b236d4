"""The period of a motion that repeats, found on the joint positions."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.least_squares import robust_sd
from vftcli.signals.recording import Recording
from vftcli.signals.rest import standing
from vftcli.signals.series import resample_columns

LEAST_REPEATED = 0.15  #: Share of the moving part of the log that must be there twice.

#: Positions return if a quarter of them come back within this share of their own spread.
#:
#: A quarter: a soft servo is off its path while it is pushed, which may be most of the time.
RETURNS = 0.015

#: A valley is worth refining if a quarter of the samples come back within this share.
SHORTLIST = 0.15
CANDIDATES = 40  #: Valleys looked at, the deepest ones.
MULTIPLES = 12  #: Multiples of the period that refine it.
AROUND = 0.03  #: How far from a stated period the true one is looked for, relative: clocks drift.
ENOUGH = 2560  #: Samples that refine a period: more of them only take longer.
#: Spans this many times what the samples fill at their usual step are gaps, not motion.
SPARSE = 10.0


class Period(NamedTuple):
    """A motion's period."""

    seconds: float  #: On the log's own clock. [s]
    #: Lower quartile over time of the joint-position distance after one period. [rad]
    deviation: float


def find_period(recording: Recording, stated: float | None = None) -> Period:
    """Find the time after which the joint positions return.

    The mean squared distance between the log and itself later (the autocorrelation with its
    overlap accounted for) has a valley at every multiple of the period. The first valley from
    which enough samples return is refined below the sample time by Gauss–Newton steps on all
    its multiples together, robust against contacts that push the arm off its path.

    Args:
        recording: The log.
        stated: The commanded period, if known: the search stays within `AROUND` of it. [s]
    """
    t, q = moving_part(recording)
    check_stated(recording, stated, float(t[-1] - t[0]))
    step = recording.median_step
    if float(t[-1] - t[0]) > SPARSE * step * len(t):
        raise ReferenceTorqueError(
            f"{recording.name}: {len(t)} samples over {t[-1] - t[0]:.4g} s: nearly all of that is "
            "a gap, in which no repetition can be looked for; leave the gap out with --interval"
        )
    x = resample_columns(np.arange(t[0], t[-1], step), t, q)
    spread = float(np.sqrt(np.mean((x - x.mean(axis=0)) ** 2) * x.shape[1]))
    closest = (float("nan"), float("inf"))
    for lag in valleys(distances(x), step, stated):
        seconds, deviation = lag * step, returned(t, q, lag * step)
        if deviation <= SHORTLIST * spread:
            seconds = refined_period(t, q, seconds)
            deviation = returned(t, q, seconds)
        if deviation <= RETURNS * spread:
            return Period(seconds, deviation)
        closest = min(closest, (seconds, deviation), key=lambda c: c[1])
    wanted = f" near {stated:g} s" if stated is not None else ""
    seconds, deviation = closest
    near = (
        f" (closest after {seconds:.4g} s, where three quarters of them are more than "
        f"{deviation:.2g} rad off)"
    )
    raise ReferenceTorqueError(
        f"{recording.name}: no repetition found{wanted}: the joint positions do not return within "
        f"the log{near if np.isfinite(deviation) else ''}; give a free run of the same motion "
        "with --free"
    )


def check_stated(recording: Recording, stated: float | None, duration: float) -> None:
    """Raise unless a stated period fits into the moving part of the log."""
    if stated is None:
        return
    if not (np.isfinite(stated) and stated > 0):
        raise ReferenceTorqueError(f"two-cycle.period is {stated:g} s; it must be positive")
    if stated > (1.0 - LEAST_REPEATED) * duration:
        raise ReferenceTorqueError(
            f"{recording.name}: a period of {stated:g} s does not fit into the {duration:.4g} s "
            "the arm moves, which must hold more than one cycle; give a shorter "
            "two-cycle.period, or in its place a free run in another log with --free"
        )
    if stated < 4.0 * recording.median_step:
        raise ReferenceTorqueError(
            f"{recording.name}: a period of {stated:g} s is shorter than four samples "
            f"({recording.median_step:g} s each); two-cycle.period is in seconds"
        )


def moving_part(recording: Recording) -> tuple[Array, Array]:
    """Clock [s] and positions [rad] without the rest before and after the motion."""
    t, q = recording.t, recording.q
    if recording.samples < 8:
        raise ReferenceTorqueError(
            f"{recording.name}: {recording.samples} samples are too few to find a period in, "
            "or to compare with a free run; record a longer log"
        )
    dq = recording.dq if recording.dq is not None else np.gradient(q, t, axis=0)
    moving = np.flatnonzero(~np.all(standing(t, dq), axis=1))
    if len(moving) < 8 or np.ptp(q[moving], axis=0).max() < 0.01:
        raise ReferenceTorqueError(
            f"{recording.name}: the arm does not move, so it repeats nothing; the two-cycle "
            "difference needs a repeated motion, or a free run of the same with --free"
        )
    span = slice(moving[0], moving[-1] + 1)
    return t[span], q[span]


def distances(x: Array) -> Array:
    """Mean squared distance of x and x `lag` samples later, every lag. (N,)"""
    x = x - x.mean(axis=0)
    samples = len(x)
    size = 1 << int(np.ceil(np.log2(2 * samples)))
    spectrum = np.fft.rfft(x, size, axis=0)
    product = np.fft.irfft(np.sum(np.abs(spectrum) ** 2, axis=1), size)[:samples]
    energy = np.concatenate([[0.0], np.cumsum(np.sum(x**2, axis=1))])
    lag = np.arange(samples)
    total = energy[samples - lag] + energy[samples] - energy[lag] - 2.0 * product
    return np.asarray(np.maximum(total, 0.0) / (samples - lag))


def valleys(distance: Array, step: float, stated: float | None) -> list[float]:
    """Lags at the distance's minima with overlap, shortest first. [samples]"""
    low, high = 4, int((1.0 - LEAST_REPEATED) * len(distance))
    if stated is not None:
        low = max(2, int(np.floor((1.0 - AROUND) * stated / step)))
        high = min(high, int(np.ceil((1.0 + AROUND) * stated / step)) + 1)
    # None where a clock of bursts spans hardly more than a few of its median steps.
    lags = np.arange(low, high)
    before, here, after = distance[lags - 1], distance[lags], distance[lags + 1]
    found = lags[(here <= before) & (here <= after)]
    if stated is not None and len(lags) and not len(found):
        found = lags[[int(np.argmin(here))]]
    deep = np.sort(found[np.argsort(distance[found])[:CANDIDATES]])
    bend = distance[deep - 1] - 2.0 * distance[deep] + distance[deep + 1]
    tilt = 0.5 * (distance[deep - 1] - distance[deep + 1])
    return [float(x) for x in deep + np.clip(tilt / np.where(bend > 0, bend, np.inf), -0.5, 0.5)]


def returned(t: Array, q: Array, seconds: float) -> float:
    """Lower quartile of the distance of q and q `seconds` later. [rad]"""
    inside = t + seconds <= t[-1]
    distance = resample_columns(t[inside] + seconds, t, q) - q[inside]
    return float(np.quantile(np.sqrt(np.sum(distance**2, axis=1)), 0.25))


def refined_period(t: Array, q: Array, period: float) -> float:
    """Refine a period below the sample time, on the log's own clock. [s]

    Gauss–Newton on q(t + mP) = q(t), first for m = 1, then for up to `MULTIPLES` multiples the log
    holds, each joint weighted by its own spread, samples by Cauchy's weight, so that pushes do not
    pull the period.
    """
    # Interpolation goes along time, column by column.
    q = np.asfortranarray(q)
    dq = np.asfortranarray(np.gradient(q, t, axis=0))
    last = max(1, int((t[-1] - t[0]) / period - LEAST_REPEATED))
    several = np.unique(np.linspace(1, last, min(last, MULTIPLES)).astype(int))
    for multiples in (several[:1], several):
        for _ in range(20):
            change = period_step(t, q, dq, period, multiples)
            period -= change
            if abs(change) < 1e-9 * period:
                break
    return period


def period_step(
    t: Array, q: Array, dq: Array, period: float, multiples: NDArray[np.int64]
) -> float:
    """Error of a period, first order, over some of its multiples. [s]"""
    every = -(-len(t) // ENOUGH)
    here, path = t[::every], q[::every]
    move = weight = 0.0
    for m in multiples:
        there = here + m * period
        inside = there <= t[-1]
        distance = resample_columns(there[inside], t, q) - path[inside]
        slope = m * resample_columns(there[inside], t, dq)
        scale = robust_sd(distance) + 1e-7
        share = 1.0 / (scale**2 + distance**2)
        move += float(np.sum(share * slope * distance))
        weight += float(np.sum(share * slope**2))
    return float(np.clip(move / weight, -0.1 * period, 0.1 * period)) if weight > 0 else 0.0
