"""What a difference cannot know: the pieces its error is made of, on signals of known size."""

from collections.abc import Callable

import numpy as np
import pytest

from vftcli.free_motion.difference import (
    ErrorModel,
    PairedRuns,
    error_model,
    noise_below,
    noise_of,
    noise_when_quiet,
    pair_with_run,
)
from vftcli.robots.run import Run
from vftcli.signals.filters import low_pass

STEP = 0.008
T = STEP * np.arange(6000)
MOVING = np.ones((6000, 1), dtype=bool)


def test_white_noise_is_measured_under_a_smooth_signal_and_where_it_is_quiet() -> None:
    x = 0.3 * np.random.default_rng(1).standard_normal((6000, 1))
    smooth = x + 10.0 * np.sin(2 * np.pi * 0.5 * T)[:, None]
    # 6000 samples tell 1 %
    assert noise_of(T, smooth, MOVING, STEP, None) == pytest.approx(0.3, rel=0.05)
    assert noise_when_quiet(T, x, MOVING, STEP, None) == pytest.approx(0.3, rel=0.05)
    assert noise_when_quiet(T[:300], x[:300], MOVING[:300], STEP, None) == 0.0  # six pieces


@pytest.mark.parametrize("cutoff", [6.0, 12.0])
def test_what_a_low_pass_leaves_of_white_noise(cutoff: float) -> None:
    """Measured beside the signal, predicted for the band that passes."""
    x = np.random.default_rng(2).standard_normal((6000, 1))
    left = float(np.sqrt(np.mean(low_pass(T, x, cutoff) ** 2)))
    assert noise_of(T, x, MOVING, STEP, cutoff) == pytest.approx(left, rel=0.1)


def test_noise_is_measured_beside_the_cutoff() -> None:
    """Above contacts, at least .2 of the rate, up to .45; pink, so that each band differs."""
    x = np.cumsum(np.random.default_rng(3).standard_normal((6000, 1)), axis=0)
    faster = (0.008, 6.0, 8.4, 15.6), (0.008, 20.0, 14.0, 26.0)
    for step, cutoff, *limits in (*faster, (0.02, 20.0, 14.0, 22.5), (0.04, 4.0, 3.5, 6.5)):
        t = step * np.arange(6000)
        expected = noise_below(t, x, MOVING, step, tuple(limits), cutoff)
        np.testing.assert_allclose(noise_of(t, x, MOVING, step, cutoff), expected, rtol=1e-9)


def coloured(memory: float, seed: int) -> np.ndarray:
    """Noise of one newton-metre whose correlation falls to 1/e within a time. (6000, 1)"""
    keep = np.exp(-STEP / memory)
    drive = np.random.default_rng(seed).standard_normal(8000) * np.sqrt(1.0 - keep**2)
    x = np.zeros(8000)
    for k in range(1, 8000):
        x[k] = keep * x[k - 1] + drive[k]
    return x[2000:, None]


@pytest.mark.parametrize(("memory", "share"), [(0.03, 0.8), (0.1, 0.55)])
def test_coloured_noise_is_measured_where_it_is_quiet(memory: float, share: float) -> None:
    """Beside a slow load and short contacts. What is slower than a piece counts for nothing: of an
    exponential correlation a line over .4 s leaves 86 % of the variance at .03 s, 45 % at .1 s."""
    load = 10.0 * np.sin(2 * np.pi * 0.1 * T)[:, None]
    contact = np.where(np.sin(2 * np.pi * 0.25 * T) > 0.0, 30.0 * np.sin(2 * np.pi * T) ** 2, 0.0)
    x = coloured(memory, 4) + load + contact[:, None]
    left = float(np.sqrt(np.mean(low_pass(T, coloured(memory, 4), 12.0) ** 2)))
    quiet = noise_when_quiet(T, low_pass(T, x, 12.0), MOVING, STEP, 12.0)[0]
    assert share * left < quiet < 1.15 * left
    # taken to be white, the band about the cutoff says less than half of that at .1 s
    assert noise_of(T, x, MOVING, STEP, 12.0)[0] < quiet


def test_what_a_differentiated_noise_leaves() -> None:
    p = np.random.default_rng(3).standard_normal((6000, 1))
    slope = np.gradient(low_pass(T, p, 8.0), T, axis=0)
    shown = float(np.sqrt(np.mean(slope[50:-50] ** 2)))
    found = noise_below(T, p, MOVING, STEP, (8.0, 16.0), 8.0, slope=1)
    assert found == pytest.approx(shown, rel=0.1)


def test_the_noise_of_momenta_is_no_motion(drive_of: Callable[..., Run]) -> None:
    """The model's torque of a run that differs by 5 sin πt N·m, and by the slope of its noise.

    Local squares of the noise scatter about their mean, so that half of it is left at most.
    """
    p = 0.02 * np.random.default_rng(5).standard_normal((6000, 1))
    noise = np.gradient(p, T, axis=0)
    square = np.mean(low_pass(T, noise, 12.0) ** 2)
    free = drive_of(T, 0.0 * p, 0.0 * p)
    for motion, least, most in ((0.0, 0.0, 0.5 * square), (5.0, 12.0, 12.5 + 0.5 * square)):
        model = noise + motion * np.sin(np.pi * T)[:, None]
        log = drive_of(T, 0.0 * p, 0.0 * p, momentum=p, model_torque=model)
        pair = PairedRuns(motion=log, pairings=[pair_with_run(T, free, 0.0)])
        found = error_model(pair, 0.0 * p, 0.0 * p, corrected=False, cutoff=12.0)
        assert least <= np.mean(found.sd**2) < most


def test_the_floor_is_over_all_samples_and_the_floor_in_motion_over_those_that_move() -> None:
    sd = np.column_stack([np.full(10, 1.0), np.repeat([1.0, 3.0], 5)])
    standing = np.zeros((10, 2), dtype=bool)
    standing[5:, 1] = True
    model = ErrorModel(sd, standing)
    np.testing.assert_allclose(model.standing_share, [0.0, 0.5])
    np.testing.assert_allclose(model.floor, [1.0, np.sqrt(5.0)])  # (5·1 + 5·9)/10
    np.testing.assert_allclose(model.floor_moving, [1.0, 1.0])  # moving half alone
    np.testing.assert_allclose(model.rms_moving(2.0 * sd), [2.0, 2.0])
    assert np.isnan(model.floor_standing[0])
    assert model.floor_standing[1] == 3.0
    standing[4:, 1] = True
    # it mostly stands, so that all samples speak for its motion too
    assert ErrorModel(sd, standing).floor_moving[1] == pytest.approx(np.sqrt(5.0))
    assert ErrorModel(sd, standing).trusted_joints.tolist() == [True, False]
