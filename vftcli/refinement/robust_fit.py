"""The model's error from a whole log: a robust fit that rejects contacts.

The first fit weighs samples down for all joints together: several feel a contact. The second
separates contact from free motion by a threshold and fits the free samples alone, with slow
external loads beside the model's error.

A correction must predict, not only fit. The free samples are cut into contiguous folds; the
others predict each, with the model free in several degrees.
Samples in motion judge a joint: at rest stiction rules, which no model predicts.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.refinement.normal_equations import FittedError, Rows, solve
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.least_squares import FOLDS, SD_PER_MEDIAN, NormalEquations, huber, robust_sd
from vftcli.signals.rest import faster
from vftcli.signals.series import covered, runs_of

CORRELATED = 0.3  #: Residuals so close in time are one. [s]
LEAST_SCALE = 0.08  #: Least scale of the residual, by dry friction. [1]
LEAST_TORQUE = 0.02  #: And by torque. [N·m]
#: Quietest share of the samples for the first scale, …
QUIET_SHARE = 0.35
#: … its largest is this share of the median in normal noise.
QUIET_QUANTILE = 0.66
REACH = 0.15  #: Samples share the worst suspicion within this time. [s]
PASSES = 8  #: Passes of the first fit.
FIRST = 0.6  #: Its first threshold: this quantile of suspicion, …
NARROWED = 1.6  #: … divided by this after a pass, …
NARROWEST = 3.0  #: … down to this many scales.
TRUSTED = 0.25  #: Least weight of samples that set the scale.
FREE_PASSES = 3  #: Passes of the second fit.
CONTACT = 5.0  #: Scales of a joint's residual in contact, …
LASTS = 0.08  #: … for at least this time. [s]
GROWN = 0.25  #: Time of a contact before and after. [s]
FEWEST = 30  #: Fewer free samples: no contact is named.


@dataclass(frozen=True, kw_only=True)
class WholeLogFit:
    """A log's fit of the model's error."""

    rows: Rows  #: What was fitted.
    step: float  #: Its sample time. [s]
    free: Mask  #: Samples free of contact. (S,)
    scale: Array  #: Residual beside model and loads. (n,) [N·m]
    weight: Array  #: Weight of every row, by scale and correlation. (S, n)

    def solved(self, sums: NormalEquations, scale: float = 1.0) -> FittedError:
        """The solution for some of its rows."""
        return solve(sums, self.rows.unknowns, self.rows.loads.sizes, scale)


def fit_robustly(rows: Rows, step: float, dry: Array) -> WholeLogFit:
    """The fit of a model's error, and the log's contact-free samples.

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
        residual = rows.d + rows.modelled(found.model) + rows.loads.torque_of(found.loads)
        scale = np.maximum(robust_sd(residual[free]), least)
    return WholeLogFit(rows=rows, step=step, free=free, scale=scale, weight=weight)


def first_fit(rows: Rows, step: float, counted: float, least: Array) -> tuple[Array, Array]:
    """Residual of a fit that weighs suspicious samples down, its scale. (S, n), (n,)

    So many samples count as one; the scale is at `least` (n,) [N·m].
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
    """Samples free of contact by any joint's residual in its scale; all if few would be. (S,)"""
    # rounding of a step must not shorten such a run
    runs = [run for run in runs_of(worst > CONTACT) if (run[1] - run[0]) * step >= LASTS - 1e-9]
    contact = covered(runs, len(worst), margin=round(GROWN / step))
    if np.count_nonzero(~contact) < FEWEST:
        return np.ones(len(worst), dtype=bool)
    return ~contact


def largest_around(values: Array, reach: int) -> Array:
    """Largest of each value and its neighbours within `reach` samples. (S,)"""
    padded = np.pad(values, reach, mode="edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1)
    return np.asarray(windows.max(axis=1))


MARGIN = 0.5  #: Cut at both ends of a fold: neighbours know each other. [s]
SCALES = (0.0, 0.1, 0.3, 1.0)  #: Freedom of the model: factors on its standard deviations.
LARGEST = 6.0  #: Most scales of a residual.
#: A joint with less motion than this share is judged by all free samples.
SELDOM = 0.2
WORTH = 0.9  #: Most of the unseen error left for a full correction, …
#: … and least for none; partly between: no sample switches it. A load of 2.8 kg that the fit
#: cannot separate from the model leaves .95.
WORTHLESS = 0.95


class Guarded(NamedTuple):
    """A model error tested on unseen samples."""

    #: From all free samples, at the freedom of the best prediction; None if not at all.
    solution: FittedError | None
    share: Array  #: Unseen error with over without it, in motion. (n,)
    #: Each joint's part: 0 if not worth having, 1 if clearly worth it. (n,)
    weight: Array
    loads: Array  #: Slow loads that are believed too, in standard deviations. (L,)


def guarded(fit: WholeLogFit, dq: Array) -> Guarded:
    """A fit tested on folds of its free samples, as far as it predicts; dq (S, n) [rad/s]."""
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
    """Part in use: 1 up to a value, 0 from another on, straight between."""
    return np.asarray(np.clip((none - value) / (none - full), 0.0, 1.0))
