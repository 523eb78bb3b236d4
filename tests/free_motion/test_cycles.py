"""The cycles of a repeated motion: numbers, spans, and how many are whole."""

from collections.abc import Callable

import numpy as np
import pytest

from vftcli.free_motion.cycles import Cycles, Period, segment
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
    with pytest.raises(ReferenceTorqueError, match="give a free run of the same motion"):
        segment(log, Period(3.7, 0.0))
