"""Bands: how far an estimate may be off, as the log itself shows it.

    sd² = rms_free² + ∫ |1 − H|² S_τ df

What the estimator reads where nothing touches the arm, bias and model error included, and what its
lag and bandwidth leave out of the torque there is. The Kalman covariance knows neither: it is the
filter's own account, of a model without error, and stands apart (`sd`).
"""

from dataclasses import replace

import numpy as np

from vftcli.observers.observer import Observer
from vftcli.refinement.baseline import Baseline, free_estimates, free_rms, stuck_joints
from vftcli.signals.arrays import handed_over
from vftcli.signals.external_torque import ExternalTorque


def with_band(found: Baseline, observer: Observer, estimate: ExternalTorque) -> ExternalTorque:
    """The estimate with its band, and its samples at rest marked; itself without spectra."""
    if found.spectra is None:
        return estimate
    response = observer.frequency_response(
        found.spectra.frequency, found.spectra.step, found.spectra.joints
    )
    variance = free_rms(found, free_estimates(found, observer, estimate)) ** 2
    variance = variance + found.spectra.missed(response)
    sd = np.broadcast_to(handed_over(np.sqrt(variance)), estimate.tau.shape)
    return replace(estimate, error_sd=sd, moving=found.rest == 0.0)


def band_notes(found: Baseline) -> tuple[str, ...]:
    """What the bands are, and where they do not hold."""
    if found.spectra is None:
        return ()
    note = "bands: sd² = rms_free² + ∫|1−H|²S_τ df, model error and lag included; 95 % is 1.96 sd"
    stuck = stuck_joints(found)
    if not stuck:
        return (note,)
    verb = "rests" if len(stuck) == 1 else "rest"
    return (
        note,
        f"{', '.join(stuck)} {verb} in most of the log: stiction limits what can be said there, "
        "and the band does not hold",
    )
