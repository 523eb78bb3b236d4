"""Windows of a log: evidence of its contacts, and their smoothed wrench.

A contact may be at the flange or on a link; the joints behind its place, which do not
feel it, show where. Outside its contact a wrench is zero: the quiet blocks on both sides
show the model error. Other contacts are hidden, and the wrench's prior is learned.

Evidence is the log likelihood of a stretch with a contact less that without, in nats, by
the smoother's forward pass with the Jacobian of the place. The best place counts.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import lru_cache
from itertools import product
from typing import Literal, NamedTuple

import numpy as np

from vftcli.robots.chain import Chain, link_jacobian, link_poses, points_on
from vftcli.robots.terms import Blocks
from vftcli.signals.arrays import Array, covered
from vftcli.signals.estimation import SPIKE, LinearModel, log_likelihood, smoothed
from vftcli.signals.pose import Pose
from vftcli.wrench.model_error import UNKNOWN, ErrorProcess, error_model, innovations
from vftcli.wrench.smoother import BlockLog, BlockSpan, JacobianIn, Lane, WrenchPrior, assembled

ArmPart = Literal["wrist", "forearm", "upper arm", "cannot tell"]  #: A part of the arm.
POINTS = 10  #: Points along each link that a force is tried at.
#: First link that is tried: on link 1 a force looks like friction.
FIRST_LINK = 2
#: Lever of a force about the flange or a link's middle. [m]
LEAST_LEVER = 0.1
FORCE_PRIOR = 100.0  #: SD that a force is given beforehand. [N]
ALIKE = 4.0  #: Points this near to the best score fit too.
#: χ² of the best point beyond which a contact is no point force.
MORE_THAN_A_FORCE = 20.0


class ContactPlace(NamedTuple):
    """A place at which a contact is weighed."""

    link: int  #: Number of the link; 0 for the flange.
    lever: float  #: SD of the moment over that of the force. [m]
    jacobian: JacobianIn  #: J of its point.


def places(chain: Chain, q: Array) -> list[ContactPlace]:
    """The flange, and the middle of every link from `FIRST_LINK` on."""
    poses = lru_cache(MOST_LANES)(lambda first, last: link_poses(chain, q[first:last]))
    at, n = poses(0, 1).translation[0], chain.joints
    found = [ContactPlace(0, LEAST_LEVER, jacobian_of(poses, n, 1.0))]
    for link in range(FIRST_LINK, n + 1):
        lever = max(LEAST_LEVER, 0.5 * float(np.linalg.norm(at[link] - at[link - 1])))
        found.append(ContactPlace(link, lever, jacobian_of(poses, link, 0.5)))
    return found


def jacobian_of(poses: Callable[[int, int], Pose], link: int, share: float) -> JacobianIn:
    """J of a point along a link, in windows: a long log's would not fit."""
    return lru_cache(MOST_LANES)(lambda *window: link_jacobian(poses(*window), link, share))


def arm_parts(joints: int) -> dict[int, ArmPart]:
    """Link → part of the arm; 0 is the flange, which belongs to the wrist.

    Of six joints links 4 to 6 are the wrist and link 3 the forearm; of seven joints links
    6 and 7, and 4 and 5. The links before are the upper arm.
    """
    forearm, wrist = (3, 4) if joints <= 6 else (4, 6)
    links = range(1, joints + 1)
    names: list[ArmPart] = ["upper arm", "forearm", "wrist"]
    return {0: "wrist", **{k: names[(k >= forearm) + (k >= wrist)] for k in links}}


class PointFit(NamedTuple):
    """A force at a point of a link, as it explains a torque."""

    link: int  #: The link, from 1; the last one's end is the flange.
    share: float  #: Share along the link, from its joint (0) to the next (1).
    misfit: float  #: χ² of the torque that is left.
    score: float  #: χ² and what the size of the force costs.
    size: float  #: Size of the force. [N]
    force: Array  #: The force in base axes. (3,) [N]
    band: float  #: Half width of the 95 % band of its size. [N]


