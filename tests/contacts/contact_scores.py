"""Truth beside lists of contacts: which row is credited to which true contact, and by how much.

A true contact is |F| > 1 N or |M| > .2 N·m, pauses shorter than .12 s closed. Rows are credited one
to one, as `vftcli.wrench.detection` does it.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from vftcli.contacts.contact_list import Contact
from vftcli.signals.arrays import Array, intervals
from vftcli.wrench.detection import ContactInterval, assignment, overlaps

LEAST_FORCE, LEAST_MOMENT, GAP = 1.0, 0.2, 0.12


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


def touched(wrench: Array) -> np.ndarray:
    """Samples in which a true wrench (M, 6) is a contact's."""
    force, moment = (np.linalg.norm(part, axis=1) for part in (wrench[:, :3], wrench[:, 3:]))
    return (force > LEAST_FORCE) | (moment > LEAST_MOMENT)


def true_contacts(t: Array, wrench: Array) -> list[TrueContact]:
    force = np.linalg.norm(wrench[:, :3], axis=1)
    found = []
    for start, stop in intervals(t, touched(wrench), gap=GAP):
        span = slice(start, stop)
        peak = start + int(np.argmax(force[span]))
        impulse = np.trapezoid(wrench[span, :3], t[span], axis=0)
        found.append(
            TrueContact(float(t[start]), float(t[stop - 1]), float(force[peak]),
                        wrench[peak, :3], impulse)
        )  # fmt: skip
    return found


def score(rows: Sequence[Contact], true: Sequence[TrueContact]) -> Score:
    """Credit each row to one true contact; false is what overlaps none."""
    both = [[ContactInterval(x.start, x.stop) for x in some] for some in (rows, true)]
    given, shared = assignment(*both), overlaps(*both)
    pairs = [(rows[i], met) for i, met in zip(given, true, strict=True) if i is not None]
    missed = [met for i, met in zip(given, true, strict=True) if i is None]
    false = [row for row, lies in zip(rows, shared, strict=True) if not lies.any()]
    return Score(pairs, missed, false, len(rows))


def angle(a: Array, b: Array) -> float:
    """Angle between two forces. [deg]"""
    cosine = float(a @ b / (np.linalg.norm(a) * np.linalg.norm(b)))
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
