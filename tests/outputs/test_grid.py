import csv
import io
import json
from html.parser import HTMLParser

import pytest

from vftcli.outputs.grid import (
    Column,
    Grid,
    GridCell,
    csv_rows,
    escape_latex,
    html,
    joint_columns,
    json_rows,
    latex,
    markdown,
    signed,
    significant,
    terminal,
)

HOSTILE = '<b>&_%|*$#"\\{a}'


@pytest.fixture
def grid() -> Grid:
    """Two observers, two joints and a floor; the first number is at the floor and the best."""
    return Grid(
        title="a_b.csv",
        quantity="RMSE",
        unit="N·m",
        columns=(Column("observer", words=True), *joint_columns(2)),
        rows=(
            ("fdo", GridCell("0.550", best=True, mark="*", html="0.550<i>!</i>"), 12.346),
            (HOSTILE, 2.0, float("nan")),
            ("floor", 0.5, None),
        ),
        summaries=1,
        marked=True,
        swatches=True,
    )


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.42649, "0.426"),
        (12.346, "12.3"),
        (1234.5, "1234"),
        (0.0027812, "0.00278"),
        (0.9996, "1.00"),
        (9.996, "10.0"),
        (0.0, "0"),
        (-1.234, "-1.23"),
        (1.5e-7, "1.50e-07"),
        (float("nan"), "–"),
        (float("inf"), "–"),
    ],
)
def test_three_significant_digits(value: float, text: str) -> None:
    assert significant(value) == text
    assert signed(value) == text.replace("-", "−")


def test_the_terminal_keeps_digits_below_digits(grid: Grid) -> None:
    width = len(HOSTILE)
    assert terminal(grid).splitlines() == [
        "a_b.csv, RMSE in N·m",
        f"{'observer':<{width}}     J1     J2",
        f"{'fdo':<{width}}  0.550*  12.3",
        f"{HOSTILE}   2.00      –",
        "-" * (width + 14),
        f"{'floor':<{width}}  0.500      –",
    ]


def test_a_table_without_headings_has_no_line_for_them() -> None:
    columns = (Column("", words=True, width=4), Column("", form=".2f", width=6))
    assert terminal(Grid(columns=columns, rows=(("a", 1.0), ("b", 22)))) == (
        "a       1.00\nb         22\n"
    )


def test_units_stand_behind_headings_and_below_them_in_latex() -> None:
    grid = Grid(columns=(Column("who", words=True), Column("fx", "N·m")), rows=(("a", 1.0),))
    assert terminal(grid).startswith("who  fx [N·m]\n")
    assert latex(grid).splitlines()[2:4] == [r"Who & fx \\", r" & [N\,m] \\"]


def test_markdown_escapes_every_text_and_bolds_the_best(grid: Grid) -> None:
    lines = markdown(grid).splitlines()
    assert lines[0] == r"**a\_b.csv, RMSE in N·m**"
    assert lines[2:5] == [
        "| observer | J1 | J2 |",
        "| --- | ---: | ---: |",
        "| fdo | **0.550** | 12.3 |",
    ]
    assert r"\<b\>&\_%\|\*$#" in lines[5]


def test_latex_escapes_every_text_and_bolds_the_best(grid: Grid) -> None:
    text = latex(grid)
    assert text.splitlines()[0] == "% a_b.csv, RMSE"
    assert r" & \multicolumn{2}{c}{RMSE [N\,m]} \\" in text
    assert r"fdo & \textbf{0.550} & 12.3 \\" in text
    assert r"\&\_\%" in text
    assert text.index(r"2.00 & -- \\") < text.rindex(r"\midrule") < text.index("floor")


def test_a_bound_is_one_number_in_latex() -> None:
    assert escape_latex("< 6") == r"$<$\,6"
    assert escape_latex("\\") == r"\textbackslash{}"


def test_comments_of_latex_stay_on_their_line() -> None:
    grid = Grid(title="a\n\\input{b}", columns=(Column("c"),), rows=())
    assert "\n\\input" not in latex(grid)


class Cells(HTMLParser):
    """Collects a table's elements with their attributes, and its words."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.words: list[str] = []
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        self.words.append(data)


def test_html_escapes_every_text_and_marks_best_floor_and_observers(grid: Grid) -> None:
    found = Cells(html(grid))
    assert "b" not in [tag for tag, _ in found.elements]
    assert HOSTILE in found.words
    assert ("td", {"class": "best"}) in found.elements
    assert ("tr", {"class": "floor"}) in found.elements
    swatches = [a["data-swatch"] for _, a in found.elements if "data-swatch" in a]
    assert swatches == ["fdo", HOSTILE]  # the floor is no observer
    assert found.words[0] == "a_b.csv, RMSE in N·m"
    assert "Observer" in found.words


def test_rows_for_machines_read_back() -> None:
    rows = [{"a": 1.5e-7, "b": "x,y", "c": True}, {"a": float("nan"), "b": None, "c": False}]
    assert json.loads(json_rows(rows)) == [
        {"a": 1.5e-7, "b": "x,y", "c": True},
        {"a": None, "b": None, "c": False},
    ]
    read = list(csv.DictReader(io.StringIO(csv_rows(rows, ["a", "b", "c"]))))
    assert float(read[0]["a"]) == 1.5e-7
    assert read[0] | {"a": ""} == {"a": "", "b": "x,y", "c": "true"}
    assert read[1] == {"a": "", "b": "", "c": "false"}
