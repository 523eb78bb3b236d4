"""Every pair of observers side by side: which is better, by how much, and how surely."""

from collections.abc import Sequence

import polars as pl

from vftcli.analysis import Analysis
from vftcli.evaluation import paired_significance
from vftcli.outputs.log.tables import line, significant, to_json

NUMBERS = ("difference_Nm", "low_Nm", "high_Nm", "p")

SURE = 0.05
"""Below this p a difference is called sure."""


def pairs_text(analyses: Sequence[Analysis], *, as_json: bool = False) -> str:
    """The paired differences of every log, as a terminal table or a JSON array of rows."""
    tables = [
        paired_significance(a.recording.name, a.estimates, a.reference)
        for a in analyses
        if a.reference is not None
    ]
    rows = pl.concat(tables)
    return to_json(rows) if as_json else terminal_pairs(rows)


def terminal_pairs(rows: pl.DataFrame) -> str:
    """One line a pair and joint; a star where the difference is sure."""
    header = ["recording", "joint", "better", "than", "by [N·m]", "95 % interval", "p"]
    body = [pair_line(row) for row in rows.iter_rows(named=True)]
    widths = [max(len(cells[c]) for cells in [header, *body]) for c in range(len(header))]
    lines = [line(cells, widths).rstrip() for cells in [header, *body]]
    return "\n".join([*lines, f"*: p below {SURE:g}", ""])


def pair_line(row: dict[str, object]) -> list[str]:
    """The cells of one pair, the better observer first."""
    difference, low, high, p = (float(str(row[k])) for k in NUMBERS)
    names = [str(row["observer"]), str(row["other"])]
    if difference > 0:
        names.reverse()
    else:
        low, high = -high, -low
    star = "*" if p < SURE else " "
    return [
        str(row["recording"]),
        f"J{row['joint']}",
        *names,
        significant(abs(difference)),
        f"{significant(low)} to {significant(high)}",
        f"{p:.3f}{star}",
    ]
