"""How much better a contact explains a stretch of log than nothing does, place by place.

Around every candidate the likelihood of the disturbance is taken under "nothing", under a wrench at
the flange and under a force and moment on each link: the forward pass of the wrench smoother with
the Jacobian of the place. Evidence is the best place's less that of nothing, in nats; the lead of a
part of the arm is how far its best place is ahead of the best of every other part.
"""

from collections.abc import Sequence

import numpy as np

from vftcli.contacts.places import ContactPlace
from vftcli.contacts.windows import (
    BlockLog,
    BlockSpan,
    Lane,
    assembled,
    batches,
    likelihoods,
    padding,
    window_of,
)
from vftcli.signals.arrays import Array
from vftcli.signals.linear_model import SPIKE
from vftcli.signals.series import covered
from vftcli.virtual_sensor.model_error import ErrorProcess, error_model, innovations
from vftcli.virtual_sensor.smoother import WrenchPrior

#: Nats that a contact must be ahead of nothing, which may spike. In 299 s of real free motion one
#: reversal of friction reached 15, everything else but abrupt stops stayed below 6.
LEAST_EVIDENCE = 12.0
#: The same where the arm moves and no free motion is known: what the model errs by in motion
#: reaches 82 nats on logs of six arms; from 75 to 200 nats the same contacts are found.
LEAST_IN_MOTION = 120.0
LEAST_FORCE = 10.0  #: Smallest standard deviation of a force that is tried. [N]
LONGEST_TIME = 1.0  #: Longest correlation time of a wrench that comes and goes. [s]
SIZES = 1.0, 3.0  #: Multiples of the standard deviation that are tried.
#: A candidate that lasts longer than the first may be a wrench that stays, as a load's, with the
#: second as its correlation time: one that wanders would have to pay for every block. [s]
LASTING, STEADY_TIME = 1.5, 100.0


def evidence(
    log: BlockLog, places: Sequence[ContactPlace], runs: Sequence[BlockSpan], prior: WrenchPrior
) -> Array:
    """Evidence ln p(d | contact there) − ln p(d | nothing) of the best size. (C, places) [nats]"""
    count = len(log.blocks.t)
    every = covered(runs, count, 1)
    nothing, touched, owner = [], [], []
    for number, run in enumerate(runs):
        window, gate = window_of(log.blocks.t, run), covered([run], count, 1)
        hidden = every & ~gate
        nothing.append(Lane(window, gate, hidden, places[0].jacobian, None))
        for k, place in enumerate(places):
            for time, force in courses(prior, log.blocks.t[run[1] - 1] - log.blocks.t[run[0]]):
                tried = WrenchPrior(time, force, place.lever * force)
                touched.append(Lane(window, gate, hidden, place.jacobian, tried))
                owner.append((number, k))
    each = np.full((len(runs), len(places)), -np.inf)
    np.maximum.at(each, tuple(np.transpose(owner)), likelihoods(log, touched))
    found: Array = each - untouched(log, nothing)[:, None]
    return found


def courses(prior: WrenchPrior, lasts: float) -> list[tuple[float, float]]:
    """Correlation time [s] and standard deviation [N] of the forces that are tried.

    Args:
        prior: How the wrench of the log's contacts moves.
        lasts: How long the candidate is. [s]
    """
    force, time = max(prior.force, LEAST_FORCE), min(prior.time, LONGEST_TIME)
    steady = [(STEADY_TIME, force)] if lasts > LASTING else []
    return [*((time, size * force) for size in SIZES), *steady]


def untouched(log: BlockLog, lanes: Sequence[Lane]) -> Array:
    """Log likelihood ln p(d | nothing), an innovation in the gate may be a spike. (L,) [nats]"""
    found = np.empty(len(lanes))
    for batch in batches(lanes):
        some = [lanes[i] for i in batch]
        model = assembled(log, some)
        often = np.zeros_like(model.d)
        for place, lane in enumerate(some):
            span = slice(*lane.window)
            inside = lane.gate[span, None] & log.blocks.known[span, None]
            often[: span.stop - span.start, place] = inside * log.course.spikes[span]
        course = ErrorProcess(model.decay[..., 6:], model.added[..., 6:], model.white, often)
        square, S = innovations(error_model(model.d, course), often)
        with np.errstate(divide="ignore"):
            usual, spiked = np.log1p(-often), np.log(often) - 0.5 * np.log(SPIKE)
        either = np.logaddexp(usual - 0.5 * square, spiked - 0.5 * square / SPIKE)
        found[batch] = (either - 0.5 * np.log(S)).sum(axis=(0, 2)) + padding(log, some)
    return found
