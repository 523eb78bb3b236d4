"""Grid: a table for terminal, Markdown, LaTeX and HTML; numbers as text.

This file and the pages' templates decide on looks and on escapes: names from files may
hold any letter. `csv_rows` writes numbers that are not rounded.
"""

import csv
import io
import re
import shutil
import textwrap
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import takewhile
from typing import Any, NamedTuple

import numpy as np

from vftcli.outputs import Record
from vftcli.signals.parsing import COLOUR, printable

DASH = "–"  #: Sign for an unknown number.


def significant(value: float, digits: int = 3) -> str:
    """A number in significant digits, an exponent below 1e-4."""
    if not np.isfinite(value):
        return DASH
    if value == 0.0:
        return "0"
    # Rounded first: 9.996 is 10.0.
    exponent = int(np.floor(np.log10(abs(float(f"{value:.{digits - 1}e}")))))
    if exponent < -4:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{max(digits - 1 - exponent, 0)}f}"


def minus(text: str) -> str:
    """A number's text with a true minus sign."""
    return text.replace("-", "−")


def signed(value: float) -> str:
    """Three significant digits with a true minus sign."""
    return minus(significant(value))


def banded(value: float | None, band: float | None, form: str = ".0f", unit: str = " N") -> str:
    """A value with the half width of its 95 % band."""
    return f"{minus(format(value, form))} ± {band:{form}}{unit}"


def at_least_shown(force: float) -> str:
    """The least force that shows, never rounded down to none. [N]"""
    return f"{force:.0f} N" if force >= 0.95 else f"{force:.1g} N"


def ranged(low: float, high: float, unit: str = " N") -> str:
    """The smallest and the largest of some forces. [N]"""
    return f"{low:.0f}–{high:.0f}{unit}"


def vector(values: Iterable[float]) -> str:
    """Numbers with one decimal, without a negative zero."""
    return ", ".join(minus(f"{x + 0.0:.1f}") for x in np.round(list(values), 1))


def percent(share: float) -> str:
    """A share in per cent: one decimal, or one significant digit."""
    value = 100.0 * share
    if 0.0 < value < 0.001:
        return "<0.001 %"
    return f"{value:.1f} %" if value >= 0.095 else f"{value:.1g} %"


#: A number or a bound, and its decimals with their point.
NUMBER = re.compile(r"(?:< )?[-−]?\d+(\.\d+)?")
#: Unseen filler for missing decimals.
DECIMALS = "." + 20 * "0"
#: Width of a column of the IEEE, a letter and a gap. [in]
COLUMN_WIDTH, LETTER_WIDTH, COLUMN_GAP = 3.5, 0.058, 0.111


class GridCell(NamedTuple):
    """An entry with emphasis, or with another text on the page."""

    text: str
    #: Whether it is the best of its column: bold.
    best: bool = False
    mark: str = ""  #: Mark behind it on the terminal, as a star.
    #: The page's text instead of `text`, escaped already; "" for none.
    html: str = ""


Entry = GridCell | str | float | None
Rows = list[Sequence[Entry]]  #: Rows of a table while it is filled.


class Column(NamedTuple):
    """One column."""

    head: str
    #: Unit, in brackets behind the heading; "" if the heading says it.
    unit: str = ""
    #: Format of a float as ``.3f``, or a function.
    form: str | Callable[[float], str] = significant
    #: Whether it holds words, aligned left; numbers are right.
    words: bool = False
    symbol: str = ""  #: The heading in LaTeX where it is a formula.
    seldom: bool = False  #: Whether a narrow terminal may leave it out.

    @property
    def heading(self) -> str:
        """The heading with its unit."""
        return f"{self.head} [{self.unit}]" if self.unit else self.head

    def cell(self, entry: Entry) -> GridCell:
        """An entry as text; a dash if unknown."""
        if isinstance(entry, GridCell):
            return entry
        if entry is None or (isinstance(entry, float) and not np.isfinite(entry)):
            return GridCell(DASH)
        if isinstance(entry, bool | np.bool):
            return GridCell("yes" if entry else "no")
        if isinstance(entry, float):
            form = self.form
            return GridCell(minus(format(entry, form)) if isinstance(form, str) else form(entry))
        return GridCell(str(entry))


