from itertools import combinations
from typing import Any

import numpy as np
import pytest

from vftcli.outputs.charts import DASHES, INK, QUIET, REFERENCE, SPARE, Chart, ChartLine
from vftcli.outputs.paper import Plot, line_figure, paper_style, plots_of

pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")

T = np.linspace(0.0, 10.0, 4001)


def chart(**changed: Any) -> Chart:
    """Six panels: a reference below five lines in all dashes, the first with a ribbon."""
    values = np.sin(T[:, None] + np.arange(6))
    lines = [ChartLine("reference", values, REFERENCE), ChartLine("zero", 0.0 * values, INK)]
    for k, dash in enumerate(DASHES[:6]):
        half = np.full_like(values, 0.1) if k == 0 else None
        lines.append(ChartLine(f"line {k}", (1.0 + 0.1 * k) * values, SPARE[k], dash, half))
    panels = tuple(f"J{j}" for j in range(1, 7))
    made = Chart("tau", "Torque", ("N·m",) * 6, panels, T, tuple(lines[:1] + lines[2:]))
    return made._replace(**changed)


def drawn(width: float, *words: Any, **more: Any) -> Any:
    with paper_style():
        figure = line_figure(width, *words, **more)
        figure.draw_without_rendering()
    return figure


@pytest.mark.slow
@pytest.mark.parametrize(("width", "rows"), [(3.5, 3), (7.16, 2)])
def test_every_axis_has_its_unit_and_rows_share_one_below(width: float, rows: int) -> None:
    figure = drawn(width, plots_of(chart()))
    assert figure.get_size_inches()[0] == width
    columns = 6 // rows
    assert [axes.get_ylabel() for axes in figure.axes] == [f"J{j} (N·m)" for j in range(1, 7)]
    below = [axes.get_xlabel() for axes in figure.axes]
    assert below == [""] * (6 - columns) + ["Time (s)"] * columns


@pytest.mark.slow
def test_lines_are_told_apart_without_colour() -> None:
    """By dashes as they are drawn, or, solid both, by width and lightness."""
    from matplotlib.colors import to_rgb

    def lightness(line: Any) -> float:
        return float(np.dot((0.299, 0.587, 0.114), to_rgb(line.get_color())))

    (axes, *_) = drawn(7.16, plots_of(chart())).axes
    assert len(axes.lines) == 7
    for one, other in combinations(axes.lines, 2):
        if one._dash_pattern == other._dash_pattern:
            assert abs(lightness(one) - lightness(other)) > 0.1
            assert one.get_linewidth() != other.get_linewidth()


@pytest.mark.slow
def test_the_legend_names_a_ribbon_where_no_contact_is_listed() -> None:
    first = chart().series[1]
    quiet = chart(series=(first._replace(quiet=T < 5.0),))
    for made, names in ((quiet, ["line 0", "95 % band", QUIET]), (chart(series=(first,)), 2)):
        (legend,) = drawn(7.16, plots_of(made)).legends
        texts = [text.get_text() for text in legend.get_texts()]
        assert texts == (names if isinstance(names, list) else ["line 0", "95 % band"])


@pytest.mark.slow
def test_nothing_sticks_out_of_the_sheet_or_covers_another_plot() -> None:
    figure = drawn(3.5, plots_of(chart(spans=[(1.0, 2.0)], band=np.ones(6), band_label="± floor")))
    boxes = [axes.get_tightbbox() for axes in figure.axes] + [figure.legends[0].get_window_extent()]
    wide, high = figure.bbox.width, figure.bbox.height
    for box in boxes:
        assert box.x0 >= -1.0
        assert box.y0 >= -1.0
        assert box.x1 <= wide + 1.0
        assert box.y1 <= high + 1.0
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))


