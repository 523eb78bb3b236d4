"""Bands: how far each estimate may be off, drawn from the log's own free samples and spectra."""

from dataclasses import replace

import numpy as np

from vftcli.observers.error_band import ENOUGH, error_band, free_error
from vftcli.refinement.baseline import Baseline, FreeReading, rests_in
from vftcli.refinement.whole_log import WholeLogBias
from vftcli.robots.friction import dry_friction
from vftcli.signals.arrays import handed_over
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, Where, caution, fact


def with_band(found: Baseline, reading: FreeReading) -> ExternalTorque:
    """The estimate with its band, and marked where joints move; itself where nothing is known.

    The band is how far the estimate may be off, as the log itself shows it: see
    `vftcli.observers.error_band`. A Kalman filter's own covariance knows neither model error nor
    lag: it is the filter's own account, and stands apart (`sd`). Where the bias of the whole log is
    off, all samples that its fit calls free of contact count as free: a stated free part is short,
    and often at rest.

    Args:
        found: The log's baseline, of the terms that the estimate was made from.
        reading: The estimate, and what it reads where nothing touches the arm.
    """
    off = found.correction
    if off is not None and np.count_nonzero(off.free) >= ENOUGH:
        reading = read_where_free(found, reading, off)
    estimate, spectra, run = reading.estimate, found.spectra, found.motion.log
    friction = dry_friction(run.robot.friction, run.robot.joints)
    if spectra is None or not len(reading.samples):
        return estimate
    free = free_error(reading.samples, reading.resting, friction)
    response = reading.observer.frequency_response(spectra.frequency, spectra.step, spectra.joints)
    sd = error_band(free, spectra.missed(response), rests_in(run), found.correction_sd)
    return replace(estimate, error_sd=handed_over(sd), moving=~found.standing)


def read_where_free(found: Baseline, reading: FreeReading, off: WholeLogBias) -> FreeReading:
    """A reading whose free samples are those that the fit of a correction calls free.

    Slow loads that the fit believes in are no error of who reads them, nor is a load that the free
    part carries where it believes in none.
    """
    run, tau = found.motion.log, reading.estimate.tau
    if off.load.any():
        tau = tau - off.load
    elif found.load is not None:
        tau = tau - found.load.torque(run)
    return reading._replace(samples=tau[off.free], resting=rests_in(run)[off.free])


def band_remarks(found: Baseline) -> tuple[Remark, ...]:
    """What the bands are, and where friction is not known."""
    if found.spectra is None:
        return (caution("no-band"),) if found.part is None else ()
    stuck = tuple(int(j) + 1 for j in np.flatnonzero(found.stuck))
    limit = (caution("band-of-a-standing-joint", Where(joints=stuck)),) if stuck else ()
    return (fact("band"), *limit)
