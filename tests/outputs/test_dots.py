from typing import Any

import numpy as np
import pytest

from vftcli.outputs.paper import DotPlot, dot_figure, paper_style

pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")

LARGE, SMALL = np.array([5.0, 2.0]), np.array([0.4, np.nan])


def plot(title: str = "a.csv", joints: tuple[str, ...] = ("J1", "J2")) -> DotPlot:
    """Two observers on two joints; the second's number on J2 is not known."""
    rows = [("gmo", LARGE, np.outer((0.9, 1.2), LARGE)), ("best", SMALL, None)]
    return DotPlot(title, joints, rows, np.array([0.5, np.nan]))


def drawn(plots: list[DotPlot], width: float = 3.5) -> Any:
    paints = {"gmo": "#dd6415", "best": "#d3224b"}
    with paper_style():
        figure = dot_figure(width, plots, paints, "RMSE (N·m)")
        figure.draw_without_rendering()
    return figure


def test_dots_stand_side_by_side_with_their_intervals_and_the_floor() -> None:
    figure = drawn([plot()])
    (axes,) = figure.axes
    assert axes.get_ylabel() == "RMSE (N·m)"
    assert axes.get_xlabel() == "Joint"
    assert [text.get_text() for text in axes.get_xticklabels()] == ["J1", "J2"]
    gmo, best = axes.containers
    assert gmo.lines[0].get_xdata()[0] < 0.0 < best.lines[0].get_xdata()[0]
    ends = gmo.lines[2][0].get_segments()[0][:, 1]
    assert ends == pytest.approx([4.5, 6.0])
    assert axes.get_yscale() == "log"  # 5 is more than ten times .4
    named = [text.get_text() for text in figure.legends[0].get_texts()]
    assert named == ["gmo", "best", "floor of the reference"]


def test_observers_are_told_apart_without_colour() -> None:
    gmo, best = drawn([plot()]).axes[0].containers
    assert gmo.lines[0].get_marker() != best.lines[0].get_marker()
    assert gmo.lines[0].get_markerfacecolor() != best.lines[0].get_markerfacecolor()


def test_numbers_of_one_size_stand_on_an_axis_from_zero() -> None:
    alone = plot()._replace(rows=[("gmo", LARGE, None)], floor=np.full(2, np.nan))
    (axes,) = drawn([alone]).axes
    assert axes.get_yscale() == "linear"
    assert axes.get_ylim()[0] == 0.0


def test_several_logs_bear_their_names_and_a_dagger_its_meaning() -> None:
    figure = drawn([plot(), plot("b.csv", ("J1", "J2†")), plot("c.csv")], 7.16)
    assert [axes.get_title() for axes in figure.axes[:3]] == ["a.csv", "b.csv", "c.csv"]
    assert figure.axes[1].get_xlabel() == "Joint († rests: reference not to be trusted)"
    assert not figure.axes[3].axison
