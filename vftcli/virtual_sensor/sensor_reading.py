"""What a log's virtual sensor measured: wrenches, zero drift, masks, contacts, and remarks."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vftcli.repetition.free_run import FreeRun
from vftcli.robots.robot import Robot
from vftcli.signals.arrays import Array, Mask, handed_over
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.lag import time_offset
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import Wrench
from vftcli.virtual_sensor.choice import WrenchChoice
from vftcli.virtual_sensor.frames import Mounting
from vftcli.virtual_sensor.null_space import Elsewhere, contact_elsewhere
from vftcli.virtual_sensor.solvers import SCALE
from vftcli.virtual_sensor.torque_error import (
    Disturbance,
    TorqueError,
    assumed,
    banded,
    measured,
    stated,
)
from vftcli.virtual_sensor.vendor import VendorCheck, check_vendor
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor
from vftcli.virtual_sensor.zero import (
    NO_START,
    SETTLING,
    Drift,
    change,
    loaded_zero,
    unloaded_start,
    without_drift,
    zero_drift,
)

PAYLOAD_SLACK = 0.05
"""Difference of payloads that is not worth a remark. [kg]"""


@dataclass(frozen=True, kw_only=True)
class FreeRunTorque:
    """What the observers read in a free run, brought to the log.

    Attributes:
        torque: Observer → its torque at the same place of the trajectory, NaN beyond the free run;
            empty where the free run is of another trajectory. (T, n) [N·m]
        mean: Observer → its mean over the free run. (n,) [N·m]
        rms: Observer → its root mean square over the free run. (n,) [N·m]
        note: Where it comes from, one sentence.
    """

    torque: Mapping[str, Array]
    mean: Mapping[str, Array]
    rms: Mapping[str, Array]
    note: str


@dataclass(frozen=True, kw_only=True)
class SensorReading:
    """Everything the virtual sensor says of one log.

    Attributes:
        sensor: Solver, frame and mounting used.
        wrenches: One an observer, drift removed where a zero was given.
        drifts: Zero drift, one an observer and unloaded span.
        free: Samples known to be unloaded: those of the zero spans, or of the unloaded start. (T,)
        vendor: What convention the log's own wrench is in, None if it has none.
        elsewhere: The null-space channel's verdicts, for arms of more than six joints.
        logged: The log's own wrench without the weight of its sensor's tool, in base axes; None
            where it was not weighed.
        reference: The wrench the others are judged by, in the same frame, or None.
        notes: What the reader of the numbers should know, one sentence each.
        warnings: What looks wrong, one sentence each.
    """

    sensor: VirtualSensor
    wrenches: tuple[Wrench, ...]
    drifts: tuple[Drift, ...] = ()
    free: Mask
    vendor: VendorCheck | None = None
    elsewhere: tuple[Elsewhere, ...] = ()
    logged: Wrench | None = None
    reference: Wrench | None = None
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def masked_share(self) -> float:
        """Share of the samples in which the pose cannot tell the wrench."""
        return float(np.mean(self.wrenches[0].hidden)) if self.wrenches else 0.0


def measure(
    recording: Recording,
    robot: Robot,
    estimates: Sequence[ExternalTorque],
    request: WrenchChoice,
    unloaded: FreeRunTorque | None = None,
    mounting: Mounting | None = None,
    disturbance: Disturbance | None = None,
) -> SensorReading:
    """Turn estimates into wrenches, remove the zero, and judge them.

    Args:
        recording: The log.
        robot: The arm, its payload mounted.
        estimates: The observers' torques.
        request: What is asked.
        unloaded: What a free run reads, for ``--zero LOG``.
        mounting: Tool and sensor poses, where they are not those of the request.
        disturbance: What tells the observers' lag, for the band.

    Raises:
        ParameterError: If a frame, solver, pose or zero interval cannot be used.
        RobotError: If the arm has fewer than six joints.
    """
    sensor = VirtualSensor(
        solver=request.solver,
        frame=request.frame,
        mounting=mounting if mounting is not None else request.mounting(robot),
    )
    torques = relieved(estimates, unloaded)
    first = sensor.wrenches(torques, recording.q, robot.chain)
    spans, found = zero_spans(request, first)
    told = free_samples(recording.t, spans)
    error = torque_error(request, torques, told, unloaded, disturbance)
    wrenches = (
        sensor.wrenches(torques, recording.q, robot.chain, dict(error.sd)) if error.sd else first
    )
    drifts = tuple(zero_drift(wrench, span) for span in spans for wrench in wrenches)
    warnings = tuple(w for drift in drifts if (w := warned(wrenches, drift)))
    free = free_samples(recording.t, spans or found)
    notes = [
        *payload_note(recording, robot),
        *mask_note(recording, wrenches),
        *drift_notes(drifts, len(wrenches)),
    ]
    notes += band_notes(error, wrenches)
    if unloaded is not None:
        notes.append(unloaded.note)
    if spans and (request.zero.of_log):
        drifts = tuple(
            replace(d, removed=True) if k < len(wrenches) else d for k, d in enumerate(drifts)
        )
        wrenches = tuple(without_drift(w, d) for w, d in zip(wrenches, drifts, strict=False))
    vendor = vendor_check(recording, robot, torques)
    if vendor is not None:
        notes.extend(vendor.sentences())
    elsewhere = tuple(e for w in wrenches if (e := contact_elsewhere(w, free)) is not None)
    return SensorReading(
        sensor=sensor,
        wrenches=wrenches,
        drifts=drifts,
        free=free,
        vendor=vendor,
        elsewhere=elsewhere,
        notes=(*notes, *elsewhere_notes(elsewhere)),
        warnings=warnings,
    )


def band_notes(error: TorqueError, wrenches: Sequence[Wrench]) -> list[str]:
    """Where the 95 % band comes from: one sentence for all, or one an observer."""
    if error.note:
        return [error.note]
    return [f"{wrench.name}: {note}" for wrench in wrenches for note in wrench.remarks]


def vendor_check(
    recording: Recording, robot: Robot, torques: Sequence[ExternalTorque]
) -> VendorCheck | None:
    """The convention of the log's own wrench, told by the first observer's; None without one."""
    if recording.wrench is None or not torques:
        return None
    ours = VirtualSensor(frame="base").wrench(torques[0], recording.q, robot.chain)
    return check_vendor(recording, ours, robot.chain)


def referred(sensed: SensorReading, reference: Wrench) -> SensorReading:
    """The measurement with a reference beside it: its zero removed, its time offset told."""
    notes = list(sensed.notes)
    if reference.name == "sensor" and sensed.drifts and sensed.drifts[0].removed:
        drift = replace(zero_drift(reference, sensed.drifts[0].span), removed=True)
        reference = replace(reference, values=reference.values - drift.mean)
        notes.append(drift.sentence())
    if reference.name == "sensor":
        notes.append(offset_note(sensed.wrenches, reference))
    return replace(sensed, reference=reference, notes=tuple(notes))


def offset_note(wrenches: Sequence[Wrench], reference: Wrench) -> str:
    """How far each virtual sensor runs behind the real one, in words."""
    told = (
        time_offset(reference.t, wrench.known / SCALE, reference.known / SCALE)
        for wrench in wrenches
    )
    each = ", ".join(
        f"{wrench.name} {offset.lag * 1e3:+.0f} ms (correlation {offset.correlation:.3f})"
        for wrench, offset in zip(wrenches, told, strict=True)
    )
    return f"time offset against the sensor, observer delay included and not removed: {each}"


def relieved(
    estimates: Sequence[ExternalTorque], unloaded: FreeRunTorque | None
) -> tuple[ExternalTorque, ...]:
    """The estimates less what a free run reads at the same place, or less its mean."""
    if unloaded is None:
        return tuple(estimates)
    return tuple(
        replace(e, tau=handed_over(e.tau - unloaded.torque.get(e.name, unloaded.mean[e.name])))
        for e in estimates
    )


def torque_error(
    request: WrenchChoice,
    torques: Sequence[ExternalTorque],
    free: Mask,
    unloaded: FreeRunTorque | None,
    disturbance: Disturbance | None,
) -> TorqueError:
    """The torque error behind the band: what was stated, else measured, else assumed.

    Args:
        request: What is asked.
        torques: The estimates.
        free: Samples of the zero spans; none if no zero was given. (T,)
        unloaded: What a free run reads, or None.
        disturbance: What tells the observers' lag, or None.
    """
    if request.torque_sd is not None:
        return stated(request.torque_sd, torques)
    if unloaded is not None:
        return measured(torques, free, unloaded.rms, disturbance)
    if np.count_nonzero(free) > 1:
        return measured(torques, free, None, disturbance)
    if torques and all(torque.error_sd is not None for torque in torques):
        return banded(torques)
    return assumed(torques, request.solver)


def free_run_torque(run: FreeRun, estimates: Sequence[ExternalTorque]) -> FreeRunTorque:
    """What a free run reads, at the same place of the trajectory where it is the log's.

    Args:
        run: The free run beside its log.
        estimates: Its observers' torques; the first `SETTLING` seconds count for no mean.
    """
    settled = {
        e.name: e.tau[e.t - e.t[0] >= min(SETTLING, 0.5 * (e.t[-1] - e.t[0]))] for e in estimates
    }
    there = {}
    words = "its mean torque is removed: it is another trajectory"
    if run.is_same_motion:
        shift = run.alignment.shift
        words = f"its torque at the same place of the trajectory is removed (shift {shift:+.4f} s)"
        there = {e.name: run.pairing.there(e.tau) for e in estimates}
    return FreeRunTorque(
        torque=there,
        mean={name: tau.mean(axis=0) for name, tau in settled.items()},
        rms={name: np.sqrt(np.mean(tau**2, axis=0)) for name, tau in settled.items()},
        note=f"zero from the free run {run.recording.name}: {words}",
    )


Spans = tuple[tuple[float, float], ...]


def zero_spans(request: WrenchChoice, wrenches: Sequence[Wrench]) -> tuple[Spans, Spans]:
    """The spans that are the zero, and the unloaded start that was found where none was given.

    Raises:
        ParameterError: If the unloaded start is asked for and there is none.
    """
    if request.zero.spans:
        return request.zero.spans, ()
    start = unloaded_start(wrenches[0]) if wrenches else None
    if not request.zero.start:
        return (), () if start is None else (start,)
    if start is None:
        raise ParameterError(NO_START)
    return (start,), ()


def free_samples(t: Array, spans: Spans) -> Mask:
    """Samples that lie in any of the spans. (T,)"""
    free: Mask = np.zeros(len(t), dtype=bool)
    for start, stop in spans:
        free |= (t >= start) & (t <= stop)
    return free


def warned(wrenches: Sequence[Wrench], drift: Drift) -> str:
    """A warning if the zero interval looks like a contact, else ""."""
    return loaded_zero(next(w for w in wrenches if w.name == drift.name), drift)


def payload_note(recording: Recording, robot: Robot) -> tuple[str, ...]:
    """A remark where the controller was told of another load than the robot's file mounts."""
    told = recording.payload_mass
    mounted_mass = robot.payload.mass if robot.payload is not None else 0.0
    if told is None or abs(told - mounted_mass) < PAYLOAD_SLACK:
        return ()
    return (
        f"the controller was told of a payload of {told:.3g} kg, the robot file mounts "
        f"{mounted_mass:.3g} kg: the difference of {9.81 * (told - mounted_mass):.3g} N reads as a "
        "force; mount it with [payload] or --payload NAME, or remove it with --zero",
    )


