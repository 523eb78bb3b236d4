"""Bias removal: what an observer reads where nothing touches the arm is not contact.

On a repeated motion the free cycle's estimate at the same phase is subtracted: friction and model
error repeat with position and velocity. Where nothing repeats, a model of the bias over position
and velocity is fitted to the free part; it is cross-validated and used only where it predicts free
samples that it has not seen.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from vftcli.observers.observer import Observer
from vftcli.refinement.baseline import Baseline, free_estimates, free_rms, free_samples
from vftcli.repetition.pairing import mean_of
from vftcli.signals.arrays import Array, handed_over
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.recording import Recording

FOLDS = 5
"""Contiguous parts of the free samples, each predicted from the others."""

PENALTIES = (1e-4, 1e-3, 1e-2, 1e-1, 1.0, 10.0)
"""Ridge penalties tried, per sample on standardised features."""

WORTH = 0.9
"""The model is used on a joint if it leaves at most this share of the free rms, unseen."""

SLOW = 0.05
"""Velocity over which the sign of friction turns. [rad/s]"""

RANGE = 1.1
"""Features are held within this many times what the free part showed: no extrapolation."""


class Removal(NamedTuple):
    """Estimates with their bias taken off.

    Attributes:
        estimates: One an observer.
        notes: What was subtracted and what was not.
    """

    estimates: tuple[ExternalTorque, ...]
    notes: tuple[str, ...]


def remove_nothing(
    _found: Baseline,
    _recording: Recording,
    _observers: Sequence[Observer],
    estimates: Sequence[ExternalTorque],
) -> Removal:
    """Leave the estimates as they are."""
    return Removal(tuple(estimates), ())


def remove_free_cycle(
    found: Baseline,
    _recording: Recording,
    observers: Sequence[Observer],
    estimates: Sequence[ExternalTorque],
) -> Removal:
    """Subtract the free cycle's own estimate at the same phase, or the free run's, aligned.

    With several free cycles or runs it is their mean, for a free cycle that of the others; a single
    free cycle becomes zero by construction. Samples outside the repeated motion keep their bias.

    Raises:
        ParameterError: If there is no free motion to subtract.
    """
    if found.part is None or not found.part.pairings:
        why = found.notes[-1] if found.part is None and found.notes else ""
        raise ParameterError(
            "--remove-bias free-cycle needs a motion that repeats with a free cycle, or a free run "
            "of the same motion (--free LOG); --remove-bias model needs neither, only a free part"
            f"{f'. Here: {why}' if why else ''}"
        )
    removed = []
    for observer, estimate in zip(observers, estimates, strict=True):
        bias = repeated_bias(found, free_estimates(found, observer, estimate), estimate)
        removed.append(less(estimate, np.nan_to_num(bias), found, bias))
    outside = ~np.isfinite(bias[:, 0]) if removed else np.zeros(0, dtype=bool)
    count = len(found.part.pairings)
    what = f"the mean of {count} free ones" if count > 1 else "the free one"
    notes = [f"bias removed: at each sample the estimate of {what} at the same phase"]
    if count == 1 and found.part.inside.any():
        notes[0] += "; the free cycle itself is zero by construction"
    if outside.any():
        share = 100.0 * float(np.mean(outside))
        notes.append(f"{share:.1f} % of the samples lie outside that motion and keep their bias")
    return Removal(tuple(removed), tuple(notes))


def repeated_bias(
    found: Baseline, free: Sequence[ExternalTorque], estimate: ExternalTorque
) -> Array:
    """The free motion's estimate at each sample's phase, NaN where there is none. (T, n)"""
    part = found.part
    if part is None:
        return np.full(estimate.tau.shape, np.nan)
    clocks = [pairing.free.t for pairing in part.pairings]
    signals = [signal_of(clock, free).tau for clock in clocks]
    bias = mean_of(part.pairings, signals)
    own = part.inside & ~np.isfinite(bias[:, 0])
    bias[own] = estimate.tau[own]
    return bias


def signal_of(clock: Array, estimates: Sequence[ExternalTorque]) -> ExternalTorque:
    """The estimate on a free run's clock."""
    return next(e for e in estimates if len(e.t) == len(clock) and np.array_equal(e.t, clock))


