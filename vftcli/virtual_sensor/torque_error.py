"""The joint torque error that a wrench's band starts from: stated, or measured on the log.

What is measured is the one model of every band, `vftcli.observers.spectra`: what the estimator
reads while nothing touches the arm, at rest and in motion apart, and what its lag leaves out of the
contacts there are. Where neither a free part nor an unloaded span is known there is no band: the
observers' own covariance assumes a torque that wanders as fast as Q_τ says and a model without
error, and differs a hundredfold between filters whose estimates are nearly the same.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from vftcli.observers.observer import Observer
from vftcli.observers.spectra import error_band, free_error, spectra_of
from vftcli.robots.friction import dry_friction
from vftcli.robots.run import Run, RunSamples
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import numbers
from vftcli.signals.remarks import Remark, Where, caution, fact
from vftcli.signals.wrench import ExternalTorque

OWN = "own"  #: The word for the observers' own covariance as the torque error.


def missed_torque(
    log: Run, observers: Sequence[Observer], free: Mask
) -> Mapping[str, Array] | None:
    """What each observer's lag leaves out of the contacts, mean square. (n,) [(N·m)²]

    Args:
        log: The log.
        observers: The observers.
        free: Unloaded samples of the log. (T,)

    Returns:
        Observer → mean square; None where a part is too short for a spectrum.
    """
    try:
        spectra = spectra_of(RunSamples(log, ~free), [RunSamples(log, free)])
    except ParameterError:
        return None
    f, step, n = spectra.frequency, spectra.step, log.robot.joints
    return {o.name: spectra.missed(o.frequency_response(f, step, n)) for o in observers}


@dataclass(frozen=True, kw_only=True)
class TorqueError:
    """Joint torque error per observer."""

    #: Observer → standard deviation, (n,) or (T, n); those without one have no band. [N·m]
    sd: Mapping[str, Array]
    remarks: tuple[Remark, ...]  #: Where it comes from, or why there is none.


def given_error(text: str, torques: Sequence[ExternalTorque]) -> TorqueError:
    """The torque error that ``virtual-sensor.torque-sd`` states."""
    if text == OWN:
        own = {torque.name: torque.sd for torque in torques if torque.sd is not None}
        without = tuple(torque.name for torque in torques if torque.sd is None)
        none = tuple(caution("no-covariance", Where(name)) for name in without)
        said = tuple(caution("band-of-observer", Where(name)) for name in own)
        return TorqueError(sd=own, remarks=(*said, *none))
    joints = torques[0].joints if torques else 0
    values = np.array(numbers(text) or ())
    if len(values) not in {1, joints} or not np.all(np.isfinite(values) & (values > 0)):
        raise ParameterError(
            f"virtual-sensor.torque-sd {text!r} is not {OWN!r}, one positive number, or one for "
            f"each of {joints} joints [N·m]"
        )
    given = np.array(np.broadcast_to(values, (joints,)))
    sd = {torque.name: given for torque in torques}
    return TorqueError(sd=sd, remarks=tuple(fact("band-given", Where(name)) for name in sd))


def from_band(torques: Sequence[ExternalTorque]) -> TorqueError:
    """The band that each estimate brings along, measured on the log's free part."""
    sd = {torque.name: torque.error_sd for torque in torques if torque.error_sd is not None}
    return TorqueError(sd=sd, remarks=(fact("band-from-torques"),))


def unknown_error() -> TorqueError:
    """No error, and so no band, where nothing of the log is known to be free of contact."""
    return TorqueError(sd={}, remarks=(caution("no-wrench-band"),))


def from_free_part(
    run: Run,
    torques: Sequence[ExternalTorque],
    free: Mask,
    missed: Mapping[str, Array] | None,
) -> TorqueError:
    """The error of the free part and of the lag, as the module's equation has it.

    Args:
        run: The log.
        torques: The estimates.
        free: Unloaded samples. (T,)
        missed: What each observer's lag leaves out of the contacts; None where that is not known.
            (n,) [(N·m)²]
    """
    friction = dry_friction(run.robot.friction, run.robot.joints)
    rests, sd, seen = run.rests, {}, True
    for torque in torques:
        inside = torque.tau[free]
        error = free_error(inside - np.nanmean(inside, axis=0), rests[free], friction)
        seen = seen and not np.any(error.unseen & ~rests.all(axis=0))
        lag = np.zeros(torque.joints) if missed is None else missed[torque.name]
        sd[torque.name] = error_band(error, lag, rests)
    remarks = [fact("band-from-free-part")]
    if missed is None:
        remarks.append(caution("band-without-lag"))
    if not seen:
        remarks.append(caution("band-of-free-rest"))
    return TorqueError(sd=sd, remarks=tuple(remarks))