def mask_note(recording: Recording, wrenches: Sequence[Wrench]) -> tuple[str, ...]:
    """How many samples are masked, and why."""
    if not wrenches or not wrenches[0].hidden.any():
        return ()
    count = int(np.count_nonzero(wrenches[0].hidden))
    sigma = wrenches[0].sigma_min
    least = float(np.min(sigma)) if sigma is not None else float("nan")
    return (
        f"the pose cannot tell the wrench in {count} of {recording.samples} samples "
        f"({count / recording.samples:.1%}): σ_min of J (angular rows × 0.3 m) falls to "
        f"{least:.3g}, below 0.05; they are null",
    )


def drift_notes(drifts: Sequence[Drift], observers: int) -> list[str]:
    """How the zero moved, where there is more than one unloaded span."""
    firsts = drifts[:observers]
    return [change(firsts[k % observers], d) for k, d in enumerate(drifts) if k >= observers]


def elsewhere_notes(elsewhere: Sequence[Elsewhere]) -> list[str]:
    """What the null-space channel says, where it says anything."""
    return [
        f"{e.name}: {e.share:.1%} of the samples have joint torque that no wrench at the flange "
        f"explains (above {e.threshold:.3g} N·m): contact elsewhere on the arm, or a wrong model"
        for e in elsewhere
        if e.share > 0.001
    ]
