"""Block maxima, events and the exponential tail, against loops and exponential noise.

The largest of ten exponential readings a second, of mean 1, passes x at 3600 (1 − (1 − e^−x)^10)
per hour, for a large x at 36 000 e^−x: the level of a rate r is ln(36 000/r).
"""

import numpy as np
import pytest

from vftcli.contacts.thresholds import BLOCK, SETTLING, block_maxima, events, tail_of
from vftcli.signals.errors import ParameterError


def test_the_interval_holds_the_analytic_level_as_often_as_it_says():
    """300 quarters of an hour (k = 30): .95 ± .025 by count, less what u's own error takes."""
    rng, held = np.random.default_rng(2), 0
    for _ in range(300):
        # The largest of ten readings in every block: the inverse of (1 − e^−x)^10.
        tail = tail_of(-np.log1p(-(rng.uniform(size=900) ** 0.1)))
        _, (low, high) = tail.threshold(1.0)
        held += low <= np.log(36_000.0) <= high
    assert 0.88 <= held / 300 <= 0.99


def test_few_maxima_tell_a_fifth_of_them_and_four_tell_nothing():
    assert tail_of(np.arange(4.0)) is None
    tail = tail_of(np.arange(60.0))
    # The twelve largest of 0 … 59 lie 1 … 12 beyond the next, 47.
    assert (tail.size, tail.start, tail.excess) == (12, 47.0, 6.5)


def test_the_lower_end_of_one_maximum_is_the_level_it_lies_beyond():
    tail = tail_of(np.array([1.0, 1.0, 2.0, 3.0, 5.0]))
    assert tail.size == 1
    value, (low, high) = tail.threshold(tail.rate / np.e)
    # One e-fold beyond u = 3 with e = 2, and 1.96 times that as half the interval.
    assert (value, low) == (5.0, 3.0)
    assert high == pytest.approx(5.0 + 1.96 * 2.0, rel=1e-12)


def test_what_happens_more_often_than_the_tail_is_read_off_the_maxima():
    """Of 3600 maxima 0 … 3599 the level 100 an hour is the hundredth largest, 3500."""
    tail = tail_of(np.arange(3600.0))
    with pytest.raises(ParameterError, match="at most 1800"):
        tail.threshold(2000.0)
    value, (low, high) = tail.threshold(100.0)
    assert value == 3500.0
    # 100 ± 1.96 √100 = 119.6 and 80.4 of them lie above the ends.
    assert (low, high) == (3480.0, 3520.0)
    few = tail_of(np.array([1.0, 1.0, 2.0, 3.0, 5.0]))
    # Of 2 the ends are 2 + 1.96 √2 = 4.8, hence 5, and the largest at the most.
    assert few.threshold(2.0 / few.hours) == (3.0, (1.0, 5.0))


def test_block_maxima_are_those_of_a_loop():
    """A jittering clock of 50 Hz with a gap of 3 s and a stretch that is not known."""
    rng = np.random.default_rng(3)
    t = np.cumsum(rng.uniform(0.015, 0.025, 1000))
    t[600:] += 3.0
    level = rng.exponential(size=1000)
    level[300:420] = np.nan
    start = t[t >= t[0] + SETTLING][0]
    expected = []
    for block in range(int((t[-1] - start) / BLOCK) + 1):
        inside = (t >= start + block * BLOCK) & (t < start + (block + 1) * BLOCK)
        known = level[inside][np.isfinite(level[inside])]
        if len(known) * np.median(np.diff(t[t >= start])) >= 0.5 * BLOCK:
            expected.append(known.max())
    np.testing.assert_array_equal(block_maxima(t, level), expected)
    assert len(block_maxima(t[:60], level[:60])) == 0  # it ends while it settles


def test_passages_less_than_half_a_second_apart_are_one_event():
    t = np.arange(0.0, 10.0, 0.1)
    level = np.zeros(100)
    # At 1 s it still settles; 4.0 and 4.4 s are one, 5.0 s is another; what is not known is none.
    level[[10, 40, 44, 50]] = [9.0, 2.0, 3.0, 1.5]
    level[80] = np.nan
    found = events(t, level)
    assert [(round(e.start, 6), round(e.stop, 6)) for e in found] == [(4.0, 4.4), (5.0, 5.0)]
