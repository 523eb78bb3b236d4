"""From a log's baseline to finished estimates: bands, and what limits them.

Bands come from the log's own free samples and spectra, without a reference.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from vftcli.bias import AUTOMATIC
from vftcli.bias.baseline import Baseline, Baselines, FreeReading, free_reading
from vftcli.bias.model_error import error_columns, friction_alone, smooth_motion
from vftcli.bias.whole_log import fitted_times, stride_of
from vftcli.free_motion.free_motion import SIGN_SPEED
from vftcli.observers.observer import Observer
from vftcli.observers.spectra import ENOUGH, UNSEEN, FreeError, Spectra, error_band, free_error
from vftcli.observers.table import BEST
from vftcli.observers.tuning import AutoTuned, Curve, bound_remarks
from vftcli.robots.friction import HELD, ONE_STOP
from vftcli.robots.run import Run
from vftcli.signals.arrays import Array, Mask, handed_over, resample_columns, rms_of_known
from vftcli.signals.errors import ClockError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, Where, caution, fact, on_joints
from vftcli.signals.shown import Shown, record

#: The cause that no sum holds: friction hidden at rest.
STICTION = "stiction at rest"


def with_band(found: Baseline, reading: FreeReading) -> ExternalTorque:
    """The estimate with its band; itself if nothing is known."""
    estimate, spectra, run = reading.estimate, found.spectra, found.motion.log
    off, tau = found.correction, estimate.tau
    called, off_sd = None, None if off is None else off.sd
    if off is not None and np.count_nonzero(off.free) >= ENOUGH:
        # Slow loads of the fit, or else the free part's, are no error of a reading.
        if off.load.any():
            tau = tau - resample_columns(run.t, fitted_times(run), off.load)
        elif found.load is not None:
            tau = tau - found.load.torque(run)
        called = free_error(tau[off.free], run.rests[off.free], run.dry_friction)
    if spectra is not None and len(reading.samples):
        asked = spectra.frequency, spectra.step, spectra.joints
        missed = spectra.missed(reading.observer.frequency_response(*asked))
        error = free_error(reading.samples, reading.resting, run.dry_friction)
        if called is not None and found.by_fit:
            error = called  # the free part is these samples; their loads are no error
        elif called is not None:
            # A stated part is short and often at rest: the larger of both counts.
            moving = np.maximum(error.moving, called.moving)
            resting = np.maximum(error.resting, called.resting)
            error = FreeError(moving, resting, unseen=error.unseen & called.unseen)
        sd = error_band(error, missed, run.rests, off_sd)
    elif estimate.name == BEST:
        sd = stated_band(run, called, off_sd)
    else:
        return estimate
    return replace(estimate, error_sd=handed_over(sd), moving=run.moving)


def stated_band(run: Run, called: FreeError | None, off_sd: Array | None) -> Array:
    """Band of `best` without spectra, by the robot's own numbers. (T, n) [N·m]

    Friction is wrong by a fifth, as is usual; with a fitted bias the band is the rest of it,
    and the readings where its fit sees no contact. In a log of a few samples, or mostly
    gaps, a moving joint has `UNSEEN` of its dry friction.
    """
    friction, nothing = run.dry_friction, np.zeros_like(run.dry_friction)
    if called is not None:
        return error_band(called, nothing, run.rests, off_sd)
    held = FreeError(nothing, (HELD * friction) ** 2, unseen=nothing > 0.0)
    try:
        motion = smooth_motion(run.coarse)
    except ClockError:
        usual = held._replace(moving=(UNSEEN * friction) ** 2)
        return error_band(usual, nothing, run.rests)
    stride = stride_of(motion.t)
    columns = error_columns(run.coarse, motion, friction_alone(run.robot), stride)
    spread = np.column_stack([np.sqrt(np.sum(column**2, axis=1)) for column in columns])
    return error_band(
        held, nothing, run.rests, resample_columns(run.t, fitted_times(run), spread)
    )


def budget(found: Baseline, spectra: Spectra, reading: FreeReading) -> dict[str, Array]:
    """RMS of an observer's error by each cause. (n,) [N·m]

    Noise is the flat floor of S_n through |H|²; bandwidth ∫|1−H|²S_τ df. Other readings on
    the free part are friction, as far as velocity explains them, else the model. Stiction
    is the dry friction a resting joint may hide, F_c/√3, times its share of time at rest.
    """
    asked = spectra.frequency, spectra.step, spectra.joints
    response = reading.observer.frequency_response(*asked)
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
    return {cause: np.sqrt(value) for cause, value in squares.items()}


def friction_share(dq: Array, tau: Array) -> Array:
    """Share of a torque's power (S, n) by velocity [rad/s], sign and size. (n,)"""
    shares = []
    for velocity, y in zip(dq.T, tau.T, strict=True):
        X = np.column_stack([np.tanh(velocity / SIGN_SPEED), velocity])
        weights, *_ = np.linalg.lstsq(X.T @ X, X.T @ y, rcond=None)
        power = np.sum(y**2)
        shares.append(1.0 - np.sum((y - X @ weights) ** 2) / power if power > 0 else 0.0)
    return np.clip(shares, 0.0, 1.0)


