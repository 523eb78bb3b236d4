"""The search along one log: candidates of both kinds, split, each with its evidence."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.contacts.candidates import filtered_contacts, threshold_contacts
from vftcli.contacts.evidence import evidence
from vftcli.contacts.places import ContactPlace, places
from vftcli.contacts.sizes import START, learn_prior, smooth_contacts, split_run
from vftcli.contacts.untouched import GAIN, SETTLED, expected_torque, observed
from vftcli.contacts.windows import BlockLog, BlockSpan
from vftcli.robots.disturbance import Blocks, disturbance_blocks
from vftcli.robots.run import Run
from vftcli.signals.arrays import Array
from vftcli.signals.series import runs_of
from vftcli.virtual_sensor.model_error import UNKNOWN, TorqueNoise, error_process, spiked_white
from vftcli.virtual_sensor.smoother import WrenchPrior

#: A torque that stays beyond the threshold for longer than this beside a contact is part of it: the
#: observer's lag is over, friction has turned. [s]
LASTING = 1.0


class Found(NamedTuple):
    """What may be contacts along a log."""

    log: BlockLog  #: The log in blocks, b strict.
    places: list[ContactPlace]  #: Where a contact may be.
    runs: list[BlockSpan]  #: Blocks of every candidate, in the order of time.
    evidence: Array  #: Of every candidate at every place. (C, places) [nats]
    #: Of every candidate whether a joint's torque is beyond its threshold in it.
    beyond: list[bool]
    prior: WrenchPrior  #: How the wrench of the candidates moves.

    @property
    def best(self) -> Array:
        """Evidence of each candidate's best place. (C,) [nats]"""
        found: Array = self.evidence.max(axis=1)
        return found

    def kept(self, chosen: Sequence[int]) -> "Found":
        """Some of the candidates."""
        return self._replace(
            runs=[self.runs[i] for i in chosen],
            evidence=self.evidence[list(chosen)],
            beyond=[self.beyond[i] for i in chosen],
        )

    def joined(self, groups: Sequence[Sequence[int]]) -> "Found":
        """The candidates of each group as one, their evidence added."""
        return self._replace(
            runs=[(self.runs[group[0]][0], self.runs[group[-1]][1]) for group in groups],
            evidence=np.array([self.evidence[list(group)].sum(axis=0) for group in groups]),
            beyond=[any(self.beyond[i] for i in group) for group in groups],
        )


def search(run: Run, noise: TorqueNoise, level: Array, seconds: float) -> Found:
    """Look for contacts along a log.

    Args:
        run: The log with its robot's model.
        noise: Noise and model error of free motion.
        level: Standard deviation of the momentum observer's torque in it. (n,) [N·m]
        seconds: Length of a block. [s]
    """
    blocks = disturbance_blocks(run.terms, run.q, seconds)
    there = places(run.robot.loaded_chain, blocks.q)
    J = there[0].jacobian
    ahead, back = error_process(noise, blocks), error_process(noise, turned_round(blocks))
    taken = filtered_contacts(blocks, (ahead, back), J)
    beyond = beyond_threshold(run, level, blocks)
    struck = taken.copy()
    # The filter takes a load that hangs on for many seconds for an error of the model, and sees
    # only what strikes it in the meantime: before, between and behind that the torque goes on.
    for start, stop in beyond:
        within, t = struck[start:stop], blocks.t[start:stop]
        for a, b in runs_of(~within) if within.any() else ():
            taken[start + a : start + b] |= t[b - 1] - t[a] > LASTING
    apart = [r for r in beyond if not taken[max(r[0] - 1, 0) : r[1] + 1].any()]
    runs = sorted([*runs_of(taken), *apart])
    for start, stop in runs:
        taken[start:stop] = True
    # What is no candidate keeps its spikes, whatever hypothesis is weighed.
    hidden = ahead._replace(white=np.where(taken[:, None], UNKNOWN, ahead.white))
    white = np.where(taken[:, None], ahead.white, spiked_white(blocks.d, hidden))
    log = BlockLog.of(blocks, ahead._replace(white=white))
    if not runs:
        return Found(log, there, [], np.zeros((0, len(there))), [], START)
    prior = learn_prior(log, J, runs, START, rounds=1)
    courses = smooth_contacts(log, [J] * len(runs), runs, [prior] * len(runs))
    pairs = zip(courses, runs, strict=True)
    pieces = [piece for course, run in pairs for piece in split_run(blocks.t, course, run, J)]
    passed = [any(a < stop and b > start for a, b in beyond) for start, stop in pieces]
    return Found(log, there, pieces, evidence(log, there, pieces, prior), passed, prior)


def turned_round(blocks: Blocks) -> Blocks:
    """The blocks of the log played backward."""
    return Blocks(
        t=-blocks.t[::-1],
        length=blocks.length[::-1],
        d=blocks.d[::-1],
        q=blocks.q[::-1],
        velocity=-blocks.velocity[::-1],
        known=blocks.known[::-1],
    )


def beyond_threshold(run: Run, level: Array, blocks: Blocks) -> list[BlockSpan]:
    """Runs of blocks in which a joint's torque is beyond its threshold."""
    t = run.t
    above = threshold_contacts(t, observed(run), expected_torque(run, level))
    above &= t >= t[0] + SETTLED
    found = []
    for start, stop in runs_of(above):
        # The observer lags by 1/gain.
        span = np.array([t[start], t[stop - 1]]) - 1.0 / GAIN
        first, last = (int(k) for k in np.searchsorted(blocks.t, span))
        last = max(last, first + 1)
        found.append((first, min(last, len(blocks.t))))
    return [each for each in found if each[0] < each[1]]