@dataclass(frozen=True)
class Grid:
    """A table."""

    given: Sequence[Any]  #: The columns; a text alone heads a column of words.
    rows: Sequence[Sequence[Entry]]  #: One entry a column.
    title: str = ""
    quantity: str = ""  #: Quantity of all numbers, as RMSE, if one.
    unit: str = ""  #: Their unit, if one.
    summaries: int = 0  #: Last rows that sum up the others, below a rule.
    #: Whether the terminal keeps a place for marks on numbers.
    marked: bool = False
    notes: tuple[str, ...] = ()  #: Lines on what the marks mean, footnotes in LaTeX.
    #: Whether the page shows the colour of a row's observer.
    swatches: bool = False

    @cached_property
    def columns(self) -> list[Column]:
        """Every column."""
        return [Column(c, words=True) if isinstance(c, str) else c for c in self.given]

    @property
    def caption(self) -> str:
        """The title with the quantity, "" without both."""
        quantity = f"{self.quantity} in {self.unit}" if self.unit else self.quantity
        return printable(", ".join(text for text in (self.title, quantity) if text))

    @property
    def cells(self) -> list[list[GridCell]]:
        """Every entry as text, row by row."""
        rows = [[c.cell(x) for c, x in zip(self.columns, row, strict=True)] for row in self.rows]
        # A name from a file may hold line ends or control codes.
        return [[cell._replace(text=printable(cell.text)) for cell in row] for row in rows]


def keyed_grid(
    columns: Mapping[str, Any], rows: Iterable[Record], title: str = "", *, swatches: bool = False
) -> Grid:
    """A table of rows, with the values of these keys as columns."""
    entries = [[*map(row.get, columns)] for row in rows]
    return Grid([*columns.values()], entries, title, swatches=swatches)


def joint_columns(joints: Sequence[int] | int, **shape: Any) -> tuple[Column, ...]:  # noqa: ANN401
    """Columns J1, J2, …: of joints by number, or of so many."""
    numbers = range(1, joints + 1) if isinstance(joints, int) else joints
    return tuple(Column(f"J{j}", symbol=f"$J_{{{j}}}$", **shape) for j in numbers)


def terminal(grid: Grid, letters: Callable[[str], str] = str, indent: int = 0) -> str:
    """A table as text, two blanks between columns, each line ended.

    A table wider than the terminal breaks its headings, then leaves out `seldom` columns and
    names them below; what is still too wide goes on below, beside its first words.
    """
    width, columns = shutil.get_terminal_size().columns - indent, grid.columns
    lines, left_out = table_lines(grid, letters), list[str]()

    def fits(lines: list[str]) -> bool:
        return all(len(COLOUR.sub("", line)) <= width for line in lines)

    if not fits(lines):
        shown = list[int]()
        for k in sorted(range(len(columns)), key=lambda k: columns[k].seldom):
            more = sorted([*shown, k])
            if columns[k].seldom and not fits(table_lines(grid, letters, more)):
                left_out.append(columns[k].head)
            else:
                shown = more
        words = [*takewhile(lambda k: columns[k].words, shown)]
        parts = [[*words]]
        for k in shown[len(words) :]:
            if parts[-1] != words and not fits(table_lines(grid, letters, [*parts[-1], k])):
                parts.append([*words])
            parts[-1].append(k)
        lines = [line for part in parts for line in ("", *table_lines(grid, letters, part))][1:]
    above = [grid.caption] if grid.caption else []
    below = [f"A wider terminal also shows: {', '.join(left_out)}."] if left_out else []
    return "".join(f"{line}\n" for line in (*above, *lines, *below))