def limits_remark(name: str, causes: Mapping[str, Array], stuck: Mask) -> Remark:
    """Each joint's largest cause of error, stiction if `stuck` (n,), and its part."""
    felt = {**causes, STICTION: np.where(stuck, causes[STICTION], 0.0)}
    sizes = np.array([*felt.values()])
    named = [list(felt)[k] for k in sizes.argmax(axis=0)]
    size, total = sizes.max(axis=0), np.linalg.norm(sizes, axis=0)
    return fact("limits", Where(about=name), causes=named, size_Nm=size, total_Nm=total)


@record
class Refinement(Shown):
    """Estimates of a complete log, with bands and limits."""

    estimates: tuple[ExternalTorque, ...]  #: The estimates with their bands.
    baselines: Baselines  #: The log's free part and spectra.
    curves: Mapping[str, Curve]  #: Tuned observer → the minimised curve.
    #: Best observer → RMS of its error by cause. (n,) [N·m]
    budget: Mapping[str, Mapping[str, Array]]
    removed: str  #: What ``bias.method`` asked for.
    remarks: tuple[Remark, ...]  #: Remarks on the estimates.


def refine(
    found: Baselines,
    observers: Sequence[Observer],
    estimates: Sequence[ExternalTorque],
    removed: str = AUTOMATIC,
) -> Refinement:
    """The observers' estimates, in this order, with bands and limits."""
    remarks, causes, shown, plain = [*found.remarks], {}, [], found.plain
    *_, leading = sorted(observers, key=lambda observer: observer.name == BEST)
    for observer, estimate in zip(observers, estimates, strict=True):
        # Observers may run on different terms: each is measured on its own.
        on = found.of(observer.name)
        reading = free_reading(on, observer, estimate)
        if observer is leading and on.spectra is not None:
            causes = {observer.name: budget(on, on.spectra, reading)}
        shown.append(with_band(on, reading))
    curves = {o.name: o.curve for o in observers if isinstance(o, AutoTuned) and o.curve}
    for name, curve in curves.items():
        least = {"expected_rmse_Nm": curve.least}
        remarks.append(fact("tuned", Where(name), omega_n_rad_s=curve.best, **least))
        remarks += bound_remarks(name, curve.best, curve.omega_n)
    if plain.spectra is not None:
        remarks.append(fact("band"))
        if plain.stuck.any():
            remarks.append(caution("band-of-a-standing-joint", on_joints(plain.stuck)))
    elif plain.part is None:
        remarks.append(caution("no-band"))
    remarks += [limits_remark(name, each, plain.stuck) for name, each in causes.items()]
    return Refinement(
        estimates=tuple(shown),
        baselines=found,
        curves=curves,
        budget=causes,
        removed=removed,
        remarks=tuple(remarks),
    )
