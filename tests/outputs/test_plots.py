import numpy as np
import pytest

from vftcli.outputs.plots import Lines, PlotLine, PlotPoints, Tab


def lines(values: np.ndarray) -> Lines:
    return Lines("/a", "what [N]", [PlotLine("line", column, "#102030") for column in values.T])


def test_the_axis_shows_all_lines_with_room() -> None:
    low, high = lines(np.array([[1.0, -3.0], [2.0, np.nan]])).ends
    assert (low, high) == pytest.approx((-3.25, 2.25))  # a twentieth of 5 on either side
    empty = lines(np.full((3, 1), np.nan)).ends
    assert empty[0] < empty[1]
    flat = lines(np.ones((3, 1))).ends
    assert flat[0] < 1.0 < flat[1]


def test_plots_of_a_family_have_one_axis() -> None:
    small, large = lines(np.ones((3, 1))), lines(np.array([[0.0], [10.0], [5.0]]))
    family = [plot._replace(family="shoulder") for plot in (small, large)]
    tab = Tab("torques", np.arange(3.0), [*family, small])
    assert tab.ends(family[0]) == tab.ends(family[1]) == pytest.approx((-0.5, 10.5))
    assert tab.ends(small) == small.ends


def test_points_are_seen_too() -> None:
    points = PlotPoints("peaks", np.array([1.0]), np.array([20.0]), "#102030")
    assert lines(np.zeros((3, 1)))._replace(points=points).ends == pytest.approx((-1.0, 21.0))
