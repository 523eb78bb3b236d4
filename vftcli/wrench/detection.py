"""Contacts of every observer, or of a list, against the true ones, one to one.

A contact is where a wrench or joint torque leaves its free band, its untouched reading.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from vftcli.observers.observer import Observer
from vftcli.robots.run import Run, RunSamples
from vftcli.signals.arrays import Array, Mask, intervals, rms_of_known, runs_of
from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.wrench.sensor import SETTLING, SensorReading
from vftcli.wrench.solvers import VirtualSensor

#: A contact ends where the score falls below this share of its threshold, 1: hysteresis.
LEAVE = 0.6
HOLD = 0.02  #: Shortest contact, longer than one noisy sample. [s]
GAP = 0.25  #: Contacts closer than this are one: a hand that slips. [s]
#: The free band reaches this far beyond the largest departure seen in the free part.
BAND = 1.3
#: An alarm this long before a true contact, or behind its end, is false: slow observers
#: show a contact for a while. [s]
EARLY, LATE = 0.1, 1.0
TRUE_TORQUE = 0.5  #: A true joint torque beyond this is a contact. [N·m]
#: A true contact, and least half width of a free band. (6,) [N, N·m]
WRENCH_LIMITS = np.repeat([1.0, 0.2], 3)
LEAST_TORQUE = 0.5  #: Smallest half width of a free band of joint torques. [N·m]
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


def departure(values: Array, quiet: Array, least: Array | float) -> Array:
    """Largest departure of any column, in half widths of the free band. (T,)

    The band is the median of the untouched readings (S, k) ± `BAND` × their largest
    departure, at least `least`; 0 if unknown.
    """
    inside = quiet[np.isfinite(quiet).all(axis=1)]
    if len(inside) == 0:
        raise ParameterError("the free part holds no sample in which the wrench is known")
    centre = np.median(inside, axis=0)
    half = np.maximum(BAND * abs(inside - centre).max(axis=0), least)
    return np.asarray(np.nan_to_num(abs(values - centre) / half, nan=0.0).max(axis=1))


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


class ContactScore(NamedTuple):
    """Detection of contacts by one observer."""

    name: str  #: The observer.
    signal: str  #: Its source: "torque", "wrench", or "list" of contacts.
    detection: Detection  #: Counts and delays.


class KnownContacts(NamedTuple):
    """Knowledge of a log's contacts before they are judged."""

    #: Samples of the log that are known to be free, if any. (T,)
    untouched: Mask
    #: Each observer's readings in free runs of other logs, by name. (S, k) each
    beside: Mapping[str, Array] = {}
    #: Contacts of a list, by the observer that gave the wrench.
    listed: Mapping[str, Sequence[ContactInterval]] = {}


def read_in_free_runs(
    pieces: Sequence[RunSamples],
    observers: Sequence[Observer],
    run_of: Callable[[str, Run], Run],
    sensor: VirtualSensor | None,
) -> dict[str, Array]:
    """Settled readings in free runs by observer's name: (S, 6) or (S, n)."""
    read: dict[str, list[Array]] = {}
    for piece in pieces:
        t, q, chain = piece.run.t, piece.run.q, piece.run.robot.chain
        settled = piece.inside & (t >= t[0] + SETTLING)
        for observer in observers:
            torque = observer.estimate(run_of(observer.name, piece.run).terms)
            values = torque.tau if sensor is None else sensor.wrench(torque, q, chain).known
            read.setdefault(observer.name, []).append(values[settled])
    return {name: np.concatenate(each) for name, each in read.items()}


def learned_free(t: Array, true: Sequence[ContactInterval]) -> Mask:
    """Samples from `SETTLING` after the start to the first true contact. (T,)"""
    first = true[0].start if true else t[-1]
    free: Mask = (t >= t[0] + SETTLING) & (t < first)
    if np.count_nonzero(free) < 10:
        raise ParameterError(
            f"contacts: the first true one begins at {first:g} s, so there is no free part to "
            f"learn the band from; name one with --free A:B"
        )
    return free


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


def judge_contacts(
    estimates: Sequence[ExternalTorque],
    measured: SensorReading | None,
    reference: ExternalTorque,
    known: KnownContacts | None = None,
) -> tuple[ContactScore, ...]:
    """Every observer's contacts against those of a reference torque.

    A list of contacts is judged if an observer has one. Otherwise contacts are found in the
    wrenches if asked for, else in the joint torques, by a free band: from the zero spans,
    else the log's free part, else free runs, else before the first true contact.
    """
    t, true = reference.t, true_contacts(reference)
    kind, least = "torque", np.asarray(LEAST_TORQUE)
    signals = {estimate.name: estimate.tau for estimate in estimates}
    if measured is not None:
        kind, least = "wrench", WRENCH_LIMITS
        signals = {wrench.name: wrench.known for wrench in measured.wrenches}
    known = known or KnownContacts(untouched=np.zeros(len(t), bool))
    settled = t >= t[0] + SETTLING
    quiet = known.untouched & settled
    if measured is not None and measured.drifts:
        quiet = measured.free
    scores = []
    for name, values in signals.items():
        found, of = known.listed.get(name), "list"
        if found is None:
            free = values[quiet] if quiet.any() else known.beside.get(name, values[:0])
            if not len(free):
                free = values[learned_free(t, true)]
            # Observers rise from zero, which is no contact.
            score = np.where(settled, departure(values, free, least), 0.0)
            found, of = find_contacts(t, score), kind
        scores.append(ContactScore(name, of, match_contacts(found, true, t[-1] - t[0])))
    return tuple(scores)
