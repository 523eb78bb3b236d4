"""Contacts of every observer, or of a list, against the true ones, one to one."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from vftcli.observers.observer import Observer
from vftcli.robots.run import Run, RunSamples
from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError
from vftcli.signals.wrench import ExternalTorque
from vftcli.virtual_sensor.contact import (
    GAP,
    ContactInterval,
    Detection,
    Interval,
    departure,
    find_contacts,
    match_contacts,
)
from vftcli.virtual_sensor.sensor_reading import SensorReading
from vftcli.virtual_sensor.virtual_sensor import VirtualSensor
from vftcli.virtual_sensor.zero import SETTLING

TRUE_TORQUE = 0.5  #: A true joint torque beyond this is a contact. [N·m]
#: A true wrench beyond this is a contact, and half a free band at least so wide. (6,) [N, N·m]
WRENCH_LIMITS = np.repeat([1.0, 0.2], 3)
LEAST_TORQUE = 0.5  #: Smallest half width of a free band of joint torques. [N·m]
#: Contacts of an exact reference closer than this are one; those of a measured one, which has a
#: floor, as those of an observer. [s]
TRUE_GAP = 0.12


class ContactScore(NamedTuple):
    """How one observer tells contacts."""

    name: str  #: The observer.
    signal: str  #: What it tells them from: "torque", "wrench", or "list" of contacts.
    detection: Detection  #: Counts and delays, of the free band itself or of the list.


@dataclass(frozen=True, kw_only=True, eq=False)
class ToldContacts:
    """What is known of a log's contacts before they are judged."""

    untouched: Mask  #: RunSamples of the log that are known to be free; none where nothing is. (T,)
    #: What each observer reads in free runs of other logs, by name. (S, k) each
    beside: Mapping[str, Array] = field(default_factory=dict)
    #: Contacts that stand in a list, by the observer whose wrench they are told of.
    listed: Mapping[str, Sequence[Interval]] = field(default_factory=dict)


def read_in_free_runs(
    pieces: Sequence[RunSamples],
    observers: Sequence[Observer],
    run_of: Callable[[str, Run], Run],
    sensor: VirtualSensor | None,
) -> dict[str, Array]:
    """What each observer reads in free runs once it has settled: wrenches, or joint torques.

    Returns:
        Name → (S, 6) or (S, n); nothing without pieces.
    """
    read: dict[str, list[Array]] = {}
    for piece in pieces:
        t, q, chain = piece.run.t, piece.run.q, piece.run.robot.chain
        settled = piece.inside & (t >= t[0] + SETTLING)
        for observer in observers:
            torque = observer.estimate(run_of(observer.name, piece.run).terms)
            values = torque.tau if sensor is None else sensor.wrench(torque, q, chain).known
            read.setdefault(observer.name, []).append(values[settled])
    return {name: np.concatenate(each) for name, each in read.items()}


def true_intervals(
    t: Array, truth: Array, limits: Array | float, gap: float = GAP
) -> tuple[ContactInterval, ...]:
    """Contacts of a true wrench or torque (T, k)."""
    return find_contacts(t, np.nan_to_num(np.abs(truth) / limits).max(axis=1), gap=gap)


def learned_free(t: Array, true: Sequence[ContactInterval]) -> Mask:
    """RunSamples from `SETTLING` after the start to the first true contact. (T,)"""
    first = true[0].start if true else float(t[-1])
    free: Mask = (t >= t[0] + SETTLING) & (t < first)
    if np.count_nonzero(free) < 10:
        raise ParameterError(
            f"contacts: the first true one begins at {first:g} s, so there is no free part to "
            f"learn the band from; name one with --free A:B"
        )
    return free


def floor_in_motion(reference: ExternalTorque) -> Array:
    """A reference's own error while a joint moves, zero where it states none. (n,) [N·m]

    Stiction at rest would deafen the reference to contacts in motion.
    """
    if reference.floor is None or reference.sd is None or reference.moving is None:
        return np.zeros(reference.joints) if reference.floor is None else reference.floor
    known = reference.moving & np.isfinite(reference.sd)
    square = np.sum(np.where(known, reference.sd, 0.0) ** 2, axis=0)
    count = np.count_nonzero(known, axis=0)
    return np.where(count > 0, np.sqrt(square / np.maximum(count, 1)), reference.floor)


def judge_contacts(
    estimates: Sequence[ExternalTorque],
    measured: SensorReading | None,
    reference: ExternalTorque,
    told: ToldContacts | None = None,
) -> tuple[ContactScore, ...]:
    """Every observer's contacts against those of a reference torque.

    An observer whose contacts are listed is judged by its list. The others' are told from their
    wrenches where they were asked for, else from their joint torques, by a free band: learned in
    the zero spans, else in the log's own free part, else in free runs, else before the first true
    contact.
    """
    limits = np.maximum(TRUE_TORQUE, 5.0 * np.nan_to_num(floor_in_motion(reference)))
    gap = TRUE_GAP if reference.floor is None else GAP
    true = true_intervals(reference.t, reference.tau, limits, gap)
    kind, least = "torque", np.asarray(LEAST_TORQUE)
    signals = {estimate.name: estimate.tau for estimate in estimates}
    if measured is not None:
        kind, least = "wrench", WRENCH_LIMITS
        signals = {wrench.name: wrench.known for wrench in measured.wrenches}
    t = reference.t
    duration = float(t[-1] - t[0])
    told = told or ToldContacts(untouched=np.zeros(len(t), dtype=bool))
    settled = t >= t[0] + SETTLING
    quiet = told.untouched & settled
    if measured is not None and measured.drifts:
        quiet = measured.free
    found = []
    for name, values in signals.items():
        if name in told.listed:
            counts = match_contacts(told.listed[name], true, duration)
            found.append(ContactScore(name, "list", counts))
            continue
        free = values[quiet] if quiet.any() else told.beside.get(name, ())
        if not len(free):
            free = values[learned_free(t, true)]
        # Observers rise from zero: what they read before they have settled touches nothing.
        score = np.where(settled, departure(values, np.asarray(free), least), 0.0)
        counts = match_contacts(find_contacts(t, score), true, duration)
        found.append(ContactScore(name, kind, counts))
    return tuple(found)
