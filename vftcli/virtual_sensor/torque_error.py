"""The joint torque error that a wrench's band starts from: stated, the observer's own, or measured.

The measured one is sd² = rms_free² + ∫|1 − H|² S_τ df: what the estimator reads while nothing
touches the arm, and what its lag leaves out of the contacts there are. H is its frequency response;
S_τ = (S_d − S_n)₊ is the spectrum of the external torque, S_d and S_n those of the raw disturbance
d = Δp/Δt − ½(μᵗ + μᵗ⁻¹) over the loaded and the free part.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vftcli.observers.observer import Observer
from vftcli.observers.spectra import Part, spectra_of
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.parsing import numbers
from vftcli.signals.remarks import Remark, caution, fact
from vftcli.virtual_sensor.solvers import TORQUE_SD

OWN = "own"
"""The word for the observers' own covariance as the torque error."""


def lag_sd(
    terms: DynamicsTerms,
    observers: Sequence[Observer],
    free_run: DynamicsTerms | None,
    free: Mask,
) -> Mapping[str, Array]:
    """What each observer's lag leaves out of the contacts, standard deviation. (n,) [N·m]

    Args:
        terms: p and μ along the log.
        observers: The observers.
        free_run: p and μ along a free run, or None.
        free: Unloaded samples of the log, used where there is no free run. (T,)
    """
    loaded, quiet = Part(terms, ~free), Part(terms, free)
    if free_run is not None:
        loaded, quiet = (Part(run, np.ones(len(run.t), dtype=bool)) for run in (terms, free_run))
    n = terms.joints
    try:
        spectra = spectra_of(loaded, [quiet])
    except ParameterError:  # too short for a spectrum: nothing is known of the lag's part
        return {observer.name: np.zeros(n) for observer in observers}
    f, step = spectra.frequency, spectra.step
    return {o.name: np.sqrt(spectra.missed(o.frequency_response(f, step, n))) for o in observers}


@dataclass(frozen=True, kw_only=True)
class TorqueError:
    """Joint torque error per observer, where it is not the observer's own account.

    Attributes:
        sd: Observer → standard deviation. (n,) [N·m]
        remark: Where it comes from, None where the wrenches themselves say it.
    """

    sd: Mapping[str, Array]
    remark: Remark | None = None


def given_error(text: str, torques: Sequence[ExternalTorque]) -> TorqueError:
    """The torque error that ``--torque-sd`` states.

    Raises:
        ParameterError: If it is neither "own", one positive number, nor one a joint.
    """
    if text == OWN:
        return TorqueError(sd={})
    joints = torques[0].joints if torques else 0
    values = np.array(numbers(text) or ())
    if len(values) not in {1, joints} or not np.all(np.isfinite(values) & (values > 0)):
        raise ParameterError(
            f"--torque-sd {text!r} is not {OWN!r}, one positive number, or one for each of "
            f"{joints} joints [N·m]"
        )
    given = np.array(np.broadcast_to(values, (joints,)))
    return TorqueError(sd={torque.name: given for torque in torques})


def from_band(torques: Sequence[ExternalTorque]) -> TorqueError:
    """The band that each estimate brings along, measured on the log's free part."""
    sd = {torque.name: torque.error_sd for torque in torques if torque.error_sd is not None}
    return TorqueError(
        sd={name: band[0] if np.all(band == band[0]) else band for name, band in sd.items()},
        remark=fact("band-from-torques"),
    )


def from_default(torques: Sequence[ExternalTorque], solver: str) -> TorqueError:
    """`TORQUE_SD` for all observers where a prior is weighed; else each states or assumes its own.

    The Kalman filter's own covariance assumes a torque that wanders as fast as its Q_τ says, often
    tens of N·m; against it the prior of the MAP solver would win everywhere.
    """
    if solver != "map":
        return TorqueError(sd={})
    sd = {torque.name: np.full(torque.joints, TORQUE_SD) for torque in torques}
    return TorqueError(sd=sd, remark=caution("band-assumed-for-prior", torque_sd_Nm=TORQUE_SD))


def from_free_part(
    torques: Sequence[ExternalTorque],
    free: Mask,
    rms: Mapping[str, Array] | None,
    lag: Mapping[str, Array],
) -> TorqueError:
    """The error of the free part and of the lag, as the module's equation has it.

    Args:
        torques: The estimates.
        free: Unloaded samples. (T,)
        rms: Root mean square over a free run, or None to take the spread over `free`. (n,) [N·m]
        lag: What each observer's lag leaves out of the contacts; see `lag_sd`. (n,) [N·m]
    """
    sd = {}
    for torque in torques:
        quiet = rms[torque.name] if rms is not None else np.nanstd(torque.tau[free], axis=0)
        sd[torque.name] = np.hypot(quiet, lag.get(torque.name, 0.0))
    return TorqueError(sd=sd, remark=fact("band-from-free-part"))
