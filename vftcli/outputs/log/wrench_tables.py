"""Error tables of wrenches: axes across, newtons and newton-metres side by side."""

from typing import NamedTuple

import polars as pl

from vftcli.signals.wrench import AXES
from vftcli.virtual_sensor.sensor import PAPER_FORCE, PAPER_MOMENT

DASH = "–"


class AxisBlock(NamedTuple):
    """RMSE of one recording's wrenches, observers down, axes across.

    Attributes:
        recording: The log's name.
        reference: What they are judged by.
        rows: Observer and six numbers as text, [N] then [N·m].
        samples: Samples in which both wrenches are known.
    """

    recording: str
    reference: str
    rows: tuple[tuple[str, ...], ...]
    samples: int

    @property
    def title(self) -> str:
        """Which log, which reference, how many samples."""
        return f"{self.recording} against {self.reference}, wrench, {self.samples} unmasked samples"


def axis_blocks(errors: pl.DataFrame) -> tuple[AxisBlock, ...]:
    """One block for each recording and reference that has wrench rows."""
    if "axis" not in errors.columns:
        return ()
    rows = errors.filter(pl.col("axis").is_not_null())
    groups = rows.group_by("recording", "reference", maintain_order=True)
    return tuple(axis_block(str(key[0]), str(key[1]), group) for key, group in groups)


def axis_block(recording: str, reference: str, rows: pl.DataFrame) -> AxisBlock:
    """The wrench rows of one recording as text."""
    found: dict[str, dict[str, float | None]] = {}
    for row in rows.iter_rows(named=True):
        value = row["rmse_N"] if row["rmse_N"] is not None else row["rmse_Nm"]
        found.setdefault(str(row["observer"]), {})[str(row["axis"])] = value
    lines = [(name, *(text_of(values.get(a)) for a in AXES)) for name, values in found.items()]
    if reference == "sensor":
        paper = [f"< {PAPER_FORCE:g}"] * 3 + [f"< {PAPER_MOMENT:g}"] * 3
        lines.append(("paper, UR5", *paper))
    return AxisBlock(recording, reference, tuple(lines), int(rows["samples"].max() or 0))  # type: ignore[arg-type]


def text_of(value: float | None) -> str:
    """A number with three significant digits, a dash where there is none."""
    from vftcli.outputs.log.tables import significant

    return DASH if value is None else significant(value)


HEADER = ("observer", *(f"{axis} [{'N' if k < 3 else 'N·m'}]" for k, axis in enumerate(AXES)))


def terminal_axes(errors: pl.DataFrame) -> str:
    """The wrench tables for a terminal, "" where no wrench was compared."""
    parts = []
    for block in axis_blocks(errors):
        widths = [max(len(r[c]) for r in (HEADER, *block.rows)) for c in range(len(HEADER))]
        lines = [
            row[0].ljust(widths[0])
            + "".join(f"  {cell.rjust(w)}" for cell, w in zip(row[1:], widths[1:], strict=True))
            for row in (HEADER, *block.rows)
        ]
        parts.append("\n".join([f"{block.title}, RMSE", *lines, ""]))
    if contacts := contact_lines(errors):
        parts.append(contacts)
    return "\n" + "\n".join(parts) if parts else ""


CONTACTS = {
    "recording": "recording",
    "observer": "observer",
    "signal": "told from",
    "contacts": "contacts",
    "missed_contacts": "missed",
    "false_alarms_per_h": "false alarms/h",
    "detection_delay_s": "mean delay [s]",
    "longest_delay_s": "longest [s]",
}
"""Columns of the contact table, and how they are headed."""


def contact_rows(errors: pl.DataFrame) -> list[tuple[str, ...]]:
    """What is told of contacts as text, one row a recording and observer; empty where not asked."""
    if "contacts" not in errors.columns:
        return []
    rows = errors.filter(pl.col("contacts").is_not_null())
    return [
        tuple(
            text_of(row[key])
            if isinstance(row[key], float)
            else str(row[key] or 0)
            if isinstance(row[key], int)
            else str(row[key] or DASH)
            for key in CONTACTS
        )
        for row in rows.iter_rows(named=True)
    ]


def contact_lines(errors: pl.DataFrame) -> str:
    """The contact table for a terminal, "" where contacts were not judged."""
    rows = contact_rows(errors)
    if not rows:
        return ""
    table = [tuple(CONTACTS.values()), *rows]
    widths = [max(len(row[c]) for row in table) for c in range(len(CONTACTS))]
    lines = ["  ".join(cell.ljust(w) for cell, w in zip(row, widths, strict=True)) for row in table]
    return "\n".join(["contacts against the reference", *(line.rstrip() for line in lines), ""])


def markdown_axes(errors: pl.DataFrame) -> str:
    """The wrench tables as GitHub Markdown, "" where no wrench was compared."""
    from vftcli.outputs.log.tables import escape_markdown

    parts = []
    for block in axis_blocks(errors):
        lines = [
            f"**{escape_markdown(block.title)}, RMSE**",
            "",
            f"| {' | '.join(HEADER)} |",
            f"| {' | '.join(['---', *['---:'] * 6])} |",
        ]
        lines += [f"| {' | '.join(map(escape_markdown, row))} |" for row in block.rows]
        parts.append("\n".join([*lines, ""]))
    return "\n" + "\n".join(parts) if parts else ""


def latex_axes(errors: pl.DataFrame) -> str:
    """The wrench tables as LaTeX tabulars (needs ``booktabs``), "" where none was compared."""
    from vftcli.outputs.log.tables import escape_latex, latex_row

    letters = ("F_x", "F_y", "F_z", "M_x", "M_y", "M_z")
    names = ["Observer", *(f"${letter}$" for letter in letters)]
    units = ["", *[r"[N]"] * 3, *[r"[N\,m]"] * 3]
    parts = []
    for block in axis_blocks(errors):
        body = [latex_row([escape_latex(row[0]), *map(latex_cell, row[1:])]) for row in block.rows]
        head = [latex_row(names), latex_row(units), r"\midrule"]
        lines = [f"% {block.title}, RMSE", r"\begin{tabular}{lrrrrrr}", r"\toprule", *head, *body]
        parts.append("\n".join([*lines, r"\bottomrule", r"\end{tabular}", ""]))
    return "\n" + "\n".join(parts) if parts else ""


def latex_cell(text: str) -> str:
    """A number as LaTeX prints it."""
    return text.replace(DASH, "--").replace("< ", r"$<$\,")
