"""A real sensor's pose on the flange, found again in its contacts."""

from dataclasses import replace

import numpy as np
import pytest

from vftcli.robots import load_robot
from vftcli.robots.chain import flange_jacobian, link_poses
from vftcli.signals.errors import MissingSignalError, ParameterError
from vftcli.signals.external_torque import ExternalTorque
from vftcli.signals.pose import Pose, adjoint, inverse, rpy_matrix
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark
from vftcli.signals.wrench import Wrench, WrenchFrame
from vftcli.wrench import FIT, WrenchChoice, ZeroChoice
from vftcli.wrench.sensor import (
    DERIVED,
    MARGIN,
    SensorReading,
    contact_elsewhere,
    find_mounting,
    fit_axes,
    fit_pose,
    unloaded_start,
    vendor_remarks,
    with_reference,
    without_drift,
    without_zero,
    zero_drift,
    zero_moved,
    zero_spans,
    zero_warning,
)
from vftcli.wrench.solvers import VirtualSensor

POSE = Pose(rpy_matrix((0.1, -0.2, 0.8)), np.array([0.01, -0.02, 0.04]))
UR5 = load_robot("ur5")
T = np.arange(0.0, 20.0, 0.05)
SWING = np.sin(np.outer(T, [0.3, 0.5, 0.7, 0.9, 1.1, 0.4]))
Q = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2]) + 0.5 * SWING
FLANGE = link_poses(UR5.chain, Q).rotation[:, -1]
PHASE = np.outer(T, [0.7, 1.1, 1.3, 0.9, 1.7, 2.1]) + np.arange(1.0, 7.0)
PUSH = np.sin(PHASE) * [20, 15, 25, 2, 2, 1.5]
"""A contact at the flange, in flange axes. (T, 6) [N, N·m]"""


def in_base(values: np.ndarray) -> np.ndarray:
    """Wrenches in base axes, given in flange axes. (T, 6)"""
    parts = [np.einsum("tij,tj->ti", FLANGE, part) for part in (values[:, :3], values[:, 3:])]
    return np.concatenate(parts, axis=1)


def test_under_noise_the_pose_is_found_within_its_own_deviation():
    """Of 50 noises a deviation is known to 10 %; .05 N·m over √400 samples of 20 N are < 1 mm."""
    rng = np.random.default_rng(2)
    reading = PUSH @ adjoint(inverse(POSE)).T
    noises = rng.standard_normal((50, *PUSH.shape)) * np.repeat([0.5, 0.05], 3)
    fits = [fit_pose(PUSH + noise, reading) for noise in noises]
    error = np.array([fit.pose.translation - POSE.translation for fit in fits])
    sd = np.mean([fit.position_sd for fit in fits], axis=0)
    np.testing.assert_allclose(sd, np.sqrt(np.mean(error**2, axis=0)), rtol=0.4)
    assert np.all(sd < 1e-3)


def test_pushes_along_one_line_tell_no_pose():
    line = np.outer(np.sin(np.linspace(0, 6, 50)), [10.0, 0, 0, 0, 1, 0])
    with pytest.raises(ParameterError, match=r"forces lie on one line.*virtual-sensor.sensor"):
        fit_pose(line, line)


def log(wrench: np.ndarray | None, frame: WrenchFrame | None = None) -> Recording:
    return Recording(t=T, q=Q, wrench=wrench, wrench_frame=frame)


def disturbance() -> ExternalTorque:
    tau = np.einsum("tij,ti->tj", flange_jacobian(UR5.chain, Q), in_base(PUSH))
    return ExternalTorque(name="disturbance", t=T, tau=tau)


