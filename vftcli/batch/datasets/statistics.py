"""Statistics of a column as LeRobot keeps them: of each episode, and of all episodes together."""

from collections.abc import Sequence

import numpy as np

from vftcli.batch.datasets.episodes import Single, Statistics

#: Keys of the quantiles.
QUANTILES = {"q01": 0.01, "q10": 0.10, "q50": 0.50, "q90": 0.90, "q99": 0.99}
KEYS = ("min", "max", "mean", "std", "count", *QUANTILES)  #: All keys.


def statistics_of(values: Single) -> Statistics:
    """The statistics of one episode, its quantiles exact. (frames, k) → (k,) each, count (1,)"""
    exact = values.astype(np.float64)
    found = {
        "min": exact.min(axis=0),
        "max": exact.max(axis=0),
        "mean": exact.mean(axis=0),
        "std": exact.std(axis=0),
        "count": np.array([len(exact)]),
    }
    each = np.quantile(exact, list(QUANTILES.values()), axis=0)
    return found | dict(zip(QUANTILES, each, strict=True))


def pooled(episodes: Sequence[Statistics]) -> Statistics:
    """The statistics of several episodes together, as LeRobot puts them together.

    Mean and standard deviation are those of all frames (law of total variance), quantiles the means
    of the episodes' own weighted with their frames.
    """
    table = {key: np.array([one[key] for one in episodes]) for key in episodes[0]}
    count = table.pop("count")
    share = count / count.sum()
    mean = np.sum(share * table["mean"], axis=0)
    variance = np.sum(share * (table["std"] ** 2 + (table["mean"] - mean) ** 2), axis=0)
    whole = {key: np.sum(share * values, axis=0) for key, values in table.items()}
    return whole | {
        "min": table["min"].min(axis=0),
        "max": table["max"].max(axis=0),
        "mean": mean,
        "std": np.sqrt(variance),
        "count": np.array([count.sum()]),
    }