def table_lines(
    grid: Grid, letters: Callable[[str], str], shown: Sequence[int] | None = None
) -> list[str]:
    """Lines of headings and rows; of some columns, headings wrap."""
    columns, cells = list[list[str]](), grid.cells
    every = range(len(grid.columns)) if shown is None else shown
    for k in every:
        column = grid.columns[k]
        # Numbers without a mark keep its place.
        room = " " * (grid.marked and not column.words)
        texts = [letters(row[k].text) + (row[k].mark or room) for row in cells]
        heads = [letters(column.heading)]
        if shown is not None:
            # The unit does not break: its blanks are hidden from textwrap.
            unit = column.unit.replace(" ", "\N{NO-BREAK SPACE}")
            head = letters(column._replace(unit=unit).heading)
            least = max(1, *map(len, [*head.split(" "), *texts]))
            heads = [h.replace("\N{NO-BREAK SPACE}", " ") for h in textwrap.wrap(head, least)]
        columns.append([*(head + room for head in heads), *texts])
    height = max(map(len, columns), default=0)
    for i, (k, texts) in enumerate(zip(every, columns, strict=True)):
        full = [""] * (height - len(texts)) + texts
        put = str.ljust if grid.columns[k].words else str.rjust
        columns[i] = [put(text, max(map(len, full))) for text in full]
    lines = ["  ".join(texts).rstrip() for texts in zip(*columns, strict=True)]
    heads = lines[: len(lines) - len(cells)]
    lines = lines if any(heads) else lines[len(heads) :]
    if grid.summaries:
        lines.insert(-grid.summaries, "-" * len(lines[0]))
    return lines


def markdown(grid: Grid) -> str:
    """A table in Markdown, its title above, the best bold."""
    heads = [escape_markdown(column.heading) for column in grid.columns]
    marks = ["---" if column.words else "---:" for column in grid.columns]
    texts = [[(escape_markdown(c.text), c.best) for c in row] for row in grid.cells]
    body = [[f"**{text}**" if best else text for text, best in row] for row in texts]
    lines = [f"| {' | '.join(texts)} |" for texts in (heads, marks, *body)]
    above = [f"**{escape_markdown(grid.caption)}**", ""] if grid.caption else []
    return "".join(f"{line}\n" for line in (*above, *lines))


def latex(*grids: Grid) -> str:
    r"""Tables of equal columns as one ``table`` or ``table*`` of the package booktabs.

    Each of several grids has its title above its rows.
    """
    first = grids[0]
    caption = (replace(first, title="") if len(grids) > 1 else first).caption or first.title
    rows = [row for grid in grids for row in grid.cells]
    texts = list(zip(*(latex_cells(texts) for texts in zip(*rows, strict=True)), strict=True))
    # About how wide it is in footnotes' type.
    letters_across = sum(
        max([0 if c.symbol else len(c.head), *(len(row[k].text) for row in rows)])
        for k, c in enumerate(first.columns)
    )
    width = LETTER_WIDTH * letters_across + COLUMN_GAP * len(first.columns)
    place = "table*" if width > COLUMN_WIDTH else "table"
    spec = "".join("l" if column.words else "r" for column in first.columns)
    parts = [rf"\begin{{{place}}}[tb]", r"\centering", rf"\caption{{{escape_latex(caption)}}}"]
    letters = re.sub("[^a-z0-9]+", "-", (first.title or caption).lower())[:40].strip("-")
    parts += [rf"\label{{tab:{letters or 'results'}}}", r"\footnotesize"]
    parts += [r"\setlength{\tabcolsep}{4pt}", rf"\begin{{tabular}}{{{spec}}}", r"\toprule"]
    heads = [column.symbol or escape_latex(column.head) for column in first.columns]
    heads[0] = heads[0][:1].upper() + heads[0][1:]
    units = [f"[{escape_latex(column.unit)}]" if column.unit else "" for column in first.columns]
    for line in filter(any, (heads, units)):
        shown = (
            text if column.words or not text else rf"\multicolumn{{1}}{{c}}{{{text}}}"
            for text, column in zip(line, first.columns, strict=True)
        )
        parts.append(rf"{' & '.join(shown)} \\")
    for grid in grids:
        count = len(grid.rows)
        lines, texts = [rf"{' & '.join(row)} \\" for row in texts[:count]], texts[count:]
        if grid.summaries:
            lines.insert(-grid.summaries, rf"\cmidrule{{1-{len(spec)}}}")
        parts.append(r"\midrule")
        if len(grids) > 1:
            title = rf"\textit{{{escape_latex(grid.title)}}}"
            parts.append(rf"\multicolumn{{{len(spec)}}}{{l}}{{{title}}} \\")
        parts += lines
    parts += [r"\bottomrule", r"\end{tabular}"]
    notes = [
        escape_latex(note) for note in dict.fromkeys(n for grid in grids for n in grid.notes)
    ]
    if notes:
        below = r" \\ ".join(notes)
        parts.append(rf"\\[2pt] \parbox{{\linewidth}}{{\footnotesize {below}}}")
    parts.append(rf"\end{{{place}}}")
    return "".join(f"{line}\n" for line in parts)


