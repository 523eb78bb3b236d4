"""Sections of the report that compare: the selection guide, and print beside computation."""

from html import escape

from vftcli.analysis import Analysis
from vftcli.evaluation.print_table import Comparison
from vftcli.evaluation.selection import Facts, advice, facts
from vftcli.outputs.grid import Column, Grid, html
from vftcli.outputs.page.shell import bullets, section, soft
from vftcli.outputs.quantity import DASH

#: Headings of the table of what was computed on the log.
HEADS = (
    "90 % of a step [ms]",
    "delay [ms]",
    "noise [N·m]",
    "noise > 5 Hz passed",
    "mean RMSE [N·m]",
    "to tune",
)


def selection_guide(analysis: Analysis) -> str:
    """Which observer for what, by what was computed on this log."""
    found = facts(analysis.observers, analysis.tunings, analysis.motion.log, analysis.errors)
    if not found:
        return ""
    computed = Grid(
        title="Computed on this log",
        columns=(Column("observer", words=True), *map(Column, HEADS)),
        rows=tuple(map(facts_row, found)),
        swatches=True,
    )
    heads = ("For", "what decides", "best here", "the paper advises")
    rows = ((a.purpose, a.criterion, ", ".join(a.best) or DASH, a.paper) for a in advice(found))
    guide = Grid(
        title="Which observer for what (Sec. IV-A)",
        columns=tuple(Column(head, words=True) for head in heads),
        rows=tuple(rows),
    )
    words = (
        "These follow from the gains more than from the method: <code>--match delay=S</code> or "
        "<code>--match bandwidth=HZ</code> puts all observers on the same footing first."
    )
    return f"<h3>Selection guide</h3>{soft(words)}{html(guide)}{html(computed)}"


def facts_row(found: Facts) -> tuple[str | float, ...]:
    """One observer's facts in the order and the units of the headings."""
    times = (1e3 * found.response, 1e3 * found.delay)
    rest = (found.noise, found.passed, found.rmse)
    return (found.name, *map(float, (*times, *rest)), found.parameter_count)


def beside_print(comparison: Comparison | None) -> str:
    """Printed and computed errors side by side, with the reasons for the difference."""
    if comparison is None:
        return ""
    columns = [Column("observer", words=True)]
    # Print and computation stand side by side, joint by joint, or nobody compares them.
    for j in range(1, len(comparison.floor) + 1):
        columns += [Column(f"J{j} print", form=".2f"), Column("here")]
    rows: list[tuple[str | float, ...]] = []
    for name in comparison.names:
        both = zip(comparison.printed(name), comparison.ours[name], strict=True)
        rows.append((name, *(float(value) for pair in both for value in pair)))
    grid = Grid(
        title=f"RMSE in N·m: {comparison.published.title}",
        columns=tuple(columns),
        rows=tuple(rows),
        swatches=True,
    )
    source = soft(escape(comparison.published.source))
    return section(
        "Beside the paper", html(grid) + source + bullets(comparison.remarks), name="paper"
    )
