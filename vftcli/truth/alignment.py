"""When two logs of one trajectory are at the same place: a time shift found on joint positions."""

from typing import NamedTuple

import numpy as np

from vftcli.arrays import Array
from vftcli.errors import ReferenceTorqueError
from vftcli.recording import Recording

LEAST_OVERLAP = 0.3
"""Share of the shorter log that must overlap at an admissible shift."""

SAME_TRAJECTORY = 0.05
"""Positions that differ by more than this after alignment are another trajectory. [rad]"""


class Alignment(NamedTuple):
    """How one log lies on another.

    Attributes:
        shift: Time to add to the log's t to reach the same place in the other log. [s]
        deviation: Root mean square of the remaining position difference over all joints. [rad]
        overlap: Samples of the log whose shifted time lies within the other. (T,) bool
    """

    shift: float
    deviation: float
    overlap: Array


def align(recording: Recording, free: Recording) -> Alignment:
    """Find the shift at which `free` passes through the recording's joint positions.

    A coarse shift minimises the mean squared position difference over all overlaps of at least
    `LEAST_OVERLAP`, by FFT on a common uniform clock; it is then refined below the sample time on
    the logs' own clocks.

    Raises:
        ReferenceTorqueError: If the two logs are not the same trajectory.
    """
    if free.joints != recording.joints:
        raise ReferenceTorqueError(
            f"{free.name} has {free.joints} joints, {recording.name} has {recording.joints}: "
            "a free run must be of the same arm"
        )
    step = max(recording.step, free.step)
    shift = coarse_shift(recording, free, step)
    shift = refined_shift(recording, free, shift, step)
    deviation, overlap = deviation_at(recording, free, shift)
    if not deviation <= SAME_TRAJECTORY:
        raise ReferenceTorqueError(
            f"{free.name} is not a free run of the trajectory in {recording.name}: at the best "
            f"shift ({shift:.3f} s) the joint positions still differ by {deviation:.3g} rad rms "
            f"(at most {SAME_TRAJECTORY:g}). Give a log of the same motion with --free"
        )
    return Alignment(shift, deviation, overlap)


def uniform(recording: Recording, step: float) -> Array:
    """Joint positions on a uniform clock. (N, n) [rad]"""
    t = np.arange(0.0, recording.duration + 0.5 * step, step)
    start = recording.t[0]
    return np.column_stack([np.interp(t + start, recording.t, q) for q in recording.q.T])


def coarse_shift(recording: Recording, free: Recording, step: float) -> float:
    """The shift with the smallest mean squared position difference, to one `step`. [s]"""
    a, b = uniform(recording, step), uniform(free, step)
    middle = b.mean(axis=0)
    a, b = a - middle, b - middle
    size = 1 << int(np.ceil(np.log2(len(a) + len(b))))
    cross = np.zeros(size)
    for x, y in zip(a.T, b.T, strict=True):
        cross += np.fft.irfft(np.conj(np.fft.rfft(x, size)) * np.fft.rfft(y, size), size)
    lags = np.arange(-(len(a) - 1), len(b))
    first = np.maximum(0, -lags)
    last = np.minimum(len(a), len(b) - lags)
    energy_a = np.concatenate([[0.0], np.cumsum(np.sum(a**2, axis=1))])
    energy_b = np.concatenate([[0.0], np.cumsum(np.sum(b**2, axis=1))])
    overlap = last - first
    squares = (
        energy_a[last] - energy_a[first] + energy_b[last + lags] - energy_b[first + lags]
        - 2.0 * cross[lags % size]
    )
    least = max(2, int(LEAST_OVERLAP * min(len(a), len(b))))
    mean = np.where(overlap >= least, squares / np.maximum(overlap, 1), np.inf)
    best = float(lags[int(np.argmin(mean))])
    return best * step + float(free.t[0] - recording.t[0])


def refined_shift(recording: Recording, free: Recording, shift: float, step: float) -> float:
    """Refine a shift on the logs' own clocks by narrowing parabolas. [s]"""
    width = step
    for _ in range(12):
        trial = shift + width * np.array([-1.0, 0.0, 1.0])
        cost = [deviation_at(recording, free, s)[0] ** 2 for s in trial]
        curvature = cost[0] - 2.0 * cost[1] + cost[2]
        if not np.isfinite(curvature) or curvature <= 0:
            return float(trial[int(np.nanargmin(cost))])
        move = 0.5 * (cost[0] - cost[2]) / curvature
        shift += float(np.clip(move, -1.0, 1.0)) * width
        width *= 0.5
    return shift


def deviation_at(recording: Recording, free: Recording, shift: float) -> tuple[float, Array]:
    """Rms position difference at a shift [rad], and the samples that overlap. (T,) bool"""
    t = recording.t + shift
    overlap = (t >= free.t[0]) & (t <= free.t[-1])
    if np.count_nonzero(overlap) < 2:
        return float("inf"), overlap
    there = np.column_stack([np.interp(t[overlap], free.t, q) for q in free.q.T])
    return float(np.sqrt(np.mean((there - recording.q[overlap]) ** 2))), overlap
