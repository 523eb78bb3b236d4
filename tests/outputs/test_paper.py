import re
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from drawings import names_in

from vftcli.outputs import paper
from vftcli.outputs.charts import DASHES, INK, QUIET, REFERENCE, SPARE, Chart, ChartLine
from vftcli.outputs.files import OutputFolder

matplotlib = pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")


def drawn(width: float) -> object:
    figure, (axes,) = paper.sheet(width, 1, 1, 1.0)
    axes.plot([0.0, 1.0], [-1.0, 1.0])
    axes.set_ylabel("costs $5 τ² (N·m)")
    return figure


def written(folder: Path, form: str) -> dict[str, bytes]:
    with OutputFolder(folder) as place:
        paper.write_figures(place, {"a": paper.Drawing("A $5 title", partial(drawn))}, form)
    return {path.name: path.read_bytes() for path in sorted((folder / "figures").iterdir())}


@pytest.mark.slow
@pytest.mark.parametrize("form", ["pdf", "svg", "png"])
def test_a_figure_has_the_same_bytes_for_every_user(form: str, tmp_path: Path) -> None:
    first = written(tmp_path / "one", form)
    with matplotlib.rc_context({"font.size": 20.0, "font.family": "monospace"}):
        assert written(tmp_path / "two", form) == first
    assert list(first) == [f"a-double.{form}", f"a-single.{form}"]
    assert {f"figures/{name}" for name in first} == {*paper.figure_files(form, ["a"])}
    for content in first.values():
        assert b"CreationDate" not in content
        assert not re.search(rb"20\d\d-\d\d-\d\dT", content)


def test_a_pdf_has_the_ieee_s_widths_and_embeds_truetype(tmp_path: Path) -> None:
    """3.5 in and 7.16 in are 252 and 515.52 points."""
    found = written(tmp_path, "pdf")
    for name, points in (("a-single.pdf", 252.0), ("a-double.pdf", 515.52)):
        box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ", found[name])
        assert float(box[1]) == pytest.approx(points)
        fonts = re.findall(rb"/BaseFont /(\S+)", found[name])
        assert fonts
        assert all(font.partition(b"+")[2].startswith(b"STIXGeneral") for font in fonts)
        assert found[name].count(b"/FontFile2") >= 1
        assert b"/Type3" not in found[name]


def test_a_png_has_600_dots_an_inch_and_an_svg_needs_no_font(tmp_path: Path) -> None:
    """3.5 in at 600 dots are 2100; the width of a PNG is in bytes 16 to 19."""
    picture = written(tmp_path / "png", "png")["a-single.png"]
    assert int.from_bytes(picture[16:20], "big") == 2100
    text = written(tmp_path / "svg", "svg")["a-double.svg"].decode()
    assert 'width="515.52pt"' in text
    assert "<text" not in text
    assert "font-family" not in text


@pytest.mark.slow
def test_a_command_without_figures_loads_no_matplotlib(loaded) -> None:
    rooms = ("figures", "admittance", "identification", "report")
    modules = (f"vftcli.outputs.{room}" for room in rooms)
    assert "matplotlib" not in loaded(", ".join(("vftcli.cli.report", *modules)))


def test_files_have_their_names_and_long_names_are_cut() -> None:
    assert paper.figure_files(None, ["a"]) == []
    assert paper.figure_files("svg", ["a"], "arm-") == ["arm-a-single.svg", "arm-a-double.svg"]
    assert paper.shortened("a" * 44) == "a" * 44
    assert paper.shortened("a" * 60) == "a" * 43 + "…"


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


def drawn_lines(width: float, *words: Any, **more: Any) -> Any:
    with paper.paper_style():
        figure = paper.line_figure(width, *words, **more)
        figure.draw_without_rendering()
    return figure


@pytest.mark.parametrize(("width", "rows", "height"), [(3.5, 3, 3 * 0.95), (7.16, 2, 2 * 1.15)])
def test_axes_have_units_and_figures_heights(width: float, rows: int, height: float) -> None:
    values = np.zeros((len(T), 6))
    values[1234, 0] = 5.0
    made = paper.plots_of(chart(series=(ChartLine("a", values),)))
    figure = drawn_lines(width, made)
    line = figure.axes[0].lines[0]
    assert line.get_ydata().max() == 5.0  # a spike of one sample stays
    assert len(line.get_xdata()) <= 1002  # two of each of 500 stretches, and the two ends
    assert figure.get_size_inches() == pytest.approx([width, height + 0.22])
    assert [axes.get_ylabel() for axes in figure.axes] == [f"J{j} (N·m)" for j in range(1, 7)]
    below, columns = [axes.get_xlabel() for axes in figure.axes], 6 // rows
    assert below == [""] * (6 - columns) + ["Time (s)"] * columns
    numbered = drawn_lines(width, made, numbers={1: 1.0})
    assert numbered.get_figheight() == pytest.approx(height + 0.34)


