"""Conventions of vendors: axes, sign, gain, lag and zeros of a logged wrench, each found."""

import numpy as np
import pytest

from vftcli.robots import load_robot
from vftcli.robots.chain import link_poses
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import Remark
from vftcli.signals.wrench import Wrench, WrenchFrame
from vftcli.wrench.sensor import fit_axes, vendor_remarks

UR5 = load_robot("ur5").chain


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


FLANGE = pushes()


def log(wrench: np.ndarray | None, frame: WrenchFrame | None = None) -> Recording:
    t = np.linspace(0, 10, len(FLANGE))
    rng = np.random.default_rng(5)
    q = np.array([0.3, -1.2, 1.4, -1.7, -1.5, 0.2]) + 0.3 * np.sin(
        np.outer(t, rng.uniform(0.3, 1, 6))
    )
    return Recording(t=t, q=q, wrench=wrench, wrench_frame=frame)


def ours_in_base() -> Wrench:
    """What the virtual sensor reads of those pushes."""
    recording = log(None)
    R = link_poses(UR5, recording.q).rotation[:, -1]
    parts = [np.einsum("tij,tj->ti", R, part) for part in (FLANGE[:, :3], FLANGE[:, 3:])]
    values = np.concatenate(parts, axis=1)
    return Wrench(name="x", t=recording.t, values=values, frame="base")


OURS = ours_in_base()


def remarks(wrench: np.ndarray | None, frame: WrenchFrame | None = None) -> list[Remark]:
    """What is said of a log's own wrench."""
    return vendor_remarks(log(wrench, frame), OURS, UR5)


def noisy(values: np.ndarray, seed: int) -> np.ndarray:
    """With noise of .5 N."""
    return values + 0.5 * np.random.default_rng(seed).standard_normal(values.shape)


@pytest.mark.parametrize(
    ("theirs", "words"),
    [
        (OURS.values, "fits base axes, force on the robot"),
        (-OURS.values, "fits base axes with turned sign"),
        (-FLANGE, "fits flange axes with turned sign"),
    ],
)
def test_a_vendors_frame_and_sign_are_reported(theirs: np.ndarray, words: str) -> None:
    assert words in str(remarks(noisy(theirs, 0), WrenchFrame("vendor", "vendor"))[-1])


def test_a_log_without_a_wrench_or_of_zeros_has_no_convention() -> None:
    """Some controllers log zeros where no sensor is fitted: their gain is 0, 0/0 correlates not."""
    assert remarks(None) == []
    assert [remark.code for remark in remarks(0.0 * FLANGE)] == ["log-wrench-all-zero"]
    fit = fit_axes(FLANGE[:, :3], np.zeros((len(FLANGE), 3)))
    assert fit.gain == 0.0
    assert np.isnan(fit.correlation)


def test_a_fit_that_is_the_same_signal_is_reported_to_be_derived() -> None:
    fits, derived = remarks(2.0 * OURS.values)
    assert (fits.code, derived.code) == ("log-wrench-fits", "log-wrench-derived")
    assert fits.values["gain"] == pytest.approx(2.0)
    assert fits.values["stated"] == "frame not stated"


def test_swapped_axes_are_named() -> None:
    swapped = OURS.values[:, [0, 2, 1, 3, 5, 4]] * [1, 1, -1, 1, 1, -1]
    (remark,) = remarks(noisy(swapped, 3))
    assert remark.code == "log-wrench-fits-other-axes"
    assert remark.values["axes"] == "+x +z −y"


def test_what_resembles_nothing_is_reported_and_zeros_in_part() -> None:
    noise = np.random.default_rng(1).standard_normal(FLANGE.shape)
    noise[:100] = 0.0
    zero, unlike = remarks(noise)
    assert (zero.code, unlike.code) == ("log-wrench-zero", "log-wrench-unlike")
    assert zero.values["share"] == pytest.approx(0.25)
    # the rms of the norm where theirs is zero
    rms = np.sqrt(np.mean(np.sum(OURS.force[:100] ** 2, axis=1)))
    assert zero.values["force_N"] == pytest.approx(rms)


def test_a_late_field_is_reported_by_how_much() -> None:
    late, *_ = remarks(np.roll(OURS.values, 4, axis=0))
    step = 10.0 / 399
    # four of 400 samples are wrapped round, and a parabola stands for the peak
    assert late.values["lag_ms"] == pytest.approx(4e3 * step, abs=250.0 * step)
    # moved back by it both are one signal but for those four
    assert late.values["correlation"] > 0.99
