"""From a log, its free motion and the estimates to the virtual sensor's reading.

The joint torque error behind a wrench's band is stated, or measured on the log by the
one model of every band, `vftcli.observers.spectra`: the estimator's reading while nothing
touches the arm, at rest and in motion apart, and the part of the contacts that its lag
leaves out. Without a free part or an unloaded span there is no band: the observers' own
covariance assumes a torque that wanders at Q_τ and a model without error, and differs a
hundredfold between filters with nearly equal estimates.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import chain as chained
from typing import NamedTuple

import numpy as np

from vftcli.free_motion.free_motion import FreeLoad, FreeMotion, within, without_load
from vftcli.observers.observer import Observer
from vftcli.observers.spectra import error_band, free_error, spectra_of
from vftcli.robots.chain import link_poses
from vftcli.robots.run import Run, RunSamples, block_means
from vftcli.robots.terms import disturbance_impulse
from vftcli.signals.arrays import Array, Mask, handed_over, resample_columns
from vftcli.signals.errors import ParameterError, ReferenceTorqueError
from vftcli.signals.external_torque import DynamicsTerms, ExternalTorque
from vftcli.signals.option import numbers
from vftcli.signals.remarks import Remark, Where, caution, fact
from vftcli.signals.wrench import Wrench
from vftcli.wrench import WrenchChoice
from vftcli.wrench.sensor import (
    SensorReading,
    contact_elsewhere,
    find_mounting,
    vendor_remarks,
    without_drift,
    zero_drift,
    zero_moved,
    zero_spans,
    zero_warning,
)
from vftcli.wrench.smoother import (
    SmoothedWrench,
    WrenchPrior,
    prior_of,
    smooth_wrench,
)
from vftcli.wrench.solvers import CHUNK, VirtualSensor, from_base

#: Half the averaging time: noise of 2 mrad/s in q̇ leaves some .05 N·m. [s]
HALF = 0.05


class Gate(NamedTuple):
    """The contacts of a log, outside of which nothing touches the arm."""

    spans: Sequence[tuple[float, float]]  #: From and to of every contact. [s]
    #: Prior of their wrench, learned from the contacts; None to choose it.
    prior: WrenchPrior | None = None


class FreeLog(NamedTuple):
    """A log as an observer has it, and its free motion."""

    run: Run  #: The log.
    #: Free samples, less a load that they carry.
    free: tuple[RunSamples, ...]
    #: A load that the free samples, hence the whole log, carry; None without one.
    load: FreeLoad | None = None

    def known_free(self, unloaded: Mask) -> tuple[RunSamples, ...]:
        """The free samples; without any, the zero's unloaded samples (T,)."""
        if self.free or np.count_nonzero(unloaded) < 2:
            return self.free
        return (RunSamples(self.run, unloaded),)


def as_modelled(motion: FreeMotion) -> FreeLog:
    """The log by the robot's model, with its free part, given or found."""
    try:
        return FreeLog(motion.log, motion.known.pieces)
    except ReferenceTorqueError:
        return FreeLog(motion.log, ())


def sense(
    motion: FreeMotion,
    observers: Sequence[Observer],
    estimates: Sequence[ExternalTorque],
    choice: WrenchChoice,
    plain: FreeLog | None = None,
    own: Mapping[str, FreeLog] | None = None,
    gate: Gate | None = None,
) -> SensorReading:
    """Wrenches of the estimates, in their order, less their zero, with remarks.

    The unloaded start, the sensor's pose and the vendor's convention come from the mean
    disturbance, whatever observers run. The smoother needs the log with its free samples, by
    the robot's model alone (`plain`) or as an observer has its own.
    """
    log, q, t, chain = motion.log, motion.log.q, motion.log.t, motion.log.robot.chain
    disturbance = mean_disturbance(log.terms)
    to_smooth, others = (
        [torque for torque in estimates if choice.smooths(torque.name) == wanted]
        for wanted in (True, False)
    )
    # In base axes --frame moves no zero; beside it the poses of the smoothed estimates.
    raw, *slow = slow_wrenches(log, (disturbance, *to_smooth))
    mounting, fitted = find_mounting(log.recording, log.robot, disturbance, choice)
    sensor = VirtualSensor(solver=choice.by_pose, frame=choice.frame, mounting=mounting)
    spans, unloaded = zero_spans(choice.zero, raw)
    raw = resampled(raw, t)
    vendor = vendor_remarks(log.recording, raw, chain)
    chosen, free = within(t, spans), within(t, unloaded)
    hidden, sigma = raw.hidden, raw.sigma_min
    del disturbance, raw  # of a long log each takes the room of an estimate
    log.spare()
    sds, on_sds = torque_error(choice.torque_sd, log, observers, estimates, chosen)
    names, plain = [wrench.name for wrench in slow], plain or as_modelled(motion)
    smoothed = smooth_all(names, plain, own or {}, unloaded=chosen, gate=gate)
    by_pose = sensor.wrenches(others, q, chain, sds) if others else ()
    made = {wrench.name: wrench for wrench in by_pose}
    made |= {
        w.name: smoothed_wrench(smoothed[w.name], resampled(w, t), sensor, log) for w in slow
    }
    wrenches = [made[torque.name] for torque in estimates]
    bands = [remark for name in names for remark in made[name].remarks]
    # Remarks on torques' errors name the torques, if some are smoothed.
    if others:
        where = Where(", ".join(torque.name for torque in others)) if smoothed else Where()
        bands[:0] = [replace(r, where=where) if r.where == Where() else r for r in on_sds]
    # Drifts span by span: the first of each observer is its zero.
    drifts = [[zero_drift(wrench, span) for wrench in wrenches] for span in spans]
    read = [pair for row in drifts for pair in zip(wrenches, row, strict=True)]
    warnings = [remark for pair in read for remark in zero_warning(*pair)]
    moved = [zero_moved(*pair) for row in drifts[1:] for pair in zip(drifts[0], row, strict=True)]
    # Only now: band and warnings are about the wrench as it was read.
    if drifts:
        wrenches = [*map(without_drift, wrenches, drifts[0])]
        drifts[0] = [drift._replace(removed=True) for drift in drifts[0]]
    return SensorReading(
        sensor=sensor,
        wrenches=tuple(wrenches),
        masked=hidden,
        drifts=tuple(chained.from_iterable(drifts)),
        smoothed=smoothed,
        remarks=(
            *warnings,
            *fitted,
            *(mask_remark(hidden, sigma) if any(w.hidden.any() for w in wrenches) else ()),
            *moved,
            *bands,
            *vendor,
            *(remark for w in wrenches for remark in contact_elsewhere(w, free)),
        ),
    )


