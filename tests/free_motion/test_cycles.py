"""The cycles of a repeated motion: numbers, spans, and how many are whole."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from vftcli.free_motion.cycles import Cycles, Period, distances, segment, valleys
from vftcli.signals.errors import ReferenceTorqueError
from vftcli.signals.recording import Recording

CYCLES = Cycles(period=4.0, begin=1.0, end=13.0)


def test_numbers_and_spans_belong_together() -> None:
    assert CYCLES.whole == 3
    number = CYCLES.number(np.array([0.99, 1.0, 4.99, 5.0, 12.99, 13.01]))
    assert number.tolist() == [-1, 0, 0, 1, 2, -1]
    for cycle in range(3):
        first, last = CYCLES.span(cycle)
        inside = np.linspace(first, last, 50)[1:-1]
        assert np.all(CYCLES.number(inside) == cycle)


def test_a_last_cycle_that_lacks_a_few_samples_is_whole() -> None:
    almost = CYCLES._replace(end=1.0 + 4.0 * (2.971))
    assert almost.whole == 3
    assert almost.span(2) == (9.0, almost.end)
    assert CYCLES._replace(end=1.0 + 4.0 * (2.969)).whole == 2
    assert CYCLES._replace(end=0.0).whole == 0


def test_less_than_a_cycle_and_a_part_of_the_next(repeated: Callable[..., Recording]) -> None:
    log = repeated(cycles=0.8)
    said = "only 2.96 s of the motion repeat, less than the period of 3.7 s; give a free run"
    with pytest.raises(ReferenceTorqueError, match=said):
        segment(replace(log, t=log.t + 10.0), Period(3.7, 0.0))


def test_distances_and_their_valleys() -> None:
    """A sine of 20.25 samples: the parabola through three samples knows its valley to .01."""
    x = np.sin(2.0 * np.pi * np.arange(200)[:, None] / 20.25) * [1.0, 0.5] + [3.0, -1.0]
    found = distances(x)
    brute = [np.mean(np.sum((x[lag:] - x[: 200 - lag]) ** 2, axis=1)) for lag in range(200)]
    np.testing.assert_allclose(found, brute, atol=1e-9)
    np.testing.assert_allclose(valleys(found, 0.01, None), 20.25 * np.arange(1, 9), atol=0.02)
    np.testing.assert_allclose(valleys(found, 0.01, 0.4), [40.5], atol=0.02)
    assert valleys(np.arange(200.0), 0.01, None) == []
    # Without a valley within 3 % of .3 s, 29 to 31 samples: the deepest place of its slope.
    assert valleys(found, 0.01, 0.3) == [pytest.approx(np.argmin(found[29:32]) + 29, abs=0.5)]
