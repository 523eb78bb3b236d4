"""The model's error from a whole log, contacts and all: a fit that rejects what it cannot explain.

A first fit weighs samples down as a whole, all joints together: a contact is felt in several. A
second one tells contact from free motion by a threshold, fits the free samples alone, and beside
the model's error fits slow external loads.
"""

from dataclasses import dataclass

import numpy as np

from vftcli.refinement.normal_equations import FittedError, Rows, solve
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.intervals import covered, runs_of
from vftcli.signals.least_squares import SD_PER_MEDIAN, NormalEquations, huber, robust_sd

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
