"""The page around the sections."""

from collections.abc import Sequence
from html import escape
from pathlib import Path
from urllib.parse import quote

from vftcli.analysis import Analysis
from vftcli.outputs.log.run_record import run_record
from vftcli.outputs.log.tables import blocks, mean_of, significant
from vftcli.outputs.page import comparisons, refinement_part, sections
from vftcli.outputs.page.payload import payload

HERE = Path(__file__).parent

POLICY = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'"
"""The browser loads nothing from anywhere."""


def render(analysis: Analysis) -> str:
    """The report of one log: self-contained, nothing is loaded from anywhere."""
    record = analysis.run or run_record(analysis, "")
    name = analysis.recording.name
    remarks = [*record.get("warnings", []), *record.get("notes", [])]
    body = "".join(
        (
            headline(name, f"External joint torques of {analysis.robot.name} from {name}"),
            sections.facts(analysis),
            sections.remarks(remarks),
            sections.errors(analysis),
            comparisons.published(analysis.published),
            sections.series(analysis),
            sections.wrenches(analysis),
            sections.observers(analysis),
            refinement_part.workup(analysis),
            comparisons.selection_guide(analysis),
            sections.conventions(record),
            sections.provenance(record),
            f'<script type="application/json" id="data">{payload(analysis)}</script>',
            f"<script>{asset('page.js')}</script>",
        )
    )
    return document(f"{name}: external torques", body)


def render_index(analyses: Sequence[tuple[str, Analysis]]) -> str:
    """The page over several reports.

    Args:
        analyses: Sub-folder of each report, relative to the index, and its analysis.
    """
    rows = [index_row(folder, analysis) for folder, analysis in analyses]
    header = ["Log", "Robot", "Reference", "Span [s]", "Samples", "Best mean RMSE [N·m]", "Floor"]
    overview = sections.html_table("Every log has its own page", header, rows, words=3)
    tables = "".join(
        f"<h2>{link(folder, analysis.recording.name)}</h2>"
        f"{''.join(sections.rmse_table(block) for block in blocks(analysis.errors))}"
        for folder, analysis in analyses
        if analysis.errors is not None
    )
    title = f"External joint torques from {len(analyses)} logs"
    top = f"<header><h1>{escape(title)}</h1></header>"
    return document(title, f"{top}{overview}{tables}")


def index_row(folder: str, analysis: Analysis) -> str:
    """One log in the overview."""
    recording = analysis.recording
    reference = analysis.reference.name if analysis.reference is not None else "–"
    found = blocks(analysis.errors) if analysis.errors is not None else ()
    best, floor = "–", "–"
    if found:
        means = [mean_of(row) for row in found[0].rmse]
        k = min(range(len(means)), key=lambda i: (means[i] != means[i], means[i]))
        best = f"{significant(means[k])} ({found[0].observers[k]})"
        floor = significant(mean_of(found[0].floor))
    head = f'<th scope="row">{link(folder, recording.name)}</th>'
    words = "".join(f'<td class="text">{escape(x)}</td>' for x in (analysis.robot.name, reference))
    numbers = (f"{recording.duration:.3f}", str(recording.samples), best, floor)
    return f"<tr>{head}{words}{''.join(sections.number_cell(x) for x in numbers)}</tr>"


def link(folder: str, name: str) -> str:
    """A link to a report in a sub-folder."""
    return f'<a href="{escape(quote(folder))}/index.html">{escape(name)}</a>'


def headline(name: str, text: str) -> str:
    """The top of a report."""
    return (
        f'<header><h1>{escape(name)}</h1><p class="soft">{escape(text)}</p>'
        '<button type="button" id="theme">dark page</button></header>'
    )


def document(title: str, body: str) -> str:
    """A whole HTML document with its style."""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<meta name="generator" content="vftcli">'
        f"<title>{escape(title)}</title><style>{asset('page.css')}</style></head>"
        f"<body>{body}</body></html>\n"
    )


def asset(name: str) -> str:
    """The text of a style sheet or script that comes with the package."""
    return (HERE / name).read_text(encoding="utf-8")
