"""The model's error from a whole log, contacts and all: a fit that rejects what it cannot explain.

A first fit weighs samples down as a whole, all joints together: a contact is felt in several. A
second one tells contact from free motion by a threshold, fits the free samples alone, and beside
the model's error fits slow external loads.

A correction is worth having where it predicts; what only fits is left alone. The free samples are
cut into contiguous folds; each is predicted from the others, with the model held back more or less.
A joint is judged by the samples in which it moves: at rest stiction rules, which no model predicts.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.refinement.normal_equations import FittedError, Rows, solve
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.intervals import covered, runs_of
from vftcli.signals.least_squares import FOLDS, SD_PER_MEDIAN, NormalEquations, huber, robust_sd
from vftcli.signals.rest import faster

CORRELATED = 0.3  #: Residuals this close in time count as one. [s]
LEAST_SCALE = 0.08  #: The residual's scale is at least this share of a joint's dry friction. [1]
LEAST_TORQUE = 0.02  #: And at least this. [N·m]
#: At first the residual's scale comes from so large a quietest share of the samples, …
QUIET_SHARE = 0.35
#: … whose largest is this share of the median where the samples are normal noise.
QUIET_QUANTILE = 0.66
REACH = 0.15  #: A sample is as suspicious as the worst within this time. [s]
PASSES = 8  #: Passes of the first fit.
FIRST = 0.6  #: Its threshold at first: this quantile of how suspicious the samples are, …
NARROWED = 1.6  #: … divided by this after every pass, …
NARROWEST = 3.0  #: … down to this many scales.
TRUSTED = 0.25  #: Samples that weigh more than this set the residual's scale.
FREE_PASSES = 3  #: Passes of the second fit.
CONTACT = 5.0  #: A sample is contact if a joint's residual is larger than this many scales, …
LASTS = 0.08  #: … for at least so long. [s]
GROWN = 0.25  #: A contact begins so long before, and ends so long after. [s]
FEWEST = 30  #: With fewer free samples nothing is called contact.


@dataclass(frozen=True, kw_only=True)
class WholeLogFit:
    """What a log says of the model's error."""

    rows: Rows  #: What was fitted.
    step: float  #: Time between two of its samples. [s]
    free: Mask  #: Samples free of contact. (S,)
    scale: Array  #: Size of what neither model nor loads explain. (n,) [N·m]
    weight: Array  #: Weight of every row, its scale and its correlation with others in it. (S, n)

    def solved(self, sums: NormalEquations, scale: float = 1.0) -> FittedError:
        """The solution for some of its rows."""
        return solve(sums, self.rows.unknowns, self.rows.loads.sizes, scale)


def fit_robustly(rows: Rows, step: float, dry: Array) -> WholeLogFit:
    """Fit the model's error, and find where the log is free of contact.

    Args:
        rows: What is fitted.
        step: Time between two samples. [s]
        dry: Dry friction of the joints. (n,) [N·m]
    """
    counted = max(1.0, CORRELATED / step)
    least = np.maximum(LEAST_SCALE * dry, LEAST_TORQUE)
    residual, scale = first_fit(rows, step, counted, least)
    for _ in range(FREE_PASSES):
        free = free_samples(np.max(np.abs(residual) / scale, axis=1), step)
        weight = huber(residual / scale) / (counted * scale**2)
        found = solve(rows.all_sums(weight, free, [])[0], rows.unknowns, rows.loads.sizes)
        residual = rows.d + rows.modelled(found.model) + rows.loads.made_by(found.loads)
        scale = np.maximum(robust_sd(residual[free]), least)
    return WholeLogFit(rows=rows, step=step, free=free, scale=scale, weight=weight)


def first_fit(rows: Rows, step: float, counted: float, least: Array) -> tuple[Array, Array]:
    """The residual of a fit that weighs suspicious samples down, and its scale. (S, n), (n,)

    Args:
        rows: What is fitted.
        step: Time between two samples. [s]
        counted: Samples that count as one.
        least: Smallest scale. (n,) [N·m]
    """
    residual = rows.d
    quiet = np.quantile(np.abs(residual), QUIET_SHARE, axis=0)
    scale = np.maximum(SD_PER_MEDIAN * quiet / QUIET_QUANTILE, least)
    threshold = np.inf
    for _ in range(PASSES):
        worst = largest_around(np.max(np.abs(residual) / scale, axis=1), round(REACH / step))
        first = np.isinf(threshold)
        threshold = np.quantile(worst, FIRST) if first else threshold / NARROWED
        threshold = max(threshold, NARROWEST)
        share = (1.0 + (worst / threshold) ** 2) ** -2
        weight = share[:, None] / (counted * scale**2)
        found = solve(rows.model_sums(weight), rows.unknowns, (0,))
        residual = rows.d + rows.modelled(found.model)
        trusted = residual[share > TRUSTED]
        if len(trusted):
            scale = np.maximum(robust_sd(trusted), least)
    return residual, scale


def free_samples(worst: Array, step: float) -> Mask:
    """Samples free of contact; all if hardly any would be. (S,)

    Args:
        worst: Largest residual of any joint, in its scale. (S,)
        step: Time between two samples. [s]
    """
    # the rounding of a step must not make a run of just that length too short
    runs = [run for run in runs_of(worst > CONTACT) if (run[1] - run[0]) * step >= LASTS - 1e-9]
    contact = covered(runs, len(worst), margin=round(GROWN / step))
    if np.count_nonzero(~contact) < FEWEST:
        return np.ones(len(worst), dtype=bool)
    return ~contact


def largest_around(values: Array, reach: int) -> Array:
    """The largest of each value's neighbours up to `reach` samples away, and itself. (S,)"""
    padded = np.pad(values, reach, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    return np.asarray(windows.max(axis=1))


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
