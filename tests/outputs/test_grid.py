import csv
import io
import json
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from unpacking import Page

from vftcli.outputs.grid import (
    Column,
    Grid,
    GridCell,
    at_least_shown,
    banded,
    csv_rows,
    escape_latex,
    joint_columns,
    latex,
    markdown,
    percent,
    signed,
    significant,
    terminal,
    vector,
)
from vftcli.outputs.page.shell import part
from vftcli.outputs.run_record import to_json
from vftcli.signals.parsing import counted

HOSTILE = '<b>&_%|*$#"\\{a}'


@pytest.fixture
def grid() -> Grid:
    """Two observers, two joints and a floor; the first number is at the floor and the best."""
    best = GridCell("0.550", best=True, mark="*", html="0.550<i>!</i>")
    return Grid(
        title="a_b.csv", quantity="RMSE", unit="N·m", summaries=1, marked=True, swatches=True,
        given=(Column("observer", words=True), *joint_columns(2)),
        rows=(("fdo", best, 12.346), (HOSTILE, 2.0, float("nan")), ("floor", 0.5, None)),
    )  # fmt: skip


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


def test_markdown_and_latex_escape_every_text_and_bold_the_best(grid: Grid) -> None:
    lines = markdown(grid).splitlines()
    assert lines[0] == r"**a\_b.csv, RMSE in N·m**"
    heads = ["| observer | J1 | J2 |", "| --- | ---: | ---: |"]
    assert lines[2:5] == [*heads, "| fdo | **0.550** | 12.3 |"]
    assert r"\<b\>&\_%\|\*$#" in lines[5]
    text = latex(grid)
    assert r"\caption{a\_b.csv, RMSE in N\,m}" in text
    assert r"\label{tab:a-b-csv}" in text
    assert r"fdo & \textbf{0.550}\rlap{$^{*}$} & 12.3 \\" in text
    assert r"\&\_\%" in text
    assert text.index("2.00") < text.rindex(r"\cmidrule") < text.index("floor")
    assert escape_latex("\\") == r"\textbackslash{}"
    assert r"\input" not in latex(Grid(title="a\n\\input{b}", given=(Column("c"),), rows=()))


def test_decimal_points_of_latex_stand_below_one_another() -> None:
    numbers = ("5.66", "12.3", "110", "−0.5", "< 6", "–", "1 N")
    grid = Grid(given=(Column("c"),), rows=tuple((text,) for text in numbers))
    body = latex(grid).split("\\midrule\n")[1].splitlines()[: len(numbers)]
    assert [line.removesuffix(r" \\") for line in body] == [
        "5.66", r"12.3\phantom{0}", r"110\phantom{.00}", r"$-$0.5\phantom{0}",
        r"$<$\,6\phantom{.00}", "--", "1 N",
    ]  # fmt: skip


def test_a_table_too_wide_for_a_column_takes_both(grid: Grid) -> None:
    """24 columns of five letters are 9.6 inches, two of them less than one."""
    wide = Grid(given=joint_columns(24), rows=(("1.234",) * 24,))
    assert r"\begin{table*}" in latex(wide)
    assert r"\begin{table}" in latex(grid)


def test_latex_takes_its_tables(grid: Grid, tmp_path: Path) -> None:
    """Compiled in two columns as wide as the IEEE's; nothing sticks out of one."""
    compiler = shutil.which("pdflatex")
    found = shutil.which("kpsewhich")
    if not compiler or not found or not run([found, "booktabs.sty"]).stdout:
        pytest.skip("no LaTeX with booktabs is installed: tables are not compiled")
    joints = replace(grid, given=(Column("observer", words=True), *joint_columns(7)))
    row = ("kfo-zoh", *(GridCell("12.34", best=True, mark="*"),) * 7)
    tables = [
        latex(grid, grid),
        latex(replace(joints, rows=(row,) * 3, notes=("† rests", "*: at the floor"))),
        latex(replace(grid, title="|F| of link 3 … link 4, 65 ± 7")),
        latex(replace(joints, title="α − ξ ≤ τ", rows=((*row[:-1], "1234567890123"),))),
    ]
    above = r"\documentclass[twocolumn]{article}\usepackage{booktabs}"
    above += r"\textwidth=7.16in\columnsep=.16in\begin{document}"
    text = "\n".join([above, *tables, r"\end{document}"])
    (tmp_path / "tables.tex").write_text(text, encoding="utf-8")
    run([compiler, "-interaction=nonstopmode", "-halt-on-error", "tables.tex"], tmp_path)
    log = (tmp_path / "tables.log").read_text(encoding="latin-1")
    assert (tmp_path / "tables.pdf").exists(), log[-2000:]
    assert "Overfull" not in log


def run(words: list[str], folder: Path | None = None) -> subprocess.CompletedProcess[bytes]:
    return subprocess.run(words, cwd=folder, capture_output=True, check=False, timeout=120)


