"""Tables of errors: all grids of a run for people, tidy rows for machines."""

from dataclasses import replace
from itertools import groupby
from typing import TYPE_CHECKING, Any

import polars as pl

from vftcli.evaluation.errors import POOLED
from vftcli.outputs.examination import refused_codes
from vftcli.outputs.grid import (
    Column,
    Grid,
    csv_rows,
    escape_markdown,
    joint_columns,
    json_rows,
    latex,
    markdown,
    terminal,
    words,
)
from vftcli.outputs.quantity import significant
from vftcli.outputs.rmse_tables import (
    DAGGER,
    LATEX_DAGGER,
    PaperBounds,
    axis_grids,
    blocks,
    contact_grids,
    detail_grids,
    marks_in_words,
    nothing_to_compare,
    rmse_grid,
)
from vftcli.signals.parsing import printable

if TYPE_CHECKING:
    from collections.abc import Sequence

    from vftcli.analysis import Analysis
    from vftcli.evaluation.published import Comparison

OVERRIDDEN = "overridden"  #: Column of the codes with which results were wanted anyway.
SURE = 0.05  #: Below this p a difference between two observers is called sure.


def marked(errors: pl.DataFrame, analyses: "Sequence[Analysis]") -> pl.DataFrame:
    """The errors with a column `overridden` where results were wanted though they mean nothing.

    It holds the codes of the findings, of all logs together in pooled rows; without any such
    finding the table is as it was.
    """
    found = {a.recording.name: refused_codes(a.examinations) for a in analyses}
    codes = {name: ", ".join(each) for name, each in found.items() if each}
    if not codes:
        return errors
    every = {POOLED: "; ".join(f"{name}: {text}" for name, text in codes.items()), **codes}
    column = pl.col("recording").replace_strict(every, default=None, return_dtype=pl.String)
    return errors.with_columns(overridden=column)


def doubts_of(errors: pl.DataFrame) -> list[str]:
    """Lines above tables of meaningless errors, one a log."""
    if OVERRIDDEN not in errors.columns:
        return []
    rows = errors.select("recording", OVERRIDDEN).unique(maintain_order=True).drop_nulls()
    return [
        f"MEANINGLESS unless these findings are wrong (--anyway): {name}: {codes}"
        for name, codes in rows.iter_rows()
        if name != POOLED
    ]


def to_terminal(
    errors: pl.DataFrame, bounds: PaperBounds | None = None, *, every: bool = True
) -> str:
    """The tables of the tidy error table as text, with the meaning of their marks."""
    found = blocks(errors)
    if not found:
        return "no errors to show: the estimates and the reference have no sample in common\n"
    above, below = (
        "".join(f"{printable(line)}\n" for line in lines)
        for lines in (doubts_of(errors), nothing_to_compare(errors))
    )
    joints = "\n".join(terminal(rmse_grid(table)) for table in found) + marks_in_words(found)
    details = detail_grids(errors) if every else ()
    grids = (*details, *axis_grids(errors, bounds), *contact_grids(errors))
    return above + "\n".join([joints + below, *map(terminal, grids)])


def to_markdown(errors: pl.DataFrame, bounds: PaperBounds | None = None) -> str:
    """All tables of the errors as GitHub Markdown, best value of each joint bold."""
    found = blocks(errors)
    lines = [*marks_in_words(found).splitlines(), *nothing_to_compare(errors)]
    marks = [f"{escape_markdown(line)}\n" for line in lines]
    below = [*detail_grids(errors), *axis_grids(errors, bounds)]
    doubts = [f"> **{escape_markdown(line)}**\n" for line in doubts_of(errors)]
    return "\n".join(
        [*doubts, *map(markdown, map(rmse_grid, found)), *marks, *map(markdown, below)]
    )


def to_latex(errors: pl.DataFrame, bounds: PaperBounds | None = None) -> str:
    """The RMSE as LaTeX tables (needs ``booktabs``), best value of each joint bold.

    Logs of arms with as many joints share a table.
    """
    lines = [*doubts_of(errors), *nothing_to_compare(errors)]
    doubts = "".join(f"% {printable(line)}\n" for line in lines)
    arms = groupby(blocks(errors), key=lambda table: table.joints)
    found = [alike(list(map(rmse_grid, tables))) for _, tables in arms]
    if axes := list(axis_grids(errors, bounds)):
        found.append(axes)
    return doubts + "\n".join(latex(*grids) for grids in found)


def alike(grids: "Sequence[Grid]") -> "Sequence[Grid]":
    """Tables of several logs with equal heads: a log's dagger moves from them to its title."""
    if len(grids) == 1:
        return grids
    found = []
    for grid in grids:
        doubtful = [column.head for column in grid.columns if DAGGER in column.head]
        title = f"{grid.title}{', ' * bool(doubtful)}{', '.join(doubtful)}"
        plain = tuple(
            c._replace(head=c.head.replace(DAGGER, ""), symbol=c.symbol.replace(LATEX_DAGGER, ""))
            for c in grid.columns
        )
        found.append(replace(grid, title=title, columns=plain))
    return found


def to_json(errors: pl.DataFrame, _bounds: PaperBounds | None = None) -> str:
    """The tidy table as a JSON array of rows; what is not known is null."""
    return json_rows(errors.to_dicts())


def to_csv(errors: pl.DataFrame, _bounds: PaperBounds | None = None) -> str:
    """The tidy table as CSV; what is not known is empty."""
    return csv_rows(errors.to_dicts(), errors.columns)


#: Name of a form → the text of the errors table in it.
FORMS = {"csv": to_csv, "json": to_json, "markdown": to_markdown, "latex": to_latex}


def pair_row(row: dict[str, Any]) -> tuple[str | float, ...]:
    """The entries of one pair: a difference above zero says that the second is the better."""
    difference, low, high, p = (row[k] for k in ("difference_Nm", "low_Nm", "high_Nm", "p"))
    names = (row["observer"], row["other"])
    # First RMSE less second: above zero the second observer is the better.
    if difference > 0:
        names = names[::-1]
    else:
        low, high = -high, -low
    interval = f"{significant(low)} to {significant(high)}"
    # A blank keeps the digits of those without a star below the others.
    star, by = "*" if p < SURE else " ", abs(float(difference))
    return (row["recording"], f"J{row['joint']}", *names, by, interval, f"{p:.3f}{star}")


def pairs_text(rows: pl.DataFrame) -> str:
    """The paired differences of all logs, as a terminal table."""
    heads = ("joint", "better", "than", "by [N·m]", "95 % interval", "p")
    columns = *words("recording"), *map(Column, heads)
    grid = Grid(columns=columns, rows=tuple(map(pair_row, rows.iter_rows(named=True))))
    return f"{terminal(grid)}*: p below {SURE:g}\n"


def print_text(found: "Comparison") -> str:
    """A printed table beside one's own: two lines an observer, and why they differ."""
    rows: list[tuple[str | float, ...]] = []
    for name in found.names:
        rows.append((f"{name}, printed", *(f"{v:.4f}" for v in found.printed(name))))
        rows.append((f"{name}, here", *map(float, found.ours[name])))
    grid = Grid(
        title=f"{found.recording} beside {found.published.title}, N·m",
        columns=(*words("observer"), *joint_columns(len(found.floor))),
        rows=(*rows, ("floor, here", *map(float, found.floor))),
    )
    return "\n".join([terminal(grid), *(f"- {text}" for text in found.remarks), ""])
