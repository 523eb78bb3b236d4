"""What a log can tell at all: which joints move, both ways, and whether something touches."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.identification.processing import PreparedLog
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import IdentificationError
from vftcli.signals.intervals import intervals, near
from vftcli.signals.least_squares import robust_sd
from vftcli.signals.remarks import Remark, Where, warning
from vftcli.signals.rest import MOVES, SLIDES, slower
from vftcli.signals.series import median_step

ENOUGH = 1.0  #: Time it must do so, and for both ways to count the time each way. [s]
TOUCH = 7.0  #: Residual that counts as contact, in robust standard deviations of its joint.
TOUCH_TIME = 0.15  #: Time it must last. [s]
TOUCH_MARGIN = 0.3  #: Time left out before and after. [s]
#: Share of the torque's variation that the profile's links and fitted friction must explain in the
#: joints that carry weight; with the right robot it is 0.99 or more.
WRONG = 0.95


class Excitation(NamedTuple):
    """Which joints the training logs excite."""

    moves: Mask  #: Whether a joint moves at all. (n,)
    reverses: Mask  #: Whether it moves both ways. (n,)


def find_excitation(motions: Sequence[PreparedLog]) -> Excitation:
    """Find which joints move, and which both ways."""
    times = np.zeros((2, motions[0].dq.shape[1]))
    for motion in motions:
        if motion.samples < 2:
            continue
        step = median_step(motion.t)
        times[0] += step * np.count_nonzero(motion.dq > MOVES, axis=0)
        times[1] += step * np.count_nonzero(motion.dq < -MOVES, axis=0)
    moves = times.sum(axis=0) >= ENOUGH
    if not np.any(moves):
        names = ", ".join(m.recording.name for m in motions)
        raise IdentificationError(
            f"{names}: no joint moves faster than {MOVES:g} rad/s for {ENOUGH:g} s; a log at rest "
            "identifies no friction and no inertia. Record free motion, or use --find-payload "
            "on static poses"
        )
    # A tenth of a second back is enough to tell the sign of friction from an offset.
    return Excitation(moves, np.min(times, axis=0) >= 0.1 * ENOUGH)


class ContactSpan(NamedTuple):
    """A stretch in which something seems to touch the arm."""

    start: float  #: First instant. [s]
    stop: float  #: Last instant. [s]
    joint: int  #: Joint with the largest residual, from 1.
    size: float  #: Its residual there. [N·m]


def find_contacts(motion: PreparedLog, residual: Array, dry: Array) -> list[ContactSpan]:
    """Find stretches whose residual is far outside what the rest of the log shows.

    Near a reversal a joint may stick, and the residual be as large as its dry friction: only what
    exceeds that counts there.

    Args:
        motion: The prepared log.
        residual: Torque that the fitted model does not explain. (M, n) [N·m]
        dry: Coulomb torque of each joint. (M, n) [N·m]
    """
    usable = motion.usable
    sd = np.array([robust_sd(r[u]) for r, u in zip(residual.T, usable.T, strict=True)])
    excess = np.maximum(np.abs(residual) - np.abs(dry) * near_standstill(motion), 0.0)
    z = excess * usable / np.maximum(sd, 1e-9)
    worst = z.max(axis=1)
    found = []
    for start, stop in intervals(motion.t, worst > TOUCH, least=TOUCH_TIME):
        k, j = np.unravel_index(int(np.argmax(z[start:stop])), (stop - start, z.shape[1]))
        begin, end = float(motion.t[start]), float(motion.t[stop - 1])
        found.append(ContactSpan(begin, end, int(j) + 1, float(residual[start + k, j])))
    return join_neighbours(found)


def near_standstill(motion: PreparedLog) -> Mask:
    """Whether a joint is slow enough to stick within a filter's length of a sample. (M, n)"""
    slow = slower(motion.dq, SLIDES)
    if motion.samples < 2:
        return slow
    step = median_step(motion.t)
    reach = max(1, round(1.0 / (motion.processing.cutoff * step)))
    # The zero-phase filter spreads what happens at standstill over about a period of its cutoff.
    return near(slow, reach)


def join_neighbours(found: Sequence[ContactSpan]) -> list[ContactSpan]:
    """Join contacts that lie closer together than twice the margin."""
    out: list[ContactSpan] = []
    for contact in found:
        if out and contact.start - out[-1].stop < 2 * TOUCH_MARGIN:
            larger = max(out[-1], contact, key=lambda c: abs(c.size))
            out[-1] = larger._replace(start=out[-1].start, stop=contact.stop)
        else:
            out.append(contact)
    return out


def outside_contacts(motion: PreparedLog, found: Sequence[ContactSpan]) -> Mask:
    """Mask outside all contacts and their margins. (M,)"""
    free = np.ones(motion.samples, dtype=bool)
    for contact in found:
        inside = motion.t > contact.start - TOUCH_MARGIN
        free &= ~(inside & (motion.t < contact.stop + TOUCH_MARGIN))
    return free


def unexplained_torque(
    name: str, robot: str, torque: Array, residual: Array, heavy: Mask
) -> Remark | None:
    """A remark on the joint that carries weight and is explained worst; None if all are well.

    Args:
        name: The log's name.
        robot: The robot's name.
        torque: Drive torque. (M, n) [N·m]
        residual: What is left after the fit. (M, n) [N·m]
        heavy: Joints whose gravity torque varies. (n,)
    """
    places = np.flatnonzero(heavy)
    if not places.size:
        return None
    spread = np.maximum(np.var(torque[:, places], axis=0), 1e-12)
    explained = 1.0 - np.mean(residual[:, places] ** 2, axis=0) / spread
    worst = int(np.argmin(explained))
    if explained[worst] >= WRONG:
        return None
    share = 100.0 * max(float(explained[worst]), 0.0)
    where = Where(name, (int(places[worst]) + 1,))
    return warning("unexplained-torque", where, robot=robot, share_percent=share)
