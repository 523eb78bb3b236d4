"""Contacts: when a wrench or a joint torque leaves its free band, and how well that tells them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, Mask, seal
from vftcli.signals.errors import ParameterError
from vftcli.signals.series import runs_of

LEAVE = 0.6
"""A contact ends where the score falls below this share of the threshold: hysteresis."""

HOLD = 0.02
"""A contact must last at least this long, so that one noisy sample is none. [s]"""

GAP = 0.25
"""Two contacts closer than this are one. [s]"""

BAND = 1.3
"""The free band reaches this far beyond the largest departure seen in the free part."""

EARLY, LATE = 0.1, 1.0
"""An alarm that begins earlier than this before a true contact, or later than this after its end,
is false, whatever it meets: a slow observer shows a contact for a while after it. [s]"""


class ContactInterval(NamedTuple):
    """One interval of contact.

    Attributes:
        start: When the score rises above 1. [s]
        stop: When it has fallen below `LEAVE`. [s]
        peak: Largest score in between: multiples of the free band.
    """

    start: float
    stop: float
    peak: float


@dataclass(frozen=True, kw_only=True)
class FreeBand:
    """The band that a signal keeps within while nothing touches the arm.

    Attributes:
        centre: Middle of the band. (k,)
        half: Half its width. (k,)
    """

    centre: Array
    half: Array

    def __post_init__(self) -> None:
        seal(self, "centre", "half")

    def score(self, values: Array) -> Array:
        """Largest departure over the columns, in half widths; 0 where nothing is known. (T,)"""
        share = np.abs(values - self.centre) / self.half
        worst: Array = np.nan_to_num(share, nan=0.0).max(axis=1)
        return worst


def free_band(values: Array, free: Mask, least: Array | float) -> FreeBand:
    """The band of the free part: its median ± `BAND` × its largest departure.

    Args:
        values: A wrench or joint torques, NaN where unknown. (T, k)
        free: Samples of the free part. (T,)
        least: Smallest half width, one or one a column. (k,)

    Raises:
        ParameterError: If the free part holds no known sample.
    """
    inside = values[free & np.all(np.isfinite(values), axis=1)]
    if len(inside) == 0:
        raise ParameterError("the free part holds no sample in which the wrench is known")
    centre = np.median(inside, axis=0)
    half = BAND * np.max(np.abs(inside - centre), axis=0)
    return FreeBand(centre=centre, half=np.maximum(half, least))


def find_contacts(t: Array, score: Array, enter: float = 1.0) -> tuple[ContactInterval, ...]:
    """Intervals in which a score rises above `enter` until it falls below `LEAVE` of it.

    Those shorter than `HOLD` are dropped, those closer than `GAP` joined.

    Args:
        t: Time. (T,) [s]
        score: Departure in half widths of the free band. (T,)
        enter: Threshold, in half widths.
    """
    found: list[ContactInterval] = []
    for begin, end in runs_of(score > LEAVE * enter):
        above = score[begin:end] > enter
        if not above.any():
            continue
        # It starts where `enter` is first exceeded, not where the lower threshold is.
        first = begin + int(np.argmax(above))
        start, stop, peak = float(t[first]), float(t[end - 1]), float(score[first:end].max())
        # A hand that slips for a moment has not let go.
        if found and start - found[-1].stop < GAP:
            found[-1] = ContactInterval(found[-1].start, stop, max(found[-1].peak, peak))
        else:
            found.append(ContactInterval(start, stop, peak))
    return tuple(c for c in found if c.stop - c.start >= HOLD)


@dataclass(frozen=True, kw_only=True)
class Detection:
    """How well detected contacts tell the true ones.

    Attributes:
        contacts: True contacts.
        missed: True contacts that no detection overlaps.
        false_alarms: Detections that begin where nothing touches the arm.
        false_alarms_per_h: Those per hour without contact. [1/h]
        delay: Time from each found contact's start to its detection; NaN where missed. [s]
    """

    contacts: int
    missed: int
    false_alarms: int
    false_alarms_per_h: float
    delay: tuple[float, ...]

    @property
    def mean_delay(self) -> float:
        """Mean delay of the contacts that were found, NaN if none was. [s]"""
        found = [d for d in self.delay if np.isfinite(d)]
        return float(np.mean(found)) if found else float("nan")

    @property
    def longest_delay(self) -> float:
        """Longest delay of the contacts that were found, NaN if none was. [s]"""
        found = [d for d in self.delay if np.isfinite(d)]
        return max(found) if found else float("nan")


def match_contacts(
    found: Sequence[ContactInterval], true: Sequence[ContactInterval], duration: float
) -> Detection:
    """Match detected contacts with the true ones of a log that lasts `duration` [s].

    A detection belongs to a true contact that it overlaps, or whose end it follows by less than
    `LATE`.
    """
    delays = []
    for contact in true:
        hits = [f for f in found if f.stop >= contact.start and f.start <= contact.stop + LATE]
        delays.append(max(hits[0].start - contact.start, 0.0) if hits else float("nan"))
    false = [f for f in found if not any(c.start - EARLY <= f.start <= c.stop + LATE for c in true)]
    free = duration - sum(c.stop - c.start for c in true)
    return Detection(
        contacts=len(true),
        missed=sum(1 for d in delays if not np.isfinite(d)),
        false_alarms=len(false),
        false_alarms_per_h=len(false) * 3600.0 / free if free > 0 else float("nan"),
        delay=tuple(delays),
    )


class OperatingPoint(NamedTuple):
    """One point of a receiver operating characteristic.

    Attributes:
        threshold: Multiple of the free band at which a contact begins.
        found: Share of the true contacts that are found.
        false_alarms_per_h: False alarms per hour without contact. [1/h]
        delay: Mean detection delay. [s]
    """

    threshold: float
    found: float
    false_alarms_per_h: float
    delay: float


def operating_curve(
    t: Array, score: Array, true: Sequence[ContactInterval], thresholds: Sequence[float]
) -> tuple[OperatingPoint, ...]:
    """Hits against false alarms as the threshold goes through `thresholds` (ROC)."""
    duration = float(t[-1] - t[0])
    points = []
    for threshold in thresholds:
        counts = match_contacts(find_contacts(t, score, threshold), true, duration)
        found = 1.0 - counts.missed / counts.contacts if counts.contacts else float("nan")
        points.append(
            OperatingPoint(threshold, found, counts.false_alarms_per_h, counts.mean_delay)
        )
    return tuple(points)
