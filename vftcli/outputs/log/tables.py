"""Error tables: pivoted for people, tidy for machines."""

import json
from typing import NamedTuple

import numpy as np
import polars as pl

from vftcli.outputs.log.error_details import markdown_details, terminal_details
from vftcli.outputs.log.wrench_tables import latex_axes, markdown_axes, terminal_axes

AT_FLOOR = 1.2
"""An RMSE within this factor of the reference's floor cannot be told from the reference's own."""

DAGGER, LATEX_DAGGER = "†", r"\dag"
RESTS = "the joint rests most of the time; the reference keeps its stiction: do not trust it"

SPECIAL = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
}
"""What LaTeX would not print as it stands."""


class Block(NamedTuple):
    """RMSE of one recording, observers down, joints across.

    Attributes:
        recording: The log's name.
        reference: What the estimates are judged by.
        joints: Joint numbers, from 1.
        observers: Names, in the order in which they ran.
        rmse: NaN where it is not known. (observers, joints) [N·m]
        floor: The reference's own error, NaN where it is not known. (joints,) [N·m]
        samples: Fewest and most samples an entry is made of.
        untrusted: Joints whose reference is not to be trusted, because they rest.
    """

    recording: str
    reference: str
    joints: tuple[int, ...]
    observers: tuple[str, ...]
    rmse: np.ndarray[tuple[int, ...], np.dtype[np.float64]]
    floor: np.ndarray[tuple[int, ...], np.dtype[np.float64]]
    samples: tuple[int, int]
    untrusted: tuple[int, ...] = ()

    @property
    def at_floor(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """Where the reference cannot tell the error from its own. (observers, joints)"""
        return np.asarray(self.rmse <= AT_FLOOR * self.floor)

    @property
    def best(self) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        """The smallest RMSE of each joint, and what prints the same. (observers, joints)"""
        least = np.where(np.isfinite(self.rmse), self.rmse, np.inf).min(axis=0)
        shown = [[significant(value) for value in row] for row in self.rmse]
        best = np.array([significant(value) for value in least])
        return np.asarray(np.array(shown) == best) & np.isfinite(self.rmse)


def blocks(errors: pl.DataFrame) -> tuple[Block, ...]:
    """One block for each recording and reference, in the table's order."""
    rows = errors.filter(pl.col("joint").is_not_null())
    groups = rows.group_by("recording", "reference", maintain_order=True)
    return tuple(block(str(key[0]), str(key[1]), group) for key, group in groups)


def block(recording: str, reference: str, rows: pl.DataFrame) -> Block:
    """The rows of one recording as a matrix."""
    joints = tuple(int(j) for j in rows["joint"].unique().sort())
    observers = tuple(str(name) for name in rows["observer"].unique(maintain_order=True))
    rmse = np.full((len(observers), len(joints)), np.nan)
    floor = np.full(len(joints), np.nan)
    for row in rows.iter_rows(named=True):
        at = joints.index(row["joint"])
        rmse[observers.index(row["observer"]), at] = known(row["rmse_Nm"])
        floor[at] = known(row["reference_floor_Nm"])
    counts = rows["samples"].drop_nulls().to_list() or [0]
    span = (int(min(counts)), int(max(counts)))
    doubtful = rows.filter(~pl.col("reference_trusted").fill_null(True))["joint"].unique().sort()
    untrusted = tuple(int(j) for j in doubtful)
    return Block(recording, reference, joints, observers, rmse, floor, span, untrusted)


def joint_heads(table: Block) -> list[str]:
    """J1, J2, …; a dagger where the reference is not to be trusted."""
    return [f"J{j}{DAGGER if j in table.untrusted else ''}" for j in table.joints]


def known(value: float | None) -> float:
    """A number, NaN for null."""
    return float("nan") if value is None else float(value)


def significant(value: float, digits: int = 3) -> str:
    """A number with three significant digits and no exponent where one can do without."""
    if not np.isfinite(value):
        return "–"
    if value == 0.0:
        return "0"
    exponent = int(np.floor(np.log10(abs(float(f"{value:.{digits - 1}e}")))))
    if exponent < -4:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{max(digits - 1 - exponent, 0)}f}"


