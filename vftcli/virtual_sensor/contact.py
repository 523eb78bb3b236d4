"""Contacts: when a wrench or a joint torque leaves its free band, and how well that tells them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from vftcli.signals.arrays import Array
from vftcli.signals.errors import ParameterError
from vftcli.signals.series import intervals, runs_of

#: A contact ends where the score falls below this share of its threshold, 1: hysteresis.
LEAVE = 0.6
HOLD = 0.02  #: A contact must last at least this long, so that one noisy sample is none. [s]
GAP = 0.25  #: Two contacts closer than this are one. [s]
BAND = 1.3  #: The free band reaches this far beyond the largest departure seen in the free part.
#: An alarm that begins earlier than this before a true contact, or later than this after its end,
#: is false, whatever it meets: a slow observer shows a contact for a while after it. [s]
EARLY, LATE = 0.1, 1.0


class ContactInterval(NamedTuple):
    """One interval of contact."""

    start: float  #: When the score rises above 1. [s]
    stop: float  #: When it has fallen below `LEAVE`. [s]


def departure(values: Array, quiet: Array, least: Array | float) -> Array:
    """Largest departure over the columns, in half widths of the free band; 0 if unknown. (T,)

    The band is the median of what is read untouched ± `BAND` × its largest departure.

    Args:
        values: A wrench or joint torques, NaN where unknown. (T, k)
        quiet: The same where nothing touches the arm. (S, k)
        least: Smallest half width, one or one a column.
    """
    inside = quiet[np.all(np.isfinite(quiet), axis=1)]
    if len(inside) == 0:
        raise ParameterError("the free part holds no sample in which the wrench is known")
    centre = np.median(inside, axis=0)
    half = np.maximum(BAND * np.max(np.abs(inside - centre), axis=0), least)
    worst: Array = np.nan_to_num(np.abs(values - centre) / half, nan=0.0).max(axis=1)
    return worst


def find_contacts(t: Array, score: Array, gap: float = GAP) -> tuple[ContactInterval, ...]:
    """Intervals in which a score rises above 1 until it falls below `LEAVE`.

    Those shorter than `HOLD` are dropped, those closer than `gap` joined.

    Args:
        t: Time. (T,) [s]
        score: Departure in half widths of the free band. (T,)
        gap: Two contacts closer than this are one. [s]
    """
    inside = np.zeros(len(t), dtype=bool)
    for begin, end in runs_of(score > LEAVE):
        above = score[begin:end] > 1.0
        # It starts where 1 is first exceeded, not where the lower threshold is.
        inside[begin:end] = np.logical_or.accumulate(above)
    # A hand that slips for a moment has not let go.
    return tuple(
        ContactInterval(float(t[start]), float(t[stop - 1]))
        for start, stop in intervals(t, inside, least=HOLD, gap=gap)
    )


class Interval(Protocol):
    """Anything with a beginning and an end: a found interval, a listed contact, a true one."""

    @property
    def start(self) -> float:
        """When it begins. [s]"""

    @property
    def stop(self) -> float:
        """When it ends. [s]"""


@dataclass(frozen=True, kw_only=True)
class Detection:
    """How well found contacts tell the true ones, one to one."""

    contacts: int  #: True contacts.
    listed: int  #: Found contacts, right or wrong.
    missed: int  #: True contacts to which no found one is credited.
    merged: int  #: Those of them that run into another: what overlaps them is credited elsewhere.
    #: Found contacts that are neither credited nor false: pieces of a true one, its echo.
    split: int
    false_alarms: int  #: Found contacts that begin where nothing touches the arm.
    false_alarms_per_h: float  #: Those per hour without contact. [1/h]
    #: Time from each true contact's start to the one found; NaN where missed. [s]
    delay: tuple[float, ...]

    @property
    def found(self) -> int:
        """True contacts that were found."""
        return self.contacts - self.missed

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


def overlaps(found: Sequence[Interval], true: Sequence[Interval]) -> Array:
    """How long each found contact lies on each true one, within `EARLY` of it. (F, C) [s]"""
    table = np.zeros((len(found), len(true)))
    for i, one in enumerate(found):
        for j, other in enumerate(true):
            shared = min(one.stop, other.stop + EARLY) - max(one.start, other.start - EARLY)
            table[i, j] = max(shared, 0.0)
    return table


def credits(found: Sequence[Interval], true: Sequence[Interval]) -> list[int | None]:
    """Of each true contact the number of the found one that is credited to it, None if missed.

    A found contact is credited to one true contact, so that as many as possible are found, and of
    the ways to do so to that which overlaps most.
    """
    from scipy.optimize import linear_sum_assignment

    given: list[int | None] = [None] * len(true)
    if not found or not true:
        return given
    shared = overlaps(found, true)
    # One more pair is worth more than all that may overlap.
    worth = np.where(shared > 0.0, 1.0 + float(shared.sum()), 0.0) + shared
    for i, j in zip(*linear_sum_assignment(worth, maximize=True), strict=True):
        if shared[i, j] > 0.0:
            given[int(j)] = int(i)
    return given


def match_contacts(
    found: Sequence[Interval], true: Sequence[Interval], duration: float
) -> Detection:
    """Match found contacts one to one with the true ones of a log that lasts `duration` [s].

    What begins within `LATE` of a true contact's end is no false alarm, but credited only where it
    overlaps one; what begins too early is one, credited or not.
    """
    given, shared = credits(found, true), overlaps(found, true) > 0.0
    used = {i for i in given if i is not None}
    missed = [j for j, i in enumerate(given) if i is None]
    false = {
        i
        for i, f in enumerate(found)
        if not any(c.start - EARLY <= f.start <= c.stop + LATE for c in true)
    }
    free = duration - sum(c.stop - c.start for c in true)
    return Detection(
        contacts=len(true),
        listed=len(found),
        missed=len(missed),
        merged=int(np.count_nonzero(shared[:, missed].any(axis=0))) if len(found) else 0,
        split=len(found) - len(used | false),
        false_alarms=len(false),
        false_alarms_per_h=len(false) * 3600.0 / free if free > 0 else float("nan"),
        delay=tuple(
            float("nan") if i is None else max(found[i].start - c.start, 0.0)
            for i, c in zip(given, true, strict=True)
        ),
    )
