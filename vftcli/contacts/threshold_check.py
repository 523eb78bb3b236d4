"""Logs against thresholds: signals, detected contacts.

They check the log's own estimate, as a robot does; else a momentum observer of 10 1/s.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.contacts.thresholds import (
    SETTLING,
    ComparedSignals,
    Thresholds,
    events,
    worst_of,
)
from vftcli.observers.paper import MomentumObserver
from vftcli.robots.run import Run
from vftcli.robots.terms import check_joints
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, caution, fact
from vftcli.signals.wrench import AXES, POINTS, Wrench
from vftcli.wrench.detection import EARLY, ContactInterval, match_contacts, true_contacts
from vftcli.wrench.solvers import VirtualSensor

GAIN = 10.0  #: Of the momentum observer. [1/s]


def compared_signals(run: Run) -> ComparedSignals:
    """Signals that a robot would compare along a log.

    The wrench is the robot's own, else by least squares in base axes about the flange point.
    """
    # Without a model nothing else checks the joints.
    log = run.recording
    check_joints(log, run.robot)
    vendor, stated, own = log.tau_ext, log.wrench_frame, log.wrench
    if vendor is not None and vendor.any():
        torque = ExternalTorque(name="tau_ext", t=log.t, tau=vendor)
    else:
        torque = MomentumObserver(gain=GAIN).estimate(run.terms)
    wrench, frame, logged = np.zeros((log.samples, 0)), "", False
    if own is not None and own.any() and stated is not None and stated.axes != "sensor":
        frame, logged = f"{stated.axes} axes at {POINTS.get(stated.point, stated.point)}", True
        wrench = own
    elif log.joints >= 6:
        solved = VirtualSensor(frame="base").wrench(torque, log.q, run.robot.chain)
        wrench, frame = solved.known, "base axes at the flange point"
    return ComparedSignals(
        recording=log,
        torque=torque.tau,
        wrench=wrench,
        of_vendor=torque.name == "tau_ext",
        logged_wrench=logged,
        frame=frame,
    )


class CheckedContact(NamedTuple):
    """A contact of a log, and whether the thresholds detect it."""

    start: float  #: When it begins. [s]
    stop: float  #: When it ends. [s]
    peak_force: float  #: Its largest force, NaN if unknown. [N]
    #: From its start to the first alarm; NaN without one, or truth. [s]
    delay: float
    by: str  #: Joint or axis of the alarm, "" without one.
    #: Whether an earlier alarm was still on.
    already_above: bool = False


class ThresholdDetection(NamedTuple):
    """Contacts of a log, and their detection by thresholds."""

    log: str  #: The log.
    contacts: tuple[CheckedContact, ...]  #: The contacts, in the order of time.
    remarks: tuple[Remark, ...]  #: Limits of the numbers.
    #: Source of the true contacts; without one alarms count as contacts.
    reference: str | None = None
    #: Alarms that touch no contact, None without a reference.
    false_alarms: int | None = None
    untouched_h: float = np.nan  #: Time without contact, NaN if not known. [h]

    @property
    def detected(self) -> tuple[CheckedContact, ...]:
        """Those that raise an alarm."""
        return tuple(contact for contact in self.contacts if contact.by)

    @property
    def figures(self) -> dict[str, float]:
        """Delays and peak forces of those detected and missed, or NaN."""
        delays = [c.delay for c in self.detected]
        peaks = [c.peak_force for c in self.detected]
        missed = [c.peak_force for c in self.contacts if not (c.by or c.already_above)]
        return {
            "median_delay_s": float(np.median(delays or np.nan)),
            "longest_delay_s": max(delays, default=np.nan),
            "smallest_detected_N": float(np.fmin.reduce(peaks, initial=np.nan)),
            "largest_missed_N": float(np.fmax.reduce(missed, initial=np.nan)),
        }


def check_contacts(
    signals: ComparedSignals,
    thresholds: Thresholds,
    reference: ExternalTorque | None,
    wrench: Wrench | None,
) -> ThresholdDetection:
    """Contacts of a log that the thresholds detect.

    A signal that passes its threshold during the contact detects it, if not above before.
    """
    t, duration = signals.t, signals.recording.duration - SETTLING
    level = np.column_stack([thresholds.level(name, signals) for name in ("joints", "axes")])
    alarms = events(t, worst_of(level))
    names = [*(f"J{j}" for j in range(1, len(thresholds.joints) + 1)), *AXES]
    each = ((n, one) for n, x in zip(names, level.T, strict=False) for one in events(t, x))
    own = sorted(each, key=lambda alarm: alarm[1].start)
    if reference is None:
        contacts = tuple(
            checked(alarm, t, signals.force, own)._replace(delay=np.nan) for alarm in alarms
        )
        remarks = (caution("check-without-truth"),)
        return ThresholdDetection(signals.recording.name, contacts, remarks)
    true = [c for c in true_contacts(reference) if c.stop >= t[0] + SETTLING]
    size = np.zeros((len(t), 0)) if wrench is None else np.linalg.norm(wrench.force, axis=1)
    touched = sum(c.stop - max(c.start, t[0] + SETTLING) for c in true)
    return ThresholdDetection(
        log=signals.recording.name,
        reference=reference.name,
        contacts=tuple(checked(c, t, size, own) for c in true),
        false_alarms=match_contacts(alarms, true, duration).false_alarms,
        untouched_h=(duration - touched) / 3600.0,
        remarks=(fact("check-against-reference", reference=reference.name), *reference.remarks),
    )


def checked(
    contact: ContactInterval, t: Array, size: Array, alarms: Sequence[tuple[str, ContactInterval]]
) -> CheckedContact:
    """A contact with its peak force and the first alarm within it."""
    force = size[(t >= contact.start) & (t <= contact.stop)]
    peak = np.fmax.reduce(force[np.isfinite(force)], initial=np.nan)
    begun = [
        (max(alarm.start - contact.start, 0.0), by)
        for by, alarm in alarms
        if contact.start - EARLY <= alarm.start <= contact.stop
    ]
    delay, by = begun[0] if begun else (np.nan, "")
    above = not by and any(alarm.start < contact.start <= alarm.stop for _, alarm in alarms)
    return CheckedContact(*contact, peak, delay, by, above)
