"""From a log's baseline to finished estimates: bands, and what limits them.

Bands come from the log's own free samples and spectra, without a reference.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from vftcli.bias import AUTOMATIC
from vftcli.bias.baseline import Baseline, Baselines, FreeReading, free_reading
from vftcli.bias.model_error import error_columns, friction_alone, smooth_motion
from vftcli.bias.whole_log import stride_of
from vftcli.free_motion.free_motion import SIGN_SPEED
from vftcli.observers.observer import Observer
from vftcli.observers.spectra import ENOUGH, UNSEEN, FreeError, Spectra, error_band, free_error
from vftcli.observers.table import BEST
from vftcli.observers.tuning import AutoTuned, Curve, bound_remarks
from vftcli.robots.friction import HELD, ONE_STOP
from vftcli.signals.arrays import Array, Mask, handed_over, resample_columns, rms_of_known
from vftcli.signals.errors import ClockError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, Where, caution, fact, on_joints
from vftcli.signals.shown import Shown, record

#: The cause that no sum holds: friction hidden at rest.
STICTION = "stiction at rest"


def with_band(found: Baseline, reading: FreeReading) -> ExternalTorque:
    """The estimate with its band, marked in motion; itself if nothing is known."""
    estimate, spectra, run = reading.estimate, found.spectra, found.motion.log
    called = fitted_error(found, reading)
    if spectra is not None and len(reading.samples):
        f, step, n = spectra.frequency, spectra.step, spectra.joints
        missed = spectra.missed(reading.observer.frequency_response(f, step, n))
        error = free_error(reading.samples, reading.resting, run.dry_friction)
        if called is not None and found.by_fit:
            error = called  # the free part is these samples, and loads in them are no error
        elif called is not None:
            # They count too, as a stated part is short and often at rest: the larger of both.
            moving = np.maximum(error.moving, called.moving)
            resting = np.maximum(error.resting, called.resting)
            error = FreeError(moving, resting, unseen=error.unseen & called.unseen)
        sd = error_band(error, missed, run.rests, found.correction_sd)
    elif estimate.name == BEST:
        sd = stated_band(found, called)
    else:
        return estimate
    return replace(estimate, error_sd=handed_over(sd), moving=run.moving)


def stated_band(found: Baseline, called: FreeError | None) -> Array:
    """Band of `best` without spectra, by the robot's own numbers. (T, n) [N·m]

    Friction is wrong by a fifth, as is usual (`model_error.expected_error`); with a
    fitted bias the band is the rest of it, and the readings where its fit sees no
    contact. Torque that the gains leave out is unknown. In a log of a few samples, or
    mostly gaps, a moving joint has `UNSEEN` of its dry friction.
    """
    run = found.motion.log
    friction, nothing = run.dry_friction, np.zeros_like(run.dry_friction)
    if called is not None:
        return error_band(called, nothing, run.rests, found.correction_sd)
    held = FreeError(nothing, (HELD * friction) ** 2, unseen=nothing > 0.0)
    try:
        motion = smooth_motion(run)
    except ClockError:
        usual = held._replace(moving=(UNSEEN * friction) ** 2)
        return error_band(usual, nothing, run.rests)
    t, stride = motion.t, stride_of(motion.t)
    columns = error_columns(run, motion, friction_alone(run.robot), stride)
    spread = np.column_stack([np.sqrt(np.sum(column**2, axis=1)) for column in columns])
    return error_band(held, nothing, run.rests, resample_columns(t, t[::stride], spread))


def fitted_error(found: Baseline, reading: FreeReading) -> FreeError | None:
    """Readings in the correction fit's free samples; None in too few.

    Slow loads of the fit are no error of a reading, nor is the free part's where it has none.
    """
    run, tau, off = found.motion.log, reading.estimate.tau, found.correction
    if off is None or np.count_nonzero(off.free) < ENOUGH:
        return None
    if off.load.any():
        tau = tau - off.load
    elif found.load is not None:
        tau = tau - found.load.torque(run)
    return free_error(tau[off.free], run.rests[off.free], run.dry_friction)


def band_remarks(found: Baseline) -> list[Remark]:
    """Meaning of the bands, and joints without known friction."""
    if found.spectra is None:
        return [caution("no-band")] if found.part is None else []
    stuck = caution("band-of-a-standing-joint", on_joints(found.stuck))
    return [fact("band"), stuck] if found.stuck.any() else [fact("band")]


class Budget(NamedTuple):
    """Sources of one observer's error, estimated on the log itself."""

    name: str  #: The observer.
    parts: dict[str, Array]  #: Cause → RMS. (n,) [N·m]

    @property
    def total(self) -> Array:
        """Root sum of squares of all causes but stiction at rest. (n,) [N·m]"""
        squares = [v**2 for cause, v in self.parts.items() if cause != STICTION]
        return np.asarray(np.sqrt(np.sum(squares, axis=0)))


