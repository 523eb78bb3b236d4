"""Sections of the report that compare: the selection guide, and print beside computation."""

from html import escape

from vftcli.analysis import Analysis
from vftcli.evaluation.print_table import Comparison
from vftcli.evaluation.selection import Facts, advice, facts
from vftcli.outputs.log.tables import significant
from vftcli.outputs.page.sections import bullets, html_table, number_cell, observer_head

HEADER = (
    "Observer",
    "90 % of a step [ms]",
    "delay [ms]",
    "noise [N·m]",
    "noise > 5 Hz passed",
    "mean RMSE [N·m]",
    "time a sample [µs]",
    "to tune",
)


def selection_guide(analysis: Analysis) -> str:
    """Which observer for what, by what was computed on this log."""
    found = facts(analysis.observers, analysis.tunings, analysis.terms, analysis.errors)
    if not found:
        return ""
    table = html_table("Computed on this log", HEADER, [facts_row(f) for f in found])
    rows = [
        f'<tr><th scope="row">{escape(a.purpose)}</th><td class="text">{escape(a.criterion)}</td>'
        f'<td class="text">{escape(", ".join(a.best) or "–")}</td>'
        f'<td class="text">{escape(a.paper)}</td></tr>'
        for a in advice(found)
    ]
    header = ["For", "what decides", "best here", "the paper advises"]
    guide = html_table("Which observer for what (Sec. IV-A)", header, rows, words=4)
    return (
        "<h2>Selection guide</h2>"
        '<p class="soft">These follow from the gains more than from the method: '
        "<code>--match delay=S</code> or <code>--match bandwidth=HZ</code> puts all observers on "
        f"the same footing first.</p>{guide}{table}"
    )


def facts_row(found: Facts) -> str:
    """One observer's facts."""
    values = (
        significant(1e3 * found.response),
        significant(1e3 * found.delay),
        significant(found.noise),
        significant(found.passed),
        significant(found.rmse),
        significant(1e6 * found.time),
        str(found.numbers),
    )
    return f"<tr>{observer_head(found.name)}{''.join(map(number_cell, values))}</tr>"


def published(comparison: Comparison | None) -> str:
    """Printed and computed errors side by side, with the reasons for the difference."""
    if comparison is None:
        return ""
    joints = len(comparison.floor)
    rows = []
    for name in comparison.names:
        printed, ours = comparison.printed(name), comparison.ours[name]
        cells = "".join(
            number_cell(f"{p:.2f}") + number_cell(significant(o))
            for p, o in zip(printed, ours, strict=True)
        )
        rows.append(f"<tr>{observer_head(name)}{cells}</tr>")
    header = ["Observer"]
    for j in range(1, joints + 1):
        header += [f"J{j} print", "here"]
    table = html_table(f"RMSE in N·m: {comparison.published.title}", header, rows)
    source = f'<p class="soft">{escape(comparison.published.source)}</p>'
    return f"<h2>Beside the paper</h2>{table}{source}{bullets(comparison.remarks)}"