def less(estimate: ExternalTorque, bias: Array, found: Baseline, known: Array) -> ExternalTorque:
    """The estimate less its bias, its band rid of it where two free motions tell what is left."""
    band = estimate.error_sd
    part = found.part
    if band is not None and part is not None and len(part.pairings) > 1 and part.inside.any():
        left = np.sqrt(np.nanmean((estimate.tau - known)[part.inside] ** 2, axis=0))
        free = free_rms(found, (estimate,))
        band = handed_over(np.sqrt(np.maximum(band**2 - free**2, 0.0) + left**2))
    return replace(estimate, tau=handed_over(estimate.tau - bias), error_sd=band)


def remove_modelled(
    found: Baseline,
    recording: Recording,
    observers: Sequence[Observer],
    estimates: Sequence[ExternalTorque],
) -> Removal:
    """Subtract a model of the bias over position and velocity, fitted to the free part.

    Raises:
        ParameterError: If there is no free part.
    """
    if found.part is None:
        raise ParameterError("--remove-bias model needs a free part: --free-part A:B or --free LOG")
    logs = found.part.runs or (recording,)
    inside = [part.inside for part in free_samples(found)]
    X = np.concatenate([features(log)[m] for log, m in zip(logs, inside, strict=True)])
    scale = Scale(X.mean(axis=0), np.maximum(X.std(axis=0), 1e-6), np.abs(X).max(axis=0))
    here = scale.applied(features(recording))
    removed, notes = [], []
    for observer, estimate in zip(observers, estimates, strict=True):
        free = free_estimates(found, observer, estimate)
        y = np.concatenate([e.tau[m] for e, m in zip(free, inside, strict=True)])
        weights, share = fitted(scale.applied(X), y)
        used = share <= WORTH
        bias = np.where(used, here @ weights[1:] + weights[0], 0.0)
        removed.append(without_model(estimate, bias, np.where(used, share, 1.0), y))
        listed = ", ".join(f"J{j + 1} {100 * s:.0f} %" for j, s in enumerate(share) if used[j])
        notes.append(
            f"{estimate.name}: bias model over position and velocity, cross-validated on the free "
            f"part; it leaves of the free rms: {listed or 'no joint gains by it, none is changed'}"
        )
    return Removal(tuple(removed), tuple(notes))


class Scale(NamedTuple):
    """What the free part showed of the features.

    Attributes:
        mean: (m,)
        sd: (m,)
        most: Largest magnitude. (m,)
    """

    mean: Array
    sd: Array
    most: Array

    def applied(self, X: Array) -> Array:
        """Standardised features, held within what the free part showed. (T, m)"""
        held = np.clip(X, -RANGE * self.most, RANGE * self.most)
        return np.asarray((held - self.mean) / self.sd)


def features(recording: Recording) -> Array:
    """What friction and gravity errors depend on: signs of velocity, velocity, angles. (T, m)"""
    q, dq = recording.q, recording.require("dq")
    sums = np.cumsum(q[:, 1:], axis=1)
    angles = np.hstack([q, sums[:, 1:4]])
    return np.hstack([np.tanh(dq / SLOW), dq, np.sin(angles), np.cos(angles)])


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


def without_model(
    estimate: ExternalTorque, bias: Array, share: Array, free: Array
) -> ExternalTorque:
    """The estimate less the modelled bias, its band rid of what the model predicts unseen."""
    band = estimate.error_sd
    if band is not None:
        square = np.mean(free**2, axis=0)
        band = handed_over(np.sqrt(np.maximum(band**2 - square * (1.0 - share**2), 0.0)))
    return replace(estimate, tau=handed_over(estimate.tau - bias), error_sd=band)


REMOVALS: dict[
    str,
    Callable[[Baseline, Recording, Sequence[Observer], Sequence[ExternalTorque]], Removal],
] = {
    "none": remove_nothing,
    "free-cycle": remove_free_cycle,
    "model": remove_modelled,
}
"""What ``--remove-bias`` takes."""


def check_removal(name: str) -> str:
    """A key of `REMOVALS`.

    Raises:
        ParameterError: If it is none.
    """
    if name not in REMOVALS:
        raise ParameterError(f"--remove-bias {name!r}; there is {', '.join(REMOVALS)}")
    return name
