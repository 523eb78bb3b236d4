"""The model error that a contact has to exceed."""

import numpy as np
import pytest
from drawn_blocks import B, blocks, drawn, noise

from vftcli.robots.friction import CREEP_SHARE, PUSHED_SHARE, STOP_SHARE
from vftcli.signals.estimation import SPIKE
from vftcli.wrench.model_error import (
    LEAST_TIME,
    UNKNOWN,
    error_model,
    error_process,
    infer_noise,
    innovations,
    learn_noise,
    spiked_white,
    without_reversals,
)


def test_what_was_drawn_is_learned() -> None:
    d = drawn(4000, np.random.default_rng(1))
    found = learn_noise([blocks(d, np.full_like(d, 0.5))], np.array([10.0]))
    # 96 s hold 120 correlation times: the variance is known to some 13 %, two of its deviations.
    np.testing.assert_allclose(found.variance, 0.25, rtol=0.3)
    np.testing.assert_allclose(found.white, 0.01, rtol=0.15)
    np.testing.assert_allclose(found.time, 0.4, rtol=0.35)
    assert found.seen[0]
    # an offset is an error too
    shifted = learn_noise([blocks(d + 3.0, np.full_like(d, 0.5))], np.array([10.0]))
    assert shifted.variance[0] > found.variance[0] + 8.0
    # ten blocks are no spectrum
    assert learn_noise([blocks(d[:10], d[:10])], np.array([10.0])) is None


def test_the_noise_of_a_log_itself_is_no_less_than_what_was_learned() -> None:
    """A joint that moves: as wide as where it is quietest, and at least .2 of its friction."""
    log = blocks(drawn(8000, np.random.default_rng(7)), np.full((8000, 1), 0.5))
    dry = np.array([0.1])
    alone = infer_noise(log, dry, None)
    # Second differences of b are noise too, γ₀(6 − 8f + 2f²); robust, of 8000: 1.5 %.
    f = np.exp(-B / 0.4)
    np.testing.assert_allclose(alone.white, 0.01 + 0.25 * (1 - 4 * f / 3 + f * f / 3), rtol=0.05)
    # b of .5 N·m and the white noise of .1: the quantile of 480 correlation times: 7 %.
    np.testing.assert_allclose(alone.variance, 0.26, rtol=0.2)
    assert alone.time[0] == LEAST_TIME
    for variance, time, found in ((9.0, 0.1, 0.1), (1e-4, 0.1, LEAST_TIME), (1e-4, 2.0, 2.0)):
        fitted = {"white": [4.0], "variance": [variance], "time": [time]}
        learned = noise()._replace(**{name: np.array(x) for name, x in fitted.items()})
        both = infer_noise(log, dry, learned)
        assert (both.white[0], both.time[0], both.free_seconds) == (4.0, found, 4.0)
        assert both.variance[0] == max(variance, alone.variance[0])
    # its friction says more than the quietest
    strong = infer_noise(log, np.array([10.0]), noise())
    assert strong.variance[0] == pytest.approx((0.2 * 10.0) ** 2)
    assert (strong.at_rest[0], strong.pushed[0]) == (noise().at_rest[0], noise().pushed[0])
    assert infer_noise(blocks(np.zeros((2, 1)), np.zeros((2, 1))), dry, None) is None


def test_reversals_are_bridged_in_a_straight_line() -> None:
    d = np.arange(6.0)[:, None]
    d[3] = 50.0
    velocity = np.array([0.3, 0.2, 0.1, 0.0, -0.1, -0.2])[:, None]
    bridged = without_reversals(blocks(d, velocity), np.array([True])).d
    np.testing.assert_allclose(bridged[:, 0], np.arange(6.0))


def test_the_filter_of_the_error_agrees_with_a_dense_solve() -> None:
    """Σ ν²/S is dᵀ C⁻¹ d with the dense covariance of the model."""
    log = blocks(drawn(40, np.random.default_rng(3)), np.full((40, 1), 0.5))
    model = error_model(log.d, error_process(noise(), log))
    squares = innovations(model, np.full((40, 1), 1e-300))[0]
    lag = np.abs(log.t[:, None] - log.t)
    covariance = 0.25 * np.exp(-lag / 0.4) + 0.01 * np.eye(40)
    # Rounding of a 40×40 solve.
    np.testing.assert_allclose(
        squares.sum(), log.d[:, 0] @ np.linalg.solve(covariance, log.d[:, 0]), rtol=1e-9
    )


def test_a_bad_sample_is_a_spike() -> None:
    d = np.zeros((50, 1))
    d[25] = 20.0
    log = blocks(d, np.full((50, 1), 0.5))
    course = error_process(noise(), log)
    white = spiked_white(d, course)
    assert white[25, 0] > (SPIKE - 1.0) * course.white[25, 0]
    assert np.all(np.delete(white, 25) == np.delete(course.white, 25))


def test_a_joint_that_stops_draws_its_stiction() -> None:
    velocity = np.concatenate([np.full(20, 0.5), np.zeros(20)])[:, None]
    course = error_process(noise(), blocks(np.zeros((40, 1)), velocity))
    assert course.added[20, 0] == (STOP_SHARE * 10.0) ** 2
    assert course.decay[20, 0] < 0.01
    # It moves away again: b may change at once.
    back = error_process(noise(), blocks(np.zeros((40, 1)), velocity[::-1]))
    assert back.decay[20, 0] < course.decay[30, 0]


def test_a_joint_that_turns_round_may_show_any_friction_for_a_moment() -> None:
    """In the blocks beside the turn, and only if it moves: noise at rest turns nothing."""
    velocity = np.column_stack([np.linspace(0.5, -0.5, 20), 0.005 * (-1.0) ** np.arange(20)])
    course = error_process(noise(2), blocks(np.zeros((20, 2)), velocity))
    turned = np.isin(np.arange(20), [9, 10])
    np.testing.assert_allclose(course.white[:, 0], 0.01 + turned * (CREEP_SHARE * 10.0) ** 2)
    np.testing.assert_allclose(course.white[:, 1], 0.01)
    # a gap says nothing
    known = np.arange(20) != 7
    gap = error_process(noise(2), blocks(np.zeros((20, 2)), velocity, known))
    assert gap.white[7].tolist() == [UNKNOWN, UNKNOWN]


def test_a_push_frees_the_stiction_of_joints_at_rest_only() -> None:
    log = blocks(np.zeros((20, 2)), np.tile([0.0, 0.5], (20, 1)))
    strict = error_process(noise(2), log)
    free = error_process(noise(2), log, np.arange(20) >= 10)
    stationary = free.added[15] / (1.0 - free.decay[15] ** 2)
    np.testing.assert_allclose(stationary, [0.25 + (PUSHED_SHARE * 10.0) ** 2, 0.25])
    np.testing.assert_array_equal(free.added[5], strict.added[5])


def test_a_joint_that_the_free_part_never_moved_errs_by_its_friction() -> None:
    log = blocks(np.zeros((20, 1)), np.full((20, 1), 0.5))
    course = error_process(noise(seen=False), log)
    stationary = course.added[10, 0] / (1.0 - course.decay[10, 0] ** 2)
    np.testing.assert_allclose(stationary, 0.25 + 4.0)