def test_html_escapes_every_text_and_marks_best_floor_and_observers(grid: Grid) -> None:
    found = Page(part("parts/table", grid))
    assert "b" not in [tag for tag, _ in found.elements]
    assert HOSTILE in found.words
    assert ("td", {"class": "best"}) in found.elements
    assert ("tr", {"class": "floor"}) in found.elements
    swatches = [a["data-swatch"] for _, a in found.elements if "data-swatch" in a]
    assert swatches == ["fdo", HOSTILE]  # the floor is no observer
    assert found.text.startswith("a_b.csv, RMSE in N·m Observer")


def test_rows_for_machines_read_back() -> None:
    first, second = {"a": 1.5e-7, "b": "x,y", "c": True}, {"a": float("nan"), "c": np.False_}
    rows = [first, second | {"b": None}]
    assert json.loads(to_json(rows)) == [first, {"a": None, "b": None, "c": False}]
    read = list(csv.DictReader(io.StringIO(csv_rows(rows, ["a", "b", "c"]))))
    assert float(read[0].pop("a")) == 1.5e-7
    assert read == [{"b": "x,y", "c": "true"}, {"a": "", "b": "", "c": "false"}]


@pytest.mark.parametrize("first", ["=", "+", "-", "@", "\t", "\r"])
def test_a_name_that_a_spreadsheet_would_run_is_a_text_in_csv(first: str) -> None:
    """OWASP's list for "CSV Injection"; numbers stay numbers."""
    name = f"{first}cmd|' /C calc'!A0.csv"
    text = csv_rows([{"log": name, "value": -1.5, "at": "-"}], ["log", "value", "at"])
    (row,) = csv.DictReader(io.StringIO(text, newline=""))
    shown = name.replace("\r", r"\r")
    assert row == {"log": f"'{shown}", "value": "-1.5", "at": "'-"}


def test_a_table_without_room_leaves_out_what_is_seldom(monkeypatch: pytest.MonkeyPatch) -> None:
    time, work = Column("time to the peak", "m, rad", ".1f"), Column("work of all", "J", ".1f")
    columns = (Column("name", words=True), time, work._replace(seldom=True))
    grid = Grid(given=columns, rows=(("a", 1.0, 2.0), ("b", 10.0, 20.0)))
    texts = []
    for width in ("80", "31", "15"):
        monkeypatch.setenv("COLUMNS", width)
        texts.append(terminal(grid))
    wide, narrow, least = texts
    assert wide.splitlines()[0] == "name  time to the peak [m, rad]  work of all [J]"
    assert narrow.split()[-6:] == ["a", "1.0", "2.0", "b", "10.0", "20.0"]
    assert "[m, rad]" in narrow
    assert max(map(len, narrow.splitlines())) <= 31
    *_, row, left_out = least.splitlines()
    assert (row, left_out) == ("b         10.0", "A wider terminal also shows: work of all.")


def test_a_table_without_room_goes_on_below(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "19")
    grid = Grid(given=("name", *joint_columns(4)), rows=(("gmo", *["-1.25"] * 4),))
    assert [line.split() for line in terminal(grid, indent=2).splitlines()] == [
        ["name", "J1"], ["gmo", "-1.25"], [], ["name", "J2"], ["gmo", "-1.25"], [],
        ["name", "J3"], ["gmo", "-1.25"], [], ["name", "J4"], ["gmo", "-1.25"],
    ]  # fmt: skip
    assert terminal(grid).count("name") == 2  # 18 columns hold two joints
    # Colours have no width.
    health = GridCell("", mark="\x1b[32msound\x1b[0m")
    assert "health" in terminal(Grid(("name", Column("health", words=True)), [("gmo", health)]))


def test_a_table_has_rows_or_headings_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    columns = (Column("", words=True), Column("", form=".2f"))
    assert terminal(Grid(given=columns, rows=(("a", 1.0), ("b", 22)))) == "a  1.00\nb    22\n"
    grid = Grid(given=(Column("name", words=True), Column("", unit="")), rows=())
    monkeypatch.setenv("COLUMNS", "3")
    assert terminal(grid) == "name\n"


def test_numbers_have_their_digits_bands_and_a_true_minus() -> None:
    shown = {
        0.42649: "0.426", 12.346: "12.3", 1234.5: "1234", 0.0027812: "0.00278", 0.9996: "1.00",
        9.996: "10.0", 0.0: "0", -1.234: "-1.23", 1.5e-7: "1.50e-07", float("nan"): "–",
        float("inf"): "–",
    }  # fmt: skip
    assert {value: significant(value) for value in shown} == shown
    assert [signed(value) for value in shown] == [t.replace("-", "−") for t in shown.values()]
    shown = {0.00099: "0.1 %", 0.0004: "0.04 %", 0.123: "12.3 %", 2e-7: "<0.001 %", 0.0: "0 %"}
    assert {share: percent(share) for share in shown} == shown
    assert banded(65.2, 7.4) == "65 ± 7 N"
    assert banded(-36.894, 2.15, ".2f", "") == "−36.89 ± 2.15"
    assert vector([-0.04, 2.0, -3.14]) == "0.0, 2.0, −3.1"
    assert [counted(k, "contact") for k in (0, 1, 2)] == ["0 contacts", "1 contact", "2 contacts"]
    assert [at_least_shown(force) for force in (0.31, 0.97, 4.4)] == ["0.3 N", "1 N", "4 N"]