def test_letters_and_lines_can_be_read_in_print() -> None:
    """Letters of 8 pt, 7 in legends and at ticks, 6.5 of numbers; no hair line, no bar."""
    made = chart(spans=[(1.0, 2.0)], band=np.ones(6), band_label="± floor")
    lines = drawn_lines(7.16, paper.plots_of(made), numbers={1: 1.0})
    assert [line.get_ydata()[0] for line in lines.axes[0].lines[-2:]] == [1.0, -1.0]  # the band
    for figure in (lines, drawn_dots([plot(), plot("b.csv")])):
        texts = [text for text in figure.findobj(matplotlib.text.Text) if text.get_text()]
        assert {text.get_fontsize() for text in texts} <= {6.5, 7.0, 8.0}
        for line in figure.findobj(matplotlib.lines.Line2D):
            if line.get_linestyle() != "None":
                assert 0.4 <= line.get_linewidth() <= 1.8
            if line.get_marker() not in {"None", "", None}:
                assert 0.3 <= line.get_markeredgewidth() <= 1.0
                assert 2.0 <= (line.get_markersize() or 2.0) <= 4.0  # a tick may have none
        for axes in figure.axes:
            assert all(spine.get_linewidth() == 0.5 for spine in axes.spines.values())
            for collection in axes.collections:
                filled = isinstance(collection, matplotlib.collections.PolyCollection)
                least, most = (0.0, 0.0) if filled else (0.5, 1.3)
                assert least <= collection.get_linewidth()[0] <= most
            assert all(patch.get_linewidth() == 0.0 for patch in axes.patches)


def test_lines_are_reported_apart_without_colour() -> None:
    """By dashes as they are drawn, or, solid both, by width and lightness."""
    from matplotlib.colors import to_rgb

    def lightness(line: Any) -> float:
        return float(np.dot((0.299, 0.587, 0.114), to_rgb(line.get_color())))

    (axes, *_) = drawn_lines(7.16, paper.plots_of(chart())).axes
    assert len(axes.lines) == 7
    for one, other in combinations(axes.lines, 2):
        if one._dash_pattern == other._dash_pattern:
            assert abs(lightness(one) - lightness(other)) > 0.1
            assert one.get_linewidth() != other.get_linewidth()


def test_a_legend_names_lines_bands_and_contacts_but_no_line_alone() -> None:
    first, *_ = lines = chart().series[1:]
    quiet = chart(series=(first._replace(quiet=T < 5.0),))
    assert names_in(drawn_lines(7.16, paper.plots_of(quiet))) == ["line 0", "95 % band", QUIET]
    alone = chart(series=(first,))
    assert names_in(drawn_lines(7.16, paper.plots_of(alone))) == ["line 0", "95 % band"]
    assert not drawn_lines(7.16, paper.plots_of(chart(series=lines[1:2]))).legends


def test_nothing_sticks_out_of_the_sheet_or_covers_another_plot() -> None:
    made = chart(spans=[(1.0, 2.0)], band=np.ones(6), band_label="± floor")
    figure = drawn_lines(3.5, paper.plots_of(made))
    names = names_in(figure)
    assert names[0] == "reference"
    assert names[-3:] == ["95 % band", "± floor", "contact"]
    boxes = [axes.get_tightbbox() for axes in figure.axes]
    boxes.append(figure.legends[0].get_window_extent())
    corners = np.array([box.extents for box in boxes])
    assert corners.min() >= -1.0
    assert (corners[:, 2:].max(axis=0) <= np.array(figure.bbox.size) + 1.0).all()
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))


