"""What looks like a contact and is none: what lasts for most of a log, and an abrupt stop.

The first is a load, a wrong payload or a wrong model, and has a mean; the jerk of a brake looks
like a knock.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from vftcli.contacts.contact_list import Contact
from vftcli.contacts.free_statistics import free_part
from vftcli.contacts.rows import NORMAL, force_course
from vftcli.free_motion.free_motion import FreeMotion
from vftcli.signals.recording import Recording
from vftcli.signals.rest import MOVES, REST, faster
from vftcli.virtual_sensor.smoother import DRIVES, hidden_by_blocks, smooth_wrench

#: The arm rests at the beginning of a contact if no joint moves for so long on either side. [s]
AROUND = 1.0
#: Share of the time since the first motion that contacts must fill together to be a load.
SHARE = 0.5
#: Several contacts are one load if their forces add up to more than this share of their sizes:
#: pushes that follow one another come from different sides.
ALIKE = 0.95
PIECE = 5.0  #: Length of the pieces whose means tell how far the mean may be off. [s]
SHORT = 0.3  #: Longest row that a stop explains. [s]
#: When the arm must have moved, how fast it was, and when it must rest: about the beginning of a
#: row, which is known to a block. A knock on an arm that stood still is none of this. [s]
BEFORE, AT_STOP, AFTER = (-0.25, -0.05), (-0.25, 0.1), (0.12, 0.35)
LEFT = 0.05  #: Share of the speed before that may be left at rest, while the arm rings.


def is_load(recording: Recording, contacts: Sequence[Contact]) -> bool:
    """Whether contacts fill more than half of the time since the first motion, with one force.

    A load neither begins nor ends while the arm rests: what does is a push.
    """
    if not contacts:
        return False
    moving = np.any(faster(recording.require("dq"), REST), axis=1)
    t = recording.t
    first = float(t[np.argmax(moving)]) if moving.any() else float(t[0])
    lasts = np.array([contact.stop - contact.start for contact in contacts])
    if lasts.sum() <= SHARE * (float(t[-1]) - first):
        return False
    for edge in (contacts[0].start, contacts[-1].stop):
        near = np.abs(t - edge) < AROUND
        if t[0] + AROUND < edge < t[-1] - AROUND and not moving[near].any():
            return False
    forces = np.array([contact.mean_force for contact in contacts]) * lasts[:, None]
    sizes = np.linalg.norm(forces, axis=1).sum()
    together = float(np.linalg.norm(forces.sum(axis=0)))
    return len(contacts) == 1 or together > ALIKE * float(sizes)


def load_row(motion: FreeMotion, contacts: Sequence[Contact]) -> Contact:
    """One row for contacts that are a load: the mean of the ungated wrench, with its band.

    The mean's standard deviation is √(s²/m + (3 % of the mean)²), s the spread of m means over 5 s.
    """
    part = free_part(motion)
    wrench = smooth_wrench(motion.log, () if part is None else part.pieces)
    start, stop = contacts[0].start, contacts[-1].stop
    inside = (wrench.t >= start) & (wrench.t <= stop)
    values, t = wrench.values[inside], wrench.t[inside]
    mean, number = values.mean(axis=0), ((t - t[0]) / PIECE).astype(int)
    pieces = np.array([values[number == k].mean(axis=0) for k in np.unique(number)])
    error = wrench.sd[inside].mean(axis=0)
    if len(pieces) > 1:
        error = pieces.std(axis=0, ddof=1) / np.sqrt(len(pieces))
    sd = np.hypot(error, DRIVES * mean)
    size = float(np.linalg.norm(mean[:3]))
    u = mean[:3] / max(size, 1e-12)
    band = NORMAL * float(np.sqrt(u**2 @ sd[:3] ** 2))
    forces = values[:, :3]
    covariance = wrench.covariance[inside, :3, :3] + hidden_by_blocks(forces, bent=0.0)
    return replace(
        max(contacts, key=lambda contact: contact.evidence or 0.0),
        number=1,
        start=start,
        stop=stop,
        is_load=True,
        peak_force=size,
        peak_band=band,
        place_band=band,
        wrench=mean,
        wrench_sd=sd,
        mean_force=mean[:3],
        impulse=mean[:3] * (stop - start),
        anywhere=(max(size - band, 0.0), size + band),
        course=force_course(t, forces, covariance),
        where="wrist" if "wrist" in {contact.where for contact in contacts} else "cannot tell",
    )


def follows_stop(recording: Recording, start: float, stop: float, block: float) -> bool:
    """Whether a row begins where every joint that moved comes to rest at once, and is over soon.

    It lasts from start to stop and is known to a block. [s]
    """
    if stop - start > SHORT + block:
        return False
    t, speed = recording.t - start, np.abs(recording.require("dq"))
    before, around, after = (
        speed[(t >= first) & (t <= last)]
        for first, last in (BEFORE, AT_STOP, (AFTER[0] + block, AFTER[1]))
    )
    if not len(before) or not len(after):
        return False
    rests = after.max(axis=0) < np.maximum(MOVES, LEFT * around.max(axis=0))
    # A median, since noise must not pass for motion.
    return bool(np.median(before, axis=0).max() > MOVES and rests.all())
