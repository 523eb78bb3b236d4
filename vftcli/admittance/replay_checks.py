"""What was limited, lost or implausible in a replay, as remarks."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from vftcli.admittance.joints import JointPath
from vftcli.admittance.law import Controller
from vftcli.admittance.metrics import Drag
from vftcli.admittance.motion import AxisMotion
from vftcli.admittance.parameters import AXES, Admittance
from vftcli.signals.arrays import Array
from vftcli.signals.remarks import Remark, Where, caution, fact, warning
from vftcli.signals.wrench import Wrench

Counts = np.ndarray[Any, np.dtype[np.int64]]

#: A drag in which the log's arm stays within this distance for so long is told. [s, m]
RESTING = (2.0, 0.01)
#: A log whose flange stays this near to its first pose replays as it was: no remark. [m]
STILL = 0.01


def unknown_force(wrench: Wrench) -> tuple[Remark, ...]:
    """Say so if some samples of the wrench are not known, so that they count as no force."""
    count = int(np.count_nonzero(~np.all(np.isfinite(wrench.known), axis=1)))
    return (caution("force-unknown", samples=count),) if count else ()


def nothing_dragged(wrench: Array, parameters: Admittance, dragged: bool) -> tuple[Remark, ...]:
    """Say so if nothing ever passed a threshold, and which axis came nearest to its own.

    Args:
        wrench: Force at each control period, NaN where unknown. (T, 6) [N, N·m]
        parameters: The thresholds.
        dragged: Whether anything did.
    """
    if dragged or not len(wrench):
        return ()
    largest = np.max(np.abs(np.nan_to_num(wrench)), axis=0)
    share = largest / np.maximum(parameters.threshold, 1e-12)
    k = int(np.argmax(share))
    threshold = float(parameters.threshold[k])
    return (caution("no-drag", axis=AXES[k], share=float(share[k]), threshold=threshold),)


def drags_at_rest(drags: Sequence[Drag], logged: Array, period: float) -> tuple[Remark, ...]:
    """Say so if an axis is dragged for long while the log's arm stands still; its longest drag.

    Args:
        drags: The drags.
        logged: Deviation of the log's own flange from its first pose. (T, 6) [m, rad]
        period: Control period. [s]
    """
    longest: dict[str, int] = {}
    long, near = round(RESTING[0] / period), RESTING[1]
    for drag in drags:
        part = logged[drag.begin : drag.release, :3]
        if len(part) <= long:
            continue
        apart = np.linalg.norm(part[long:] - part[:-long], axis=1)
        # Round trips bring a moving arm back to where it was, so one coincidence is not rest.
        held = np.max(np.linalg.norm(part - part.mean(axis=0), axis=1))
        if np.any(apart < near) and (held < near or np.median(apart) < near):
            axis = AXES[drag.axis]
            longest[axis] = max(longest.get(axis, 0), len(part))
    return tuple(
        caution("drag-at-rest", axis=axis, duration_s=count * period)
        for axis, count in longest.items()
    )


def limits_met(
    controllers: Sequence[Controller], motion: AxisMotion, path: JointPath, rises: Counts
) -> tuple[Remark, ...]:
    """What went wrong or was limited on the way, controller by controller."""
    found = []
    for n, controller in enumerate(controllers):
        where = Where(controller.name)
        if motion.escaped[n]:
            k = int(np.argmin(np.all(np.isfinite(motion.x[:, n]), axis=1)))
            found.append(warning("motion-escaped", where, time_s=float(motion.t[k])))
        if acted := int(np.count_nonzero(np.any(motion.clipped[:, n], axis=1))):
            found.append(fact("speed-limit-acted", where, periods=acted))
        if lost := int(np.count_nonzero(~path.reached[:, n])):
            first = float(motion.t[int(np.argmin(path.reached[:, n]))])
            rows = {"lost": lost, "poses": len(motion.t)}
            found.append(caution("poses-out-of-reach", where, **rows, first_s=first))
        if path.speed[n] > 1.0:
            found.append(caution("joint-too-fast", where, share=float(path.speed[n])))
        if rises[n]:
            found.append(warning("energy-rises", where, steps=int(rises[n])))
    return tuple(found)


def implausible_travel(
    parameters: Admittance, controllers: Sequence[Controller], motion: AxisMotion, path: JointPath
) -> tuple[Remark, ...]:
    """Say so if the travel is none that the arm could make, and what to do under a hard threshold.

    Where every pose is reached the travel is plausible, however long.
    """
    lost = [n for n in range(len(controllers)) if not np.all(path.reached[:, n])]
    if not lost:
        return ()
    travel = np.nan_to_num(np.linalg.norm(motion.x[:, lost, :3], axis=2), nan=np.inf)
    hard = parameters.threshold_mode == "hard"
    code = "travel-implausible-hard" if hard else "travel-implausible"
    return (caution(code, travel_m=float(travel.max())),)


def arm_moved(logged: Array) -> tuple[Remark, ...]:
    """Say so if the log's arm moved while the replay holds it at its first pose. (T, 6) [m, rad]"""
    far = float(np.linalg.norm(logged[:, :3], axis=1).max())
    return (fact("log-arm-moved", distance_m=far),) if far >= STILL else ()