@pytest.mark.parametrize(
    ("sign", "frame"), [(1.0, None), (-1.0, WrenchFrame("sensor", "sensor", "by-robot"))]
)
def test_a_pose_is_found_in_the_contacts_whatever_sign_and_zero_they_are_logged_with(sign, frame):
    zero = np.array([1.0, -2.0, 3.0, 0.1, 0.0, -0.2])
    recording = log(sign * PUSH @ adjoint(inverse(POSE)).T + zero, frame)
    fit = WrenchChoice(sensor_pose=FIT)
    mounting, remarks = find_mounting(recording, UR5, disturbance(), fit)
    np.testing.assert_allclose(mounting.sensor.rotation, POSE.rotation, atol=1e-9)
    np.testing.assert_allclose(mounting.sensor.translation, POSE.translation, atol=1e-9)
    (remark,) = remarks
    np.testing.assert_allclose(remark.values["position_mm"], [10, -20, 40], atol=1e-6)
    assert "10.0 −20.0 40.0 mm" in str(remark)


def test_a_pose_that_is_given_is_not_looked_for_nor_one_without_a_sensors_wrench():
    given = WrenchChoice(sensor_pose="0,0,0.05")
    mounting, remarks = find_mounting(log(None), UR5, disturbance(), given)
    np.testing.assert_array_equal(mounting.sensor.translation, [0, 0, 0.05])
    assert remarks == ()
    fit = WrenchChoice(sensor_pose=FIT)
    with pytest.raises(MissingSignalError, match="no wrenches"):
        find_mounting(log(None), UR5, disturbance(), fit)
    with pytest.raises(ParameterError, match=r"fit: .* in base axes.*wrench\[sensor\]"):
        find_mounting(log(PUSH, WrenchFrame("base", "flange")), UR5, disturbance(), fit)


TIMES = np.arange(0.0, 20.0, 0.01)
SPAN = (1.0, 3.0)


def force(late: float = 0.0, offset: float = 0.0) -> np.ndarray:
    """A push along each axis after 5 s. (T, 6)"""
    shape = np.column_stack([np.sin((k + 1.0) * (TIMES - late)) for k in range(6)])
    return np.where(TIMES[:, None] > 5.0, shape * [20, 10, 15, 2, 1, 2], 0.0) + offset


def reading(*removed: bool) -> SensorReading:
    """One observer, 80 ms late; a drift of its unloaded span for each flag."""
    wrench = Wrench(name="gmo", t=TIMES, values=force(0.08), frame="base", masked=TIMES > 19.0)
    drifts = tuple(zero_drift(wrench, SPAN)._replace(removed=flag) for flag in removed)
    found = {"wrenches": (wrench,), "masked": wrench.hidden, "drifts": drifts}
    return SensorReading(sensor=VirtualSensor(frame="base"), **found)


def test_a_sensors_own_zero_goes_where_the_readings_went():
    theirs = Wrench(name="sensor", t=TIMES, values=force(offset=1.5), frame="base")
    found = with_reference(reading(True), theirs, of_sensor=True)
    np.testing.assert_allclose(found.reference.values, force(), atol=1e-12)
    zero, lag = found.remarks
    assert (zero.code, zero.where.about) == ("zero-removed", "sensor")
    np.testing.assert_allclose(zero.values["force_N"], 1.5)
    assert (lag.code, lag.where.about) == ("lag-behind-sensor", "gmo")
    assert lag.values["lag_ms"] == pytest.approx(80.0, abs=5.0)  # half a sample


@pytest.mark.parametrize(
    ("flags", "of_sensor", "codes"),
    [
        ((), True, ["lag-behind-sensor"]),
        ((False,), True, ["lag-behind-sensor"]),
        ((True,), False, []),  # another reference has no zero and no lag of its own
    ],
)
def test_without_a_zero_of_the_reading_the_sensor_keeps_its_own(flags, of_sensor, codes):
    theirs = Wrench(name="sensor", t=TIMES, values=force(offset=1.5), frame="base")
    found = with_reference(reading(*flags), theirs, of_sensor=of_sensor)
    assert found.reference is theirs
    assert [remark.code for remark in found.remarks] == codes


