"""Contacts of every observer against the true ones."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.virtual_sensor.contact import (
    TRUE_FORCE,
    TRUE_MOMENT,
    ContactInterval,
    Detection,
    OperatingPoint,
    contacts,
    detection,
    free_band,
    operating_curve,
)
from vftcli.virtual_sensor.sensor_reading import SensorReading
from vftcli.virtual_sensor.zero import SETTLING

TRUE_TORQUE = 0.5
"""A true joint torque beyond this is a contact. [N·m]"""

LEAST_TORQUE = 0.5
"""Smallest half width of a free band of joint torques. [N·m]"""

THRESHOLDS = tuple(float(x) for x in np.geomspace(0.1, 10.0, 41))
"""Multiples of the free band of an operating curve."""


@dataclass(frozen=True, kw_only=True)
class Signal:
    """What contacts are told from: an observer's wrench or its joint torques.

    Attributes:
        name: The observer.
        kind: "torque" or "wrench".
        values: NaN where not known. (T, k)
        least: Smallest half width of its free band, one a column. (k,)
    """

    name: str
    kind: str
    values: Array
    least: Array


class ContactScore(NamedTuple):
    """How one observer tells contacts.

    Attributes:
        name: The observer.
        signal: What it tells them from, "torque" or "wrench".
        detection: Counts and delays at the free band itself.
        curve: Hits against false alarms over `THRESHOLDS`.
        found: The contacts it found.
    """

    name: str
    signal: str
    detection: Detection
    curve: tuple[OperatingPoint, ...]
    found: tuple[ContactInterval, ...]


def wrench_limits() -> Array:
    """What a true wrench must exceed to be a contact, and a free band at least be. (6,)"""
    return np.repeat([TRUE_FORCE, TRUE_MOMENT], 3)


def true_intervals(t: Array, truth: Array, limits: Array | float) -> tuple[ContactInterval, ...]:
    """Contacts of a true wrench or torque (T, k)."""
    return contacts(t, np.nan_to_num(np.abs(truth) / limits).max(axis=1))


def learned_free(t: Array, true: Sequence[ContactInterval]) -> Mask:
    """Samples from `SETTLING` after the start to the first true contact. (T,)

    Raises:
        ParameterError: If a contact begins before the observers have settled.
    """
    first = true[0].start if true else float(t[-1])
    free: Mask = (t >= t[0] + SETTLING) & (t < first)
    if np.count_nonzero(free) < 10:
        raise ParameterError(
            f"contacts: the first true one begins at {first:g} s, so there is no free part to "
            f"learn the band from; name one with --zero A:B"
        )
    return free


def judge_contacts(
    estimates: Sequence[ExternalTorque], measured: SensorReading | None, reference: ExternalTorque
) -> tuple[ContactScore, ...]:
    """Every observer's contacts against those of a reference torque.

    Told from the wrenches where they were asked for, else from the joint torques. The free band is
    learned in the zero spans if they were given, else before the first true contact.

    Args:
        estimates: The observers' torques.
        measured: Their wrenches, or None.
        reference: The true torque; beyond `TRUE_TORQUE`, or five times its floor, it is a contact.

    Raises:
        ParameterError: If there is no free part to learn the band from.
    """
    floor = np.zeros(reference.joints) if reference.floor is None else reference.floor
    limits = np.maximum(TRUE_TORQUE, 5.0 * np.nan_to_num(floor))
    true = true_intervals(reference.t, reference.tau, limits)
    if measured is not None:
        least = wrench_limits()
        signals = [
            Signal(name=w.name, kind="wrench", values=w.known, least=least)
            for w in measured.wrenches
        ]
    else:
        signals = [
            Signal(name=e.name, kind="torque", values=e.tau, least=np.full(e.joints, LEAST_TORQUE))
            for e in estimates
        ]
    given = measured is not None and measured.drifts
    free = measured.free if measured is not None and given else learned_free(reference.t, true)
    return contact_scores(reference.t, signals, free, true)


def contact_scores(
    t: Array, signals: Iterable[Signal], free: Mask, true: Sequence[ContactInterval]
) -> tuple[ContactScore, ...]:
    """Judge every observer's contacts by the true ones.

    Args:
        t: Time. (T,) [s]
        signals: The observers.
        free: The free part the band is learned from. (T,)
        true: True contacts.
    """
    found = []
    for signal in signals:
        score = free_band(signal.values, free, signal.least).score(signal.values)
        # Observers rise from zero: what they read before they have settled touches nothing.
        score = np.where(t < t[0] + SETTLING, 0.0, score)
        here = contacts(t, score)
        found.append(
            ContactScore(
                name=signal.name,
                signal=signal.kind,
                detection=detection(here, true, float(t[-1] - t[0])),
                curve=operating_curve(t, score, true, THRESHOLDS),
                found=here,
            )
        )
    return tuple(found)
