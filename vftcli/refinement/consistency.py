"""Consistency of a Kalman filter with its log: whiteness and size of its innovations.

A filter whose model were true would have white innovations ν with variance S: NIS = ν²/S would
average 1, and 95 % of it would lie below 3.84. A log never is that kind: friction and pushes are no
white noise. What this says is how far the filter's own covariance can be believed.

References:
    Y. Bar-Shalom, X. R. Li, T. Kirubarajan, "Estimation with Applications to Tracking and
    Navigation", Wiley, 2001, Sec. 5.4.
"""

from typing import NamedTuple

import numpy as np

from vftcli.observers.auto_tuning import AutoTuned
from vftcli.observers.kalman import KalmanObserver
from vftcli.observers.observer import Observer
from vftcli.observers.smoother import innovations
from vftcli.refinement.baseline import Baseline
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.series import median_step

LAGS = 20
"""Lags of the autocorrelation that are looked at."""

CHI_SQUARE_95 = 3.841
"""95 % of a squared standard normal deviate lie below this."""


class Consistency(NamedTuple):
    """One filter's innovations.

    Attributes:
        name: The observer.
        nis: Mean of ν²/S, 1 for a true model. (n,)
        inside: Share of ν²/S below its 95 % bound. (n,)
        correlation: Autocorrelation of ν one sample apart, 0 for a true model. (n,)
        coloured: Share of the first 20 lags beyond 95 % of white noise, 0.05 for a true model. (n,)
        loudest: Frequency below which half of S_n's power lies, NaN without spectra. (n,) [Hz]
    """

    name: str
    nis: Array
    inside: Array
    correlation: Array
    coloured: Array
    loudest: Array


def consistency(
    found: Baseline, observer: Observer, estimate: ExternalTorque
) -> Consistency | None:
    """How the innovations of a Kalman filter look on its log; None for any other observer.

    The steady gains at the median sample time are used; on an uneven clock it is approximate.
    """
    inner = observer.observer if isinstance(observer, AutoTuned) else observer
    if not isinstance(inner, KalmanObserver) or found.terms.samples <= 2 * LAGS:
        return None
    step, n = median_step(found.terms.t), found.terms.joints
    settled, model = inner.steady(step, n), inner.model(step, n)
    nu = innovations(estimate.tau, settled.gains.l2, model.a22)[1:]
    nis = nu**2 / (settled.prior.p11 + model.r)
    lags = autocorrelation(nu)
    bound = 1.96 / np.sqrt(len(nu))
    loudest = np.full(n, np.nan)
    if found.spectra is not None:
        total = np.cumsum(found.spectra.free, axis=0)
        loudest = found.spectra.frequency[np.argmax(total >= 0.5 * total[-1], axis=0)]
    return Consistency(
        name=observer.name,
        nis=np.asarray(nis.mean(axis=0)),
        inside=np.asarray(np.mean(nis <= CHI_SQUARE_95, axis=0)),
        correlation=lags[0],
        coloured=np.asarray(np.mean(np.abs(lags) > bound, axis=0)),
        loudest=loudest,
    )


def autocorrelation(x: Array) -> Array:
    """Correlation of a series with itself 1…`LAGS` samples later. (LAGS, n)"""
    power = np.maximum(np.sum(x**2, axis=0), np.finfo(float).tiny)
    return np.array([np.sum(x[k:] * x[:-k], axis=0) / power for k in range(1, LAGS + 1)])
