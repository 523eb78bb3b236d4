"""Words of the command line: spans and lists of numbers."""

import numpy as np
import pytest

from vftcli.signals.errors import ParameterError
from vftcli.signals.parsing import interval, numbers


@pytest.mark.parametrize(
    ("text", "span"),
    [("1:2", (1.0, 2.0)), (":2", (-np.inf, 2.0)), ("1:", (1.0, np.inf)), (":", (-np.inf, np.inf))],
)
def test_intervals(text: str, span: tuple[float, float]) -> None:
    assert interval(text) == span


@pytest.mark.parametrize("text", ["2", "2:1", "a:b", "1:1", "1:b", "1:2:3"])
def test_intervals_that_are_none(text: str) -> None:
    with pytest.raises(ParameterError, match="A:B with A < B"):
        interval(text)


def test_numbers_or_none() -> None:
    assert numbers("1,-2.5, 3e-1") == (1.0, -2.5, 0.3)
    assert numbers("1,,2") is None
    assert numbers("tool") is None
