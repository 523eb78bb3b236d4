"""Bands: how far an estimate may be off, as the log itself shows it.

    sd² = rms_free² + ∫ |1 − H|² S_τ df

What the estimator reads where nothing touches the arm, bias and model error included, and what its
lag and bandwidth leave out of the torque there is. The Kalman covariance knows neither: it is the
filter's own account, of a model without error, and stands apart (`sd`).
"""

from dataclasses import replace

import numpy as np

from vftcli.refinement.baseline import Baseline, FreeReading
from vftcli.signals.arrays import handed_over
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, Where, caution, fact


def with_band(found: Baseline, reading: FreeReading) -> ExternalTorque:
    """The estimate with its band, and marked where joints move; itself without spectra."""
    estimate, spectra = reading.estimate, found.spectra
    if spectra is None:
        return estimate
    response = reading.observer.frequency_response(spectra.frequency, spectra.step, spectra.joints)
    sd = np.sqrt(reading.rms**2 + spectra.missed(response))
    banded = np.broadcast_to(handed_over(sd), estimate.tau.shape)
    return replace(estimate, error_sd=banded, moving=~found.standing)


def band_remarks(found: Baseline) -> tuple[Remark, ...]:
    """What the bands are, and where they do not hold."""
    if found.spectra is None:
        return ()
    stuck = tuple(int(j) + 1 for j in np.flatnonzero(found.stuck))
    limit = (caution("band-of-a-standing-joint", Where(joints=stuck)),) if stuck else ()
    return (fact("band"), *limit)