def test_spikes_stay_and_few_points_are_drawn() -> None:
    """500 stretches, two samples each, and the two ends."""
    values = np.zeros((len(T), 6))
    values[1234, 0] = 5.0
    made = chart(series=(ChartLine("a", values),))
    line = drawn(3.5, plots_of(made)).axes[0].lines[0]
    assert len(line.get_xdata()) <= 1002
    assert line.get_ydata().max() == 5.0


@pytest.mark.slow
def test_a_legend_names_lines_bands_and_contacts_but_no_line_alone() -> None:
    made = chart(spans=[(1.0, 2.0)], band=np.ones(6), band_label="± floor")
    (legend,) = drawn(7.16, plots_of(made)).legends
    named = [text.get_text() for text in legend.get_texts()]
    assert named[0] == "reference"
    assert named[-3:] == ["95 % band", "± floor", "contact"]
    assert not drawn(7.16, plots_of(chart(series=made.series[2:3]))).legends


@pytest.mark.slow
def test_contacts_are_numbered_above_the_first_row_where_there_is_room() -> None:
    figure = drawn(7.16, plots_of(chart()), numbers={1: 1.0, 2: 1.1, 3: 5.0})
    assert [[text.get_text() for text in axes.texts] for axes in figure.axes] == [
        ["1", "3"],
        ["1", "3"],
        ["1", "3"],
        [],
        [],
        [],
    ]


def test_frequencies_stand_on_a_logarithmic_axis_without_powers() -> None:
    figure = drawn(3.5, plots_of(chart(unit="Hz", log=True, x=T + 0.01), only=[0, 2]))
    assert [axes.get_ylabel() for axes in figure.axes] == ["J1 (N·m)", "J3 (N·m)"]
    axes = figure.axes[0]
    assert axes.get_xscale() == "log"
    assert axes.get_xlabel() == "Frequency (Hz)"
    shown = axes.xaxis.get_major_formatter()
    assert [shown(value) for value in (0.01, 1.0, 100.0)] == ["0.01", "1", "100"]


@pytest.mark.slow
def test_a_second_chart_has_its_axis_to_the_right_named_at_the_end_of_a_row() -> None:
    over = chart(title="|H|", units=("dB",) * 6)
    figure = drawn(7.16, plots_of(chart(), over))
    rights = figure.axes[6:]
    assert [axes.get_ylabel() for axes in rights] == ["", "", "|H| (dB)", "", "", "|H| (dB)"]


def test_marks_stand_where_they_are_told_each_shape_its_own() -> None:
    marks = {"a": (np.arange(6.0), np.zeros(6)), "b": (np.ones(6), np.zeros(6))}
    figure = drawn(7.16, [Plot(chart(), 0), Plot(chart(), 3)], marks=marks, below="Rate (Hz)")
    one, other = figure.axes[1].lines[-2:]
    assert list(one.get_xdata()) == [3.0]
    assert one.get_marker() != other.get_marker()
    assert figure.axes[0].get_xlabel() == "Rate (Hz)"
    assert [text.get_text() for text in figure.legends[0].get_texts()][-2:] == [
        "a, chosen",
        "b, chosen",
    ]


@pytest.mark.slow
def test_of_seven_joints_the_sixth_has_its_time_in_the_empty_place() -> None:
    """Rows stay as close as without it: the numbers below take no room of their own."""
    values = np.zeros((len(T), 7))
    names = tuple(f"J{j}" for j in range(1, 8))
    made = chart(series=(ChartLine("a", values),), units=("N·m",) * 7, panels=names)
    *plots, empty = drawn(3.5, plots_of(made)).axes
    assert [axes.get_xlabel() for axes in plots] == [""] * 6 + ["Time (s)"]
    assert [text.get_text() for text in empty.texts] == ["Time (s)"]
    assert empty.get_xlim() == plots[0].get_xlim()
    bottoms = [plots[k].get_position().y0 for k in (0, 2, 4, 6)]
    np.testing.assert_allclose(np.diff(bottoms), np.diff(bottoms).mean(), atol=0.01)
