"""The prior of the wrench: what the gate pins, and what the log's likelihood chooses."""

import numpy as np

from vftcli.robots.terms import Blocks
from vftcli.signals.arrays import Array, Mask
from vftcli.wrench.model_error import TorqueNoise
from vftcli.wrench.smoother import GRID, LEVER, BlockModel, WrenchPrior, gated

COUNT, SECONDS = 30, 0.1
T = SECONDS * (np.arange(COUNT) + 0.5)
NOTHING = np.zeros((COUNT, 6))
BLOCKS = Blocks(
    T, np.full(COUNT, SECONDS), NOTHING, NOTHING, np.ones((COUNT, 6)), np.ones(COUNT, dtype=bool)
)
NOISE = TorqueNoise(
    white=np.full(6, 0.1),
    variance=np.full(6, 4.0),
    time=np.full(6, 0.5),
    dry=np.zeros(6),
    seen=np.ones(6, dtype=bool),
    at_rest=np.full(6, 5.0),
    pushed=np.full(6, 1.44 * 9.0),
)
PRIOR = WrenchPrior(2.0, 30.0)


def moves(blocks: Blocks, inside: Mask) -> tuple[Array, Array]:
    """Decay and added variance of wrench and model error under `PRIOR`. (K, 12) each"""
    model = BlockModel(blocks, np.zeros((COUNT, 6, 6)), NOISE, inside).under([PRIOR])
    return model.decay[:, 0], model.added[:, 0]


def test_a_listed_contact_opens_its_blocks_and_one_on_either_side() -> None:
    # .55 to .85 s touches blocks 5 to 8
    assert np.flatnonzero(gated(BLOCKS, [(0.55, 0.85)])).tolist() == list(range(4, 10))
    assert np.flatnonzero(gated(BLOCKS, [(0.0, 0.05), (2.95, 9.0)])).tolist() == [0, 1, 28, 29]
    assert not gated(BLOCKS, []).any()
    assert gated(BLOCKS, None).all()


def test_a_wrench_keeps_its_variance_while_it_lasts_and_starts_with_it() -> None:
    inside = gated(BLOCKS, [(0.55, 0.85), (2.0, 2.2)])
    decay, variance = moves(BLOCKS, inside)
    assert not decay[~inside, :6].any()
    assert not variance[~inside, :6].any()
    stationary = np.repeat([900.0, (LEVER * 30.0) ** 2], 3)
    for first in (4, 19):
        assert not decay[first, :6].any()
        np.testing.assert_allclose(variance[first, :6], stationary)
    np.testing.assert_allclose(decay[5, :6], np.exp(-SECONDS / 2.0))
    np.testing.assert_allclose(decay[5, :6] ** 2 * stationary + variance[5, :6], stationary)


def test_the_model_error_is_stationary_from_the_first_block_on() -> None:
    decay, variance = moves(BLOCKS, gated(BLOCKS, None))
    assert not decay[0].any()
    np.testing.assert_allclose(variance[0, 6:], 4.0)
    np.testing.assert_allclose(decay[1:, 6:], np.exp(-SECONDS / 0.5))
    np.testing.assert_allclose(decay[1:, 6:] ** 2 * 4.0 + variance[1:, 6:], 4.0)


def test_a_gap_lets_both_decay_by_its_own_length() -> None:
    late = BLOCKS._replace(t=np.concatenate([T[:10], T[10:] + 3.0]))
    decay, _ = moves(late, gated(late, None))
    np.testing.assert_allclose(decay[10, :6], np.exp(-3.1 / 2.0))
    np.testing.assert_allclose(decay[10, 6:], np.exp(-3.1 / 0.5))


def test_what_keeps_for_half_a_minute_and_hardly_changes_in_a_second_is_a_load() -> None:
    """σ_f √(2/τ_w) is 15 N for (30 s, 60 N), pushes in a row, and 5 N for (300 s, 60 N)."""
    steady = [(prior.time, prior.force) for prior in GRID if prior.is_steady]
    assert steady == [(30, 10), (100, 10), (100, 30), (300, 10), (300, 30), (300, 60)]
