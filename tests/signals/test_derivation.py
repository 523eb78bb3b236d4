"""Velocities derived from positions."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.readers import ReadChoice
from vftcli.signals.derivation import is_fast, with_velocity
from vftcli.signals.recording import Recording


def swinging(rate: float, seconds: float = 8.0) -> tuple[Recording, np.ndarray]:
    """A log of two joints that swing at .5 and 1 Hz, and their true velocities."""
    t = np.arange(0, seconds, 1 / rate)
    w = 2 * np.pi * np.array([0.5, 1.0])
    return Recording(t=t, q=np.sin(np.outer(t, w))), w * np.cos(np.outer(t, w))


@pytest.mark.parametrize(("rate", "cutoff"), [(125.0, 12.0), (50.0, 10.0), (20.0, 4.0)])
def test_a_slow_swing_is_derived(rate: float, cutoff: float) -> None:
    log, truth = swinging(rate)
    derived = with_velocity(log)
    (told,) = derived.source.remarks
    assert told.code == "derived-velocity"
    assert told.values["cutoff_Hz"] == pytest.approx(cutoff)
    assert derived.source.derived == ("dq",)
    inner = slice(int(rate), -int(rate))
    # Both passes together leave 1/(1 + (f/fc)⁴) of a swing of f, a central difference
    # sin(x)/x of it with x = 2πf/rate; at 1 Hz and fc = 4 Hz .9961 · .9836.
    error = np.abs(derived.require("dq")[inner] - truth[inner]).max(axis=0)
    f = np.array([0.5, 1.0])
    lost = 1 - np.sinc(2 * f / rate) / (1 + (f / cutoff) ** 4)
    # The bilinear design bends the cutoff and the ends still ring: a tenth and 1e-3 for both.
    np.testing.assert_allclose(error, lost * 2 * np.pi * f, rtol=0.15, atol=2e-3)


def test_a_joint_that_is_logged_within_a_turn_has_no_jumps_in_its_velocity() -> None:
    t = np.arange(0, 20, 0.01)
    turning = np.outer(t, [1.0, 30.0])
    turning[:, 0] = np.angle(np.exp(1j * turning[:, 0]))  # the second is a motor's count
    derived = with_velocity(Recording(t=t, q=turning)).require("dq")
    np.testing.assert_allclose(derived, np.broadcast_to([1.0, 30.0], derived.shape), rtol=1e-9)


def test_what_a_log_has_is_kept() -> None:
    log, truth = swinging(100.0)
    log = replace(log, dq=truth)
    assert with_velocity(log) is log


@pytest.mark.parametrize(("rate", "fast"), [(1000.0, True), (50.0, True), (49.0, False)])
def test_from_50_hz_on_it_is_done_unasked(rate: float, fast: bool) -> None:
    assert is_fast(swinging(rate)[0]) is fast


def test_logged_velocities_give_way_where_that_is_asked_for() -> None:
    """Velocities in deg/s beside positions in rad: what the finding about them advises."""
    log, truth = swinging(100.0)
    derived = ReadChoice(derive="dq").taken(replace(log, dq=np.rad2deg(truth)))
    assert derived.source.derived == ("dq",)
    np.testing.assert_array_equal(derived.require("dq"), with_velocity(log).require("dq"))
