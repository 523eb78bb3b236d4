"""Conventions of vendors: axes, sign, gain, lag and zeros of a logged wrench, each found."""

import numpy as np
import pytest

from vftcli.robots import load_robot
from vftcli.robots.chain import link_poses
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import Wrench, WrenchFrame
from vftcli.wrench.sensor import AxesFit, fit_axes, vendor_remarks


def pushes(samples: int = 400, seed: int = 1) -> np.ndarray:
    """Smooth wrenches in all directions, flange axes. (T, 6)"""
    t = np.linspace(0, 10, samples)[:, None]
    rng = np.random.default_rng(seed)
    phase, speed = rng.uniform(0, 6, 6), rng.uniform(0.5, 3, 6)
    return np.sin(speed * t + phase) * np.array([20, 15, 25, 2, 2, 1.5])


@pytest.mark.parametrize("seed", range(6))
def test_any_order_and_sign_of_axes_is_recognised(seed: int) -> None:
    rng = np.random.default_rng(seed)
    P = np.eye(3)[rng.permutation(3)] * rng.choice([-1.0, 1.0], 3)[:, None]
    ours = pushes(seed=seed)[:, :3]
    theirs = 1.7 * ours @ P.T + 3.0 + 0.2 * rng.standard_normal(ours.shape)
    fit = fit_axes(ours, theirs)
    np.testing.assert_array_equal(fit.matrix, P)
    assert fit.gain == pytest.approx(1.7, rel=0.01)  # 0.2 N of noise over 400 samples of 20 N
    assert not fit_axes(ours, ours + rng.standard_normal(ours.shape)).derived
    assert fit_axes(ours, 2.0 * ours @ P.T).derived


def test_axes_in_words() -> None:
    matrix = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    fit = AxesFit(matrix=matrix, gain=1.0, correlation=1.0)
    assert fit.words == "+x +z −y"


def log(wrench: np.ndarray, frame: WrenchFrame | None, samples: int = 400) -> Recording:
    t = np.linspace(0, 10, samples)
    rng = np.random.default_rng(5)
    q = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2]) + 0.3 * np.sin(
        np.outer(t, rng.uniform(0.3, 1, 6))
    )
    return Recording(t=t, q=q, wrench=wrench, wrench_frame=frame)


def ours_in_base(recording: Recording, flange: np.ndarray) -> Wrench:
    R = link_poses(load_robot("ur5").chain, recording.q).rotation[:, -1]
    parts = [np.einsum("tij,tj->ti", R, part) for part in (flange[:, :3], flange[:, 3:])]
    values = np.concatenate(parts, axis=1)
    return Wrench(name="x", t=recording.t, values=values, frame="base")


@pytest.mark.parametrize(
    ("axes", "sign", "words"),
    [
        ("base", 1.0, "fits base axes, force on the robot"),
        ("base", -1.0, "fits base axes with turned sign"),
        ("flange", -1.0, "fits flange axes with turned sign"),
    ],
)
def test_a_vendors_frame_and_sign_are_reported(axes: str, sign: float, words: str) -> None:
    flange = pushes()
    ours = ours_in_base(log(flange, None), flange)
    rng = np.random.default_rng(0)
    theirs = sign * (flange if axes == "flange" else ours.values)
    theirs = theirs + 0.5 * rng.standard_normal(theirs.shape)
    remarks = vendor_remarks(
        log(theirs, WrenchFrame("vendor", "vendor")), ours, load_robot("ur5").chain
    )
    assert words in str(remarks[-1])


def test_a_vendors_zeros_are_called_that() -> None:
    flange = pushes()
    ours = ours_in_base(log(flange, None), flange)
    remarks = vendor_remarks(log(np.zeros_like(flange), None), ours, load_robot("ur5").chain)
    assert [remark.code for remark in remarks] == ["log-wrench-all-zero"]


def test_a_fit_that_is_the_same_signal_is_reported_to_be_derived() -> None:
    flange = pushes()
    ours = ours_in_base(log(flange, None), flange)
    remarks = vendor_remarks(log(2.0 * ours.values, None), ours, load_robot("ur5").chain)
    codes = [remark.code for remark in remarks]
    assert codes == ["log-wrench-fits", "log-wrench-derived"]
    assert remarks[0].values["gain"] == pytest.approx(2.0)
    assert remarks[0].values["stated"] == "frame not stated"


def test_swapped_axes_are_named() -> None:
    flange = pushes()
    ours = ours_in_base(log(flange, None), flange)
    rng = np.random.default_rng(3)
    theirs = ours.values[:, [0, 2, 1, 3, 5, 4]] * [1, 1, -1, 1, 1, -1]
    theirs = theirs + 0.5 * rng.standard_normal(theirs.shape)
    remarks = vendor_remarks(log(theirs, None), ours, load_robot("ur5").chain)
    (remark,) = remarks
    assert remark.code == "log-wrench-fits-other-axes"
    assert remark.values["axes"] == "+x +z −y"


def test_what_resembles_nothing_is_reported_and_zeros_in_part() -> None:
    flange = pushes()
    ours = ours_in_base(log(flange, None), flange)
    noise = np.random.default_rng(1).standard_normal(flange.shape)
    noise[:100] = 0.0
    remarks = vendor_remarks(log(noise, None), ours, load_robot("ur5").chain)
    assert [remark.code for remark in remarks] == ["log-wrench-zero", "log-wrench-unlike"]
    assert remarks[0].values["share"] == pytest.approx(0.25)
    # the rms of the norm where theirs is zero
    rms = np.sqrt(np.mean(np.sum(ours.force[:100] ** 2, axis=1)))
    assert remarks[0].values["force_N"] == pytest.approx(rms)


def test_a_late_field_is_reported_by_how_much() -> None:
    flange = pushes()
    ours = ours_in_base(log(flange, None), flange)
    late = np.roll(ours.values, 4, axis=0)
    remarks = vendor_remarks(log(late, None), ours, load_robot("ur5").chain)
    step = 10.0 / 399
    # four of 400 samples are wrapped round, and a parabola stands for the peak
    assert remarks[0].values["lag_ms"] == pytest.approx(4e3 * step, abs=250.0 * step)


def test_a_log_without_a_wrench_has_no_convention() -> None:
    flange = pushes()
    recording = log(flange, None)
    without = Recording(t=recording.t, q=recording.q)
    assert vendor_remarks(without, ours_in_base(recording, flange), load_robot("ur5").chain) == []


def test_a_field_of_zeros_fits_no_axes_and_has_no_correlation() -> None:
    """Some controllers log zeros where no sensor is fitted: their gain is 0, 0/0 correlates not."""
    ours = pushes()[:, :3]
    fit = fit_axes(ours, np.zeros_like(ours))
    assert fit.gain == 0.0
    assert np.isnan(fit.correlation)
