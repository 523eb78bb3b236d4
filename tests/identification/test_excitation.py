"""Which joints move, and where something touches the arm."""

import numpy as np
import pytest

from vftcli.identification.excitation import (
    TOUCH_MARGIN,
    TOUCH_TIME,
    ContactSpan,
    find_contacts,
    find_excitation,
    join_neighbours,
    near_standstill,
    outside_contacts,
    unexplained_torque,
)
from vftcli.signals.errors import IdentificationError
from vftcli.signals.rest import MOVES, SLIDES

T = np.arange(0, 10, 0.01)


def speeds(**seconds):
    """Velocities of three joints that run +0.5 and −0.5 rad/s for so many seconds each."""
    dq = np.zeros((len(T), 3))
    for name, (forwards, backwards) in seconds.items():
        j = int(name[1:]) - 1
        dq[forwards - 1e-9 > T, j] = 0.5
        dq[(T >= 5) & (5 + backwards - 1e-9 > T), j] = -0.5
    return dq


def test_a_joint_moves_from_one_second_on_and_reverses_from_a_tenth_of_it(prepared):
    found = find_excitation([prepared(T, dq=speeds(J1=(1.2, 0.2), J2=(1.2, 0.05), J3=(0.9, 0.0)))])
    assert found.moves.tolist() == [True, True, False]
    assert found.reverses.tolist() == [True, False, False]


def test_times_of_several_logs_add_up(prepared):
    log = prepared(T, dq=speeds(J1=(0.6, 0.0)))
    with pytest.raises(IdentificationError, match="no joint moves faster than"):
        find_excitation([log])
    assert find_excitation([log, log]).moves.tolist() == [True, False, False]


def test_a_slow_joint_does_not_move(prepared):
    dq = np.column_stack([np.full(len(T), 0.9 * MOVES), np.full(len(T), 1.1 * MOVES)])
    assert find_excitation([prepared(T, dq=dq)]).moves.tolist() == [False, True]


def touched(seconds, size, joint=1, base=1.0):
    """Residual ±base in turn, whose robust sd is 1.48·base, and a push from 4 s on."""
    residual = base * np.where(np.arange(len(T)) % 2, 1.0, -1.0)[:, None] * np.ones(3)
    residual[(T >= 4.0) & (4.0 + seconds > T), joint] = size
    return residual


@pytest.mark.parametrize(
    ("seconds", "size", "found"),
    [
        (0.5, 11.0, True),  # 7 · 1.4826 = 10.4
        (0.5, 10.0, False),
        (0.5, -11.0, True),
        (TOUCH_TIME - 0.03, 11.0, False),
    ],
)
def test_a_contact_is_seven_deviations_large_and_lasts(prepared, seconds, size, found):
    motion = prepared(T, dq=np.full((len(T), 3), 0.5))
    spans = find_contacts(motion, touched(seconds, size), np.zeros((len(T), 3)))
    assert len(spans) == found
    for span in spans:
        assert (span.joint, span.size) == (2, size)
        # first and last sample at or above it
        assert (span.start, span.stop) == pytest.approx((4.0, 4.0 + seconds - 0.01), abs=1e-9)


def test_what_dry_friction_can_hold_near_standstill_is_no_contact(prepared):
    dry = np.full((len(T), 3), 30.0)
    standing = prepared(T, dq=np.zeros((len(T), 3)))
    running = prepared(T, dq=np.full((len(T), 3), 0.5))
    assert not find_contacts(standing, touched(0.5, 35.0), dry)
    assert find_contacts(standing, touched(0.5, 45.0), dry)  # 45 − 30 = 15 > 10.4
    assert find_contacts(running, touched(0.5, 35.0), dry)


def test_samples_that_tell_nothing_are_no_contact(prepared):
    motion = prepared(T, dq=np.full((len(T), 3), 0.5), usable=np.abs(T - 4.25)[:, None] > [[0.3]])
    usable = np.repeat(motion.usable, 3, axis=1)
    motion = prepared(T, dq=motion.dq, usable=usable)
    assert not find_contacts(motion, touched(0.5, 50.0), np.zeros((len(T), 3)))


def test_standstill_is_spread_by_a_period_of_the_filter(prepared):
    dq = np.full((len(T), 1), 0.5)
    dq[500] = 0.9 * SLIDES
    near = near_standstill(prepared(1.2 * T, dq=dq))[:, 0]
    # 1 / 8 Hz is 10.4 samples of 12 ms: 10 to either side
    assert np.flatnonzero(near).tolist() == list(range(490, 511))


def test_neighbours_are_joined_and_the_larger_one_names_them():
    near = 2 * TOUCH_MARGIN - 0.01
    spans = [
        ContactSpan(1.0, 2.0, 1, -5.0),
        ContactSpan(2.0 + near, 3.0, 2, 4.0),
        ContactSpan(3.0 + 2 * TOUCH_MARGIN + 0.01, 5.0, 3, 1.0),
    ]
    joined = join_neighbours(spans)
    assert joined == [ContactSpan(1.0, 3.0, 1, -5.0), spans[2]]


def test_a_contact_is_left_out_with_its_margin(prepared):
    free = outside_contacts(prepared(T, q=np.zeros((len(T), 1))), [ContactSpan(4.0, 5.0, 1, 9.0)])
    lost = T[~free]
    assert lost[0] == pytest.approx(4.0 - TOUCH_MARGIN + 0.01)
    assert lost[-1] == pytest.approx(5.0 + TOUCH_MARGIN - 0.01)


def test_the_worst_explained_heavy_joint_is_named():
    torque = np.sin(T)[:, None] * np.array([10.0, 10.0, 10.0])
    residual = torque * np.sqrt([0.04, 0.2, 0.9])  # unexplained shares of a sine about zero
    heavy = np.array([True, True, False])
    remark = unexplained_torque("a.csv", "ur5", torque, residual, heavy)
    assert remark.where.joints == (2,)
    mean = np.mean(torque[:, 1] ** 2) / np.var(torque[:, 1])
    assert remark.values["share_percent"] == pytest.approx(100 * (1 - 0.2 * mean), abs=1e-9)
    assert unexplained_torque("a.csv", "ur5", torque, residual, heavy & [True, False, True]) is None
    assert unexplained_torque("a.csv", "ur5", torque, residual, np.zeros(3, dtype=bool)) is None
