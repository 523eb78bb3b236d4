"""Where a mask along a clock is true: its stretches, and the mask of stretches."""

from collections.abc import Sequence

import numpy as np

from vftcli.signals.arrays import Array, Mask


def runs_of(mask: Mask) -> list[tuple[int, int]]:
    """Where the unbroken runs of true samples begin and end, as ``slice`` takes them.

    Args:
        mask: True or false, sample by sample. (T,)

    Returns:
        Of each run the index of its first sample and of the one behind its last.
    """
    # With a false sample at either end every run has both its edges.
    walled = np.concatenate([[False], mask, [False]])
    edges = np.flatnonzero(walled[1:] != walled[:-1]).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def intervals(t: Array, mask: Mask, least: float = 0.0, gap: float = 0.0) -> list[tuple[int, int]]:
    """Runs of a mask, those less than `gap` apart as one, that then last at least `least` [s]."""
    found: list[tuple[int, int]] = []
    for start, stop in runs_of(mask):
        joined = bool(found) and t[start] - t[found[-1][1] - 1] < gap
        found.append((found.pop()[0] if joined else start, stop))
    return [(start, stop) for start, stop in found if t[stop - 1] - t[start] >= least]


def covered(runs: Sequence[tuple[int, int]], samples: int, margin: int = 0) -> Mask:
    """The mask of some runs and of `margin` samples on either side of each. (T,)"""
    mask = np.zeros(samples, dtype=bool)
    for start, stop in runs:
        mask[max(start - margin, 0) : stop + margin] = True
    return mask


def grown(t: Array, mask: Mask, margin: float) -> Mask:
    """A mask with the samples up to `margin` before and after each of its runs [s]. (T,)"""
    found = mask.copy()
    for start, stop in runs_of(mask):
        first = np.searchsorted(t, t[start] - margin)
        found[first : np.searchsorted(t, t[stop - 1] + margin, side="right")] = True
    return found


def near(mask: Mask, count: int) -> Mask:
    """Samples within `count` samples of a true one, column by column. (T, n)"""
    total = np.vstack([np.zeros((1, mask.shape[1])), np.cumsum(mask, axis=0)])
    k = np.arange(len(mask))
    first, last = np.maximum(k - count, 0), np.minimum(k + count + 1, len(mask))
    found: Mask = total[last] - total[first] > 0.0
    return found