def slow_wrenches(log: Run, torques: Sequence[ExternalTorque]) -> tuple[Wrench, ...]:
    """Wrenches of slow torques in base axes, on the clock of the coarse run."""
    chain, coarse, sensor = log.robot.chain, log.coarse, VirtualSensor(frame="base")
    slow = [
        ExternalTorque(name=torque.name, t=coarse.t, tau=block_means(torque.tau, log.blocked))
        for torque in torques
    ]
    return sensor.wrenches(slow, coarse.q, chain)


def resampled(wrench: Wrench, t: Array) -> Wrench:
    """A wrench without a band, interpolated to times t (T,) [s]."""
    if wrench.t is t:
        return wrench
    sigma, left = (
        None if x is None else handed_over(np.interp(t, wrench.t, x))
        for x in (wrench.sigma_min, wrench.null_space)
    )
    return replace(
        wrench,
        t=t,
        values=handed_over(resample_columns(t, wrench.t, wrench.values)),
        sigma_min=sigma,
        masked=np.interp(t, wrench.t, wrench.hidden) > 0.5,
        null_space=left,
    )


def smoothed_wrench(
    smoothed: SmoothedWrench, wrench: Wrench, sensor: VirtualSensor, log: Run
) -> Wrench:
    """A wrench with the smoother's values and band in the sensor's frame, unmasked."""

    def to_frame(q: Array) -> Array:
        flange = link_poses(log.robot.chain, q).rotation[:, -1]
        return from_base(sensor.frame, flange, sensor.mounting)

    # The arm hardly turns within a block: its band is turned with it.
    X = to_frame(resample_columns(smoothed.t, log.t, log.q))
    turned = smoothed._replace(covariance=X @ smoothed.covariance @ X.swapaxes(1, 2))
    values, sd = turned.at(wrench.t)
    for start in range(0, len(values), CHUNK):
        span = slice(start, start + CHUNK)
        values[span] = np.squeeze(to_frame(log.q[span]) @ values[span, :, None], axis=2)
    return replace(
        wrench,
        values=handed_over(values),
        frame=sensor.frame,
        sd=handed_over(sd),
        masked=None,
        remarks=smoothed.remarks(wrench.name),
    )


def smooth_all(
    names: Sequence[str],
    plain: FreeLog,
    own: Mapping[str, FreeLog],
    *,
    unloaded: Mask,
    gate: Gate | None = None,
) -> dict[str, SmoothedWrench]:
    """The smoothed wrench of each observer, one computation a log."""
    logs = {name: own.get(name, plain) for name in names}
    each = {log.run: log for log in reversed(logs.values())}
    wrenches = {run: smooth_log(log, plain, unloaded, gate) for run, log in each.items()}
    return {name: wrenches[log.run] for name, log in logs.items()}


def smooth_log(log: FreeLog, plain: FreeLog, unloaded: Mask, gate: Gate | None) -> SmoothedWrench:
    """The smoothed wrench of one log.

    A corrected model error is used where the wrench comes and goes. If the uncorrected log
    implies one steady load it is left out, since load and model error look alike.
    """
    run, free, load = log.run, log.known_free(unloaded), log.load
    if gate is not None:
        found = smooth_wrench(without_load(run, load), free, gate.spans, gate.prior)
        if load is None:
            return found
        q = resample_columns(found.t, run.t, run.q)
        values, covariance = load.wrench(run.robot.chain, q)
        values, covariance = found.values + values, found.covariance + covariance
        return found._replace(values=values, covariance=covariance, load=load)
    if run is not plain.run:
        modelled = plain.known_free(unloaded)
        prior = prior_of(plain.run, modelled)
        if prior.is_steady:
            return smooth_wrench(plain.run, modelled, prior=prior)._replace(uncorrected=True)
    return smooth_wrench(run, free)


