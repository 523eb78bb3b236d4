"""Search along one log: candidates of two kinds, split, each with evidence.

The first kind is found by an interacting two-state filter (IMM) in joint space. Its mode
"free" is d = b + n, its mode "contact" d = b + x + n with x of every joint an
Ornstein–Uhlenbeck process, as large as a push of 30 N and 3 N·m at the flange makes. All
joints share the mode. It runs forward and backward in time, for taps and for leans.

The second is beyond a momentum observer's threshold: a slow rise, or one joint loaded
alone, which looks like friction to the filter.

References:
    H. A. P. Blom, Y. Bar-Shalom, "The interacting multiple model algorithm for systems with
    Markovian switching coefficients", IEEE Trans. Automatic Control 33(8), 1988.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.contacts.free_statistics import GAIN, beyond_threshold
from vftcli.contacts.windows import (
    START,
    ContactPlace,
    WindowWrench,
    contact_lanes,
    evidence,
    learn_prior,
    places,
    smooth_lanes,
    times_of,
)
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.run import Run
from vftcli.robots.terms import Blocks, disturbance_blocks
from vftcli.signals.arrays import Array, Mask, covered, intervals, runs_of
from vftcli.signals.estimation import SPIKE
from vftcli.wrench.model_error import (
    ErrorProcess,
    TorqueNoise,
    error_process,
    spiked_white,
    steps,
)
from vftcli.wrench.smoother import BlockLog, BlockSpan, WrenchPrior

#: Longer beyond the threshold beside a contact is part of it, no lag. [s]
LASTING = 1.0
#: A push as it may be: SD of force and moment at the flange. [N, N·m]
PUSH = np.repeat([30.0, 3.0], 3)
#: Correlation time and length, for taps and for leans. [s]
SEARCHES = (0.3, 0.5), (2.0, 3.0)
#: Warm-up and length of the stretches of a long log. [s]
WARM_UP, STRETCH = 5.0, 10.0
BETWEEN = 30.0  #: Mean time from one contact to the next. [s]
AT_FIRST = 0.1  #: Probability that a log begins in contact.
#: Least probability of a contact in one direction of time, and in the other.
SURE, LIKELY = 0.99, 0.5
GAP = 0.12  #: Contacts closer than this are one. [s]
MOST_ODDS = 300.0  #: Log odds are kept within ± this many nats.
#: A contact is split where the force is below so many SDs for so long
#: [s], and below this share of the peaks on both sides.
RELEASED, RELEASE_TIME, RELEASE_SHARE = 1.5, 0.08, 0.25
#: Also split where the force falls below this share of both peaks,
#: if they point so far apart (cosine) and each lasts so long [s].
HALF, TURNED, APART = 0.5, np.cos(np.radians(60.0)), 0.25


class Candidates(NamedTuple):
    """Possible contacts along a log."""

    log: BlockLog  #: The log in blocks, b strict.
    places: list[ContactPlace]  #: Possible places of a contact.
    runs: list[BlockSpan]  #: Blocks of every candidate, in the order of time.
    evidence: Array  #: Of every candidate at every place. (C, places) [nats]
    #: Whether a joint's torque is beyond its threshold in each.
    beyond: list[bool]
    prior: WrenchPrior  #: Prior of the candidates' wrench.

    @property
    def best(self) -> Array:
        """Evidence of each candidate's best place. (C,) [nats]"""
        return np.asarray(self.evidence.max(axis=1))

    @property
    def spans(self) -> list[Array]:
        """When each candidate begins and ends. (C, 2) [s]"""
        return [times_of(self.log.blocks, run) for run in self.runs]

    @property
    def lasts(self) -> list[float]:
        """Length of each candidate. (C,) [s]"""
        return [self.log.blocks.length[slice(*run)].sum() for run in self.runs]

    def kept(self, chosen: Sequence[int]) -> "Candidates":
        """Some of the candidates."""
        return self.joined([[i] for i in chosen])

    def joined(self, groups: Sequence[Sequence[int]]) -> "Candidates":
        """The candidates of each group as one, their evidence added."""
        sums = [self.evidence[list(group)].sum(axis=0) for group in groups]
        return self._replace(
            runs=[(self.runs[group[0]][0], self.runs[group[-1]][1]) for group in groups],
            evidence=np.reshape(sums, (-1, len(self.places))),
            beyond=[any(self.beyond[i] for i in group) for group in groups],
        )