def test_what_is_masked_and_zeroed_can_be_asked():
    assert reading(True).masked_share == pytest.approx(0.05, abs=0.001)
    assert reading(False, True).zero_span == SPAN
    assert reading(False).zero_span is None


def test_which_solver_made_which_wrench():
    found = reading()
    assert (found.solver, found.hides) == ("pinv", True)
    one = found.wrenches[0]
    best = replace(one, name="best", masked=None)
    smoothed = {"best": object()}  # its numbers are not asked for here
    both = replace(found, wrenches=(best, one), smoothed=smoothed)
    assert (both.solver, both.hides) == ("smoother for best, pinv for the others", True)
    alone = replace(both, wrenches=(best,))
    assert (alone.solver, alone.hides) == ("smoother", False)


def wrench(null_space: np.ndarray | None) -> Wrench:
    t = np.arange(1000.0)
    nothing = np.zeros((1000, 6))
    return Wrench(name="gmo", t=t, values=nothing, frame="base", null_space=null_space)


FREE = np.arange(1000) < 500


def test_a_contact_elsewhere_is_what_exceeds_the_free_part():
    residual = np.full(1000, 0.8)
    residual[100], residual[600:650], residual[700:800], residual[10] = 1.0, 2.0, MARGIN, np.nan
    (remark,) = contact_elsewhere(wrench(residual), FREE)
    assert (remark.code, remark.where.about) == ("contact-elsewhere", "gmo")
    assert remark.values == {"share": pytest.approx(0.05), "threshold_Nm": pytest.approx(MARGIN)}
    # a stray sample is none
    stray = np.where(np.arange(1000) == 999, 5.0, 1.0)
    assert contact_elsewhere(wrench(stray), FREE) == ()
    assert contact_elsewhere(wrench(np.where(np.arange(1000) >= 998, 5.0, 1.0)), FREE)
    # nothing is said without a channel or a free part
    residual = np.where(FREE, 1.0, 2.0)
    assert contact_elsewhere(wrench(None), FREE) == ()
    assert contact_elsewhere(wrench(residual), np.zeros(1000, dtype=bool)) == ()
    assert contact_elsewhere(wrench(np.where(FREE, np.nan, 2.0)), FREE) == ()


@pytest.mark.parametrize("seed", range(6))
def test_any_order_and_sign_of_axes_is_recognised(seed):
    rng = np.random.default_rng(seed)
    P = np.eye(3)[rng.permutation(3)] * rng.choice([-1.0, 1.0], 3)[:, None]
    ours = PUSH[:, :3]
    theirs = 1.7 * ours @ P.T + 3.0 + 0.2 * rng.standard_normal(ours.shape)
    fit = fit_axes(ours, theirs)
    np.testing.assert_array_equal(fit.matrix, P)
    assert fit.gain == pytest.approx(1.7, rel=0.01)  # 0.2 N of noise over 400 samples of 20 N
    assert fit_axes(ours, ours + rng.standard_normal(ours.shape)).correlation < DERIVED
    assert fit_axes(ours, 2.0 * ours @ P.T).correlation >= DERIVED


OURS = Wrench(name="x", t=T, values=in_base(PUSH), frame="base")
"""What the virtual sensor reads of those pushes."""


def remarks(wrench: np.ndarray | None, frame: WrenchFrame | None = None) -> list[Remark]:
    return vendor_remarks(log(wrench, frame), OURS, UR5.chain)


def noisy(values: np.ndarray, seed: int) -> np.ndarray:
    """With noise of .5 N."""
    return values + 0.5 * np.random.default_rng(seed).standard_normal(values.shape)


@pytest.mark.parametrize(
    ("theirs", "words"),
    [
        (OURS.values, "fits base axes, force on the robot"),
        (-OURS.values, "fits base axes with turned sign"),
        (-PUSH, "fits flange axes with turned sign"),
        (OURS.values[:, [0, 2, 1, 3, 5, 4]] * [1, 1, -1, 1, 1, -1], "+x +z −y"),
    ],
)
def test_a_vendors_frame_and_sign_are_reported(theirs, words):
    assert words in str(remarks(noisy(theirs, 0), WrenchFrame("vendor", "vendor"))[-1])


