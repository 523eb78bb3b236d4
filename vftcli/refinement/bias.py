"""Bias removal: what an observer reads where nothing touches the arm is not contact.

A model of the bias over position and velocity is fitted to the free part; it is cross-validated and
used only where it predicts free samples that it has not seen.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.refinement.baseline import Baseline, FreeReading
from vftcli.signals.arrays import Array, handed_over
from vftcli.signals.errors import ParameterError
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, Where, fact

FOLDS = 5
"""Contiguous parts of the free samples, each predicted from the others."""

PENALTIES = (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0)
"""Ridge penalties tried, per sample on standardised features."""

WORTH = 0.9
"""The model is used on a joint if it leaves at most this share of the free rms, unseen."""

SIGN_SPEED = 0.05
"""Velocity over which the sign of friction turns. [rad/s]"""

RANGE = 1.1
"""Features are held within this many times what the free part showed: no extrapolation."""


class Removal(NamedTuple):
    """Estimates with their bias taken off.

    Attributes:
        readings: One an observer: its estimate, and what of it is left in the free samples.
        remarks: What was subtracted and what was not.
    """

    readings: tuple[FreeReading, ...]
    remarks: tuple[Remark, ...] = ()


def remove_nothing(_found: Baseline, readings: Sequence[FreeReading]) -> Removal:
    """Leave the estimates as they are."""
    return Removal(tuple(readings))


def remove_modelled(found: Baseline, readings: Sequence[FreeReading]) -> Removal:
    """Subtract a model of the bias over position and velocity, fitted to the free part.

    Raises:
        ParameterError: If there is no free part.
    """
    if found.part is None:
        raise ParameterError("--remove-bias model needs a free part: --free A:B or --free LOG")
    X = np.concatenate([features(piece.run.recording)[piece.inside] for piece in found.pieces])
    scale = Scale(X.mean(axis=0), np.maximum(X.std(axis=0), 1e-6), X.min(axis=0), X.max(axis=0))
    here = scale.applied(features(found.motion.log.recording))
    removed, remarks = [], []
    for reading in readings:
        weights, share = fitted(scale.applied(X), reading.samples)
        used = share <= WORTH
        bias = np.where(used, here @ weights[1:] + weights[0], 0.0)
        estimate = reading.estimate
        less = replace(estimate, tau=handed_over(estimate.tau - bias))
        # The band gets rid of what the model predicts of free samples that it has not seen.
        left = reading.samples * np.where(used, share, 1.0)
        removed.append(reading._replace(estimate=less, samples=left))
        where = Where(about=estimate.name, joints=tuple(int(j) + 1 for j in np.flatnonzero(used)))
        code = "bias-modelled" if used.any() else "bias-not-modelled"
        remarks.append(fact(code, where, share=share[used].tolist()))
    return Removal(tuple(removed), tuple(remarks))


class Scale(NamedTuple):
    """What the free part showed of the features.

    Attributes:
        mean: (m,)
        sd: (m,)
        least: (m,)
        most: (m,)
    """

    mean: Array
    sd: Array
    least: Array
    most: Array

    def applied(self, X: Array) -> Array:
        """Standardised features, held within what the free part showed. (T, m)"""
        more = 0.5 * (RANGE - 1.0) * (self.most - self.least)
        held = np.clip(X, self.least - more, self.most + more)
        return np.asarray((held - self.mean) / self.sd)


def features(recording: Recording) -> Array:
    """What friction and gravity errors depend on: signs of velocity, velocity, angles. (T, m)"""
    q, dq = recording.q, recording.require("dq")
    sums = np.cumsum(q[:, 1:], axis=1)
    angles = np.hstack([q, sums[:, 1:4]])
    return np.hstack([np.tanh(dq / SIGN_SPEED), dq, np.sin(angles), np.cos(angles)])


def fitted(X: Array, y: Array) -> tuple[Array, Array]:
    """Ridge weights of each joint, intercept first, and the share of the rms left, unseen.

    The penalty is the one with the smallest error on parts of the free samples that were left out.
    """
    folds = [np.asarray(fold) for fold in np.array_split(np.arange(len(X)), FOLDS)]
    power = np.maximum(np.sum(y**2, axis=0), np.finfo(float).tiny)
    shares = np.array([unseen(X, y, folds, penalty) / power for penalty in PENALTIES])
    best = np.argmin(shares, axis=0)
    columns = [ridge(X, y[:, j], PENALTIES[b]) for j, b in enumerate(best)]
    return np.column_stack(columns), np.sqrt(shares.min(axis=0))


def unseen(X: Array, y: Array, folds: Sequence[NDArray[np.intp]], penalty: float) -> Array:
    """Sum of squares that the model leaves of the folds it was not fitted to. (n,)"""
    left = np.zeros(y.shape[1])
    for fold in folds:
        others = np.ones(len(X), dtype=bool)
        others[fold] = False
        weights = ridge(X[others], y[others], penalty)
        left += np.sum((y[fold] - X[fold] @ weights[1:] - weights[0]) ** 2, axis=0)
    return left


def ridge(X: Array, y: Array, penalty: float) -> Array:
    """Intercept and weights of a ridge regression; the intercept is not penalised. (m+1, …)"""
    mean, level = X.mean(axis=0), y.mean(axis=0)
    A = (X - mean).T @ (X - mean) / len(X) + penalty * np.eye(X.shape[1])
    weights = np.linalg.solve(A, (X - mean).T @ (y - level) / len(X))
    return np.concatenate([np.asarray(level - mean @ weights)[None], weights])


REMOVALS: dict[str, Callable[[Baseline, Sequence[FreeReading]], Removal]] = {
    "model": remove_modelled,
}
"""The words of ``--remove-bias`` that take something off once the observers have run."""
