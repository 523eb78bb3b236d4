"""Bands: error of each estimate by the log's own free samples and spectra."""

from dataclasses import replace

import numpy as np

from vftcli.observers.spectra import (
    ENOUGH,
    UNSEEN,
    FreeError,
    error_band,
    free_error,
)
from vftcli.observers.table import BEST
from vftcli.refinement.baseline import Baseline, FreeReading
from vftcli.refinement.model_error import error_columns, friction_alone, smooth_motion
from vftcli.refinement.whole_log import stride_of
from vftcli.robots.friction import HELD, dry_friction
from vftcli.signals.arrays import Array, handed_over
from vftcli.signals.errors import ClockError
from vftcli.signals.remarks import Remark, Where, caution, fact
from vftcli.signals.series import resample_columns
from vftcli.signals.wrench import ExternalTorque


def with_band(found: Baseline, reading: FreeReading) -> ExternalTorque:
    """The estimate with its band, marked in motion; itself if nothing is known.

    The band is `vftcli.observers.spectra`'s: a filter's own covariance, `sd`, knows no lag.
    """
    estimate, spectra, run = reading.estimate, found.spectra, found.motion.log
    if spectra is None or not len(reading.samples):
        if estimate.name != BEST:
            return estimate
        stated = stated_band(found, reading)
        return replace(estimate, error_sd=stated, moving=~found.standing)
    free = known_error(found, reading)
    response = reading.observer.frequency_response(spectra.frequency, spectra.step, spectra.joints)
    sd = error_band(free, spectra.missed(response), run.rests, found.correction_sd)
    return replace(estimate, error_sd=handed_over(sd), moving=~found.standing)


def stated_band(found: Baseline, reading: FreeReading) -> Array:
    """Band of `best` without spectra, by the robot's own numbers.

    Friction is as wrong as is usual, by a fifth (`model_error.expected_error`); where a bias was
    fitted it is what that leaves of it, and what is read where its fit sees no contact. What the
    gains leave out of the torque is not known. In a log of a few samples, or of hardly anything but
    gaps, a moving joint has `UNSEEN` of its dry friction.

    Returns:
        Standard deviation. (T, n) [N·m]
    """
    run = found.motion.log
    friction = dry_friction(run.robot.friction, reading.estimate.joints)
    nothing = np.zeros_like(friction)
    called = fitted_error(found, reading, friction)
    if called is not None:
        return handed_over(error_band(called, nothing, run.rests, found.correction_sd))
    held = FreeError(nothing, (HELD * friction) ** 2, unseen=nothing > 0.0)
    try:
        motion = smooth_motion(run)
    except ClockError:
        usual = held._replace(moving=(UNSEEN * friction) ** 2)
        return handed_over(error_band(usual, nothing, run.rests))
    t, stride = motion.t, stride_of(motion.t)
    columns = error_columns(run, motion, friction_alone(run.robot), stride)
    spread = np.column_stack([np.sqrt(np.sum(column**2, axis=1)) for column in columns])
    sd = resample_columns(t, t[::stride], spread)
    return handed_over(error_band(held, nothing, run.rests, sd))


def known_error(found: Baseline, reading: FreeReading) -> FreeError:
    """An estimator's reading without contact, as far as the log shows it.

    Samples that a fitted bias calls free speak too, as a stated part is short and often at rest:
    the larger of both counts.
    """
    friction = dry_friction(found.motion.log.robot.friction, reading.estimate.joints)
    stated = free_error(reading.samples, reading.resting, friction)
    called = fitted_error(found, reading, friction)
    if called is None:
        return stated
    if found.by_fit:  # the free part is these samples, and the loads in them are no error
        return called
    moving = np.maximum(stated.moving, called.moving)
    resting = np.maximum(stated.resting, called.resting)
    return FreeError(moving, resting, unseen=stated.unseen & called.unseen)


def fitted_error(found: Baseline, reading: FreeReading, friction: Array) -> FreeError | None:
    """Readings in the correction fit's free samples; None in too few.

    Slow loads that the fit believes in are no error of who reads them, nor is a load that the free
    part carries where it believes in none.
    """
    run, tau, off = found.motion.log, reading.estimate.tau, found.correction
    if off is None or np.count_nonzero(off.free) < ENOUGH:
        return None
    if off.load.any():
        tau = tau - off.load
    elif found.load is not None:
        tau = tau - found.load.torque(run)
    return free_error(tau[off.free], run.rests[off.free], friction)


def band_remarks(found: Baseline) -> tuple[Remark, ...]:
    """Meaning of the bands, and joints without known friction."""
    if found.spectra is None:
        return (caution("no-band"),) if found.part is None else ()
    stuck = tuple(int(j) + 1 for j in np.flatnonzero(found.stuck))
    limit = (caution("band-of-a-standing-joint", Where(joints=stuck)),) if stuck else ()
    return (fact("band"), *limit)