def search(run: Run, noise: TorqueNoise, level: Array, seconds: float) -> Candidates:
    """Possible contacts along a log in blocks [s], by free motion's noise and level."""
    blocks = disturbance_blocks(run.terms, run.q, seconds)
    options = places(run.robot.loaded_chain, blocks.q)
    flange, J = options[0].jacobian, flange_jacobian(run.robot.loaded_chain, blocks.q)
    ahead, back = error_process(noise, blocks), blocks.part(slice(None, None, -1))
    back = back._replace(t=-back.t, velocity=-back.velocity)
    inside = filtered_contacts(blocks, (ahead, error_process(noise, back)), J)
    spans = np.reshape(runs_of(beyond_threshold(run, level)), (-1, 2)).astype(int)
    # The observer lags by 1/gain.
    first, last = blocks.t.searchsorted(run.t[spans - [0, 1]] - 1.0 / GAIN).T
    last = np.minimum(np.maximum(last, first + 1), len(blocks.t))
    beyond = [(a, b) for a, b in np.stack([first, last], axis=1).tolist() if a < b]
    struck = inside.copy()
    # A long load looks like a model error: the search goes on around it.
    for start, stop in beyond:
        within, t = struck[start:stop], blocks.t[start:stop]
        for a, b in runs_of(~within) if within.any() else ():
            inside[start + a : start + b] |= t[b - 1] - t[a] > LASTING
    apart = [r for r in beyond if not inside[max(r[0] - 1, 0) : r[1] + 1].any()]
    runs = sorted([*runs_of(inside), *apart])
    inside |= covered(runs, len(inside))
    # No candidate: spikes stay under every hypothesis.
    spiked = spiked_white(blocks.d, ahead.hiding(inside))
    white = np.where(inside[:, None], ahead.white, spiked)
    log = BlockLog(blocks, ahead._replace(white=white))
    if not runs:
        return Candidates(log, options, [], np.zeros((0, len(options))), [], START)
    prior = learn_prior(log, flange, runs, START, rounds=1)
    wrenches = smooth_lanes(contact_lanes(log, runs, flange), [prior] * len(runs))
    pairs = zip(wrenches, runs, strict=True)
    pieces = [piece for pair in pairs for piece in split_run(blocks.t, *pair, J)]
    passed = [any(a < stop and b > start for a, b in beyond) for start, stop in pieces]
    return Candidates(log, options, pieces, evidence(log, options, pieces, prior), passed, prior)


def filtered_contacts(
    blocks: Blocks, processes: tuple[ErrorProcess, ErrorProcess], J: Array
) -> Mask:
    """Contact: runs of positive mean log odds, one of the two sure. (K,)"""
    size = np.sqrt(np.einsum("kij,i->kj", J**2, PUSH**2))
    sure, likely = (np.log(p / (1.0 - p)) for p in (SURE, LIKELY))
    inside = np.zeros(len(blocks.t), bool)
    for forward, backward in two_state_odds(blocks, processes, size):
        low = np.minimum(forward, backward)
        seed = (np.maximum(forward, backward) > sure) & (low > likely)
        runs = intervals(blocks.t, 0.5 * (forward + backward) > 0.0, gap=GAP)
        inside |= covered([run for run in runs if seed[slice(*run)].any()], len(seed))
    return inside


