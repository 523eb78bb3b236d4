"""Contacts: hysteresis and matching with the truth."""

import numpy as np
import pytest

from vftcli.signals.errors import ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.virtual_sensor.detection import (
    ContactInterval,
    assignment,
    departure,
    find_contacts,
    judge_contacts,
    learned_free,
    match_contacts,
)

T = np.arange(0.0, 20.0, 0.01)


def pulses(*spans: tuple[float, float], height: float = 3.0) -> np.ndarray:
    score = np.zeros(len(T))
    for start, stop in spans:
        score[(start <= T) & (stop > T)] = height
    return score


def test_a_score_that_dips_stays_one_contact_until_it_leaves_the_lower_threshold() -> None:
    score = np.array([0, 0.5, 1.2, 0.8, 0.7, 1.1, 0.5, 0.0, 0.9, 0.0])
    (found,) = find_contacts(np.arange(10.0), score)
    assert (found.start, found.stop) == (2.0, 5.0)


def test_short_spikes_are_dropped_and_close_contacts_joined() -> None:
    score = pulses((2.0, 3.0), (3.1, 4.0), (8.0, 8.01), (12.0, 12.5))
    found = find_contacts(T, score)
    assert [(round(c.start, 2), round(c.stop, 2)) for c in found] == [(2.0, 3.99), (12.0, 12.49)]


def test_hits_misses_false_alarms_and_delays_are_counted() -> None:
    true = find_contacts(T, pulses((2, 4), (8, 9), (14, 15)))
    found = find_contacts(T, pulses((2.2, 4.3), (11, 11.5), (14.1, 15)))
    told = match_contacts(found, true, 20.0)
    assert (told.contacts, told.missed, told.false_alarms) == (3, 1, 1)
    # one alarm in the 16 s without contact (each contact's last sample is 10 ms early)
    assert told.false_alarms_per_h == pytest.approx(3600 / 16.03, rel=1e-3)
    np.testing.assert_allclose(told.delay, [0.2, np.nan, 0.1], atol=1e-9)
    assert told.mean_delay == pytest.approx(0.15)
    assert told.longest_delay == pytest.approx(0.2)


def test_a_found_contact_is_credited_to_one_true_one() -> None:
    true = find_contacts(T, pulses((2, 4), (5, 6), (7, 8), (14, 15)))
    # One interval over three contacts, the last of which it has most of; one in two pieces.
    found = find_contacts(T, pulses((3.9, 8), (14, 14.3), (14.6, 15)))
    told = match_contacts(found, true, 20.0)
    assert (told.contacts, told.listed, told.found, told.missed) == (4, 3, 2, 2)
    assert (told.merged, told.split, told.false_alarms) == (2, 1, 0)
    assert assignment(found, true)[3] == 2  # the longer piece


def test_as_many_contacts_as_possible_are_credited() -> None:
    """The first interval overlaps the second contact more, but the second has nothing else."""
    true = [ContactInterval(1.0, 2.0), ContactInterval(3.0, 6.0)]
    found = [ContactInterval(1.9, 4.0), ContactInterval(4.5, 5.0)]
    assert assignment(found, true) == [0, 1]
    assert assignment([], true) == [None, None]
    # Within a tenth of a second of its end a contact is still met, later no more.
    assert assignment([ContactInterval(2.05, 2.5)], true[:1]) == [0]
    late = match_contacts([ContactInterval(2.15, 2.5)], true[:1], 10.0)
    assert (late.missed, late.split, late.false_alarms) == (1, 1, 0)


def test_the_free_band_holds_the_free_part() -> None:
    rng = np.random.default_rng(1)
    values = rng.standard_normal((500, 6))
    assert np.max(departure(values, values[:300], 0.1)[:300]) < 1.0


def test_contacts_are_told_from_torques_before_the_first_true_one() -> None:
    truth = np.zeros((len(T), 6))
    truth[:, 1] = 10 * pulses((5, 6), (10, 11), height=1.0)
    rng = np.random.default_rng(2)
    late = np.roll(truth, 8, axis=0) + 0.1 * rng.standard_normal(truth.shape)
    estimate = ExternalTorque(name="gmo", t=T, tau=late)
    reference = ExternalTorque(name="file:truth", t=T, tau=truth)
    (told,) = judge_contacts([estimate], None, reference)
    assert told.signal == "torque"
    assert (told.detection.contacts, told.detection.missed) == (2, 0)
    assert told.detection.mean_delay == pytest.approx(0.08, abs=0.011)  # eight samples late


def test_a_log_that_starts_in_contact_has_no_free_part() -> None:
    with pytest.raises(ParameterError, match=r"no free part.*--free A:B"):
        learned_free(T, find_contacts(T, pulses((0.5, 2.0))))
