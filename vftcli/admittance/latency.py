"""Latencies of a closed loop: of the sensor, from the true force, and as the paper times them.

The paper's sensor knows no true force: its Figs 6 and 9 time from detection to motion, and from the
estimate's fall below the threshold to the turn.
"""

from dataclasses import dataclass

import numpy as np

from vftcli.admittance.closed_loop import ClosedLoop
from vftcli.signals.arrays import Array, Mask

STARTED = 5e-3  #: Displacement of the flange at which it is said to have moved. [m]
TURNED = 0.02  #: Rotation of the flange at which it is said to have turned. [rad]
#: Speeds below which the flange counts as at rest when a force comes. [m/s, rad/s]
STILL = (0.005, 0.05)
REST = 1.0  #: A contact begins where the force had been below the threshold for this long. [s]


@dataclass(frozen=True, kw_only=True)
class Latency:
    """One application of a force, all in seconds; None where it did not happen."""

    axis: int  #: Index of the axis whose true force is the first to pass its threshold.
    force: float  #: When it passes.
    detection: float | None  #: Time from then until the estimate passes it.
    #: Time from `force` until the flange has moved by `STARTED` (or `TURNED`).
    motion: float | None
    #: Time from the true force's fall below the threshold to the estimate's.
    withdrawal: float | None
    #: Time from detection until the flange has moved by as much from where it was then.
    reaction: float | None
    #: Time from the estimate's fall below the threshold until the flange goes no farther.
    turn: float | None
    #: Whether the flange was at rest when the force came; a time to a displacement says nothing of
    #: one that was moving already.
    rested: bool


def latencies(run: ClosedLoop) -> tuple[Latency, ...]:
    """One entry for each application of a force above a threshold."""
    threshold = run.controller.parameters.threshold
    above = np.any(np.abs(run.truth) > threshold, axis=1)
    period = run.controller.parameters.period
    quiet = max(round(REST / period), 1)
    found, last = [], -quiet
    for k in np.flatnonzero(above).tolist():
        if k - last >= quiet:
            found.append(latency_of(run, k, threshold))
        last = k
    return tuple(found)


def latency_of(run: ClosedLoop, k: int, threshold: Array) -> Latency:
    """The latencies of the contact whose force first passes a threshold in row `k`."""
    axis = int(np.argmax(np.abs(run.truth[k]) / threshold))
    limit, t = threshold[axis], run.t
    felt, there = np.abs(run.estimate[:, axis]) > limit, np.abs(run.truth[:, axis]) > limit
    part = slice(0, 3) if axis < 3 else slice(3, 6)
    start = STARTED if axis < 3 else TURNED

    def far(since: int) -> Mask:
        way = np.linalg.norm(run.moved[:, part] - run.moved[since, part], axis=1)
        return np.asarray(way > start)

    before = run.moved[max(k - 3, 0) : k + 1, part]
    speed = np.linalg.norm(before[-1] - before[0]) / max(t[k] - t[max(k - 3, 0)], 1e-9)
    seen, ends = first_true(felt, k), first_true(~there, k)
    lost = None if ends is None else first_true(~felt, ends)
    out = np.linalg.norm(run.moved[:, part], axis=1)
    turned = np.append(np.diff(out) <= 0.0, False)
    return Latency(
        axis=axis,
        force=float(t[k]),
        detection=time_until(felt, k, t),
        motion=time_until(far(k), k, t),
        withdrawal=None if ends is None else time_until(~felt, ends, t),
        reaction=None if seen is None else time_until(far(seen), seen, t),
        turn=None if lost is None else time_until(turned, lost, t),
        rested=bool(speed < STILL[0 if axis < 3 else 1]),
    )


def first_true(flags: Mask, start: int) -> int | None:
    """First row from `start` on that is set, or None."""
    found = np.flatnonzero(flags[start:])
    return start + int(found[0]) if found.size else None


def time_until(flags: Mask, start: int, t: Array) -> float | None:
    """Time from row `start` to the first row from there on that is set, or None. [s]"""
    row = first_true(flags, start)
    return None if row is None else float(t[row] - t[start])
