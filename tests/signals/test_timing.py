"""Timing: what is counted block by block is what the whole clock tells."""

import numpy as np
import pytest

from vftcli.signals import timing
from vftcli.signals.series import clock_of, median_step
from vftcli.signals.timing import TimingCount


def counted(t: np.ndarray, size: int) -> TimingCount:
    """The stamps, so many at a time; again where one pass does not tell the median."""
    count: TimingCount | None = TimingCount()
    found = TimingCount()
    while count is not None:
        for start in range(0, len(t), size):
            count.add(t[start : start + size])
        found, count = count, count.again()
    return found


@pytest.mark.parametrize("size", [1, 7, 1000])
@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_clock_is_that_of_the_whole(size: int, noise: float) -> None:
    """Median, mean step, evenness and the longest steps."""
    rng = np.random.default_rng(1)
    steps = 1e-3 + noise * rng.random(2000)
    t = np.cumsum(steps)
    found = counted(t, size).timing
    assert found.clock == clock_of(t)
    assert found.step == median_step(t)
    assert (found.samples, found.start, found.end) == (2000, t[0], t[-1])
    assert found.steps[:, 0].max() == np.diff(t).max()


@pytest.mark.parametrize("change", [1.0, 3.0, 0.2])
def test_memory_is_bounded(monkeypatch: pytest.MonkeyPatch, change: float) -> None:
    """More different steps than are kept: the median is exact, if need be by another pass."""
    monkeypatch.setattr(timing, "DISTINCT", 64)
    rng = np.random.default_rng(2)
    steps = 1e-3 + 1e-4 * rng.random(5001)
    steps[2000:] *= change
    t = np.cumsum(steps)
    found = counted(t, 100)
    assert len(found._steps) <= 64 + 100
    assert found.timing.step == median_step(t)
