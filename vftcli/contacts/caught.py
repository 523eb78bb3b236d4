"""Which contacts of a log thresholds would have caught: when, by what, and how hard they were."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.contacts.compared_signals import ComparedSignals
from vftcli.contacts.tail import SETTLING, events
from vftcli.contacts.thresholds import Thresholds, worst_of
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.remarks import Remark, caution, fact
from vftcli.signals.wrench import AXES, Wrench
from vftcli.virtual_sensor.contact import ContactInterval, match_contacts
from vftcli.virtual_sensor.detection import TRUE_TORQUE, true_intervals


class CheckedContact(NamedTuple):
    """A contact of a log, and whether the thresholds tell it.

    Attributes:
        start: When it begins. [s]
        stop: When it ends. [s]
        peak_force: Its largest force, NaN where that is not known. [N]
        delay: From its start to the first alarm; NaN where there is none, or no truth. [s]
        by: The joint or axis that raises the alarm, "" where there is none.
    """

    start: float
    stop: float
    peak_force: float
    delay: float
    by: str

    @property
    def is_caught(self) -> bool:
        """Whether an alarm tells it."""
        return self.by != ""


@dataclass(frozen=True, kw_only=True)
class ContactCheck:
    """What thresholds would have done along a log with contacts.

    Attributes:
        log: The log.
        reference: What says where the contacts are, None where nothing does: then the alarms
            themselves stand for them.
        contacts: The contacts, in the order of time.
        false_alarms: Alarms that touch no contact, None where nothing says where they are.
        untouched_h: Time without contact, NaN likewise. [h]
        remarks: What a reader of the numbers should know.
    """

    log: str
    reference: str | None
    contacts: tuple[CheckedContact, ...]
    false_alarms: int | None
    untouched_h: float
    remarks: tuple[Remark, ...]

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
        missed = [contact for contact in self.contacts if not contact.is_caught]
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

    A contact is caught by an alarm that overlaps it, or follows its end by less than a second. One
    that is over before the settling is left out, like what is read then.

    Args:
        signals: The log.
        thresholds: The thresholds.
        reference: The true torque of every joint; beyond .5 N·m, or five times its own floor, it
            is a contact. None where nothing tells: then the alarms are listed, with the force that
            is estimated.
        wrench: The true wrench, None where the force is not known.
    """
    t = signals.t
    level = np.column_stack([thresholds.level(name, signals) for name in ("joints", "axes")])
    names = [*(f"J{j}" for j in range(1, len(thresholds.joints) + 1)), *AXES]
    alarms = events(t, worst_of(level))
    if reference is None:
        size = signals.force[:, 0] if signals.force.shape[1] else np.full(len(t), np.nan)
        found = tuple(
            CheckedContact(
                a.start, a.stop, peak_of(size, t, a), np.nan, first_over(level, names, t, a)
            )
            for a in alarms
        )
        remarks = (caution("check-without-truth"),)
        return ContactCheck(
            log=signals.recording.name,
            reference=None,
            contacts=found,
            false_alarms=None,
            untouched_h=float("nan"),
            remarks=remarks,
        )
    floor = np.zeros(reference.joints) if reference.floor is None else reference.floor
    limits = np.maximum(TRUE_TORQUE, 5.0 * np.nan_to_num(floor))
    true = [c for c in true_intervals(t, reference.tau, limits) if c.stop >= t[0] + SETTLING]
    size = np.full(len(t), np.nan)
    if wrench is not None:
        size = np.linalg.norm(wrench.force, axis=1)
    told = match_contacts(alarms, true, signals.recording.duration - SETTLING)
    found = tuple(
        CheckedContact(
            contact.start,
            contact.stop,
            peak_of(size, t, contact),
            delay,
            first_over(level, names, t, ContactInterval(contact.start + delay, float(t[-1]), 0.0)),
        )
        for contact, delay in zip(true, told.delay, strict=True)
    )
    touched = sum(c.stop - max(c.start, float(t[0]) + SETTLING) for c in true)
    return ContactCheck(
        log=signals.recording.name,
        reference=reference.name,
        contacts=found,
        false_alarms=told.false_alarms,
        untouched_h=(signals.recording.duration - SETTLING - touched) / 3600.0,
        remarks=(fact("check-against-reference", reference=reference.name), *reference.remarks),
    )


def inside(t: Array, span: ContactInterval) -> Mask:
    """Samples of a contact. (T,)"""
    found: Mask = (t >= span.start) & (t <= span.stop)
    return found


def peak_of(size: Array, t: Array, span: ContactInterval) -> float:
    """The largest known value (T,) within a contact, NaN if none is known."""
    there = size[inside(t, span)]
    known = there[np.isfinite(there)]
    return float(known.max()) if len(known) else float("nan")


def first_over(level: Array, names: Sequence[str], t: Array, span: ContactInterval) -> str:
    """The joint or axis, of the columns' names, that is first beyond 1 in a span, "" if none is."""
    rows = np.flatnonzero(inside(t, span) & (worst_of(level) > 1.0))
    return names[int(np.nanargmax(level[rows[0]]))] if len(rows) else ""
