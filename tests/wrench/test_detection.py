"""Contacts against the true ones: hysteresis, matching, limits."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.signals.external_torque import ExternalTorque
from vftcli.wrench.detection import (
    ContactInterval,
    assignment,
    find_contacts,
    floor_in_motion,
    judge_contacts,
    match_contacts,
    true_contacts,
)

T = np.arange(0.0, 20.0, 0.01)


def push(height: float, start: float = 5.0, stop: float = 7.0) -> np.ndarray:
    return np.where((start <= T) & (stop > T), height, 0.0)


def contacts(*spans: tuple[float, float]) -> tuple[ContactInterval, ...]:
    """The contacts of a score of 3 in these spans; each ends 10 ms early."""
    return find_contacts(T, np.sum([push(3.0, *span) for span in spans], axis=0))


def reference(height: float, floor: float | None = None) -> ExternalTorque:
    """So much on the first of two joints from 5 to 7 s, known to a floor."""
    tau = np.outer(push(height), [1.0, 0.0])
    floors = None if floor is None else np.array([floor, np.nan])
    return ExternalTorque(name="truth", t=T, tau=tau, floor=floors)


def test_hits_misses_false_alarms_and_delays_are_counted():
    true = contacts((2, 4), (8, 9), (14, 15))
    found = contacts((2.2, 4.3), (11, 11.5), (14.1, 15))
    reported = match_contacts(found, true, 20.0)
    assert (reported.contacts, reported.missed, reported.false_alarms) == (3, 1, 1)
    # one alarm in the 16 s without contact
    assert reported.false_alarms_per_h == pytest.approx(3600 / 16.03, rel=1e-3)
    np.testing.assert_allclose(reported.delay, [0.2, np.nan, 0.1], atol=1e-9)
    assert reported.mean_delay == pytest.approx(0.15)
    assert reported.longest_delay == pytest.approx(0.2)


def test_a_found_contact_is_credited_to_one_true_one():
    true = contacts((2, 4), (5, 6), (7, 8), (14, 15))
    # One interval over three contacts, the last of which it has most of; one in two pieces.
    found = contacts((3.9, 8), (14, 14.3), (14.6, 15))
    reported = match_contacts(found, true, 20.0)
    assert (reported.contacts, reported.listed, reported.found, reported.missed) == (4, 3, 2, 2)
    assert reported.false_alarms == 0
    assert assignment(found, true)[3] == 2  # the longer piece


def test_as_many_contacts_as_possible_are_credited():
    """The first interval overlaps the second contact more, but the second has nothing else."""
    true = [ContactInterval(1.0, 2.0), ContactInterval(3.0, 6.0)]
    found = [ContactInterval(1.9, 4.0), ContactInterval(4.5, 5.0)]
    assert assignment(found, true) == [0, 1]
    assert assignment([], true) == [None, None]
    # Within a tenth of a second of its end a contact is still met, later no more.
    assert assignment([ContactInterval(2.05, 2.5)], true[:1]) == [0]
    late = match_contacts([ContactInterval(2.15, 2.5)], true[:1], 10.0)
    assert (late.missed, late.false_alarms) == (1, 0)


@pytest.mark.parametrize(
    ("score", "count"),
    [
        (push(1.01), 1),
        (push(1.0), 0),
        # Below .6 it ends, and what follows within a quarter of a second belongs to it.
        (np.where((T > 5.5) & (T < 6.0), 0.61, push(1.3)), 1),
        (np.where((T > 5.5) & (T < 6.0), 0.59, push(1.3)), 2),
        (np.where((T > 5.5) & (T < 5.74), 0.0, push(1.3)), 1),
        (np.where((T > 5.5) & (T < 5.77), 0.0, push(1.3)), 2),
        # It lasts 20 ms at least: three samples do.
        (push(1.3, 4.995, 5.015), 0),
        (push(1.3, 4.995, 5.025), 1),
    ],
)
def test_a_contact_is_a_score_beyond_one_that_lasts(score, count):
    assert len(find_contacts(T, score)) == count


@pytest.mark.parametrize(
    ("start", "false"), [(1.88, 1), (1.92, 0), (3.05, 0), (3.15, 0), (3.95, 0), (4.05, 1)]
)
def test_what_begins_too_early_or_late_is_false(start, false):
    """A true contact from 2 to 3 s: .1 s before it to 1 s behind its end are its own."""
    found = [ContactInterval(start, start + 0.5)]
    reported = match_contacts(found, [ContactInterval(2.0, 3.0)], 10.0)
    assert reported.false_alarms == false
    assert reported.found == (start < 3.1)
    assert reported.delay == (pytest.approx(max(start - 2.0, 0.0)),) or not reported.found


@pytest.mark.parametrize(
    ("pause", "floor", "count"),
    [(0.10, None, 1), (0.13, None, 2), (0.23, 0.1, 1), (0.26, 0.1, 2)],
)
def test_contacts_of_an_exact_reference_are_parted_by_a_shorter_pause(pause, floor, count):
    tau = np.outer(push(2.0, 5.0, 6.0) + push(2.0, 6.0 + pause, 7.0), [1.0, 0.0])
    known = replace(reference(2.0, floor), tau=tau)
    assert judge_contacts((), known).contacts == count


def test_true_contacts_exceed_half_a_newton_metre_on_any_joint():
    truth = np.zeros((len(T), 6))
    truth[:, 1], truth[:, 4] = push(0.6), push(0.6, 10.0, 11.0)
    truth[:, 2], truth[0, 0] = push(0.4, 14.0, 15.0), np.nan
    found = true_contacts(ExternalTorque(name="truth", t=T, tau=truth))
    assert [(round(c.start, 1), round(c.stop, 1)) for c in found] == [(5.0, 7.0), (10.0, 11.0)]


def test_a_reference_with_a_floor_calls_only_what_exceeds_five_times_it_a_contact():
    for floor, count in ((None, 1), (0.5, 0)):
        assert judge_contacts((), reference(2.0, floor)).contacts == count


def test_stiction_at_rest_deafens_no_reference():
    """1 N·m in motion, of half the samples or of one; a joint at rest has its floor."""
    t = np.arange(200) * 0.01
    moving = np.arange(200)[:, None] < [100, 1, 0]
    errors = {"sd": np.where(moving, 1.0, 5.0), "floor": np.array([np.sqrt(13.0), 5.0, 5.0])}
    one = ExternalTorque(name="x", t=t, tau=np.zeros((200, 3)), moving=moving, **errors)
    np.testing.assert_allclose(floor_in_motion(one), [1.0, 1.0, 5.0])


def test_what_is_listed_is_judged_as_it_stands():
    """Two rows for one push: one is credited, the other a piece."""
    listed = (ContactInterval(5.0, 5.8), ContactInterval(6.0, 7.0))
    detection = judge_contacts(listed, reference(2.0))
    assert (detection.found, detection.listed, detection.false_alarms) == (1, 2, 0)
