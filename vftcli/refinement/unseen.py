"""Whether a fitted model error predicts motion that it has not seen, joint by joint.

A correction is worth having where it predicts; what only fits is left alone. The free samples are
cut into contiguous folds; each is predicted from the others, with the model held back more or less.
A joint is judged by the samples in which it moves: at rest stiction rules, which no model predicts.
"""

from typing import NamedTuple

import numpy as np

from vftcli.refinement.normal_equations import FittedError
from vftcli.refinement.robust_fit import WholeLogFit
from vftcli.signals.arrays import Array
from vftcli.signals.intervals import covered
from vftcli.signals.least_squares import FOLDS
from vftcli.signals.rest import faster

MARGIN = 0.5  #: Left out at both ends of a fold: neighbours in time know each other. [s]
SCALES = (0.0, 0.1, 0.3, 1.0)  #: How far the model is let go: factors on its standard deviations.
LARGEST = 6.0  #: A residual counts at most so many scales.
#: A joint that moves in less than this share of the free samples is judged by all of them.
SELDOM = 0.2
WORTH = 0.9  #: A joint is corrected in full if at most this share of its unseen error is left, …
#: … not at all if so much is left, and between the two in part: no sample switches it. A load of
#: 2.8 kg that the fit cannot hold apart from the model leaves .95.
WORTHLESS = 0.95


class Guarded(NamedTuple):
    """A model error that has been tried on what it had not seen."""

    #: From all free samples, held back as far as predicts best; None if not at all.
    solution: FittedError | None
    share: Array  #: Unseen error with it over that without, while the joint moves. (n,)
    #: How much of it each joint gets: 0 where it is not worth having, 1 where it clearly is. (n,)
    weight: Array
    loads: Array  #: Slow loads that are believed beside it, in standard deviations. (L,)


def guarded(fit: WholeLogFit, dq: Array) -> Guarded:
    """Try a fit on folds of its free samples, and keep what predicts.

    Args:
        fit: The fit.
        dq: Joint velocities at its samples. (S, n) [rad/s]
    """
    moves = faster(dq)
    judged = moves | (moves[fit.free].mean(axis=0) < SELDOM)
    folds = [(int(f[0]), int(f[-1]) + 1) for f in np.array_split(np.flatnonzero(fit.free), FOLDS)]
    left_out = [covered([f], len(fit.free), margin=round(MARGIN / fit.step)) for f in folds]
    whole, *parts = fit.rows.all_sums(fit.weight, fit.free, left_out)
    squares = np.zeros((len(SCALES), fit.rows.joints))
    for fold, part in zip(folds, parts, strict=True):
        inner = slice(*fold)
        free = fit.free[inner]
        rest = whole.minus(part)
        for k, scale in enumerate(SCALES):
            residual = fit.rows.d[inner]
            if scale:
                found = fit.solved(rest, scale).model
                residual = residual + fit.rows.modelled(found, inner)
            held = np.minimum(np.abs(residual[free]) / fit.scale, LARGEST)
            squares[k] += np.sum(held**2 * judged[inner][free], axis=0)
    best = int(np.argmin(squares.mean(axis=1)))
    share = np.sqrt(squares[best] / np.maximum(squares[0], np.finfo(float).tiny))
    if not SCALES[best]:
        return Guarded(None, share, np.zeros_like(share), fit.solved(whole).loads)
    solution = fit.solved(whole, SCALES[best])
    return Guarded(solution, share, faded(share, WORTH, WORTHLESS), solution.loads)


def faded(value: Array, full: float, none: float) -> Array:
    """How much of something is used: 1 up to a value, 0 from another on, straight between."""
    return np.asarray(np.clip((none - value) / (none - full), 0.0, 1.0))
