"""Statistics of a column."""

import numpy as np

from vftcli.batch.datasets.lerobot import KEYS, pooled, statistics_of

RNG = np.random.default_rng(4)
EPISODES = [
    RNG.standard_normal((n, 3)).astype(np.float32) + k for k, n in enumerate((30, 50, 20))
]


def test_an_episode_s_are_exact():
    found = statistics_of(EPISODES[0])
    assert set(found) == set(KEYS)
    np.testing.assert_array_equal(found["count"], [30])
    np.testing.assert_array_equal(
        found["q10"], np.quantile(EPISODES[0].astype(float), 0.1, axis=0)
    )
    np.testing.assert_array_equal(found["std"], EPISODES[0].astype(float).std(axis=0))


def test_the_dataset_s_are_those_of_all_frames_but_for_quantiles():
    each = [statistics_of(own) for own in EPISODES]
    found, whole = pooled(each), np.concatenate(EPISODES).astype(float)
    for key in ("min", "max", "mean", "std"):
        # sums in another order
        np.testing.assert_allclose(found[key], getattr(np, key)(whole, axis=0), atol=1e-12)
    np.testing.assert_array_equal(found["count"], [100])
    weighted = (30 * each[0]["q50"] + 50 * each[1]["q50"] + 20 * each[2]["q50"]) / 100
    np.testing.assert_allclose(found["q50"], weighted, atol=1e-12)
