"""Where a contact may be: two searches in joint space, for any arm and any place of contact.

The first is an interacting two-state filter (IMM). Its mode "free" says d = b + n, its mode
"contact" d = b + x + n with x of every joint an Ornstein–Uhlenbeck process, as large as a push of
30 N and 3 N·m at the flange makes; the mode is shared by all joints, the states are each joint's
own. It runs forward and backward in time, so that ends are as sharp as beginnings, for taps and for
leans.

The second is a threshold on a momentum observer. It finds what rises slowly or loads one joint
alone, which the first takes for friction.

References:
    H. A. P. Blom, Y. Bar-Shalom, "The interacting multiple model algorithm for systems with
    Markovian switching coefficients", IEEE Trans. Automatic Control 33(8), 1988.
"""

from typing import NamedTuple

import numpy as np

from vftcli.robots.disturbance import Blocks
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.linear_model import SPIKE
from vftcli.signals.series import covered, intervals
from vftcli.virtual_sensor.model_error import ErrorProcess, steps

#: A push as it may be: standard deviation of force and moment at the flange. [N, N·m]
PUSH = np.repeat([30.0, 3.0], 3)
#: Correlation time of a contact's torque and how long a contact lasts: for taps, for leans. [s]
SEARCHES = (0.3, 0.5), (2.0, 3.0)
#: Stretches in which a long log is searched, and what of the log before each is taken along. [s]
WARM_UP, STRETCH = 5.0, 10.0
BETWEEN = 30.0  #: Mean time from one contact to the next. [s]
AT_FIRST = 0.1  #: Probability that a log begins in contact.
#: Probability that a contact must reach in one direction of time, and in the other.
SURE, LIKELY = 0.99, 0.5
GAP = 0.12  #: Contacts closer than this are one. [s]
LEVEL = 4.0  #: Standard deviations of a joint's torque beyond which it is touched.
#: How long it must stay there, and the pause up to which two such stretches are one. [s]
LASTING, NEAR = 0.05, 0.2
MOST_ODDS = 300.0  #: Log odds are kept within ± this many nats.


class Search(NamedTuple):
    """What the filter's two modes believe, of every search and direction of time."""

    b: Array  #: Mean of b in mode 0, 1. (2, S, n)
    x: Array  #: Mean of x in mode 1. (S, n)
    bb: Array  #: Variance of b in mode 0, 1. (2, S, n)
    bx: Array  #: Covariance of b and x in mode 1. (S, n)
    xx: Array  #: Variance of x in mode 1. (S, n)
    odds: Array  #: ln P(contact)/P(free). (S,)


def filtered_contacts(blocks: Blocks, courses: tuple[ErrorProcess, ErrorProcess], J: Array) -> Mask:
    """Blocks that the two-state filter takes for contact. (K,)

    Args:
        blocks: The log.
        courses: How b goes forward along it, and along the log turned round.
        J: Jacobian of the flange. (K, 6, n)
    """
    size = np.sqrt(np.einsum("kij,i->kj", J**2, PUSH**2))
    odds = two_state_odds(blocks, courses, size)
    taken = np.zeros(len(blocks.t), dtype=bool)
    for forward, backward in odds:
        taken |= sure_runs(blocks, forward, backward)
    return taken


def sure_runs(blocks: Blocks, forward: Array, backward: Array) -> Mask:
    """Blocks of the runs in which the mean of two log odds is positive, one of them sure. (K,)"""
    sure, likely = (np.log(p / (1.0 - p)) for p in (SURE, LIKELY))
    high, low = np.maximum(forward, backward), np.minimum(forward, backward)
    seed = (high > sure) & (low > likely)
    runs = intervals(blocks.t, 0.5 * (forward + backward) > 0.0, gap=GAP)
    return covered([run for run in runs if seed[slice(*run)].any()], len(seed))


def two_state_odds(
    blocks: Blocks, courses: tuple[ErrorProcess, ErrorProcess], size: Array
) -> list[tuple[Array, Array]]:
    """Log odds of contact of the search for taps and of that for leans, forward and backward.

    A long log is searched in stretches side by side, each after `WARM_UP` seconds of the log before
    it, in which the filter forgets that it has just begun.

    Args:
        blocks: The log.
        courses: How b goes forward and backward.
        size: Standard deviation of each joint's torque in contact. (K, n) [N·m]
    """
    step = steps(blocks)
    step[0] = float(np.median(blocks.length))
    back = np.concatenate([step[:1], step[:0:-1]])
    ahead = (blocks.d, *courses[0], size**2, step[:, None])
    turned = (blocks.d[::-1], *courses[1], size[::-1] ** 2, back[:, None])
    usual = float(np.median(blocks.length))
    begins, warm, length = stretches_of(len(step), usual)
    inputs = [
        np.stack([stretch(series, k, length) for series in pair for k in begins for _ in SEARCHES])
        for pair in zip(ahead, turned, strict=True)
    ]
    odds = filtered_odds(*(np.moveaxis(series, 0, 1) for series in inputs))
    table = odds.reshape(length, 2, len(begins), len(SEARCHES))
    joined = np.concatenate([table[(warm if k else 0) :, :, i] for i, k in enumerate(begins)])
    found = joined[: len(step)]
    return [(found[:, 0, s], found[::-1, 1, s]) for s in range(len(SEARCHES))]


def stretches_of(count: int, step: float) -> tuple[list[int], int, int]:
    """First blocks of the stretches that are searched, their warm-up and their length. [blocks]"""
    warm, own = max(round(WARM_UP / step), 1), max(round(STRETCH / step), 2)
    if count <= warm + 2 * own:
        return [0], 0, count
    begins = [0, *range(own, count - warm, own)]
    return begins, warm, warm + own


