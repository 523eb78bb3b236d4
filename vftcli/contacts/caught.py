"""Which contacts of a log thresholds would have caught: when, by what, and how hard they were."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.contacts.compared_signals import ComparedSignals
from vftcli.contacts.tail import SETTLING, events
from vftcli.contacts.thresholds import Thresholds, worst_of
from vftcli.signals.arrays import Array
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, caution, fact
from vftcli.signals.wrench import AXES, Wrench
from vftcli.virtual_sensor.contact import EARLY, ContactInterval, match_contacts
from vftcli.virtual_sensor.detection import TRUE_TORQUE, true_intervals


class CheckedContact(NamedTuple):
    """A contact of a log, and whether the thresholds tell it."""

    start: float  #: When it begins. [s]
    stop: float  #: When it ends. [s]
    peak_force: float  #: Its largest force, NaN where that is not known. [N]
    delay: float  #: From its start to the first alarm; NaN where there is none, or no truth. [s]
    by: str  #: The joint or axis that raises the alarm, "" where there is none.
    #: Whether none begins because one was on already, left over from a contact before.
    was_on: bool = False

    @property
    def is_caught(self) -> bool:
        """Whether an alarm tells it."""
        return self.by != ""


@dataclass(frozen=True, kw_only=True)
class ContactCheck:
    """What thresholds would have done along a log with contacts."""

    log: str  #: The log.
    #: What says where the contacts are, None where nothing does: then the alarms themselves stand
    #: for them.
    reference: str | None
    contacts: tuple[CheckedContact, ...]  #: The contacts, in the order of time.
    #: Alarms that touch no contact, None where nothing says where they are.
    false_alarms: int | None
    untouched_h: float  #: Time without contact, NaN likewise. [h]
    remarks: tuple[Remark, ...]  #: What a reader of the numbers should know.

    @property
    def caught(self) -> tuple[CheckedContact, ...]:
        """Those that an alarm tells."""
        return tuple(contact for contact in self.contacts if contact.is_caught)

    @property
    def median_delay(self) -> float:
        """Of those that are caught, NaN if none is. [s]"""
        delays = [c.delay for c in self.caught]
        return float(np.median(delays)) if delays else float("nan")

    @property
    def longest_delay(self) -> float:
        """Of those that are caught, NaN if none is. [s]"""
        return max((c.delay for c in self.caught), default=float("nan"))

    @property
    def smallest_caught(self) -> float:
        """Peak force of the weakest contact that is caught, NaN if none's is known. [N]"""
        return min(known_forces(self.caught), default=float("nan"))

    @property
    def largest_missed(self) -> float:
        """Peak force of the hardest contact that is not caught, NaN if there is none. [N]"""
        missed = [c for c in self.contacts if not c.is_caught and not c.was_on]
        return max(known_forces(missed), default=float("nan"))


def known_forces(contacts: Sequence[CheckedContact]) -> list[float]:
    """The peak forces that are known. [N]"""
    return [c.peak_force for c in contacts if np.isfinite(c.peak_force)]


def check_contacts(
    signals: ComparedSignals,
    thresholds: Thresholds,
    reference: ExternalTorque | None,
    wrench: Wrench | None,
) -> ContactCheck:
    """What thresholds would have done along a log: every joint and every axis may raise the alarm.

    A contact is caught if a signal passes its threshold while it lasts; one that has stayed beyond
    it since before says nothing of it. Contacts that are over before the settling are left out.
    """
    t = signals.t
    level = np.column_stack([thresholds.level(name, signals) for name in ("joints", "axes")])
    alarms = events(t, worst_of(level))
    names = [*(f"J{j}" for j in range(1, len(thresholds.joints) + 1)), *AXES]
    own = [
        RaisedAlarm(n, e) for n, one in zip(names, level.T, strict=False) for e in events(t, one)
    ]
    own.sort(key=lambda alarm: alarm.span.start)
    if reference is None:
        size = signals.force[:, 0] if signals.force.shape[1] else np.full(len(t), np.nan)
        return ContactCheck(
            log=signals.recording.name,
            reference=None,
            contacts=tuple(
                CheckedContact(a.start, a.stop, peak_of(size, t, a), np.nan, first_within(own, a))
                for a in alarms
            ),
            false_alarms=None,
            untouched_h=float("nan"),
            remarks=(caution("check-without-truth"),),
        )
    floor = np.zeros(reference.joints) if reference.floor is None else reference.floor
    limits = np.maximum(TRUE_TORQUE, 5.0 * np.nan_to_num(floor))
    true = [c for c in true_intervals(t, reference.tau, limits) if c.stop >= t[0] + SETTLING]
    size = np.full(len(t), np.nan)
    if wrench is not None:
        size = np.linalg.norm(wrench.force, axis=1)
    told = match_contacts(alarms, true, signals.recording.duration - SETTLING)
    touched = sum(c.stop - max(c.start, float(t[0]) + SETTLING) for c in true)
    return ContactCheck(
        log=signals.recording.name,
        reference=reference.name,
        contacts=tuple(checked(c, peak_of(size, t, c), own) for c in true),
        false_alarms=told.false_alarms,
        untouched_h=(signals.recording.duration - SETTLING - touched) / 3600.0,
        remarks=(fact("check-against-reference", reference=reference.name), *reference.remarks),
    )


class RaisedAlarm(NamedTuple):
    """One signal beyond its threshold."""

    by: str  #: The joint or axis.
    span: ContactInterval  #: From when to when.


def checked(contact: ContactInterval, peak: float, alarms: Sequence[RaisedAlarm]) -> CheckedContact:
    """A true contact of a peak force [N] with the first alarm, in their order, that it raises."""
    for alarm in alarms:
        if contact.start - EARLY <= alarm.span.start <= contact.stop:
            delay = max(alarm.span.start - contact.start, 0.0)
            return CheckedContact(contact.start, contact.stop, peak, delay, alarm.by)
    was_on = any(a.span.start < contact.start <= a.span.stop for a in alarms)
    return CheckedContact(contact.start, contact.stop, peak, np.nan, "", was_on)


def first_within(alarms: Sequence[RaisedAlarm], span: ContactInterval) -> str:
    """Who raises the first of some alarms, in their order, within a span."""
    return next(a.by for a in alarms if span.start <= a.span.start <= span.stop)


def peak_of(size: Array, t: Array, span: ContactInterval) -> float:
    """The largest known value (T,) within a contact, NaN if none is known."""
    there = size[(t >= span.start) & (t <= span.stop)]
    known = there[np.isfinite(there)]
    return float(known.max()) if len(known) else float("nan")