def budget(found: Baseline, spectra: Spectra, reading: FreeReading) -> Budget:
    """Divide an observer's error into its causes, each estimated from the log.

    Noise is the flat floor of S_n through |H|²; bandwidth ∫|1−H|²S_τ df. Other readings
    on the free part are model error: friction as far as sign and size of a joint's
    velocity explain it, else the rest of the model. Stiction at rest is the dry friction
    a resting joint may hide, F_c/√3, times its share of time at rest.
    """
    f, step, n = spectra.frequency, spectra.step, spectra.joints
    response = reading.observer.frequency_response(f, step, n)
    read = rms_of_known(reading.samples) ** 2
    share = abs(response) ** 2
    noise = np.minimum(np.sum(spectra.floor * share, axis=0) * spectra.width, read)
    velocity = np.concatenate([piece.run.dq[piece.inside] for piece in found.pieces])
    by_friction = (read - noise) * friction_share(velocity, reading.samples)
    log = found.motion.log
    hidden = ONE_STOP * log.dry_friction
    squares = {
        "noise": noise,
        "friction": by_friction,
        "model": read - noise - by_friction,
        "bandwidth": spectra.missed(response),
        STICTION: hidden**2 * log.standing.mean(axis=0),
    }
    parts = {cause: np.sqrt(value) for cause, value in squares.items()}
    return Budget(reading.observer.name, parts)


def friction_share(dq: Array, tau: Array) -> Array:
    """Share of a torque's power (S, n) by velocity [rad/s], sign and size. (n,)"""
    shares = []
    for velocity, y in zip(dq.T, tau.T, strict=True):
        X = np.column_stack([np.tanh(velocity / SIGN_SPEED), velocity])
        weights, *_ = np.linalg.lstsq(X.T @ X, X.T @ y, rcond=None)
        power = np.sum(y**2)
        shares.append(1.0 - np.sum((y - X @ weights) ** 2) / power if power > 0 else 0.0)
    return np.clip(shares, 0.0, 1.0)


def limits_remark(found: Budget, stuck: Mask) -> Remark:
    """Limits of a log: each joint's largest cause, and its part of the error.

    Hidden stiction is added to the error of a standing joint, one of `stuck`. (n,)
    """
    stiction = found.parts[STICTION]
    moving = {cause: part for cause, part in found.parts.items() if cause != STICTION}
    decided = stuck & (stiction > 0.0)  # no friction known: nothing known of stiction
    named = [
        STICTION if rests else max(moving, key=lambda cause: float(moving[cause][j]))
        for j, rests in enumerate(decided)
    ]
    size = [found.parts[cause][j] for j, cause in enumerate(named)]
    total = np.hypot(found.total, np.where(stuck, stiction, 0.0))
    where = Where(about=found.name)
    return fact("limits", where, causes=named, size_Nm=size, total_Nm=total)


@record
class Refinement(Shown):
    """Estimates of a complete log, with bands and limits."""

    estimates: tuple[ExternalTorque, ...]  #: The estimates with their bands.
    baselines: Baselines  #: The log's free part and spectra, as the observers have them.
    curves: Mapping[str, Curve]  #: Observer that was tuned → the curve that was minimised.
    #: Where each observer's error comes from, one an observer; none without spectra.
    budgets: tuple[Budget, ...]
    removed: str  #: What ``bias.method`` asked for.
    remarks: tuple[Remark, ...]  #: What the reader of the estimates should know.


def refine(
    found: Baselines,
    observers: Sequence[Observer],
    estimates: Sequence[ExternalTorque],
    removed: str = AUTOMATIC,
) -> Refinement:
    """The observers' estimates, in this order, with their bands and what limits them."""
    remarks, budgets, shown, plain = [*found.remarks], list[Budget](), [], found.plain
    for observer, estimate in zip(observers, estimates, strict=True):
        # Observers may run on different terms: each is measured on its own.
        on = found.of(observer.name)
        reading = free_reading(on, observer, estimate)
        if on.spectra is not None:
            budgets.append(budget(on, on.spectra, reading))
        shown.append(with_band(on, reading))
    curves = {o.name: o.curve for o in observers if isinstance(o, AutoTuned) and o.curve}
    for name, curve in curves.items():
        values = {"omega_n_rad_s": curve.best, "expected_rmse_Nm": curve.least}
        remarks.append(fact("tuned", Where(name), **values))
    for name, curve in curves.items():
        remarks += bound_remarks(name, curve.best, curve.omega_n)
    remarks += band_remarks(plain)
    # Of the most accurate estimate: of `best` if it ran, else of the last.
    leading = [one for one in budgets if one.name == BEST] or budgets[-1:]
    remarks += [limits_remark(one, plain.stuck) for one in leading]
    return Refinement(
        estimates=tuple(shown),
        baselines=found,
        curves=curves,
        budgets=tuple(budgets),
        removed=removed,
        remarks=tuple(remarks),
    )
