"""How a wrench may move: its prior, chosen by the log, and the gate outside of which it is zero."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.robots.disturbance import Blocks
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.linear_model import LinearModel, beside_errors, log_likelihood
from vftcli.signals.series import covered, runs_of
from vftcli.virtual_sensor.smoother.noise import TorqueNoise, steps

LEVER = 0.1  #: Standard deviation of a moment over that of the force. [m]
TIMES = (1.0, 3.0, 10.0, 30.0, 100.0, 300.0)  #: Correlation times of a wrench that are tried. [s]
FORCES = (10.0, 30.0, 60.0)  #: Standard deviations of a force that are tried. [N]


class WrenchPrior(NamedTuple):
    """An Ornstein–Uhlenbeck prior of the wrench in base axes."""

    time: float  #: Correlation time τ_w. [s]
    force: float  #: Standard deviation σ_f of each component of the force. [N]
    #: That of the moment; `LEVER` times the force where none is known. [N·m]
    moment: float | None = None

    @property
    def is_steady(self) -> bool:
        """Whether it is the prior of a load rather than of contacts that come and go."""
        # What the force changes by in a second, where that is short against τ_w.
        change = self.force * np.sqrt(2.0 / self.time)
        return bool(self.time >= STEADY and change <= LOAD_CHANGE)

    @property
    def variance(self) -> Array:
        """Stationary variance of force and moment. (6,) [N², (N·m)²]"""
        moment = LEVER * self.force if self.moment is None else self.moment
        return np.repeat([self.force**2, moment**2], 3)

    def course(self, inside: Mask, step: Array) -> tuple[Array, Array]:
        """Share that is kept from the block before, and variance that is added. (K, 1), (K, 6)

        None is kept where the gate opens, and outside, where none is added either.

        Args:
            inside: Blocks in which there may be a wrench. (K,)
            step: Time from the block before. (K,) [s]
        """
        goes_on = inside & np.concatenate([[False], inside[:-1]])
        kept = np.where(goes_on, np.exp(-step / self.time), 0.0)[:, None]
        return kept, np.where(inside[:, None], self.variance * (1.0 - kept**2), 0.0)


STEADY = 30.0  #: A wrench that keeps for at least this long is a load, … [s]
LOAD_CHANGE = 5.0  #: … if it changes by no more than this (one standard deviation) in a second. [N]
#: The priors that are tried.
GRID = tuple(WrenchPrior(time, force) for time in TIMES for force in FORCES)


def gated(blocks: Blocks, intervals: Sequence[tuple[float, float]] | None) -> Mask:
    """Blocks in which there may be a wrench: listed intervals and a block on either side. (K,)

    Args:
        blocks: The blocks.
        intervals: From and to [s]; None where the whole log is one contact.
    """
    if intervals is None:
        return np.ones(len(blocks.t), dtype=bool)
    inside = np.zeros(len(blocks.t), dtype=bool)
    half = 0.5 * blocks.length
    for start, stop in intervals:
        touched = (blocks.t + half > start) & (blocks.t - half < stop)
        inside |= touched
    return covered(runs_of(inside), len(inside), 1)


def wrench_model(
    blocks: Blocks, J: Array, noise: TorqueNoise, priors: Sequence[WrenchPrior], inside: Mask
) -> LinearModel:
    """Wrench w and model error b under each of G priors: d = Jᵀw + b + noise. (K, G, 6 + n)

    Outside the gate the wrench is pinned to zero; the first block inside starts it with the prior's
    own variance, independent of before. So does the first block of the log the model error.

    Args:
        blocks: The blocks.
        J: Jacobian of the wrench's point. (K, 6, n)
        noise: Noise and model error.
        priors: The priors.
        inside: Blocks in which there may be a wrench. (K,)
    """
    count, n = blocks.d.shape
    decay, added = (np.zeros((count, len(priors), 6 + n)) for _ in range(2))
    step = steps(blocks)
    for g, prior in enumerate(priors):
        decay[:, g, :6], added[:, g, :6] = prior.course(inside, step)
    # Where the whole log may be touched nothing tells a push from what it re-settles.
    pushed = inside if not inside.all() else np.zeros(count, dtype=bool)
    variance, time = noise.course(blocks, pushed)
    kept = np.exp(-step[:, None] / time)
    kept[0] = 0.0
    decay[:, :, 6:] = kept[:, None, :]
    added[:, :, 6:] = (variance * (1.0 - kept**2))[:, None, :]
    known = blocks.known[:, None, None]
    return LinearModel(
        d=np.where(known, blocks.d[:, None], 0.0),
        observation=(beside_errors(J) * known)[:, None],
        white=np.where(known, noise.white, 1.0),
        decay=decay,
        added=added,
    )


def choose_prior(blocks: Blocks, J: Array, noise: TorqueNoise, inside: Mask) -> WrenchPrior:
    """The prior of `GRID` under which the log is most likely; the arguments of `wrench_model`."""
    return GRID[int(np.argmax(log_likelihood(wrench_model(blocks, J, noise, GRID, inside))))]