def test_a_log_without_a_wrench_or_of_zeros_has_no_convention():
    """Some controllers log zeros where no sensor is fitted: their gain is 0, 0/0 correlates not."""
    assert remarks(None) == []
    assert [remark.code for remark in remarks(0.0 * PUSH)] == ["log-wrench-all-zero"]
    fit = fit_axes(PUSH[:, :3], np.zeros((len(PUSH), 3)))
    assert fit.gain == 0.0
    assert np.isnan(fit.correlation)


def test_a_fit_that_is_the_same_signal_is_reported_to_be_derived():
    fits, derived = remarks(2.0 * OURS.values)
    assert (fits.code, derived.code) == ("log-wrench-fits", "log-wrench-derived")
    assert fits.values["gain"] == pytest.approx(2.0)
    assert fits.values["stated"] == "frame not stated"


def test_what_resembles_nothing_is_reported_and_zeros_in_part():
    noise = np.random.default_rng(1).standard_normal(PUSH.shape)
    noise[:100] = 0.0
    zero, unlike = remarks(noise)
    assert (zero.code, unlike.code) == ("log-wrench-zero", "log-wrench-unlike")
    assert zero.values["share"] == pytest.approx(0.25)
    # the rms of the norm where theirs is zero
    rms = np.sqrt(np.mean(np.sum(OURS.force[:100] ** 2, axis=1)))
    assert zero.values["force_N"] == pytest.approx(rms)


def test_a_late_field_is_reported_by_how_much():
    late, *_ = remarks(np.roll(OURS.values, 4, axis=0))
    # four of 400 samples are wrapped round, and a parabola stands for the peak
    assert late.values["lag_ms"] == pytest.approx(4 * 50.0, abs=12.5)
    # moved back by it both are one signal but for those four
    assert late.values["correlation"] > 0.99


DRIFT = np.array([-0.43166, -0.53348, 0.83768, -0.16294, 0.13407, 0.09103])
"""The paper's zero drift of the Panda, Sec. IV-D. [N, N·m]"""


def hung(masked: bool = False, noise: float = 0.05) -> Wrench:
    """Ten seconds at 100 Hz: drift, then 9.2 N hang on the flange from 5 s on."""
    t = np.arange(0.0, 10.0, 0.01)
    rng = np.random.default_rng(0)
    values = DRIFT + noise * rng.standard_normal((len(t), 6))
    values[t >= 5.0, 2] -= 9.2
    return Wrench(name="kfo-fe", t=t, values=values, frame="base", masked=np.full(len(t), masked))


def test_the_drift_is_the_mean_of_the_span_and_its_removal_leaves_the_load():
    wrench = hung()
    drift = zero_drift(wrench, (1.0, 4.5))
    # the mean of 350 samples of 0.05 N noise: 0.003 N
    np.testing.assert_allclose(drift.mean, DRIFT, atol=0.015)
    clean = without_drift(wrench, drift)
    assert clean.force[wrench.t > 5.5, 2].mean() == pytest.approx(-9.2, rel=0.002)
    assert clean.remarks[-1].code == "zero-removed"
    assert "drift of 1 to 4.5 s removed (base axes)" in str(clean.remarks[-1])


def test_the_change_between_two_spans_is_reported():
    wrench = hung(noise=0.0)
    moved = zero_moved(zero_drift(wrench, (1, 2)), zero_drift(wrench, (6, 7)))
    np.testing.assert_allclose(moved.values["force_N"], [0.0, 0.0, -9.2], atol=1e-12)
    np.testing.assert_allclose(moved.values["moment_Nm"], np.zeros(3), atol=1e-12)
    assert moved.where.span == (6, 7)


