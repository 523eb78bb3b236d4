"""Below the RMSE tables: how sure each number is, how late each estimate, and who really wins."""

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import polars as pl

DASH = "–"


class Detail(NamedTuple):
    """One further table of the same shape as the RMSE table.

    Attributes:
        title: What its cells are.
        cell: A row of the tidy table as one cell's text.
    """

    title: str
    cell: Callable[[dict[str, Any]], str]


def interval_text(row: dict[str, Any]) -> str:
    """The RMSE's 95 % interval."""
    from vftcli.outputs.log.tables import significant

    low, high = row["rmse_low_Nm"], row["rmse_high_Nm"]
    return DASH if low is None or high is None else f"{significant(low)}–{significant(high)}"


def lag_text(row: dict[str, Any]) -> str:
    """The best-fitting delay in milliseconds."""
    return DASH if row["lag_s"] is None else f"{1e3 * row['lag_s']:.0f}"


def chance_text(row: dict[str, Any]) -> str:
    """The chance that it is no worse than the best, or that it is the best."""
    p = row["p_vs_best"]
    if p is None:
        return DASH
    return "best" if p >= 1.0 else f"{p:.3f}"


def coverage_text(row: dict[str, Any]) -> str:
    """The share of samples within the estimate's own 95 % band."""
    share = row.get("coverage_95")
    return DASH if share is None else f"{100 * share:.0f} %"


DETAILS = (
    Detail("95 % interval of the RMSE, moving-block bootstrap [N·m]", interval_text),
    Detail("lag of the estimate behind the reference, best fit [ms]", lag_text),
    Detail("samples within the estimate's 95 % band, while the joint moves", coverage_text),
    Detail("p of being no worse than the best, paired bootstrap", chance_text),
)
"""The tables below the RMSE table, in order."""


def details(errors: pl.DataFrame) -> Iterator[tuple[str, list[str], list[list[str]]]]:
    """Title, header and rows of every further table that has something to say."""
    rows = errors.filter(pl.col("joint").is_not_null() & pl.col("p_vs_best").is_not_null())
    for (recording, _), group in rows.group_by("recording", "reference", maintain_order=True):
        header = ["observer", *(f"J{j}" for j in group["joint"].unique().sort())]
        for detail in DETAILS:
            cells: dict[str, list[str]] = {}
            for row in group.iter_rows(named=True):
                cells.setdefault(row["observer"], []).append(detail.cell(row))
            lines = [[name, *texts] for name, texts in cells.items()]
            if any(text != DASH for _, *texts in lines for text in texts):
                yield f"{recording}: {detail.title}", header, lines


def terminal_details(errors: pl.DataFrame) -> str:
    """The further tables as text for a terminal."""
    parts = []
    for title, header, rows in details(errors):
        widths = [max(len(row[c]) for row in [header, *rows]) for c in range(len(header))]
        lines = [
            row[0].ljust(widths[0])
            + "".join(f"  {text.rjust(w)}" for text, w in zip(row[1:], widths[1:], strict=True))
            for row in [header, *rows]
        ]
        parts.append("\n".join(["", title, *lines, ""]))
    return "".join(parts)


def markdown_details(errors: pl.DataFrame) -> str:
    """The further tables as GitHub Markdown."""
    from vftcli.outputs.log.tables import escape_markdown

    parts = []
    for title, header, rows in details(errors):
        marks = ["---", *("---:" for _ in header[1:])]
        lines = [header, marks, *([escape_markdown(row[0]), *row[1:]] for row in rows)]
        body = "\n".join(f"| {' | '.join(line)} |" for line in lines)
        parts.append(f"\n**{escape_markdown(title)}**\n\n{body}\n")
    return "".join(parts)
