"""The raw disturbance: the torque that made p and μ, and its density on clocks with gaps."""

from itertools import pairwise

import numpy as np
import pytest

from vftcli.robots.terms import (
    disturbance_blocks,
    disturbance_impulse,
    disturbance_stretches,
    raw_disturbance,
)
from vftcli.signals.external_torque import DynamicsTerms
from vftcli.signals.filters import welch

STEP = 0.004


def terms_of(t: np.ndarray, torque: np.ndarray) -> DynamicsTerms:
    """Terms of an arm on which `torque` (T−1, n) acts between the samples, and μ of its own."""
    mu = np.column_stack([np.sin(t), np.cos(2.0 * t)])[:, : torque.shape[1]]
    gained = (torque + 0.5 * (mu[1:] + mu[:-1])) * np.diff(t)[:, None]
    p = np.vstack([np.zeros((1, torque.shape[1])), np.cumsum(gained, axis=0)])
    return DynamicsTerms(t=t, p=p, mu=mu)


def test_it_is_the_torque_that_acted() -> None:
    rng = np.random.default_rng(1)
    t = np.cumsum(rng.uniform(0.5 * STEP, 1.5 * STEP, 400))
    torque = rng.standard_normal((399, 2))
    # p reaches 1, so differences over 4 ms lose three digits
    np.testing.assert_allclose(raw_disturbance(terms_of(t, torque)), torque, atol=1e-11)


def test_an_even_clock_is_only_cut() -> None:
    t = STEP * np.arange(50)
    torque = np.random.default_rng(2).standard_normal((49, 1))
    inside = np.ones(50, dtype=bool)
    inside[[0, 20, 21, 40]] = False
    found = disturbance_stretches(terms_of(t, torque), inside, STEP)
    # a step counts if the samples at both its ends do
    assert [len(d) for d in found] == [18, 17, 8]
    np.testing.assert_allclose(found[1], torque[22:39], atol=1e-11)


def test_an_uneven_clock_keeps_the_impulse() -> None:
    """The integral of d over a stretch does not change with the clock."""
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.6 * STEP, 1.4 * STEP, 300))
    torque = rng.standard_normal((299, 2))
    (found,) = disturbance_stretches(terms_of(t, torque), np.ones(300, dtype=bool), STEP)
    whole = np.sum(torque * np.diff(t)[:, None], axis=0)
    cut = np.abs(torque).max() * STEP  # the last, incomplete step
    assert np.all(np.abs(np.sum(found, axis=0) * STEP - whole) <= cut)


@pytest.mark.parametrize("clock", ["even", "gapped", "uneven"])
def test_white_noise_has_the_density_of_white_noise_on_any_clock(clock: str) -> None:
    """σ²·2Ts: the second Welch took raw samples of an uneven clock at its median step."""
    rng = np.random.default_rng(4)
    sigma, count = 2.0, 60_000
    steps = np.full(count - 1, STEP)
    spread = 0.0
    if clock == "gapped":
        steps[rng.choice(count - 1, 30, replace=False)] = 0.5
    elif clock == "uneven":
        steps = STEP * rng.uniform(0.5, 1.5, count - 1)
        spread = 1.0 / 12.0  # variance of the steps by their squared mean
    t = np.concatenate([[0.0], np.cumsum(steps)])
    torque = sigma * rng.standard_normal((count - 1, 1))
    stretches = disturbance_stretches(terms_of(t, torque), np.ones(count, dtype=bool), STEP)
    size = 200
    power, segments = welch(stretches, size, STEP)
    # Linear interpolation of the integral averages over a step, so above a tenth of the rate an
    # uneven clock's density falls; what acts on an arm lies below.
    low = power[2 : size // 10, 0]
    expected = 2.0 * sigma**2 * STEP * (1.0 + spread)
    assert segments > 500
    # 600 segments and 18 bins, half of them overlapping: 1.5 %
    assert np.mean(low) == pytest.approx(expected, rel=0.05)


def test_the_impulse_is_what_the_torque_gave() -> None:
    t = np.cumsum(np.random.default_rng(5).uniform(0.002, 0.006, 300))
    torque = np.random.default_rng(6).standard_normal((299, 2))
    found = disturbance_impulse(terms_of(t, torque))
    assert not found[0].any()
    # sums of 300 numbers up to 1 N·m·s
    np.testing.assert_allclose(
        found[1:], np.cumsum(torque * np.diff(t)[:, None], axis=0), atol=1e-12
    )


def test_blocks_follow_one_another_and_hold_the_mean_torque() -> None:
    """On an uneven clock too a block holds whole samples, and d is the impulse over its time."""
    rng = np.random.default_rng(7)
    t = np.cumsum(rng.uniform(0.8 * STEP, 1.2 * STEP, 103))
    torque, q = rng.standard_normal((102, 2)), np.column_stack([t, 2.0 * t])
    blocks = disturbance_blocks(terms_of(t, torque), q, 10.2 * STEP)
    # 102 steps make ten blocks of ten; the two that are left over join the last
    edges = np.array([*range(0, 100, 10), 102])
    np.testing.assert_allclose(blocks.length, np.diff(t[edges]))
    np.testing.assert_allclose(blocks.t, 0.5 * (t[edges[1:]] + t[edges[:-1]]))
    expected = [
        np.average(torque[a:b], axis=0, weights=np.diff(t)[a:b]) for a, b in pairwise(edges)
    ]
    np.testing.assert_allclose(blocks.d, expected, atol=1e-11)  # as of the raw disturbance
    np.testing.assert_allclose(blocks.q, np.column_stack([blocks.t, 2.0 * blocks.t]))
    np.testing.assert_allclose(blocks.velocity, np.tile([1.0, 2.0], (10, 1)))
    assert blocks.known.all()
    few = blocks.part(slice(2, 5))
    np.testing.assert_array_equal(few.d, blocks.d[2:5])
    np.testing.assert_array_equal(few.t, blocks.t[2:5])


def test_a_gap_and_what_is_left_out_are_blocks_of_which_nothing_is_known() -> None:
    t = STEP * np.arange(100.0)
    t[60:] += 1.0
    terms, q = terms_of(t, np.ones((99, 1))), np.zeros((100, 1))
    gap = disturbance_blocks(terms, q, 20 * STEP)
    np.testing.assert_array_equal(gap.known, [True, True, True, False, True, True])
    assert gap.length[3] == pytest.approx(1.0 + STEP)
    assert gap.length.sum() == pytest.approx(t[-1] - t[0])
    inside = np.ones(100, dtype=bool)
    inside[[0, 30, 99]] = False
    part = disturbance_blocks(terms, q, 20 * STEP, inside)
    # 0 and 99 leave a step each at the ends, 30 the two beside it
    np.testing.assert_array_equal(part.known, [0, 1, 0, 1, 0, 1, 1, 0])
    np.testing.assert_allclose(part.d[part.known], 1.0, atol=1e-11)


@pytest.mark.parametrize("inside", [None, np.zeros(1, dtype=bool)])
def test_one_sample_is_a_block_of_which_nothing_is_known(inside: np.ndarray | None) -> None:
    one = DynamicsTerms(t=np.zeros(1), p=np.ones((1, 2)), mu=np.ones((1, 2)))
    found = disturbance_blocks(one, np.ones((1, 2)), 0.1, inside)
    assert (len(found.t), found.known.tolist()) == (1, [False])
    np.testing.assert_array_equal(found.q, [[1.0, 1.0]])