def two_state_odds(
    blocks: Blocks, processes: tuple[ErrorProcess, ErrorProcess], size: Array
) -> list[tuple[Array, Array]]:
    """Log odds of contact, forward and backward, for taps and for leans.

    A long log is searched in stretches side by side, each after `WARM_UP` seconds.
    """
    step, usual, many = steps(blocks), np.median(blocks.length), len(SEARCHES)
    step[0] = usual
    back = np.concatenate([step[:1], step[:0:-1]])
    ahead = (blocks.d, *processes[0], size**2, step[:, None])
    turned = (blocks.d[::-1], *processes[1], size[::-1] ** 2, back[:, None])
    warm, own = max(round(WARM_UP / usual), 1), max(round(STRETCH / usual), 2)
    begins, length = [0, *range(own, len(step) - warm, own)], warm + own
    if len(step) <= warm + 2 * own:
        begins, warm, length = [0], 0, len(step)
    # The last block is repeated beyond the end.
    at = np.minimum(np.add.outer(begins, np.arange(length)), len(step) - 1)
    pairs = (np.concatenate([x[at], y[at]]) for x, y in zip(ahead, turned, strict=True))
    inputs = (pair.repeat(many, axis=0).swapaxes(0, 1) for pair in pairs)
    table = filtered_odds(*inputs).reshape(length, 2, len(begins), many)
    joined = np.concatenate([table[(warm if k else 0) :, :, i] for i, k in enumerate(begins)])
    odds = joined[: len(step)]
    return [(odds[:, 0, s], odds[::-1, 1, s]) for s in range(many)]


class ImmState(NamedTuple):
    """State of the two-mode filter, of every search both ways."""

    b: Array  #: Mean of b in mode 0, 1. (2, S, n)
    x: Array  #: Mean of x in mode 1. (S, n)
    bb: Array  #: Variance of b in mode 0, 1. (2, S, n)
    bx: Array  #: Covariance of b and x in mode 1. (S, n)
    xx: Array  #: Variance of x in mode 1. (S, n)
    odds: Array  #: ln P(contact)/P(free). (S,)