def point_fits(chain: Chain, q: Array, torque: Array, sd: Array) -> list[PointFit]:
    """Forces at points of the links that fit within `ALIKE`, the best first.

    `POINTS` a link are tried, from `FIRST_LINK` on. F = (AᵀA + I/σ²)⁻¹Aᵀ(τ/sd), A the rows
    of the point's Jacobian over sd. Joints behind it predict zero, which shows the place.
    """
    poses, n = link_poses(chain, q[None]), chain.joints
    links = np.arange(FIRST_LINK, n + 1).repeat(POINTS)
    along = np.tile(np.arange(1, POINTS + 1) / POINTS, n + 1 - FIRST_LINK)
    points = points_on(poses, links, along[:, None])[0]
    origins = poses.translation[0, :-1]
    rows = np.cross(poses.rotation[0, :-1, :, 2][None], points[:, None] - origins[None])
    rows[np.arange(n)[None] >= links[:, None]] = 0.0
    A, y = rows / sd[:, None], torque / sd
    precision = A.swapaxes(1, 2) @ A + np.eye(3) / FORCE_PRIOR**2
    covariance = np.linalg.inv(precision)
    forces = (covariance @ (A.swapaxes(1, 2) @ y)[..., None])[..., 0]
    misfit = np.sum((y - (A @ forces[..., None])[..., 0]) ** 2, axis=1)
    score = misfit + np.sum(forces**2, axis=1) / FORCE_PRIOR**2
    size = np.linalg.norm(forces, axis=1)
    u = forces / np.maximum(size, 1e-12)[:, None]
    bands = 1.96 * np.sqrt(np.einsum("pi,pij,pj->p", u, covariance, u))
    least = score.min() + ALIKE
    order = score.argsort(kind="stable")[: np.count_nonzero(score <= least)]
    columns = (x[order].tolist() for x in (links, along, misfit, score, size))
    return [PointFit(*each) for each in zip(*columns, forces[order], bands[order], strict=True)]


MARGIN = 1.0  #: Length of a window beyond its contacts. [s]
NEAR = 0.4  #: That length where only the prior is learned. [s]
CERTAIN = 1e-30  #: Least variance of the model error. [(N·m)²]
MOST_LANES = 96  #: Lanes that are worked on at once.
START = WrenchPrior(0.3, 30.0, 3.0)  #: The prior that learning starts from.
TIMES = 0.03, 0.1, 0.3, 1.0, 3.0, 10.0, 100.0  #: Correlation times that are tried. [s]
#: Smallest and largest SD. [N], [N·m]
FORCES, MOMENTS = ((3.0, 300.0), (0.1, 50.0))
#: Evidence over nothing, which may spike. [nats] In 299 s of real free motion one
#: reversal had 15, all else but abrupt stops below 6.
LEAST_EVIDENCE = 12.0
#: In motion that nobody named free. [nats] Errors reach 82 on six arms; 75 to 200 do alike.
LEAST_IN_MOTION = 120.0
LEAST_FORCE = 10.0  #: Smallest SD of a force that is tried. [N]
LONGEST_TIME = 1.0  #: Longest correlation time of a moving wrench. [s]
SIZES = 1.0, 3.0  #: Multiples of the SD that are tried.
#: Longer candidates may also be a steady wrench of this time. [s]
LASTING, STEADY_TIME = 1.5, 100.0


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
        return np.asarray(np.linalg.norm(self.values[:, :3], axis=1))


def times_of(blocks: Blocks, run: BlockSpan) -> Array:
    """When a run of blocks begins and ends. (2,) [s]"""
    ends = [run[0], run[1] - 1]
    return blocks.t[ends] + blocks.length[ends] * [-0.5, 0.5]