def latex_cells(column: Sequence[GridCell]) -> list[str]:
    """The entries of a column, numbers with room for decimals."""
    numbers = [NUMBER.fullmatch(cell.text) for cell in column]
    most = max((len(found[1] or "") for found in numbers if found), default=0)
    texts = []
    for cell, found in zip(column, numbers, strict=True):
        text = escape_latex(cell.text)
        text = rf"\textbf{{{text}}}" if cell.best else text
        text += rf"\rlap{{$^{{{cell.mark}}}$}}" if cell.mark else ""
        # The point counts among the decimals.
        missing = DECIMALS[len(found[1] or "") : most] if found else ""
        texts.append(text + (rf"\phantom{{{missing}}}" if missing else ""))
    return texts


def escape_markdown(text: str) -> str:
    """Text that Markdown shows as it is."""
    return re.sub(r"[\\|*_`<>\[\]]", r"\\\g<0>", printable(text))


#: Letters that LaTeX does not print as they are.
LATEX_LETTERS = str.maketrans({
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}",
    "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "…": r"\ldots{}", "±": r"$\pm$", "|": r"$|$",
    "–": "--", "†": r"$\dagger$", "−": "$-$", "×": r"$\times$", "<": r"$<$", "·": r"\,",
    "α": r"$\alpha$", "ξ": r"$\xi$", "µ": r"$\mu$", "τ": r"$\tau$", "σ": r"$\sigma$",
    "ω": r"$\omega$", "≤": r"$\leq$", "≥": r"$\geq$", "→": r"$\rightarrow$",
})  # fmt: skip


def escape_latex(text: str) -> str:
    """Text that LaTeX prints as it is."""
    text = printable(text)
    if text.startswith("-") and NUMBER.fullmatch(text):
        text = minus(text)
    # A thin blank behind the sign of a bound: "< 6" is one number.
    return text.translate(LATEX_LETTERS).replace("$<$ ", r"$<$\,")


#: Begin of texts that spreadsheets run, from OWASP's "CSV Injection".
FORMULA = ("=", "+", "-", "@", "\t", "\r")


def csv_rows(rows: Sequence[Record], keys: Iterable[str]) -> str:
    """Rows as CSV under a line of keys; empty if unknown, booleans in lower case.

    Texts that a spreadsheet would run as a formula begin with "'".
    """

    def cell(value: Any) -> Any:  # noqa: ANN401 - whatever a row holds
        if isinstance(value, bool | np.bool):
            return str(value).lower()
        if isinstance(value, str):
            text = value.replace("\r", r"\r")  # unquoted before Python 3.13: it would end the row
            return f"'{text}" if value.startswith(FORMULA) else text
        return None if isinstance(value, float) and not np.isfinite(value) else value

    text, keys = io.StringIO(), list(keys)
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(keys)
    writer.writerows([cell(row[key]) for key in keys] for row in rows)
    return text.getvalue()