def mean_disturbance(terms: DynamicsTerms) -> ExternalTorque:
    """The raw disturbance, averaged over `HALF` around each sample. (T, n) [N·m]

    As a difference of its integral it weighs an uneven clock by time. It is shorter at the
    log's ends, 0 for one sample.
    """
    t, joints = terms.t, terms.joints
    if len(t) < 2:
        return ExternalTorque(name="disturbance", t=t, tau=np.zeros((len(t), joints)))
    total = disturbance_impulse(terms)
    before, after = np.maximum(t - HALF, t[0]), np.minimum(t + HALF, t[-1])
    mean = resample_columns(after, t, total) - resample_columns(before, t, total)
    mean /= (after - before)[:, None]
    return ExternalTorque(name="disturbance", t=t, tau=handed_over(mean))


def mask_remark(hidden: Mask, sigma: Array | None) -> tuple[Remark, ...]:
    """A remark with the count of hidden samples (T,) and the smallest σ_min [m]."""
    count = np.count_nonzero(hidden)
    if not count or sigma is None:
        return ()
    values = {"masked": count, "samples": len(hidden), "share": count / len(hidden)}
    return (caution("pose-hides-wrench", **values, sigma_min_m=sigma.min()),)


OWN = "own"  #: The word for the observers' own covariance as the torque error.
#: Observer → SD, (n,) or (T, n), none of those without a band [N·m]; and
#: its source, or why there is none.
TorqueError = tuple[dict[str, Array], list[Remark]]


def torque_error(
    stated: str | None,
    log: Run,
    observers: Sequence[Observer],
    torques: Sequence[ExternalTorque],
    free: Mask,
) -> TorqueError:
    """The torque error behind the band: as stated, else of the zero spans (T,)."""
    if stated is not None:
        return given_error(stated, torques)
    known = {torque.name: torque.error_sd for torque in torques if torque.error_sd is not None}
    if torques and len(known) == len(torques):
        return known, [fact("band-from-torques")]
    if np.count_nonzero(free) < 2:
        return {}, [caution("no-wrench-band")]
    return from_free_part(log, torques, free, missed_torque(log, observers, free))


def given_error(text: str, torques: Sequence[ExternalTorque]) -> TorqueError:
    """The torque error that ``virtual-sensor.torque-sd`` states."""
    if text == OWN:
        own = {torque.name: torque.sd for torque in torques if torque.sd is not None}
        without = [torque.name for torque in torques if torque.sd is None]
        remarks = [caution("band-of-observer", Where(name)) for name in own]
        return own, remarks + [caution("no-covariance", Where(name)) for name in without]
    joints = torques[0].joints if torques else 0
    values = np.array(numbers(text) or ())
    if len(values) not in {1, joints} or not np.all(np.isfinite(values) & (values > 0)):
        raise ParameterError(
            f"virtual-sensor.torque-sd {text!r} is not {OWN!r}, one positive number, or one for "
            f"each of {joints} joints [N·m]"
        )
    given = np.array(np.broadcast_to(values, (joints,)))
    names = [torque.name for torque in torques]
    return dict.fromkeys(names, given), [fact("band-given", Where(name)) for name in names]


def from_free_part(
    run: Run,
    torques: Sequence[ExternalTorque],
    free: Mask,
    missed: Mapping[str, Array] | None,
) -> TorqueError:
    """The error of the free samples (T,), and of the lag where it is known."""
    rests, sd, seen = run.rests, {}, True
    for torque in torques:
        inside = torque.tau[free]
        error = free_error(inside - np.nanmean(inside, axis=0), rests[free], run.dry_friction)
        seen = seen and not np.any(error.unseen & ~rests.all(axis=0))
        lag = np.zeros(torque.joints) if missed is None else missed[torque.name]
        sd[torque.name] = error_band(error, lag, rests)
    remarks = [fact("band-from-free-part")]
    if missed is None:
        remarks.append(caution("band-without-lag"))
    if not seen:
        remarks.append(caution("band-of-free-rest"))
    return sd, remarks


def missed_torque(
    log: Run, observers: Sequence[Observer], free: Mask
) -> Mapping[str, Array] | None:
    """Observer → mean square of contacts that its lag leaves out. (n,) [(N·m)²]

    None if the free part or the rest is too short for a spectrum.
    """
    try:
        spectra = spectra_of(RunSamples(log, ~free), [RunSamples(log, free)])
    except ParameterError:
        return None
    f, step, n = spectra.frequency, spectra.step, log.robot.joints
    return {o.name: spectra.missed(o.frequency_response(f, step, n)) for o in observers}