def contact_lanes(
    log: BlockLog,
    runs: Sequence[BlockSpan],
    jacobian: JacobianIn,
    margin: float = MARGIN,
    tail: float = 0.0,
) -> Iterator[Lane]:
    """A lane without prior for every run: its blocks, one and `tail` [s] more on either side.

    That one says of the model error b what all quiet blocks there do, so far as `margin`. Before
    the run they leave b with mean m and variance p, as d = 2m of variance 2p does with a prior
    of 2p. Behind it they make N(m, p) of N(0, v), as d = mR/p of variance R = 1/(1/p − 1/v) does;
    v is the least R, for which no digit is lost.
    """
    if not runs:
        return
    t, (start, stop) = log.blocks.t, np.transpose(runs)
    reach, more = margin + tail, 1 + round(tail / np.median(log.blocks.length))
    first, last = t.searchsorted(t[start] - reach), t.searchsorted(t[stop - 1] + reach, "right")
    # No gate goes into another contact.
    free_from, free_to = np.append(0, stop[:-1] + 1), np.append(start[1:] - 1, len(t))
    start, stop = (
        np.maximum(np.maximum(start - more, np.minimum(free_from, start - 1)), first),
        np.minimum(np.minimum(stop + more, np.maximum(free_to, stop + 1)), last),
    )
    begin, length = np.append(first, stop), np.append(start - first, last - stop)
    number = np.arange(length.max(initial=1))[:, None]
    at, inside = np.minimum(begin + number, len(t) - 1), (number < length)[..., None]
    quiet = log.process.hiding(covered(runs, len(t), 1))
    d, decay, added, white = (x[at] for x in (log.blocks.d, *quiet[:3]))
    behind, least = slice(len(runs), None), log.process.white.min(axis=0)
    added[0] /= np.maximum(1.0 - decay[0] ** 2, 1e-9)
    decay[0], added[0, behind] = 0.0, least
    decay *= inside
    process = ErrorProcess(decay, added, np.where(inside, white, UNKNOWN), d)
    mean, variance = quiet_error(d, process)
    last_before = np.maximum(start - first, 1) - 1, np.arange(len(runs))
    m, p = 2.0 * mean[last_before], 2.0 * variance[last_before]
    weight = np.maximum(1.0 / variance[0, behind] - 1.0 / least, 1.0 / UNKNOWN)
    known = mean[0, behind] / variance[0, behind] / weight
    for i, (a, b) in enumerate(np.transpose([start, stop]).tolist()):
        window = a - (a > first[i]), b + (b < last[i])
        some = slice(*window)
        d, decay, added, white, spikes = (x[some].copy() for x in (log.blocks.d, *log.process))
        if window[0] < a:
            d[0], decay[0], added[0], white[0] = m[i], 0.0, p[i], p[i]
        if window[1] > b:
            d[-1], white[-1] = known[i], 1.0 / weight[i]
        blocks = log.blocks.part(some)._replace(d=d)
        piece = BlockLog(blocks, ErrorProcess(decay, added, white, spikes))
        gate = covered([(a - window[0], b - window[0])], len(d))
        yield Lane(piece, window, gate, jacobian, None)


def quiet_error(d: Array, process: ErrorProcess) -> tuple[Array, Array]:
    """Mean and variance of b by the d that are not hidden. (K, …, n)"""
    mean, covariance = smoothed(error_model(d, process))
    return mean[..., 0], np.maximum(covariance[..., 0, 0], CERTAIN)


def batches(lanes: Sequence[Lane]) -> Iterator[list[int]]:
    """Numbers of lanes of about equal length."""
    length = np.array([len(lane.gate) for lane in lanes])
    left = length.argsort(kind="stable")
    while left.size:
        alike = length[left[:MOST_LANES]] <= 1.5 * length[left[0]] + 20
        batch, left = np.split(left, [np.count_nonzero(alike)])
        yield batch.tolist()


def smooth_lanes(lanes: Iterable[Lane], priors: Sequence[WrenchPrior]) -> list[WindowWrench]:
    """The smoothed wrench of every lane along its window, by its prior."""
    lanes = [lane._replace(prior=prior) for lane, prior in zip(lanes, priors, strict=True)]
    found = dict[int, WindowWrench]()
    for batch in batches(lanes):
        mean, covariance = smoothed(assembled([lanes[i] for i in batch]))
        for place, i in enumerate(batch):
            first, last = lanes[i].window
            span = slice(last - first), place, slice(6)
            found[i] = WindowWrench(first, mean[span], covariance[*span, :6])
    return [found[i] for i in range(len(lanes))]


