"""One-to-one scoring of a list of contacts against a true wrench.

A row may be credited to one true contact, so that rows that run into one another count as misses.
A true contact is |F| > 1 N or |M| > .2 N·m, pauses shorter than .12 s closed; a row meets it if it
overlaps it, within .1 s.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.contacts.candidates import close_gaps
from vftcli.contacts.contact_list import Contact
from vftcli.signals.arrays import Array
from vftcli.signals.series import runs_of

LEAST_FORCE, LEAST_MOMENT, GAP, SLACK = 1.0, 0.2, 0.12, 0.1


class TrueContact(NamedTuple):
    """A contact as it was: from, to, |F| at its peak, the force there and the impulse."""

    start: float
    stop: float
    size: float
    force: Array
    impulse: Array


class Score(NamedTuple):
    """What a list got right: rows and the true contacts they are credited to, and the rest."""

    pairs: list[tuple[Contact, TrueContact]]
    missed: list[TrueContact]
    false: list[Contact]
    rows: int


def true_contacts(t: Array, wrench: Array) -> list[TrueContact]:
    """The contacts of a true wrench (M, 6)."""
    force = np.linalg.norm(wrench[:, :3], axis=1)
    touched = (force > LEAST_FORCE) | (np.linalg.norm(wrench[:, 3:], axis=1) > LEAST_MOMENT)
    found = []
    for start, stop in runs_of(close_gaps(t, touched, GAP)):
        span = slice(start, stop)
        peak = start + int(np.argmax(force[span]))
        impulse = np.trapezoid(wrench[span, :3], t[span], axis=0)
        found.append(
            TrueContact(float(t[start]), float(t[stop - 1]), float(force[peak]),
                        wrench[peak, :3], impulse)
        )  # fmt: skip
    return found


def score(rows: Sequence[Contact], true: Sequence[TrueContact]) -> Score:
    """Credit each row to the one true contact, of those left, that it overlaps most."""
    left, pairs, false = list(true), [], []
    for row in rows:
        overlaps = [overlap(row, each) for each in true]
        if max(overlaps, default=0.0) <= 0.0:
            false.append(row)
        met = max(left, key=lambda each: overlap(row, each), default=None)
        if met is not None and overlap(row, met) > 0.0:
            pairs.append((row, met))
            left.remove(met)
    return Score(pairs, left, false, len(rows))


def overlap(row: Contact, true: TrueContact) -> float:
    """How long a row and a true contact lie on one another, the slack included. [s]"""
    return min(row.stop, true.stop + SLACK) - max(row.start, true.start - SLACK)


def angle(a: Array, b: Array) -> float:
    """Angle between two forces. [deg]"""
    cosine = float(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)))
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
