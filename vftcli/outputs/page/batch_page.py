"""The page over a batch: one line a log, made from its table alone."""

from collections.abc import Iterator, Mapping, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

from vftcli.outputs.believability import LogSummary
from vftcli.outputs.grid import Column, Grid, GridCell, html
from vftcli.outputs.page.index_page import WORST_FIRST, least_error, overview
from vftcli.outputs.page.shell import document, lead, section, soft, top
from vftcli.outputs.quantity import DASH, banded, counted
from vftcli.signals.letters import printable

if TYPE_CHECKING:
    import polars as pl


def render_batch(lines: Sequence[LogSummary], failures: "pl.DataFrame") -> str:
    """The page over a batch."""
    robots = sorted({line.robot for line in lines})
    touched = sum(line.contacts not in {DASH, "0", "load"} for line in lines)
    told = sum(line.contacts != DASH for line in lines)
    title = f"{len(lines)} logs" + (f", {touched} of {told} touched." if told else ".")
    count = failures.height
    words = f"{counted(count, 'log')} could not be analysed." if count else ""
    grid = Grid(
        columns=tuple(Column(head, words=True) for head in ("Log", "Stage", "Error", "Why")),
        rows=tuple(
            (*where, GridCell(line, html=f'<span class="wrapped">{escape(printable(line))}</span>'))
            for *where, line in failures.select("log", "stage", "error", "line").iter_rows()
        ),
    )
    parts = (
        top((f"{len(lines) + count} logs", ", ".join(robots)), title, lead(words)),
        section("Not analysed", html(grid), str(count), opened=True) if count else "",
        overview(lines),
        soft(
            f"{escape(WORST_FIRST)} A click on a head sorts by it. Every number is in "
            "batch.parquet."
        ),
    )
    return document(title, "".join(parts), scripts=["sort.js"])


def batch_lines(table: "pl.DataFrame", pages: Mapping[str, str]) -> Iterator[LogSummary]:
    """The line of every log."""
    from vftcli.evaluation.errors import joint_means

    if table.is_empty():
        return
    best = {str(log): least_error(joint_means(rows)) for (log,), rows in table.group_by("log")}
    for row in table.unique("log", keep="first", maintain_order=True).iter_rows(named=True):
        yield batch_line(row, pages.get(row["log"], ""), best.get(row["log"], DASH))


def batch_line(row: Mapping[str, Any], page: str, error: str) -> LogSummary:
    """One log's line, from the first of its rows."""
    force, count = row["hardest_N"], row["contacts"]
    hardest = DASH
    if force is not None:
        hardest = f"{banded(force, row['hardest_band_N'])} at {row['hardest_s']:.1f} s"
        hardest = hardest if force > row["hardest_band_N"] else f"unknown ({hardest})"
    return LogSummary(
        name=row["log"],
        page=page,
        robot=row["robot"],
        duration=row["duration_s"],
        contacts=DASH if count is None else "load" if row["load"] else str(count),
        hardest=hardest,
        force=force or 0.0,
        least=row["told_N"],
        error=error,
        standing=row["health"],
        words=row["reason"],
    )
