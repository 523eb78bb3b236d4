"""Windows: the stretches of a log in which its contacts are weighed and measured."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from vftcli.robots.disturbance import Blocks
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.linear_model import (
    LinearModel,
    beside_errors,
    log_likelihood,
    smoothed,
)
from vftcli.virtual_sensor.model_error import UNKNOWN, ErrorProcess, steps
from vftcli.virtual_sensor.smoother import WrenchPrior

MARGIN = 1.0  #: How far a window reaches beyond its contacts on either side. [s]
MOST_LANES = 96  #: Lanes that are worked on at once.
BlockSpan = tuple[int, int]  #: Number of the first block, and of the one behind the last.


class BlockLog(NamedTuple):
    """A log in blocks, with what its model errs by."""

    blocks: Blocks  #: The blocks.
    course: ErrorProcess  #: How b goes along them.
    step: Array  #: Time from the block before. (K,) [s]

    @classmethod
    def of(cls, blocks: Blocks, course: ErrorProcess) -> "BlockLog":
        """The log of these blocks."""
        return cls(blocks, course, steps(blocks))


class Lane(NamedTuple):
    """One hypothesis on one window."""

    window: BlockSpan  #: Which blocks.
    gate: Mask  #: Blocks of the log in which the wrench may differ from zero. (K,)
    hidden: Mask  #: Blocks of the log that say nothing. (K,)
    jacobian: Array  #: J along the log. (K, 6, n)
    prior: WrenchPrior | None  #: How the wrench may move; None where nothing touches.


def window_of(t: Array, run: BlockSpan, margin: float = MARGIN) -> BlockSpan:
    """The blocks within `margin` of a run of them."""
    first = int(np.searchsorted(t, t[run[0]] - margin))
    last = int(np.searchsorted(t, t[run[1] - 1] + margin, side="right"))
    return first, last


def batches(lanes: Sequence[Lane]) -> Iterator[list[int]]:
    """Numbers of lanes that are about equally long, so that little is padded."""
    length = [stop - start for start, stop in (lane.window for lane in lanes)]
    order = sorted(range(len(lanes)), key=length.__getitem__)
    batch: list[int] = []
    for number in order:
        if batch and (len(batch) == MOST_LANES or length[number] > 1.5 * length[batch[0]] + 20):
            yield batch
            batch = []
        batch.append(number)
    if batch:
        yield batch


def assembled(log: BlockLog, lanes: Sequence[Lane]) -> LinearModel:
    """Lanes side by side; shorter ones end in blocks that say nothing."""
    n = log.blocks.d.shape[1]
    longest = max(lane.window[1] - lane.window[0] for lane in lanes)
    shape = (longest, len(lanes))
    d, jacobian = np.zeros((*shape, n)), np.zeros((*shape, 6, n))
    white, decay = np.full((*shape, n), UNKNOWN), np.ones((*shape, 6 + n))
    added = np.zeros((*shape, 6 + n))
    decay[:, :, :6] = 0.0
    for i, lane in enumerate(lanes):
        first, last = lane.window
        span, count = slice(first, last), last - first
        d[:count, i] = log.blocks.d[span]
        white[:count, i] = np.where(lane.hidden[span, None], UNKNOWN, log.course.white[span])
        decay[:count, i, 6:] = log.course.decay[span]
        added[:count, i, 6:] = log.course.added[span]
        # A window begins with what b is like anywhere, not with what it was before.
        kept = decay[0, i, 6:].copy()
        decay[0, i, 6:] = 0.0
        added[0, i, 6:] /= np.maximum(1.0 - kept**2, 1e-9)
        if lane.prior is None:
            continue
        jacobian[:count, i] = lane.jacobian[span]
        course = lane.prior.process(lane.gate[span], log.step[span])
        decay[:count, i, :6], added[:count, i, :6] = course
    return LinearModel(d, beside_errors(jacobian), white, decay, added)


def padding(log: BlockLog, lanes: Sequence[Lane]) -> Array:
    """What the blocks behind lanes side by side take off each one's log likelihood. (L,) [nats]"""
    length = np.array([stop - start for start, stop in (lane.window for lane in lanes)])
    found: Array = 0.5 * (length.max() - length) * log.blocks.d.shape[1] * np.log(UNKNOWN)
    return found


def likelihoods(log: BlockLog, lanes: Sequence[Lane]) -> Array:
    """Log likelihood ln p(d) of every lane; only lanes of one window may be compared. [nats]"""
    found = np.empty(len(lanes))
    for batch in batches(lanes):
        some = [lanes[i] for i in batch]
        found[batch] = log_likelihood(assembled(log, some)) + padding(log, some)
    return found


class WindowWrench(NamedTuple):
    """The wrench in one window, zero with certainty outside its gate."""

    first: int  #: Number of the window's first block.
    values: Array  #: Force and moment in base axes. (k, 6) [N, N·m]
    covariance: Array  #: (k, 6, 6)

    def within(self, run: BlockSpan) -> "WindowWrench":
        """The wrench in some of its blocks."""
        span = slice(run[0] - self.first, run[1] - self.first)
        return WindowWrench(run[0], self.values[span], self.covariance[span])

    @property
    def size(self) -> Array:
        """|F|. (k,) [N]"""
        found: Array = np.linalg.norm(self.values[:, :3], axis=1)
        return found


def smooth_lanes(log: BlockLog, lanes: Sequence[Lane]) -> list[WindowWrench]:
    """The smoothed wrench of every lane along its window."""
    found: list[WindowWrench | None] = [None] * len(lanes)
    for batch in batches(lanes):
        mean, covariance = smoothed(assembled(log, [lanes[i] for i in batch]))
        for place, i in enumerate(batch):
            count = lanes[i].window[1] - lanes[i].window[0]
            found[i] = WindowWrench(
                lanes[i].window[0], mean[:count, place, :6], covariance[:count, place, :6, :6]
            )
    return [each for each in found if each is not None]
