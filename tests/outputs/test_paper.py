import re
from functools import partial
from pathlib import Path

import pytest

from vftcli.outputs.files import OutputFolder
from vftcli.outputs.paper import (
    Drawing,
    figure_files,
    sheet,
    shortened,
    write_figures,
)

matplotlib = pytest.importorskip("matplotlib", reason="no figure is drawn without matplotlib")


def drawn(width: float) -> object:
    figure, (axes,) = sheet(width, 1, 1, 1.0, {})
    axes.plot([0.0, 1.0], [-1.0, 1.0])
    axes.set_ylabel("costs $5 τ² (N·m)")
    return figure


def written(folder: Path, form: str) -> dict[str, bytes]:
    with OutputFolder(folder) as place:
        write_figures(place, {"a": Drawing("A $5 title", partial(drawn))}, form)
    return {path.name: path.read_bytes() for path in sorted((folder / "figures").iterdir())}


@pytest.mark.slow
@pytest.mark.parametrize("form", ["pdf", "svg", "png"])
def test_the_same_figure_has_the_same_bytes_whatever_its_user_prefers(
    form: str, tmp_path: Path
) -> None:
    first = written(tmp_path / "one", form)
    with matplotlib.rc_context({"font.size": 20.0, "font.family": "monospace"}):
        assert written(tmp_path / "two", form) == first
    assert list(first) == [f"a-double.{form}", f"a-single.{form}"]
    assert [f"figures/{name}" for name in sorted(first)] == sorted(figure_files(form, ["a"]))
    for content in first.values():
        assert b"CreationDate" not in content
        assert not re.search(rb"20\d\d-\d\d-\d\dT", content)


@pytest.mark.slow
def test_a_pdf_has_the_widths_of_the_ieee_and_its_fonts_embedded_as_truetype(
    tmp_path: Path,
) -> None:
    """3.5 in and 7.16 in are 252 and 515.52 points."""
    found = written(tmp_path, "pdf")
    for name, points in (("a-single.pdf", 252.0), ("a-double.pdf", 515.52)):
        box = re.search(rb"/MediaBox \[ 0 0 ([\d.]+) ", found[name])
        assert box is not None
        assert float(box[1]) == pytest.approx(points)
        fonts = re.findall(rb"/BaseFont /(\S+)", found[name])
        assert fonts
        assert all(font.partition(b"+")[2].startswith(b"STIXGeneral") for font in fonts)
        assert found[name].count(b"/FontFile2") >= 1
        assert b"/Type3" not in found[name]


@pytest.mark.slow
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


def test_no_files_without_a_form_and_names_beside_a_file() -> None:
    assert figure_files(None, ["a"]) == []
    assert figure_files("svg", ["a"], "arm-") == ["arm-a-single.svg", "arm-a-double.svg"]


def test_a_legend_takes_as_many_lines_as_it_needs() -> None:
    """Seven names of five letters are .625 in each: five a line of 3.5 in, so four and three."""
    names = {f"abcd{k}": matplotlib.lines.Line2D([], []) for k in range(7)}
    bare, _ = sheet(3.5, 1, 1, 1.0, {})
    assert bare.legends == []
    for width, columns, room in ((3.5, 4, 0.35), (7.16, 7, 0.2)):
        figure, _ = sheet(width, 1, 1, 1.0, names)
        assert figure.legends[0]._ncols == columns  # it has no public name
        assert figure.get_figheight() - bare.get_figheight() == pytest.approx(room)


def test_long_names_are_cut() -> None:
    assert shortened("a" * 44) == "a" * 44
    assert shortened("a" * 60) == "a" * 43 + "…"
