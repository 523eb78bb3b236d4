"""Abrupt stops, what is none, and the rest around a contact."""

from types import SimpleNamespace

import numpy as np
import pytest
from drawn_blocks import B, blocks

from vftcli.contacts.listing import follows_stop, rests_around
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

T = 0.01 * np.arange(400)


def log(speed: Array) -> Recording:
    """One joint with this speed, and two at rest."""
    dq = speed[:, None] * [1.0, 0.0, 0.0]
    return Recording(t=T, q=np.cumsum(dq, axis=0) * 0.01, dq=dq, torque=np.zeros_like(dq))


def braked(left=0.0, speed=0.3, after=2.0, again=9.0) -> Array:
    """A joint's speed: a brake at 2 s leaves it to ring with so much; it may start again."""
    ringing = left * np.cos(np.pi * 50.0 * T)
    return np.where((after > T) | (again < T), speed, ringing)


@pytest.mark.parametrize(
    ("speed", "start", "lasts", "stops"),
    [
        (braked(), 1.98, 0.17, True),
        (braked(speed=-0.3), 1.98, 0.17, True),
        # It lasts .3 s and a block of .05 s at most.
        (braked(), 1.98, 0.34, True),
        (braked(), 1.98, 0.36, False),
        # The arm moved most of the time from .25 s to .05 s before it, faster than 20 mrad/s,
        (braked(), 2.135, 0.1, True),
        (braked(), 2.165, 0.1, False),
        (braked(speed=0.022), 1.98, 0.17, True),
        (braked(speed=0.018), 1.98, 0.17, False),
        # and rests from .12 s and a block behind its beginning to .35 s behind it.
        (braked(), 1.835, 0.1, True),
        (braked(), 1.815, 0.1, False),
        (braked(again=2.335), 2.0, 0.1, False),
        (braked(again=2.355), 2.0, 0.1, True),
        # It may ring with 20 mrad/s, or a twentieth of its speed from .25 s before to .1 s behind.
        (braked(0.018), 1.98, 0.17, True),
        (braked(0.022), 1.98, 0.17, False),
        (braked(0.028, 0.6), 1.98, 0.17, True),
        (braked(0.032, 0.6), 1.98, 0.17, False),
        (np.where(T < 1.725, 0.6, braked(0.028)), 1.98, 0.17, False),
        (np.where(T < 1.745, 0.6, braked(0.028)), 1.98, 0.17, True),
        (np.where(T < 2.075, braked(), np.where(T < 2.085, 0.6, 0.028)), 1.98, 0.17, False),
        (np.where(T < 2.065, braked(), np.where(T < 2.075, 0.6, 0.028)), 1.98, 0.17, True),
        # A knock on an arm that stood, an arm that goes on, and the ends of a log are none.
        (np.where((T > 2.0) & (T < 2.1), 0.05, 0.0), 1.99, 0.16, False),
        (np.full(400, 0.3), 1.98, 0.17, False),
        (braked(after=3.9), 3.98, 0.01, False),
        (braked(), -0.2, 0.2, False),
    ],
)
def test_a_brief_row_where_the_arm_comes_to_rest_is_a_stop(speed, start, lasts, stops):
    assert follows_stop(log(speed), (start, start + lasts), 0.05) is stops


def test_a_joint_that_moves_on_is_no_stop():
    stopped = log(braked())
    both = np.column_stack([stopped.require("dq")[:, 0], np.full(400, 0.3), 0.0 * T])
    moving = Recording(t=T, q=stopped.q, dq=both, torque=stopped.torque)
    assert not follows_stop(moving, (1.98, 2.15), 0.05)


@pytest.mark.parametrize(
    ("start", "stop", "speed", "rests"),
    [
        (0.0, 9.0, 0.019, True),
        (0.0, 9.0, -0.021, False),
        # A twentieth of the 3 s from 1 s before the contact to 1 s behind it are 15 samples.
        (3.0, 3.14, 0.3, True),
        (3.0, 3.17, 0.3, False),
        (1.8, 2.14, 0.3, True),
        (1.8, 2.19, 0.3, False),
        (4.86, 5.5, 0.3, True),
        (4.81, 5.5, 0.3, False),
    ],
)
def test_an_arm_rests_around_a_contact_from_3_to_4_s(start, stop, speed, rests):
    """One joint moves from `start` to `stop`, the other never."""
    t = 0.01 * np.arange(700)
    moving = np.where((t >= start) & (t < stop), speed, 0.0)
    run = SimpleNamespace(t=t, dq=np.column_stack([0.0 * t, moving]))
    nothing = np.zeros((300, 2))
    found = SimpleNamespace(log=SimpleNamespace(blocks=blocks(nothing, nothing)))
    span = round(3.0 / B), round(4.0 / B)
    assert rests_around(run, found, span) is rests