def likelihoods(lanes: Sequence[Lane]) -> Array:
    """Log p(d) of every lane, comparable within one window. [nats]"""
    found = np.empty(len(lanes))
    for batch in batches(lanes):
        some = [lanes[i] for i in batch]
        model = assembled(some)
        # Without prior nothing touches, but may spike.
        bare = some[0].prior is None
        nats = untouched_likelihood(some, model) if bare else log_likelihood(model)
        # Less the blocks behind the shorter lanes.
        length = np.array([len(lane.gate) for lane in some])
        padding = 0.5 * (length.max() - length) * model.d.shape[-1] * np.log(UNKNOWN)
        found[batch] = nats + padding
    return found


def untouched_likelihood(lanes: Sequence[Lane], model: LinearModel) -> Array:
    """Log likelihood of untouched lanes, joint by joint. (L,) [nats]"""
    often = np.zeros_like(model.d)
    for place, lane in enumerate(lanes):
        inside = (lane.gate & lane.log.blocks.known)[:, None]
        often[: len(inside), place] = inside * lane.log.process.spikes
    process = ErrorProcess(model.decay[..., 6:], model.added[..., 6:], model.white, often)
    square, S = innovations(model.d, process)
    with np.errstate(divide="ignore"):
        usual, spiked = np.log1p(-often), np.log(often) - 0.5 * np.log(SPIKE)
    either = np.logaddexp(usual - 0.5 * square, spiked - 0.5 * square / SPIKE)
    return np.asarray((either - 0.5 * np.log(S)).sum(axis=(0, 2)))


def learn_prior(
    log: BlockLog,
    jacobian: JacobianIn,
    runs: Sequence[BlockSpan],
    prior: WrenchPrior,
    rounds: int,
) -> WrenchPrior:
    """The prior: τ_w by likelihood, σ by expectation and maximisation."""
    own = [*contact_lanes(log, runs, jacobian, NEAR)]
    for _ in range(rounds):
        priors = [prior._replace(time=time) for time in TIMES]
        lanes = [lane._replace(prior=each) for each in priors for lane in own]
        best = likelihoods(lanes).reshape(len(TIMES), -1).sum(axis=1).argmax()
        wrenches = smooth_lanes(own, [priors[best]] * len(runs))
        inside = [wrench.within(run) for wrench, run in zip(wrenches, runs, strict=True)]
        _, *each = zip(*inside, strict=True)
        values, covariance = map(np.concatenate, each)
        power = (values**2 + np.diagonal(covariance, axis1=1, axis2=2)).mean(axis=0)
        moment = np.sqrt(power[3:].mean())
        sds = np.clip(np.sqrt(power[:3].mean()), *FORCES), np.clip(moment, *MOMENTS)
        prior = WrenchPrior(TIMES[best], *sds)
    return prior


def evidence(
    log: BlockLog, places: Sequence[ContactPlace], runs: Sequence[BlockSpan], prior: WrenchPrior
) -> Array:
    """Evidence of the best size: ln p(d | contact) − ln p(d). (C, places) [nats]"""
    force, time = max(prior.force, LEAST_FORCE), min(prior.time, LONGEST_TIME)
    moving = [(time, size * force) for size in SIZES]
    bare = [*contact_lanes(log, runs, places[0].jacobian)]
    each, owners, touched = np.full((len(runs), len(places)), -np.inf), [], []
    for i, (start, stop) in enumerate(runs):
        lasts = log.blocks.t[stop - 1] - log.blocks.t[start] > LASTING
        tried = [*moving, (STEADY_TIME, force)] if lasts else moving
        for (k, place), (own, sd) in product(enumerate(places), tried):
            owners.append((i, k))
            prior = WrenchPrior(own, sd, place.lever * sd)
            touched.append(bare[i]._replace(jacobian=place.jacobian, prior=prior))
    np.maximum.at(each, tuple(np.transpose(owners)), likelihoods(touched))
    return each - likelihoods(bare)[:, None]