def mean_of(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
    """The mean over the joints that are known, NaN if none is."""
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if finite.size else float("nan")


def cells(table: Block) -> list[list[str]]:
    """Rows of text: observer, one RMSE a joint, their mean; the floor last where it is known."""
    rows = [
        [name, *map(significant, row), significant(mean_of(row))]
        for name, row in zip(table.observers, table.rmse, strict=True)
    ]
    if np.any(np.isfinite(table.floor)):
        rows.append(["floor", *map(significant, table.floor), significant(mean_of(table.floor))])
    return rows


def terminal(errors: pl.DataFrame) -> str:
    """The RMSE tables as text for a terminal, a block for each recording, with their meaning."""
    found = blocks(errors)
    if not found:
        return "no errors to show: the estimates and the reference have no sample in common\n"
    joints = "\n".join(terminal_block(table) for table in found)
    return joints + explanation(found) + terminal_details(errors) + terminal_axes(errors)


def terminal_block(table: Block) -> str:
    """One recording's RMSE, right-aligned; a star where the reference can tell no more."""
    rows = cells(table)
    for k, at in enumerate(table.at_floor):
        rows[k][1:-1] = [
            f"{text}{'*' if star else ' '}" for text, star in zip(rows[k][1:-1], at, strict=True)
        ]
    for row in rows:
        row[1:] = [text if text.endswith(("*", " ")) else f"{text} " for text in row[1:]]
    header = ["observer", *(f"{head} " for head in joint_heads(table)), "mean "]
    widths = [max(len(row[c]) for row in [header, *rows]) for c in range(len(header))]
    lines = [line(header, widths), *(line(row, widths) for row in rows)]
    if rows[-1][0] == "floor":
        lines.insert(-1, "-" * len(lines[0].rstrip()))
    return "\n".join([f"{title(table)}, RMSE in N·m", *(text.rstrip() for text in lines), ""])


def title(table: Block) -> str:
    """Which log, which reference, how many samples."""
    low, high = table.samples
    samples = f"{high}" if low == high else f"{low} to {high}"
    return f"{table.recording} against {table.reference}, {samples} samples"


def line(row: list[str], widths: list[int]) -> str:
    """A row with its first cell to the left and the numbers to the right."""
    first, *numbers = row
    return first.ljust(widths[0]) + "".join(
        f"  {text.rjust(width)}" for text, width in zip(numbers, widths[1:], strict=True)
    )


def explanation(found: tuple[Block, ...]) -> str:
    """What floor, star and dash mean, where they occur."""
    lines = []
    if any(np.any(np.isfinite(table.floor)) for table in found):
        lines.append("floor: RMSE that the reference itself is known to have")
    if any(np.any(table.at_floor) for table in found):
        lines.append(f"*: within {AT_FLOOR:g} × the floor; the reference can tell no more")
    if any(table.untrusted for table in found):
        lines.append(f"{DAGGER}: {RESTS}")
    if any(not np.all(np.isfinite(table.rmse)) for table in found):
        lines.append("–: no sample where both the estimate and the reference are known")
    return "".join(f"{text}\n" for text in lines)


def to_json(errors: pl.DataFrame) -> str:
    """The tidy table as a JSON array of rows; what is not known is null."""
    rows = errors.with_columns(pl.col(pl.Float64).fill_nan(None)).to_dicts()
    return json.dumps(rows, indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def to_csv(errors: pl.DataFrame) -> str:
    """The tidy table as CSV; what is not known is empty."""
    return errors.with_columns(pl.col(pl.Float64).fill_nan(None)).write_csv()


def to_markdown(errors: pl.DataFrame) -> str:
    """The RMSE tables as GitHub Markdown, best value of each joint bold."""
    return "\n".join(markdown_block(table) for table in blocks(errors)) + markdown_more(errors)


def markdown_more(errors: pl.DataFrame) -> str:
    """What stands below the RMSE tables in Markdown: marks, intervals and lags, wrenches."""
    doubtful = any(table.untrusted for table in blocks(errors))
    mark = f"\n{DAGGER} {RESTS}\n" if doubtful else ""
    return mark + markdown_details(errors) + markdown_axes(errors)


def markdown_block(table: Block) -> str:
    """One recording as Markdown."""
    rows = cells(table)
    for k, best in enumerate(table.best):
        rows[k][1:-1] = [
            f"**{text}**" if bold else text for text, bold in zip(rows[k][1:-1], best, strict=True)
        ]
    header = ["observer", *joint_heads(table), "mean"]
    marks = ["---", *("---:" for _ in header[1:])]
    lines = [f"| {' | '.join(escape_markdown(c) for c in header)} |", f"| {' | '.join(marks)} |"]
    lines += [f"| {' | '.join([escape_markdown(row[0]), *row[1:]])} |" for row in rows]
    return "\n".join([f"**{escape_markdown(title(table))}, RMSE in N·m**", "", *lines, ""])


def escape_markdown(text: str) -> str:
    """Text that Markdown shows as it is."""
    for mark in "\\|*_`<>[]":
        text = text.replace(mark, f"\\{mark}")
    return text.replace("\n", " ")


def to_latex(errors: pl.DataFrame) -> str:
    """The RMSE tables as LaTeX tabulars (needs ``booktabs``), best value of each joint bold."""
    return "\n".join(latex_block(table) for table in blocks(errors)) + latex_axes(errors)


def latex_block(table: Block) -> str:
    """One recording as a tabular with its title as a comment above."""
    rows = cells(table)
    for k, best in enumerate(table.best):
        rows[k][1:-1] = [
            rf"\textbf{{{text}}}" if bold else text
            for text, bold in zip(rows[k][1:-1], best, strict=True)
        ]
    body = [[escape_latex(row[0]), *(text.replace("–", "--") for text in row[1:])] for row in rows]
    joints = [rf"$J_{{{j}}}${LATEX_DAGGER * (j in table.untrusted)}" for j in table.joints]
    lines = [latex_row(row) for row in body]
    if rows[-1][0] == "floor":
        lines.insert(-1, r"\midrule")
    caption = f"% {title(table)}, RMSE".replace("\n", " ")
    if table.untrusted:
        caption += f"\n% {LATEX_DAGGER}: {RESTS}"
    unit = rf" & \multicolumn{{{len(joints) + 1}}}{{c}}{{RMSE [N\,m]}} \\"
    head = [unit, latex_row(["Observer", *joints, "mean"])]
    parts = [rf"\begin{{tabular}}{{l{'r' * (len(joints) + 1)}}}", r"\toprule", *head, r"\midrule"]
    return "\n".join([caption, *parts, *lines, r"\bottomrule", r"\end{tabular}", ""])


def latex_row(row: list[str]) -> str:
    """One row of a tabular."""
    return rf"{' & '.join(row)} \\"


def escape_latex(text: str) -> str:
    """Text that LaTeX prints as it is."""
    return "".join(SPECIAL.get(letter, letter) for letter in text)