def filtered_odds(
    d: Array, decay: Array, added: Array, white: Array, spikes: Array, variance: Array, dt: Array
) -> Array:
    """Log odds ln P(contact)/P(free) along S searches side by side. (K, S)

    Arrays are (K, S, n), of b and of a contact's torque; dt (K, S, 1) is from block to block.
    """
    count, n = d.shape[1:]
    time, lasts = np.tile(np.transpose(SEARCHES), count // len(SEARCHES))
    kept = np.exp(-dt / time[:, None])
    # Behind a long gap exactly 1 leaves 0/0.
    begins, ends = (np.minimum(-np.expm1(-dt[..., 0] / s), 1.0 - 1e-9) for s in (BETWEEN, lasts))
    turns = np.stack([1.0 - begins, begins], axis=1), np.stack([ends, 1.0 - ends], axis=1)
    often = np.log(spikes) - 0.5 * np.log(SPIKE), np.log1p(-spikes)
    # A stretch begins with what b is like anywhere.
    added[0] /= np.maximum(1.0 - decay[0] ** 2, 1e-9)
    both, first = np.zeros((2, count, n)), np.full(count, np.log(AT_FIRST / (1.0 - AT_FIRST)))
    state, odds = ImmState(both, both[0], both, both[0], variance[0], first), []
    ahead = zip(*turns, decay, added, kept, variance, strict=True)
    for moves, here in zip(ahead, zip(d, white, *often, strict=True), strict=True):
        state = imm_update(imm_predict(state, *moves), *here)
        odds.append(state.odds)
    return np.array(odds)


def imm_predict(
    state: ImmState, free: Array, held: Array, f: Array, added: Array, g: Array, variance: Array
) -> ImmState:
    """The states of each mode a block later, moments matched.

    From mode 0 probability goes to each mode by `free`, from mode 1 by `held`. (2, S)
    State b keeps the share f and gains variance; x keeps g, its variance is stationary.
    """
    come = np.exp(state.odds) * held
    ahead = free + come
    # Share of the contact mode in what each mode begins with. (2, S, 1)
    w = (come / ahead)[:, :, None]
    rest, apart, x = 1.0 - w, state.b[1] - state.b[0], state.x
    b = f * (state.b[0] + w * apart)
    bb = state.bb[0] + w * (state.bb[1] - state.bb[0] + rest * (apart * apart))
    stays, aside = g * w[1], rest[1] * x
    xx = variance + g * stays * (state.xx - variance + aside * x)
    bx = f * stays * (state.bx + aside * apart)
    return ImmState(b, stays * x, f * f * bb + added, bx, xx, np.log(ahead[1] / ahead[0]))


def imm_update(state: ImmState, d: Array, white: Array, spike: Array, none: Array) -> ImmState:
    """The states updated by a block's disturbance; a spike counts a 40th."""
    own = state.bx + state.xx
    # Covariance of b, as each mode has it, with d. (2, S, n)
    cross = state.bb.copy()
    cross[1] += state.bx
    S, nu = cross + white, d - state.b
    S[1] += own
    nu[1] -= state.x
    square = nu * nu / S
    usual = none - 0.5 * square
    spiked = spike - 0.5 / SPIKE * square
    likely = np.logaddexp(usual, spiked) - 0.5 * np.log(S)
    odds = state.odds + (likely[1] - likely[0]).sum(axis=1)
    S = np.where(spiked > usual, SPIKE * S, S)
    K, Kx = cross / S, own / S[1]
    return ImmState(
        state.b + K * nu,
        state.x + Kx * nu[1],
        state.bb - K * cross,
        state.bx - K[1] * own,
        state.xx - Kx * own,
        np.minimum(np.maximum(odds, -MOST_ODDS), MOST_ODDS),
    )


def split_run(t: Array, wrench: WindowWrench, run: BlockSpan, jacobian: Array) -> list[BlockSpan]:
    """A contact's blocks, split where force and torque pause."""
    inside = wrench.within(run)
    size = inside.size
    torque = np.linalg.norm(np.einsum("ki,kij->kj", inside.values, jacobian[slice(*run)]), axis=1)
    sd = np.sqrt(np.trace(inside.covariance[:, :3, :3], axis1=1, axis2=2))
    low, at, force = size < RELEASED * sd, t[slice(*run)], inside.values[:, :3]
    pieces, begin, usual = [], 0, np.median(np.diff(at)) if len(at) > 1 else 0.0
    for k, end in runs_of(low):
        if k == 0 or end == len(at) or at[end - 1] - at[k] + usual < RELEASE_TIME:
            continue
        if is_valley((size[begin:], torque[begin:]), k - begin, end - begin, RELEASE_SHARE):
            pieces += split_at_turns(at, force, torque, (begin, k))
            begin = end
    pieces += split_at_turns(at, force, torque, (begin, len(at)))
    return [(first + run[0], last + run[0]) for first, last in pieces]


def split_at_turns(t: Array, force: Array, torque: Array, piece: BlockSpan) -> list[BlockSpan]:
    """A contact's stretch, split between forces of different directions."""
    span = slice(*piece)
    at, there, load = t[span], force[span], torque[span]
    size = np.linalg.norm(there, axis=1)
    inner = np.flatnonzero((at - at[0] >= APART) & (at[-1] - at >= APART))
    for k in inner[size[inner].argsort()].tolist():
        if not is_valley((size, load), k, k + 1, HALF):
            continue
        i, j = size[:k].argmax(), k + size[k:].argmax()
        if there[i] @ there[j] < TURNED * size[i] * size[j]:
            start, stop = piece
            before = split_at_turns(t, force, torque, (start, start + k))
            return before + split_at_turns(t, force, torque, (start + k, stop))
    return [piece]


def is_valley(series: Sequence[Array], start: int, stop: int, share: float) -> bool:
    """Whether all series fall below a share of their peaks on both sides."""
    return all(x[start:stop].min() < share * min(x[:start].max(), x[stop:].max()) for x in series)
