"""Velocities derived from positions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vftcli.readers.reader import ReadChoice
from vftcli.readers.reading import Library
from vftcli.signals.recording import Recording
from vftcli.signals.repairs import RATE, with_velocity, without_isolated


def swinging(rate: float, seconds: float = 8.0) -> tuple[Recording, np.ndarray]:
    """A log of two joints that swing at .5 and 1 Hz, and their true velocities."""
    t = np.arange(0, seconds, 1 / rate)
    w = 2 * np.pi * np.array([0.5, 1.0])
    return Recording(t=t, q=np.sin(np.outer(t, w))), w * np.cos(np.outer(t, w))


@pytest.mark.parametrize(("rate", "cutoff"), [(125.0, 12.0), (50.0, 10.0), (20.0, 4.0)])
def test_a_slow_swing_is_derived(rate: float, cutoff: float) -> None:
    log, truth = swinging(rate)
    derived = with_velocity(log)
    (reported,) = derived.source.remarks
    assert reported.code == "derived-velocity"
    assert reported.values["cutoff_Hz"] == pytest.approx(cutoff)
    # 40 ms at 12 Hz, longer with a lower cutoff
    assert reported.values["blunted_ms"] == pytest.approx(40 * 12 / cutoff)
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


@pytest.mark.parametrize(("rate", "fast"), [(1000.0, True), (50.0, True), (49.0, False)])
def test_from_50_hz_on_it_is_done_unasked_and_what_a_log_has_is_kept(rate, fast) -> None:
    log, truth = swinging(rate)
    assert (with_velocity(log, RATE) is not log) is fast
    log = replace(log, dq=truth)
    assert with_velocity(log) is log


def test_logged_velocities_give_way_where_that_is_asked_for() -> None:
    """Velocities in deg/s beside positions in rad: what the finding about them advises."""
    log, truth = swinging(100.0)
    derived = ReadChoice(derive="dq").with_stated_effort(replace(log, dq=np.rad2deg(truth)))
    assert derived.source.derived == ("dq",)
    np.testing.assert_array_equal(derived.require("dq"), with_velocity(log).require("dq"))


STEP = 0.01
ROWS = 1000


def moving(noise: float = 0.05) -> Recording:
    """10 s of two joints, the second at rest, with white noise in their torques [N·m]."""
    t = STEP * np.arange(ROWS)
    q = np.column_stack([np.sin(2.0 * t), np.full(ROWS, 0.3)])
    dq = np.column_stack([2.0 * np.cos(2.0 * t), np.zeros(ROWS)])
    torque = 10.0 * q + noise * np.random.default_rng(1).standard_normal(q.shape)
    return Recording(t=t, q=q, dq=dq, torque=torque)


def with_sample(log: Recording, signal: str, row: int, joint: int, off: float) -> Recording:
    values = np.array(getattr(log, signal))
    values[row, joint] += off
    return replace(log, **{signal: values})


@pytest.mark.parametrize("row", [0, 1, 2, 400, ROWS - 2, ROWS - 1])
@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize(
    ("signal", "off", "left"),
    # left: at an end a line of six samples misses 4 rad/s² by ½(3 Ts)² of it, 1.8 mrad, and its
    # change by less than .01 rad/s; of the torque 6 sd of its noise
    [("q", 2.0 * np.pi, 2e-3), ("q", -0.05, 2e-3), ("dq", 5.0, 1e-2), ("torque", 200.0, 0.3),
     ("torque", -200.0, 0.3)],
)  # fmt: skip
def test_one_bad_sample_is_drawn_to_its_neighbours(signal, off, left, row, joint) -> None:
    log = moving()
    found = without_isolated(with_sample(log, signal, row, joint, off))
    (said,) = found.source.remarks
    assert (said.code, said.where.joints) == ("isolated-samples-evened", (joint + 1,))
    assert said.values["samples"] == 1
    for name in ("q", "dq", "torque"):
        size = left if name == signal else 0.0
        np.testing.assert_allclose(getattr(found, name), getattr(log, name), rtol=0, atol=size)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_a_sample_is_worth_falls_back_without_a_jump(sign: float) -> None:
    """The larger a fault, the less is left of it, on its own side; no step between two sizes."""
    log, row = moving(), 400
    sizes = np.linspace(0.0, 8.0, 81)
    found = (without_isolated(with_sample(log, "torque", row, 1, sign * s)) for s in sizes)
    left = np.array([sign * (one.torque[row, 1] - log.torque[row, 1]) for one in found])
    # the sample follows the fault or goes back as fast; the fault itself moves the quantile little
    assert np.max(np.abs(np.diff(left))) <= 1.1 * (sizes[1] - sizes[0])
    assert left.max() > 0.5
    assert left.min() > -0.15  # 3 sd of the noise
    assert abs(left[-1]) < 0.3  # 6 sd of the noise


@pytest.mark.parametrize("rows", [3, 6, 12])
def test_a_tap_and_a_step_are_no_isolated_samples(rows: int) -> None:
    """A half sine of 30, 60 or 120 ms, and a torque that jumps and stays."""
    torque = np.array(moving().torque)
    torque[500 : 500 + rows, 0] += 30.0 * np.sin(np.pi * (np.arange(rows) + 0.5) / rows)
    torque[700:, 1] += 5.0
    found = without_isolated(replace(moving(), torque=torque))
    np.testing.assert_allclose(found.torque, torque, rtol=0, atol=1e-12)


def test_a_sound_log_is_left_as_it_is_and_numbers_beyond_all_bounds_are_no_warning() -> None:
    log = moving()
    assert without_isolated(log) is log
    torque = np.array(log.torque)
    torque[10:20] = 1e308
    torque[30] = -np.inf
    without_isolated(replace(log, torque=torque))


def test_the_one_odd_current_of_a_real_log_goes(logs: Path) -> None:
    """Row 4 073 of free_14harm: 4.1 A on J3 between .3 A before and behind it."""
    columns = "t,q:6,dq:6,current:6,target_current:6,target_torque:6"
    choice = ReadChoice.parsed(columns=columns)
    (log,) = Library().open_each([logs / "ur10e" / "free_14harm.csv"], choice)
    found = without_isolated(log)
    assert np.count_nonzero(found.current != log.current) == 1
    np.testing.assert_array_equal(found.q, log.q)
