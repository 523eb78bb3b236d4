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
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.parsing import numbers
from vftcli.signals.remarks import Remark, Where, caution, fact

OWN = "own"  #: The word for the observers' own covariance as the torque error.


@dataclass(frozen=True, kw_only=True)
class TorqueError:
    """Joint torque error per observer."""

    #: Observer → standard deviation, (n,) or (T, n); those without one have no band. [N·m]
    sd: Mapping[str, Array]
    remarks: tuple[Remark, ...]  #: Where it comes from, or why there is none.


def torque_error(
    stated: str | None,
    log: Run,
    observers: Sequence[Observer],
    torques: Sequence[ExternalTorque],
    free: Mask,
) -> TorqueError:
    """The torque error behind the band: as ``virtual-sensor.torque-sd`` states, else measured.

    It is measured on the samples of the zero spans (T,); without any there is none.
    """
    if stated is not None:
        return given_error(stated, torques)
    known = {torque.name: torque.error_sd for torque in torques if torque.error_sd is not None}
    if torques and len(known) == len(torques):
        return TorqueError(sd=known, remarks=(fact("band-from-torques"),))
    if np.count_nonzero(free) < 2:
        return TorqueError(sd={}, remarks=(caution("no-wrench-band"),))
    return from_free_part(log, torques, free, missed_torque(log, observers, free))


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


def from_free_part(
    run: Run,
    torques: Sequence[ExternalTorque],
    free: Mask,
    missed: Mapping[str, Array] | None,
) -> TorqueError:
    """The error of the free samples (T,) and of what the lag misses, where that is known."""
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


def missed_torque(
    log: Run, observers: Sequence[Observer], free: Mask
) -> Mapping[str, Array] | None:
    """Observer → mean square that its lag leaves out of the contacts. (n,) [(N·m)²]

    None where the part that is free, or the rest, is too short for a spectrum.
    """
    try:
        spectra = spectra_of(RunSamples(log, ~free), [RunSamples(log, free)])
    except ParameterError:
        return None
    f, step, n = spectra.frequency, spectra.step, log.robot.joints
    return {o.name: spectra.missed(o.frequency_response(f, step, n)) for o in observers}