@pytest.mark.parametrize(
    ("lasts", "size", "stop"),
    [(0, 0.0, 12.99), (0.09, 9, 12.99), (0.11, 9, 7.7), (2, 2.8, 12.99), (2, 3.2, 7.7)],
)
def test_what_is_short_or_light_does_not_end_the_unloaded_start(lasts, size, stop):
    """From a second after the log's begin at 3 s to .3 s before a load of .1 s and 3 N, if any."""
    t = 3.0 + np.arange(0.0, 10.0, 0.01)
    values = DRIFT + 0.05 * np.random.default_rng(0).standard_normal((len(t), 6))
    values[(t > 7.995) & (t < 7.995 + lasts), 1] += size
    span = unloaded_start(Wrench(name="kfo-fe", t=t, values=values, frame="base"))
    assert span == (pytest.approx(4.0), pytest.approx(stop))


def test_a_log_too_short_or_masked_has_no_unloaded_start():
    assert unloaded_start(hung(masked=True)) is None
    t = np.arange(0.0, 1.2, 0.01)
    short = Wrench(name="x", t=t, values=np.zeros((len(t), 6)), frame="base")
    assert unloaded_start(short) is None


def test_a_zero_inside_a_contact_is_suspected_and_an_unloaded_one_is_not():
    wrench = hung()
    assert zero_warning(wrench, zero_drift(wrench, (2.0, 4.0))) == ()
    (remark,) = zero_warning(wrench, zero_drift(wrench, (6.0, 8.0)))
    assert (remark.code, remark.level) == ("zero-far-from-start", "warning")
    assert (remark.values["axis"], remark.values["unit"]) == ("fz", "N")
    # the load less six standard deviations of .05 N of noise
    assert remark.values["size"] == pytest.approx(9.2 - 0.3, abs=0.05)


def test_a_zero_across_the_begin_of_a_contact_swings():
    no_start = replace(hung(), masked=np.arange(1000) < 300)
    twice = replace(no_start, values=no_start.values + (no_start.values - DRIFT))
    (remark,) = zero_warning(twice, zero_drift(twice, (4.0, 6.0)))
    assert (remark.code, remark.values["axis"]) == ("zero-swings", "fz")
    # 18.4 N exceed the 12 N that are four times a step of load; 9.2 N do not
    assert zero_warning(no_start, zero_drift(no_start, (4.0, 6.0))) == ()


@pytest.mark.parametrize(
    ("span", "masked", "words"),
    [
        ((20.0, 30.0), False, "zero interval 20:30 is outside the log"),
        ((-np.inf, -3.0), False, "zero interval :-3 is outside the log"),
        ((1.0, 4.0), True, "no two of its samples have a known wrench"),
    ],
)
def test_a_zero_outside_the_log_or_in_a_masked_span_is_refused(span, masked, words):
    with pytest.raises(ParameterError, match=words):
        zero_drift(hung(masked), span)


def test_the_zero_is_the_chosen_spans_or_the_start_where_it_is_chosen():
    wrench, spans = hung(), ((1.0, 2.0), (8.0, 9.0))
    start = (unloaded_start(wrench),)
    assert zero_spans(ZeroChoice(spans=spans), wrench) == (spans, spans)
    assert zero_spans(ZeroChoice(start=True), wrench) == (start, start)
    assert zero_spans(ZeroChoice(), wrench) == ((), start)
    with pytest.raises(ParameterError, match=r"--zero start: .*--zero A:B"):
        zero_spans(ZeroChoice(start=True), hung(masked=True))


def test_a_sensors_own_zero_is_removed_by_the_same_choice():
    wrench = hung(noise=0.0)
    clean = without_zero(wrench, ZeroChoice(spans=((1.0, 4.0), (6.0, 7.0))))
    np.testing.assert_allclose(clean.values, wrench.values - DRIFT, atol=1e-12)
    by_start = without_zero(wrench, ZeroChoice(start=True))
    np.testing.assert_allclose(by_start.values, clean.values, atol=1e-12)
    assert without_zero(wrench, ZeroChoice()) is wrench
