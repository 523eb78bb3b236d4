"""Touches: where a log shows contact by itself, so that nobody calls its motion free.

The torque that the model leaves open is low-passed and compared with its own quiet level: friction
that is missed spreads over a log, a contact sticks out of it.
"""

from typing import NamedTuple

import numpy as np

from vftcli.robots.run import Run
from vftcli.signals.filters import low_pass
from vftcli.signals.intervals import runs_of
from vftcli.signals.remarks import Remark, Where, warning

#: Cutoff of the open torque's low-pass: a hand's push lasts longer, reversals do not. [Hz]
CUTOFF = 2.0
#: Multiple of a joint's median open torque from which it sticks out.
#:
#: Free UR10e logs reach more on joints with friction missed for a moment (13.8), but below
#: their dry friction; logs of hands, and simulated pushes, reach 17–100.
STANDING_OUT = 8.0
#: Multiple of a joint's dry friction up to which friction may be what is open; free UR10e logs
#: reach 1.15, logs of hands 1.8–7.
OF_FRICTION = 1.5
#: Torque below which nothing is called a contact: an arm of link torques leaves 1.8 open. [N·m]
LEAST = 2.0
#: Multiple of its limit from which open torque is plainly no model error: a free UR10 reaches
#: 1.14, hands and pushes 2.1 and more.
PLAIN = 1.5
SHORTEST = 2.0  #: Shorter logs have no quiet level. [s]


class ShownContact(NamedTuple):
    """A contact that a log shows."""

    joint: int  #: The joint that shows it most, from zero.
    start: float  #: When it begins. [s]
    stop: float  #: When it ends. [s]
    torque: float  #: The largest torque that is open. [N·m]
    quiet: float  #: The joint's quiet level. [N·m]
    excess: float  #: The largest torque that is open, over its limit.


def touches(run: Run) -> tuple[ShownContact, ...]:
    """The contacts that a log shows, in the order of time; what it does not show may still be."""
    recording, robot = run.recording, run.robot
    # Motor friction that nobody models hides contact and looks like one.
    unknown = robot.torque_source == "current" and not robot.friction
    if unknown or recording.dq is None or recording.duration < SHORTEST:
        return ()
    cutoff = min(CUTOFF, 0.2 / recording.median_step)
    open_torque = low_pass(run.t, run.model_torque - run.drive_torque, cutoff)
    level = np.abs(open_torque - np.median(open_torque, axis=0))
    quiet = np.median(level, axis=0)
    limit = np.maximum(np.maximum(STANDING_OUT * quiet, OF_FRICTION * run.dry_friction), LEAST)
    found = []
    for start, stop in runs_of(np.asarray((level > limit).any(axis=1))):
        excess = (level[start:stop] / limit).max(axis=0)
        joint = int(np.argmax(excess))
        torque = float(level[start:stop, joint].max())
        begin, end = float(run.t[start]), float(run.t[stop - 1])
        found.append(
            ShownContact(joint, begin, end, torque, float(quiet[joint]), float(excess[joint]))
        )
    return tuple(found)


def touched_remarks(run: Run) -> tuple[Remark, ...]:
    """A warning where a log that is to be free shows contact, with the longest span without.

    What the model leaves open may be friction as well: who says that nobody touched the arm is
    believed, and reads what speaks against it.
    """
    found = touches(run)
    if not found:
        return ()
    worst = max(found, key=lambda touch: touch.torque / max(touch.quiet, LEAST))
    t = run.recording.t
    edges = [float(t[0]), *(x for touch in found for x in (touch.start, touch.stop)), float(t[-1])]
    spans = list(zip(edges[::2], edges[1::2], strict=True))
    begin, end = max(spans, key=lambda span: span[1] - span[0])
    values = {
        "torque_Nm": worst.torque, "quiet_Nm": worst.quiet, "spans": len(found),
        # Rounded inwards, so that the span that is offered holds nothing of what it leaves out.
        "begin_s": np.ceil(10.0 * begin) / 10.0, "end_s": np.floor(10.0 * end) / 10.0,
    }  # fmt: skip
    where = Where(joints=(worst.joint + 1,), span=(worst.start, worst.stop))
    return (warning("reference-zero-touched", where, **values),)
