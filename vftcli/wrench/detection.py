"""Listed contacts against the true ones of a reference, one to one."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.signals.arrays import Array, Mask, intervals, rms_of_known, runs_of
from vftcli.signals.external_torque import ExternalTorque

#: A contact ends where the score falls below this share of its threshold, 1: hysteresis.
LEAVE = 0.6
HOLD = 0.02  #: Shortest contact, longer than one noisy sample. [s]
GAP = 0.25  #: Contacts closer than this are one: a hand that slips. [s]
#: An alarm this long before a true contact, or behind its end, is false: slow observers
#: show a contact for a while. [s]
EARLY, LATE = 0.1, 1.0
TRUE_TORQUE = 0.5  #: A true joint torque beyond this is a contact. [N·m]
#: Contacts of an exact reference closer than this are one; a measured one uses `GAP`. [s]
TRUE_GAP = 0.12


class ContactInterval(NamedTuple):
    """One interval of contact."""

    start: float  #: When the score rises above 1. [s]
    stop: float  #: When it has fallen below `LEAVE`. [s]


def contact_intervals(
    t: Array, mask: Mask, least: float = 0.0, gap: float = 0.0
) -> tuple[ContactInterval, ...]:
    """Stretches of a mask by `vftcli.signals.arrays.intervals`, in time."""
    runs = intervals(t, mask, least, gap)
    return tuple(ContactInterval(t[start], t[stop - 1]) for start, stop in runs)


def find_contacts(t: Array, score: Array, gap: float = GAP) -> tuple[ContactInterval, ...]:
    """Intervals in which a score (T,) rises above 1 until it falls below `LEAVE`.

    Those shorter than `HOLD` are dropped, those closer than `gap` joined.
    """
    inside = np.zeros(len(t), bool)
    for begin, end in runs_of(score > LEAVE):
        # It starts where 1 is exceeded, not at the lower threshold.
        inside[begin:end] = np.logical_or.accumulate(score[begin:end] > 1.0)
    return contact_intervals(t, inside, HOLD, gap)


class Detection(NamedTuple):
    """Agreement of found contacts with the true ones, one to one."""

    contacts: int  #: True contacts.
    listed: int  #: Found contacts, right or wrong.
    missed: int  #: True contacts to which no found one is credited.
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
        return float(np.nanmean(self.delay)) if self.found else float("nan")

    @property
    def longest_delay(self) -> float:
        """Longest delay of the contacts that were found, NaN if none was. [s]"""
        return float(np.fmax.reduce(self.delay, initial=np.nan))


def overlaps(found: Sequence[ContactInterval], true: Sequence[ContactInterval]) -> Array:
    """Overlap of each found contact with each true one ± `EARLY`. (F, C) [s]"""
    begin, end = np.reshape([*found], (-1, 2)).T[:, :, None]
    first, last = np.reshape([*true], (-1, 2)).T
    shared = np.minimum(end, last + EARLY) - np.maximum(begin, first - EARLY)
    return np.asarray(np.maximum(shared, 0.0))


def assignment(
    found: Sequence[ContactInterval], true: Sequence[ContactInterval]
) -> list[int | None]:
    """Number of the found contact credited to each true one, None if missed.

    Each is credited at most once: as many as possible, with the largest overlap.
    """
    given: list[int | None] = [None] * len(true)
    if found and true:
        from scipy.optimize import linear_sum_assignment

        shared = overlaps(found, true)
        # One more pair is worth more than all that may overlap.
        worth = np.where(shared > 0.0, 1.0 + shared.sum(), 0.0) + shared
        for i, j in np.transpose(linear_sum_assignment(worth, maximize=True)).tolist():
            if shared[i, j] > 0.0:
                given[j] = i
    return given


def match_contacts(
    found: Sequence[ContactInterval], true: Sequence[ContactInterval], duration: float
) -> Detection:
    """Found contacts, one to one with the true ones of a log of `duration` [s].

    Beginning within `LATE` of a true contact's end is no false alarm, too early is one.
    """
    given, meant = assignment(found, true), [(c.start - EARLY, c.stop + LATE) for c in true]
    false = sum(not any(a <= f.start <= b for a, b in meant) for f in found)
    free = duration - sum(c.stop - c.start for c in true)
    return Detection(
        contacts=len(true),
        listed=len(found),
        missed=given.count(None),
        false_alarms=false,
        false_alarms_per_h=false * 3600.0 / free if free > 0 else float("nan"),
        delay=tuple(
            float("nan") if i is None else max(found[i].start - c.start, 0.0)
            for i, c in zip(given, true, strict=True)
        ),
    )


def floor_in_motion(reference: ExternalTorque) -> Array:
    """A reference's own error while a joint moves, zero if not stated. (n,) [N·m]

    With stiction at rest the reference would miss contacts in motion.
    """
    floor, sd, moving = reference.floor, reference.sd, reference.moving
    if floor is None or sd is None or moving is None:
        return np.zeros(reference.joints) if floor is None else floor
    own = rms_of_known(np.where(moving, sd, np.nan))
    return np.where(np.isfinite(own), own, floor)


def true_contacts(reference: ExternalTorque) -> tuple[ContactInterval, ...]:
    """Contacts of a reference: a joint above `TRUE_TORQUE` and 5 × its error."""
    limits = np.maximum(TRUE_TORQUE, 5.0 * np.nan_to_num(floor_in_motion(reference)))
    score = np.nan_to_num(abs(reference.tau) / limits).max(axis=1)
    return find_contacts(reference.t, score, TRUE_GAP if reference.floor is None else GAP)


def judge_contacts(listed: Sequence[ContactInterval], reference: ExternalTorque) -> Detection:
    """Agreement of listed contacts with those of a reference."""
    t = reference.t
    return match_contacts(listed, true_contacts(reference), t[-1] - t[0])
