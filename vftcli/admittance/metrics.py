"""What a motion is judged by: peak, its time, overshoot, return, idle time, work; by axis."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vftcli.admittance.law import Controller
from vftcli.admittance.motion import AxisMotion, Phases
from vftcli.admittance.parameters import AXES
from vftcli.signals.arrays import Array
from vftcli.signals.series import runs_of

PAUSE = 1.0  #: Drags of one axis that follow each other within this time are one. [s]
#: Return time → share of the deviation at release inside which the axis has to stay.
SHARES = {"return_10_s": 0.10, "return_2_s": 0.02}


@dataclass(frozen=True, kw_only=True)
class Drag:
    """One drag of one axis, from where its force passes the threshold to the next drag."""

    axis: int  #: Index of the axis.
    number: int  #: Count of the drags of that axis, from 1.
    begin: int  #: Row of the motion at which the drag phase begins.
    release: int  #: Row from which on the axis recovers.
    end: int  #: Row after the last that belongs to it.


def drags_of(phases: Phases, period: float) -> tuple[Drag, ...]:
    """The drags of every axis along a record of T forces (rows 0 … T of the motion)."""
    found: list[Drag] = []
    for axis in range(6):
        spans: list[list[int]] = []
        for begin, release in runs_of(phases.dragged[:, axis]):
            if spans and (begin - spans[-1][1]) * period < PAUSE:
                spans[-1][1] = release
            else:
                spans.append([begin, release])
        ends = [*(begin for begin, _ in spans[1:]), len(phases.dragged)][: len(spans)]
        found += [
            Drag(axis=axis, number=k + 1, begin=begin, release=release, end=end + 1)
            for k, ((begin, release), end) in enumerate(zip(spans, ends, strict=True))
        ]
    return tuple(found)


def releases_of(x: Array, rows: int) -> tuple[Drag, ...]:
    """The released axes of a release from deviation `x` (6,), as drags that are over at row 0."""
    return tuple(
        Drag(axis=int(axis), number=1, begin=0, release=0, end=rows) for axis in np.flatnonzero(x)
    )


def rows_of(
    controllers: Sequence[Controller],
    motion: AxisMotion,
    drags: Sequence[Drag],
    wrench: Array,
) -> list[dict[str, Any]]:
    """The comparison as rows, one for each controller, axis and drag.

    `start_s` and `release_s` are on the motion's clock, `time_to_peak_s` and `idle_s` from the
    drag's start, return times from its release [s]; `work_J` is the hand's in the drag phase. What
    does not happen before the record ends or the next drag begins is None.
    """
    rows = [
        row_of(controller, motion, n, drag, wrench)
        for n, controller in enumerate(controllers)
        for drag in drags
    ]
    first = {(r["axis"], r["drag"]): r for r in rows if r["controller"] == "traditional"}
    for row in rows:
        other = first.get((row["axis"], row["drag"]))
        row["peak_advance_s"] = (
            other["time_to_peak_s"] - row["time_to_peak_s"]
            if other and row["controller"] != "traditional"
            else None
        )
    return rows


def row_of(
    controller: Controller,
    motion: AxisMotion,
    n: int,
    drag: Drag,
    wrench: Array,
) -> dict[str, Any]:
    """One controller's figures for one drag of one axis."""
    axis, t = drag.axis, motion.t
    x, v = motion.x[:, n, axis], motion.v[:, n, axis]
    window = slice(drag.begin, drag.end)
    sizes = np.nan_to_num(np.abs(x[window]), nan=np.inf)
    top = drag.begin + int(np.argmax(sizes))
    returns = {name: return_time(motion.t, x, drag, share) for name, share in SHARES.items()}
    back = returns["return_2_s"]
    period = float(t[1] - t[0]) if len(t) > 1 else 0.0
    span = slice(drag.begin, drag.release)
    # Row k + 1 is what the force of row k made of row k.
    work = np.nansum(wrench[span, axis] * v[1:][span]) * period if len(wrench) else 0.0
    return {
        "controller": controller.kind,
        "alpha": None if controller.kind == "traditional" else float(controller.alpha[axis]),
        "xi": float(controller.xi[axis]),
        "axis": AXES[axis],
        "unit": "m" if axis < 3 else "rad",
        "drag": drag.number,
        "start_s": float(t[drag.begin]),
        "release_s": float(t[drag.release]),
        "peak": finite(x[top]),
        "time_to_peak_s": float(t[top] - t[drag.begin]),
        "at_release": finite(x[drag.release]),
        "overshoot": overshoot(x, drag),
        **returns,
        "idle_s": None if back is None else float(t[drag.release] - t[drag.begin]) + back,
        "work_J": finite(float(work)),
    }


def return_time(t: Array, x: Array, drag: Drag, share: float) -> float | None:
    """Time from the release to the last sample beyond `share` of the deviation then. [s]

    None if the axis is still outside when the record ends or the next drag begins.
    """
    after = np.abs(x[drag.release : drag.end])
    if not np.all(np.isfinite(after)) or after[0] == 0.0:
        return None
    outside = np.flatnonzero(after > share * after[0])
    last = int(outside[-1]) if outside.size else 0
    if last == len(after) - 1:
        return None
    return float(t[drag.release + last] - t[drag.release])


def overshoot(x: Array, drag: Drag) -> float | None:
    """Largest deviation to the other side after the release, as a share of that at the release."""
    after = x[drag.release : drag.end]
    if not np.all(np.isfinite(after)) or after[0] == 0.0:
        return None
    return max(float(np.max(-after / after[0])), 0.0)


def finite(value: float) -> float | None:
    """A finite number, or None."""
    return float(value) if np.isfinite(value) else None
