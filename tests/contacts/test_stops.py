"""Abrupt stops, and what is none."""

import numpy as np

from vftcli.contacts.listing import follows_stop
from vftcli.signals.arrays import Array
from vftcli.signals.recording import Recording

T = 0.01 * np.arange(400)


def log(speed: Array) -> Recording:
    """One joint with this speed, and two at rest."""
    dq = speed[:, None] * [1.0, 0.0, 0.0]
    return Recording(t=T, q=np.cumsum(dq, axis=0) * 0.01, dq=dq, torque=np.zeros_like(dq))


def test_a_brake_that_catches_the_arm_is_a_stop() -> None:
    stopped = log(np.where(T < 2.0, 0.3, 0.0))
    assert follows_stop(stopped, 1.98, 2.15, 0.05)
    # It rings, by less than a twentieth of what it had.
    ringing = log(np.where(T < 2.0, 0.3, 0.01 * np.cos(60.0 * T)))
    assert follows_stop(ringing, 1.98, 2.15, 0.05)


def test_what_lasts_or_goes_on_is_none() -> None:
    stopped = log(np.where(T < 2.0, 0.3, 0.0))
    assert not follows_stop(stopped, 1.98, 2.6, 0.05)
    moving = log(np.full(400, 0.3))
    assert not follows_stop(moving, 1.98, 2.15, 0.05)


def test_a_knock_on_an_arm_that_stands_is_none() -> None:
    knocked = log(np.where((T > 2.0) & (T < 2.1), 0.05, 0.0))
    assert not follows_stop(knocked, 1.99, 2.15, 0.024)


def test_at_the_ends_of_a_log_nothing_is_known() -> None:
    stopped = log(np.where(T < 3.9, 0.3, 0.0))
    assert not follows_stop(stopped, 3.98, 3.99, 0.05)
    assert not follows_stop(stopped, -0.2, 0.0, 0.05)
