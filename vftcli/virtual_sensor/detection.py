"""Contacts of every observer against the true ones."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, Mask
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.virtual_sensor.contact import (
    ContactInterval,
    Detection,
    OperatingPoint,
    find_contacts,
    free_band,
    match_contacts,
    operating_curve,
)
from vftcli.virtual_sensor.sensor_reading import SensorReading
from vftcli.virtual_sensor.zero import SETTLING

TRUE_TORQUE = 0.5
"""A true joint torque beyond this is a contact. [N·m]"""

WRENCH_LIMITS = np.repeat([1.0, 0.2], 3)
"""A true wrench beyond this is a contact, and half a free band at least so wide. (6,) [N, N·m]"""

LEAST_TORQUE = 0.5
"""Smallest half width of a free band of joint torques. [N·m]"""

THRESHOLDS = tuple(float(x) for x in np.geomspace(0.1, 10.0, 41))
"""Multiples of the free band of an operating curve."""


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


def true_intervals(t: Array, truth: Array, limits: Array | float) -> tuple[ContactInterval, ...]:
    """Contacts of a true wrench or torque (T, k)."""
    return find_contacts(t, np.nan_to_num(np.abs(truth) / limits).max(axis=1))


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
    estimates: Sequence[ExternalTorque], measured: SensorReading | None, reference: ExternalTorque
) -> tuple[ContactScore, ...]:
    """Every observer's contacts against those of a reference torque.

    Told from the wrenches where they were asked for, else from the joint torques. The free band is
    learned in the zero spans if they were given, else before the first true contact.

    Args:
        estimates: The observers' torques.
        measured: Their wrenches, or None.
        reference: The true torque; beyond `TRUE_TORQUE`, or five times its floor in
            motion, it is a contact.

    Raises:
        ParameterError: If there is no free part to learn the band from.
    """
    limits = np.maximum(TRUE_TORQUE, 5.0 * np.nan_to_num(floor_in_motion(reference)))
    true = true_intervals(reference.t, reference.tau, limits)
    kind, least = "torque", np.asarray(LEAST_TORQUE)
    signals = {estimate.name: estimate.tau for estimate in estimates}
    if measured is not None:
        kind, least = "wrench", WRENCH_LIMITS
        signals = {wrench.name: wrench.known for wrench in measured.wrenches}
    given = measured is not None and measured.drifts
    t = reference.t
    free = measured.free if measured is not None and given else learned_free(t, true)
    found = []
    for name, values in signals.items():
        score = free_band(values, free, least).score(values)
        # Observers rise from zero: what they read before they have settled touches nothing.
        score = np.where(t < t[0] + SETTLING, 0.0, score)
        here = find_contacts(t, score)
        found.append(
            ContactScore(
                name=name,
                signal=kind,
                detection=match_contacts(here, true, float(t[-1] - t[0])),
                curve=operating_curve(t, score, true, THRESHOLDS),
                found=here,
            )
        )
    return tuple(found)