def test_contacts_are_numbered_where_there_is_room() -> None:
    """10 s in 1.79 in: a digit takes .26 s, and what is between two .11 s, .37 s in all."""
    numbers = {1: 1.0, 2: 1.35, 3: 5.0, 4: 5.39}
    figure = drawn_lines(7.16, paper.plots_of(chart()), numbers=numbers)
    texts = [[text.get_text() for text in axes.texts] for axes in figure.axes[:6]]
    assert texts == [["1", "3", "4"]] * 3 + [[]] * 3


def test_of_seven_joints_the_last_of_each_column_has_the_time() -> None:
    values = np.zeros((len(T), 7))
    names = tuple(f"J{j}" for j in range(1, 8))
    made = chart(series=(ChartLine("a", values),), units=("N·m",) * 7, panels=names)
    *plots, empty = drawn_lines(3.5, paper.plots_of(made)).axes
    assert [axes.get_xlabel() for axes in plots] == [""] * 5 + ["Time (s)"] * 2
    assert not empty.axison
    bottoms = [plots[k].get_position().y0 for k in (0, 2, 4, 6)]  # rows stay as close
    np.testing.assert_allclose(np.diff(bottoms), np.diff(bottoms).mean(), atol=0.01)


LARGE, SMALL = np.array([5.0, 2.0]), np.array([0.4, np.nan])


def plot(title: str = "a.csv", joints: tuple[str, ...] = ("J1", "J2")) -> paper.DotPlot:
    """Two observers on two joints; the second's number on J2 is not known."""
    rows = [("gmo", LARGE, np.outer((0.9, 1.2), LARGE)), ("best", SMALL, None)]
    return paper.DotPlot(title, joints, rows, np.array([0.5, np.nan]))


def drawn_dots(plots: list[paper.DotPlot], width: float = 3.5) -> Any:
    paints = {"gmo": "#dd6415", "best": "#d3224b"}
    with paper.paper_style():
        figure = paper.dot_figure(width, plots, paints, "RMSE (N·m)")
        figure.draw_without_rendering()
    return figure


def test_dots_stand_side_by_side_with_their_intervals_and_the_floor() -> None:
    figure = drawn_dots([plot()])
    (axes,) = figure.axes
    assert figure.get_figheight() == pytest.approx(1.7 + 0.22 + 2 * 0.15 + 0.05)  # two of names
    assert axes.get_ylabel() == "RMSE (N·m)"
    assert axes.get_xlabel() == "Joint"
    assert [text.get_text() for text in axes.get_xticklabels()] == ["J1", "J2"]
    gmo, best = axes.containers
    # Two thirds of a joint's room, nearly, shared by two.
    assert gmo.lines[0].get_xdata() == pytest.approx([-0.165, 0.835])
    assert best.lines[0].get_xdata() == pytest.approx([0.165, 1.165])
    assert axes.get_xlim() == (-0.5, 1.5)
    ends = gmo.lines[2][0].get_segments()[0][:, 1]
    assert ends == pytest.approx([4.5, 6.0])
    assert axes.get_yscale() == "log"  # 5 is more than ten times .4
    assert names_in(figure) == ["gmo", "best", "floor of the reference"]
    # They are told apart without colour, too.
    assert gmo.lines[0].get_marker() != best.lines[0].get_marker()
    assert gmo.lines[0].get_markerfacecolor() != best.lines[0].get_markerfacecolor()


def test_numbers_of_one_size_stand_on_an_axis_from_zero() -> None:
    alone = plot()._replace(rows=[("gmo", LARGE, None)], floor=np.full(2, np.nan))
    (axes,) = drawn_dots([alone]).axes
    assert axes.get_yscale() == "linear"
    assert axes.get_ylim()[0] == 0.0
    for least, scale in ((0.51, "linear"), (0.49, "log"), (0.0, "linear")):
        (axes,) = drawn_dots([alone._replace(floor=np.full(2, least))]).axes
        assert axes.get_yscale() == scale


def test_several_logs_bear_their_names_and_a_dagger_its_meaning() -> None:
    figure = drawn_dots([plot(), plot("b.csv", ("J1", "J2†")), plot("c.csv")], 7.16)
    assert [axes.get_title() for axes in figure.axes[:3]] == ["a.csv", "b.csv", "c.csv"]
    assert figure.get_figheight() == pytest.approx(2 * 1.45 + 0.22 + 0.15 + 0.05)
    assert figure.axes[1].get_xlabel() == "Joint († rests: reference not to be trusted)"
    assert not figure.axes[3].axison
