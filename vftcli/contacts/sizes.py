"""How hard: the wrench of every contact by the gated smoother, its prior learned from the contacts.

Outside its contact a wrench is pinned to zero, so that the model error is learned from the quiet
blocks on both sides of a contact, and the contact is measured against that. What other contacts
load says nothing of it.
"""

from collections.abc import Sequence

import numpy as np

from vftcli.contacts.windows import (
    MARGIN,
    BlockLog,
    BlockSpan,
    Lane,
    WindowWrench,
    likelihoods,
    smooth_lanes,
    window_of,
)
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.series import covered, runs_of
from vftcli.virtual_sensor.smoother import WrenchPrior

START = WrenchPrior(0.3, 30.0, 3.0)  #: The prior that learning starts from.
TIMES = 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0  #: Correlation times that are tried. [s]
NEAR = 0.4  #: How far a window reaches beyond its contact where only the prior is learned. [s]
FORCES, MOMENTS = (3.0, 300.0), (0.1, 50.0)  #: Smallest and largest standard deviation. [N], [N·m]
#: A contact is split where the force is below so many standard deviations for so long [s], and
#: below this share of the peaks on both sides.
RELEASED, RELEASE_TIME, RELEASE_SHARE = 1.5, 0.08, 0.25
#: A contact is split too where the force falls below this share of the peaks on both sides, if
#: these point so far apart (cosine) and each side lasts so long [s]: one hand follows another.
HALF, TURNED, APART = 0.5, np.cos(np.radians(60.0)), 0.25


def smooth_contacts(
    log: BlockLog,
    jacobians: Sequence[Array],
    runs: Sequence[BlockSpan],
    priors: Sequence[WrenchPrior],
) -> list[WindowWrench]:
    """The wrench in the window of every contact.

    Args:
        log: The log.
        jacobians: J of each contact's point along the log. (K, 6, n) each
        runs: The blocks of every contact.
        priors: How the wrench of each may move.
    """
    return smooth_lanes(log, contact_lanes(log, jacobians, runs, priors))


def contact_lanes(
    log: BlockLog,
    jacobians: Sequence[Array],
    runs: Sequence[BlockSpan],
    priors: Sequence[WrenchPrior],
    margin: float = MARGIN,
) -> list[Lane]:
    """A lane for every contact, the others hidden.

    Args:
        log: The log.
        jacobians: J of each contact's point along the log. (K, 6, n) each
        runs: The blocks of every contact.
        priors: How the wrench of each may move.
        margin: How far a lane reaches beyond its contact. [s]
    """
    count = len(log.blocks.t)
    every, lanes = covered(runs, count, 1), []
    for run, jacobian, prior in zip(runs, jacobians, priors, strict=True):
        gate = covered([run], count, 1)
        window = window_of(log.blocks.t, run, margin)
        lanes.append(Lane(window, gate, every & ~gate, jacobian, prior))
    return lanes


def learn_prior(
    log: BlockLog, jacobian: Array, runs: Sequence[BlockSpan], prior: WrenchPrior, rounds: int
) -> WrenchPrior:
    """The prior by expectation and maximisation: τ_w by likelihood, then σ_f and σ_m by the mean.

    Args:
        log: The log.
        jacobian: J of the flange. (K, 6, n)
        runs: The blocks of every contact.
        prior: Where to start.
        rounds: How often.
    """
    each = [jacobian] * len(runs)
    for _ in range(rounds):
        priors = [prior._replace(time=time) for time in TIMES]
        lanes = [
            lane for p in priors for lane in contact_lanes(log, each, runs, [p] * len(runs), NEAR)
        ]
        nats = likelihoods(log, lanes).reshape(len(priors), len(runs)).sum(axis=1)
        time = TIMES[int(np.argmax(nats))]
        timed = [prior._replace(time=time)] * len(runs)
        courses = smooth_lanes(log, contact_lanes(log, each, runs, timed, NEAR))
        inside = [course.within(run) for course, run in zip(courses, runs, strict=True)]
        values = np.concatenate([course.values for course in inside])
        covariance = np.concatenate([course.covariance for course in inside])
        power = (values**2 + np.diagonal(covariance, axis1=1, axis2=2)).mean(axis=0)
        force, moment = np.sqrt(power[:3].mean()), np.sqrt(power[3:].mean())
        prior = WrenchPrior(time, float(np.clip(force, *FORCES)), float(np.clip(moment, *MOMENTS)))
    return prior


def split_run(t: Array, course: WindowWrench, run: BlockSpan, jacobian: Array) -> list[BlockSpan]:
    """A contact's blocks, split where force and joint torque are gone for a while between peaks.

    Args:
        t: Time. (K,) [s]
        course: The wrench in the contact's window.
        run: The contact's blocks.
        jacobian: J of the wrench's point. (K, 6, n)
    """
    inside = course.within(run)
    size = inside.size
    torque = np.linalg.norm(np.einsum("ki,kij->kj", inside.values, jacobian[slice(*run)]), axis=1)
    sd = np.sqrt(np.trace(inside.covariance[:, :3, :3], axis1=1, axis2=2))
    low, at = size < RELEASED * sd, t[run[0] : run[1]]
    pieces, begin = [], 0
    for k, end in quiet_pauses(low, at):
        if is_valley((size[begin:], torque[begin:]), k - begin, end - begin, RELEASE_SHARE):
            pieces.append((run[0] + begin, run[0] + k))
            begin = end
    pieces.append((run[0] + begin, run[1]))
    force = inside.values[:, :3]
    return [
        (first + run[0], last + run[0])
        for piece in pieces
        for first, last in split_at_turns(at, force, torque, (piece[0] - run[0], piece[1] - run[0]))
    ]


def split_at_turns(t: Array, force: Array, torque: Array, piece: BlockSpan) -> list[BlockSpan]:
    """A stretch of a contact, split at valleys of force and torque between different directions.

    Args:
        t: Time along the contact. (k,) [s]
        force: Its force. (k, 3) [N]
        torque: |Jᵀw|. (k,) [N·m]
        piece: First and last block of the stretch.
    """
    span = slice(*piece)
    at, there, load = t[span], force[span], torque[span]
    size = np.linalg.norm(there, axis=1)
    inner = np.flatnonzero((at - at[0] >= APART) & (at[-1] - at >= APART))
    for k in inner[np.argsort(size[inner])].tolist():
        if not is_valley((size, load), k, k + 1, HALF):
            continue
        i, j = int(np.argmax(size[:k])), k + int(np.argmax(size[k:]))
        if there[i] @ there[j] < TURNED * size[i] * size[j]:
            ends = (piece[0], piece[0] + k), (piece[0] + k, piece[1])
            return [part for end in ends for part in split_at_turns(t, force, torque, end)]
    return [piece]


def is_valley(series: Sequence[Array], start: int, stop: int, share: float) -> bool:
    """Whether all series fall below a share of their peaks on both sides."""
    return all(x[start:stop].min() < share * min(x[:start].max(), x[stop:].max()) for x in series)


def quiet_pauses(low: Mask, t: Array) -> list[tuple[int, int]]:
    """Runs of low blocks within a contact that last at least `RELEASE_TIME`."""
    usual = float(np.median(np.diff(t))) if len(t) > 1 else 0.0
    return [
        (start, stop)
        for start, stop in runs_of(low)
        if start > 0 and stop < len(low) and t[stop - 1] - t[start] + usual >= RELEASE_TIME
    ]
