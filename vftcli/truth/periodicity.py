"""The period of a motion that repeats, found on the joint positions."""

from typing import NamedTuple

import numpy as np

from vftcli.arrays import Array
from vftcli.errors import ReferenceTorqueError
from vftcli.recording import Recording
from vftcli.truth.rest import at_rest, stops
from vftcli.truth.zero_phase import resampled

LEAST_REPEATED = 0.15
"""Share of the moving part of the log that must be there twice."""

RETURNS = 0.015
"""Positions return if a quarter of them come back within this share of their own spread.

A quarter: a soft servo is off its path while it is pushed, which may be most of the time.
"""

AROUND = 0.03
"""How far from a stated period the true one is looked for, relative: clocks drift."""


class Period(NamedTuple):
    """A motion's period.

    Attributes:
        seconds: On the log's own clock. [s]
        deviation: Lower quartile over time of the joint-position distance after one period. [rad]
    """

    seconds: float
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

    Raises:
        ReferenceTorqueError: If the arm does not move, or its positions do not return.
    """
    t, q = moving_part(recording)
    check_stated(recording, stated, float(t[-1] - t[0]))
    step = recording.step
    even = np.arange(t[0], t[-1], step)
    x = resampled(even, t, q)
    candidates = valleys(distances(x), x, step, stated)
    spread = float(np.sqrt(np.mean((x - x.mean(axis=0)) ** 2) * x.shape[1]))
    found = [(lag, returned(x, lag)) for lag in candidates]
    good = [c for c in found if c[1] <= RETURNS * spread]
    if not good:
        raise ReferenceTorqueError(no_repetition(recording, found, step, stated))
    closest = min(deviation for _, deviation in good)
    lag = next(k for k, deviation in good if deviation <= max(3.0 * closest, 0.01 * spread))
    seconds = refined_period(t, q, lag * step)
    return Period(seconds, returned(x, max(1, round(seconds / step))))


def check_stated(recording: Recording, stated: float | None, duration: float) -> None:
    """Raise unless a stated period fits into the moving part of the log."""
    if stated is None:
        return
    if not (np.isfinite(stated) and stated > 0):
        raise ReferenceTorqueError(f"--period is {stated:g} s; it must be positive")
    if stated > (1.0 - LEAST_REPEATED) * duration:
        raise ReferenceTorqueError(
            f"{recording.name}: a period of {stated:g} s does not fit into the {duration:.4g} s "
            "the arm moves, which must hold more than one cycle; give a shorter --period, or a "
            "free run in another log with --free"
        )
    if stated < 4.0 * recording.step:
        raise ReferenceTorqueError(
            f"{recording.name}: a period of {stated:g} s is shorter than four samples "
            f"({recording.step:g} s each); --period is in seconds"
        )


def moving_part(recording: Recording) -> tuple[Array, Array]:
    """Clock [s] and positions [rad] without the rest before and after the motion.

    Raises:
        ReferenceTorqueError: If the arm does not move at all.
    """
    t, q = recording.t, recording.q
    if recording.samples < 8:
        raise ReferenceTorqueError(
            f"{recording.name}: {recording.samples} samples are too few to find a period in; "
            "give a free run in another log with --free"
        )
    dq = recording.dq if recording.dq is not None else np.gradient(q, t, axis=0)
    moving = np.flatnonzero(~np.all(at_rest(t, stops(t, dq)) > 0, axis=1))
    if len(moving) < 8 or np.ptp(q[moving], axis=0).max() < 0.01:
        raise ReferenceTorqueError(
            f"{recording.name}: the arm does not move, so it repeats nothing; the two-cycle "
            "difference needs a repeated motion, or a free run of the same with --free"
        )
    span = slice(moving[0], moving[-1] + 1)
    return t[span], q[span]


def distances(x: Array) -> Array:
    """Mean squared distance between x and itself `lag` samples later, for every lag. (N,)"""
    x = x - x.mean(axis=0)
    samples = len(x)
    size = 1 << int(np.ceil(np.log2(2 * samples)))
    spectrum = np.fft.rfft(x, size, axis=0)
    product = np.fft.irfft(np.sum(np.abs(spectrum) ** 2, axis=1), size)[:samples]
    energy = np.concatenate([[0.0], np.cumsum(np.sum(x**2, axis=1))])
    lag = np.arange(samples)
    total = energy[samples - lag] + energy[samples] - energy[lag] - 2.0 * product
    mean: Array = np.maximum(total, 0.0) / (samples - lag)
    return mean


def valleys(distance: Array, x: Array, step: float, stated: float | None) -> list[int]:
    """Lags at local minima of the distance that leave enough overlap, nearest first. [samples]"""
    last = int((1.0 - LEAST_REPEATED) * len(x))
    low, high = 4, last
    if stated is not None:
        low = max(2, int(np.floor((1.0 - AROUND) * stated / step)))
        high = min(last, int(np.ceil((1.0 + AROUND) * stated / step)) + 1)
    lags = np.arange(low, max(high, low + 1))
    inner = distance[lags]
    before, after = distance[lags - 1], distance[np.minimum(lags + 1, len(distance) - 1)]
    found = lags[(inner <= before) & (inner <= after)]
    if stated is not None and not len(found):
        found = lags[[int(np.argmin(inner))]]
    deep = found[np.argsort(distance[found])[:40]]
    return [int(lag) for lag in np.sort(deep)]


def returned(x: Array, lag: int) -> float:
    """Lower quartile over time of the distance between x and itself `lag` samples later. [rad]"""
    return float(np.quantile(np.sqrt(np.sum((x[lag:] - x[:-lag]) ** 2, axis=1)), 0.25))


def refined_period(t: Array, q: Array, period: float) -> float:
    """Refine a period below the sample time, on the log's own clock. [s]

    Gauss–Newton on q(t + mP) = q(t) for every multiple m the log holds, each joint weighted by its
    own spread, samples by Cauchy's weight, so that pushes do not pull the period.
    """
    dq = np.gradient(q, t, axis=0)
    for _ in range(20):
        move, weight = 0.0, 0.0
        for m in range(1, max(1, int((t[-1] - t[0]) / period - LEAST_REPEATED)) + 1):
            there = t + m * period
            inside = there <= t[-1]
            distance = resampled(there[inside], t, q) - q[inside]
            slope = m * resampled(there[inside], t, dq)
            scale = 1.4826 * np.median(np.abs(distance), axis=0) + 1e-7
            share = 1.0 / (scale**2 + distance**2)
            move += float(np.sum(share * slope * distance))
            weight += float(np.sum(share * slope**2))
        change = move / weight
        period -= change
        if abs(change) < 1e-9 * period:
            break
    return period


def no_repetition(
    recording: Recording, found: list[tuple[int, float]], step: float, stated: float | None
) -> str:
    """One line on why no period was found."""
    wanted = f" near {stated:g} s" if stated is not None else ""
    closest = ""
    if found:
        lag, deviation = min(found, key=lambda c: c[1])
        closest = (
            f" (closest after {lag * step:.4g} s, where three quarters of them are more than "
            f"{deviation:.2g} rad off)"
        )
    return (
        f"{recording.name}: no repetition found{wanted}: the joint positions do not return within "
        f"the log{closest}; give a free run of the same motion with --free"
    )