def stretch(series: Array, first: int, length: int) -> Array:
    """So many blocks of a series from one on, its last one repeated beyond the end."""
    return series[np.minimum(np.arange(first, first + length), len(series) - 1)]


def filtered_odds(
    d: Array, decay: Array, added: Array, white: Array, spikes: Array, variance: Array, dt: Array
) -> Array:
    """Log odds ln P(contact)/P(free) along S searches side by side. (K, S)

    Args:
        d: Mean disturbance. (K, S, n) [N·m]
        decay: Share of b that is kept. (K, S, n)
        added: Variance that b is given. (K, S, n)
        white: R. (K, S, n)
        spikes: How often an innovation is a spike. (K, S, n)
        variance: Variance of a contact's torque. (K, S, n) [(N·m)²]
        dt: Time from the block before. (K, S, 1) [s]
    """
    blocks, count, n = d.shape
    time, lasts = (np.tile(each, count // len(SEARCHES)) for each in zip(*SEARCHES, strict=True))
    kept = np.exp(-dt[..., 0] / time)[..., None]
    # Behind a long gap neither mode is certain: 1 exactly would leave 0/0 of a certain one.
    begins, ends = (np.minimum(-np.expm1(-dt[..., 0] / s), 1.0 - 1e-9) for s in (BETWEEN, lasts))
    often = np.log(spikes) - 0.5 * np.log(SPIKE), np.log1p(-spikes)
    # A stretch begins with what b is like anywhere.
    added[0] /= np.maximum(1.0 - decay[0] ** 2, 1e-9)
    nought, first = np.zeros((count, n)), np.full(count, np.log(AT_FIRST / (1.0 - AT_FIRST)))
    both = np.zeros((2, count, n))
    state = Search(both, nought, both, nought, variance[0].copy(), first)
    odds = np.empty((blocks, count))
    for k in range(blocks):
        mixed = mix(state, begins[k], ends[k], variance[k])
        predicted = predict(mixed, decay[k], added[k], kept[k], variance[k])
        state = correct(predicted, d[k], white[k], (often[0][k], often[1][k]))
        odds[k] = state.odds
    return odds


def mix(state: Search, begins: Array, ends: Array, variance: Array) -> Search:
    """The states with which each mode begins the next block, moments matched."""
    p1 = 1.0 / (1.0 + np.exp(-state.odds))
    p0 = 1.0 - p1
    ahead0, ahead1 = p0 * (1.0 - begins) + p1 * ends, p0 * begins + p1 * (1.0 - ends)
    # Share of the contact mode in what each mode begins with. (2, S, 1)
    w = np.stack([p1 * ends / ahead0, p1 * (1.0 - ends) / ahead1])[:, :, None]
    apart = state.b[1] - state.b[0]
    b = state.b[0] + w * apart
    spread = w * (1.0 - w)
    bb = (1.0 - w) * state.bb[0] + w * state.bb[1] + spread * apart * apart
    w1, s1 = w[1], spread[1]
    x = w1 * state.x
    xx = w1 * state.xx + (1.0 - w1) * variance + s1 * state.x * state.x
    bx = w1 * state.bx + s1 * apart * state.x
    return Search(b, x, bb, bx, xx, np.log(ahead1 / ahead0))


def predict(state: Search, f: Array, added: Array, g: Array, variance: Array) -> Search:
    """The states a block later; x keeps the share g and wanders within its variance."""
    return Search(
        f * state.b,
        g * state.x,
        f * f * state.bb + added,
        f * g * state.bx,
        g * g * state.xx + variance * (1.0 - g * g),
        state.odds,
    )


def correct(state: Search, d: Array, white: Array, often: tuple[Array, Array]) -> Search:
    """The states with a block's disturbance in them; a joint that spikes tells a 40th."""
    S0 = state.bb[0] + white
    b1, cross, own = state.bb[1], state.bb[1] + state.bx, state.bx + state.xx
    S1 = cross + own + white
    S = np.stack([S0, S1])
    nu = np.stack([d - state.b[0], d - state.b[1] - state.x])
    square = nu * nu / S
    usual = often[1] - 0.5 * square
    spiked = often[0] - 0.5 * square / SPIKE
    likely = np.logaddexp(usual, spiked) - 0.5 * np.log(S)
    odds = state.odds + (likely[1] - likely[0]).sum(axis=1)
    S = np.where(spiked > usual, SPIKE * S, S)
    K0, K1, Kx = state.bb[0] / S[0], cross / S[1], own / S[1]
    return Search(
        np.stack([state.b[0] + K0 * nu[0], state.b[1] + K1 * nu[1]]),
        state.x + Kx * nu[1],
        np.stack([state.bb[0] * (1.0 - K0), b1 - K1 * cross]),
        state.bx - K1 * own,
        state.xx - Kx * own,
        np.clip(odds, -MOST_ODDS, MOST_ODDS),
    )


def threshold_contacts(t: Array, torque: Array, sd: Array) -> Mask:
    """Samples in which a joint's torque is beyond `LEVEL` standard deviations for a while. (T,)

    Args:
        t: Time. (T,) [s]
        torque: An observer's estimate. (T, n) [N·m]
        sd: Its standard deviation where nothing touches. (T, n) [N·m]
    """
    above: Mask = np.any(np.abs(torque) > LEVEL * sd, axis=1)
    return covered(intervals(t, above, least=LASTING, gap=NEAR), len(t))
