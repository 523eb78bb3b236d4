"""The raw disturbance: the external torque as p and μ show it unfiltered, with all their noise."""

import numpy as np

from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array, Mask, is_uniform
from vftcli.signals.series import gaps_of, resample_columns, runs_of

GAP = 5.5
"""A step of more than this many median steps is a gap; no stretch reaches across."""


def raw_disturbance(terms: DynamicsTerms) -> Array:
    """The unfiltered external torque d of every sample but the first. (T−1, n) [N·m]

    d = (pᵗ − pᵗ⁻¹)/Ts − ½(μᵗ + μᵗ⁻¹) by the log's own sample times: the mean over a sample of the
    external torque and of everything else that the model leaves unexplained.
    """
    d = np.diff(terms.p, axis=0)
    d /= np.diff(terms.t)[:, None]
    d -= 0.5 * (terms.mu[1:] + terms.mu[:-1])
    return d


def disturbance_stretches(terms: DynamicsTerms, inside: Mask, step: float) -> list[Array]:
    """The raw disturbance in unbroken stretches of chosen samples, on a uniform clock. (N, n) each

    On an uneven clock the integral of d is interpolated, which averages d over each new step.

    Args:
        terms: p and μ along a log.
        inside: The samples to take. (T,)
        step: Sample time of the uniform clock. [s]
    """
    t, d = terms.t, raw_disturbance(terms)
    whole = inside[1:] & inside[:-1]
    if len(t) > 1 and is_uniform(t):
        return [d[start:stop] for start, stop in runs_of(whole)]
    # Across a gap the mean of two μ says nothing of what was between them.
    whole[gaps_of(t, GAP)] = False
    stretches = []
    for start, stop in runs_of(whole):
        clock = t[start : stop + 1]
        total = np.concatenate([np.zeros((1, d.shape[1])), d[start:stop] * np.diff(clock)[:, None]])
        np.cumsum(total, axis=0, out=total)
        even = np.arange(clock[0], clock[-1], step)
        stretches.append(np.diff(resample_columns(even, clock, total), axis=0) / step)
    return stretches
