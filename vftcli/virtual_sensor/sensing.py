"""From a log, its free motion and the estimates to what the virtual sensor says of it."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from itertools import chain as chained
from typing import Any

import numpy as np

from vftcli.observers.observer import Observer
from vftcli.repetition.free_motion import FreeMotion
from vftcli.robots.disturbance import disturbance_impulse
from vftcli.robots.robot import Robot
from vftcli.robots.terms import DynamicsTerms
from vftcli.signals.arrays import Array, Mask, handed_over
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark, Where, caution
from vftcli.signals.series import resample_columns
from vftcli.signals.wrench import ExternalTorque, Wrench
from vftcli.virtual_sensor.choice import WrenchChoice
from vftcli.virtual_sensor.sensor import find_mounting
from vftcli.virtual_sensor.sensor_reading import SensorReading, contact_elsewhere
from vftcli.virtual_sensor.smoother.observer_wrench import (
    FreeLog,
    Gate,
    as_modelled,
    smooth_all,
    smoothed_wrench,
)
from vftcli.virtual_sensor.torque_error import (
    TorqueError,
    from_band,
    from_free_part,
    given_error,
    missed_torque,
    unknown_error,
)
from vftcli.virtual_sensor.vendor import check_vendor
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor
from vftcli.virtual_sensor.zero import (
    without_drift,
    zero_drift,
    zero_moved,
    zero_spans,
    zero_warning,
)

HALF = 0.05  #: Half the time it is averaged over: noise of 2 mrad/s in q̇ leaves some .05 N·m. [s]
PAYLOAD_SLACK = 0.05  #: Difference of payloads that is not worth a remark. [kg]


def sense(
    motion: FreeMotion,
    observers: Sequence[Observer],
    estimates: Sequence[ExternalTorque],
    choice: WrenchChoice,
    plain: FreeLog | None = None,
    own: Mapping[str, FreeLog] | None = None,
    gate: Gate | None = None,
) -> SensorReading:
    """Turn estimates into wrenches, remove the zero, and judge them.

    What is asked of the log rather than of an observer (its unloaded start, its sensor's pose, its
    vendor's convention) is read off the mean disturbance, so that it is the same whichever
    observers run.

    Args:
        motion: The log and its robot.
        observers: The observers, whose lag widens the band.
        estimates: Their torques, in the same order.
        choice: What is asked of the virtual sensor.
        plain: The log and its free samples as the robot's model alone has them; None to find them.
        own: The same as an observer has them that has others, by its name.
        gate: The contacts, outside of which the smoother's wrench is zero; None where the whole log
            is one.

    Raises:
        ParameterError: If a pose or zero interval cannot be used, or cannot be found in the log.
        MissingSignalError: If the log has no wrench and a sensor's pose is asked for.
        RobotError: If the arm has fewer than six joints.
    """
    recording, robot, terms = motion.log.recording, motion.log.robot, motion.log.terms
    t, chain = recording.t, robot.chain
    disturbance = mean_disturbance(terms)
    raw = VirtualSensor(frame="base").wrench(disturbance, recording.q, chain)
    mounting, found = find_mounting(recording, robot, disturbance, choice)
    # The disturbance was solved in base axes, so that --frame moves no zero.
    sensor = VirtualSensor(solver=choice.by_pose, frame=choice.frame, mounting=mounting)
    zero = zero_spans(choice.zero, raw)
    error = torque_error(choice, motion, observers, estimates, zero.chosen(t))
    wrenches = sensor.wrenches(estimates, recording.q, chain, dict(error.sd))
    smoothed = smooth_all(
        [wrench.name for wrench in wrenches if choice.smooths(wrench.name)],
        plain or as_modelled(motion),
        own or {},
        unloaded=zero.chosen(t),
        gate=gate,
    )
    wrenches = tuple(
        smoothed_wrench(smoothed[w.name], w, sensor, motion) if w.name in smoothed else w
        for w in wrenches
    )
    bands = band_remarks(error, wrenches, smoothed)
    # Drifts span by span: the first of each observer is its zero.
    drifts = [[zero_drift(wrench, span) for wrench in wrenches] for span in zero.spans]
    warnings = tuple(
        remark
        for row in drifts
        for wrench, drift in zip(wrenches, row, strict=True)
        for remark in zero_warning(wrench, drift)
    )
    moved = tuple(
        zero_moved(first, last)
        for row in drifts[1:]
        for first, last in zip(drifts[0], row, strict=True)
    )
    # Only now: the band and the warnings are about the wrench as it was read.
    if drifts:
        drifts[0] = [replace(drift, removed=True) for drift in drifts[0]]
        wrenches = tuple(without_drift(w, d) for w, d in zip(wrenches, drifts[0], strict=True))
    free = zero.unloaded(t)
    vendor = check_vendor(recording, raw, chain)
    elsewhere = tuple(e for w in wrenches if (e := contact_elsewhere(w, free)) is not None)
    return SensorReading(
        sensor=sensor,
        wrenches=wrenches,
        masked=raw.hidden,
        drifts=tuple(chained.from_iterable(drifts)),
        free=free,
        vendor=vendor,
        smoothed=smoothed,
        elsewhere=elsewhere,
        remarks=(
            *warnings,
            *found,
            *(() if drifts else payload_remark(recording, robot)),
            *(
                mask_remark(raw.hidden, raw.sigma_min)
                if any(w.hidden.any() for w in wrenches)
                else ()
            ),
            *moved,
            *bands,
            *(() if vendor is None else vendor.remarks),
            *(remark for e in elsewhere for remark in e.remarks),
        ),
    )


def mean_disturbance(terms: DynamicsTerms) -> ExternalTorque:
    """The raw disturbance, its mean over `HALF` before and after each sample. (T, n) [N·m]

    What is asked of a log itself is asked of it: no option touches it and no filter delays it. The
    mean is a difference of its integral, so an uneven clock weighs by time; at the ends of the log
    it is over what there is. A log of one sample reads nothing.
    """
    t, joints = terms.t, terms.joints
    if len(t) < 2:
        return ExternalTorque(name="disturbance", t=t, tau=np.zeros((len(t), joints)))
    total = disturbance_impulse(terms)
    before, after = np.maximum(t - HALF, t[0]), np.minimum(t + HALF, t[-1])
    mean = resample_columns(after, t, total) - resample_columns(before, t, total)
    mean /= (after - before)[:, None]
    return ExternalTorque(name="disturbance", t=t, tau=handed_over(mean))


def band_remarks(
    error: TorqueError, wrenches: Sequence[Wrench], smoothed: Collection[str]
) -> tuple[Remark, ...]:
    """Where the wrenches' bands come from: the error of the torques, and each smoother's own.

    Beside a smoothed wrench, what is said of the torques' error names those that it is said of.
    """
    own = [r for w in wrenches if w.name in smoothed for r in w.remarks]
    others = [w.name for w in wrenches if w.name not in smoothed]
    if not others:
        return tuple(own)
    names = Where(", ".join(others))
    common = error.remarks
    if smoothed:
        common = tuple(replace(r, where=names) if r.where == Where() else r for r in common)
    return (*common, *own)


def torque_error(
    choice: WrenchChoice,
    motion: FreeMotion,
    observers: Sequence[Observer],
    torques: Sequence[ExternalTorque],
    free: Mask,
) -> TorqueError:
    """The torque error behind the band: what was given, else measured, else unknown.

    Args:
        choice: What is asked.
        motion: The log.
        observers: The observers.
        torques: Their estimates.
        free: Samples of the zero spans; none if no zero was given. (T,)
    """
    if choice.torque_sd is not None:
        return given_error(choice.torque_sd, torques)
    if torques and all(torque.error_sd is not None for torque in torques):
        return from_band(torques)
    if np.count_nonzero(free) < 2:
        return unknown_error()
    missed = missed_torque(motion.log, observers, free)
    return from_free_part(motion.log, torques, free, missed)


def payload_remark(recording: Recording, robot: Robot) -> tuple[Remark, ...]:
    """A remark where the controller was told of another load than the robot's file mounts."""
    told = recording.payload_mass
    mounted = robot.payload.mass if robot.payload is not None else 0.0
    if told is None or abs(told - mounted) < PAYLOAD_SLACK:
        return ()
    weight = float(np.linalg.norm(robot.chain.gravity)) * (told - mounted)
    return (caution("payload-differs", told_kg=told, mounted_kg=mounted, weight_N=weight),)


def mask_remark(hidden: Mask, sigma: Array | None) -> tuple[Remark, ...]:
    """How many samples are masked, and how near to a singularity the arm comes.

    Args:
        hidden: Samples in which the pose cannot tell a wrench. (T,)
        sigma: Smallest singular value of the Jacobian, if it was looked at, somewhere. [m]
    """
    count = int(np.count_nonzero(hidden))
    if not count or sigma is None:
        return ()
    values: dict[str, Any] = {"masked": count, "samples": len(hidden), "share": count / len(hidden)}
    return (caution("pose-hides-wrench", **values, sigma_min_m=float(np.min(sigma))),)
