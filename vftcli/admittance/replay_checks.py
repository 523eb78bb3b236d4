"""Remarks on a replay: what was limited, lost or implausible, one sentence each."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from vftcli.admittance.joints import JointPath
from vftcli.admittance.law import Controller
from vftcli.admittance.metrics import Drag
from vftcli.admittance.motion import AxisMotion
from vftcli.admittance.parameters import AXES, Admittance
from vftcli.signals.arrays import Array
from vftcli.signals.remarks import Remark, caution
from vftcli.signals.wrench import Wrench

Counts = np.ndarray[Any, np.dtype[np.int64]]

RESTING = (2.0, 0.01)
"""A drag in which the log's arm stays within this distance for so long is told. [s, m]"""


def unknown_remark(wrench: Wrench) -> tuple[Remark, ...]:
    """Say so if some samples of the wrench are not known, so that they count as no force."""
    count = int(np.count_nonzero(~np.all(np.isfinite(wrench.known), axis=1)))
    return (caution("force-unknown", samples=count),) if count else ()


def quiet_note(wrench: Array, parameters: Admittance, dragged: bool) -> tuple[str, ...]:
    """Say so if nothing ever passed a threshold."""
    if dragged or not len(wrench):
        return ()
    share = np.nanmax(np.abs(np.nan_to_num(wrench)), axis=0) / np.maximum(
        parameters.threshold, 1e-12
    )
    k = int(np.argmax(share))
    return (
        f"no axis ever passes its threshold, so nothing moves; the nearest is {AXES[k]} with "
        f"{100.0 * share[k]:.0f} % of its {parameters.threshold[k]:g}",
    )


def resting_note(drags: Sequence[Drag], logged: Array, period: float) -> tuple[str, ...]:
    """Say so if an axis is dragged for long while the log's arm stands still."""
    long, near = round(RESTING[0] / period), RESTING[1]
    found = []
    for drag in drags:
        part = logged[drag.begin : drag.release, :3]
        if len(part) <= long:
            continue
        apart = np.linalg.norm(part[long:] - part[:-long], axis=1)
        held = np.max(np.linalg.norm(part - part.mean(axis=0), axis=1)) if apart.size else np.inf
        if np.any(apart < near) and (held < near or np.median(apart) < near):
            found.append(
                f"{AXES[drag.axis]} is above its threshold for {len(part) * period:.1f} s while "
                "the log's arm stands still: stiction and model errors leave such an offset at "
                "rest; --zero A:B removes a constant one, a higher threshold ignores it"
            )
    return tuple(dict.fromkeys(found))


def motion_notes(
    controllers: Sequence[Controller], motion: AxisMotion, path: JointPath, rises: Counts
) -> tuple[str, ...]:
    """What went wrong or was limited on the way, one sentence each."""
    found = []
    for n, controller in enumerate(controllers):
        name = controller.name
        if motion.escaped[n]:
            k = int(np.argmin(np.all(np.isfinite(motion.x[:, n]), axis=1)))
            found.append(f"{name}: escaped in finite time, {motion.t[k]:.3f} s")
        if limits := int(np.count_nonzero(np.any(motion.clipped[:, n], axis=1))):
            found.append(f"{name}: the speed limit acted in {limits} control periods")
        if lost := int(np.count_nonzero(~path.reached[:, n])):
            first = motion.t[int(np.argmin(path.reached[:, n]))]
            found.append(
                f"{name}: {lost} of {len(motion.t)} poses cannot be reached inside the workspace "
                f"and the joint limits, the first at {first:.3f} s; there the arm waits"
            )
        if path.speed[n] > 1.0:
            found.append(f"{name}: a joint would need {path.speed[n]:.2g} times its speed limit")
        if rises[n]:
            found.append(
                f"{name}: W rises by more than 1e-12 of its start in {rises[n]} steps of "
                "recovery phases"
            )
    return tuple(found)


def travel_note(
    parameters: Admittance, controllers: Sequence[Controller], motion: AxisMotion, path: JointPath
) -> tuple[str, ...]:
    """Whether the travel is one that the arm could make."""
    travel = np.nan_to_num(np.linalg.norm(motion.x[:, :, :3], axis=2), nan=np.inf).max(axis=0)
    lost = [n for n in range(len(controllers)) if not np.all(path.reached[:, n])]
    if not lost:
        return ()
    largest = max(travel[n] for n in lost)
    soft = (
        ""
        if parameters.threshold_mode == "soft"
        else (
            " With the hard threshold the whole force enters as soon as it passes; "
            "--threshold-mode soft lets in only what exceeds it."
        )
    )
    return (f"the travel of up to {largest:.2f} m is implausible: this arm cannot make it.{soft}",)


def moved_note(logged: Array) -> tuple[str, ...]:
    """Say so if the log's arm moved while the replay holds it at its first pose."""
    far = float(np.linalg.norm(logged[:, :3], axis=1).max())
    if far < 0.01:
        return ()
    return (
        f"in the log the flange moves by up to {far:.3f} m; the replay holds the log's first pose "
        "as its target and uses the force as it was recorded",
    )
