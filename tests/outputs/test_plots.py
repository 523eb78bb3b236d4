import numpy as np
import pytest

from vftcli.outputs.plots import Lines, PlotLine


def lines(values: np.ndarray) -> Lines:
    return Lines("/a", "what [N]", [PlotLine("line", column, "#102030") for column in values.T])


def test_the_axis_shows_all_lines_with_room() -> None:
    low, high = lines(np.array([[1.0, -3.0], [2.0, np.nan]])).ends
    assert (low, high) == pytest.approx((-3.25, 2.25))  # a twentieth of 5 on either side
    empty = lines(np.full((3, 1), np.nan)).ends
    assert empty[0] < empty[1]
    flat = lines(np.ones((3, 1))).ends
    assert flat[0] < 1.0 < flat[1]
