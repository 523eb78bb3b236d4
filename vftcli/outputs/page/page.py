"""The report of one log as one HTML page, and the index over the reports of several."""

from collections.abc import Sequence
from html import escape
from urllib.parse import quote

from vftcli.analysis import Analysis
from vftcli.outputs.grid import DASH, Column, Grid, GridCell, html, significant
from vftcli.outputs.log.rmse_tables import blocks, mean_of, rmse_grid
from vftcli.outputs.log.run_record import run_record
from vftcli.outputs.page import comparisons, sections
from vftcli.outputs.page.payload import payload
from vftcli.outputs.page.refinement_part import refinement_section
from vftcli.outputs.page.shell import document, headline, health, pairs, provenance, remarks
from vftcli.outputs.page.wrench_part import wrench_section


def render(analysis: Analysis) -> str:
    """The report of one log: self-contained, nothing is loaded from anywhere."""
    record = analysis.run or run_record(analysis, "")
    name = analysis.recording.name
    parts = (
        headline(name, f"External joint torques of {analysis.robot.name} from {name}"),
        sections.facts_section(analysis),
        health(analysis.examinations),
        remarks([*record.get("warnings", ()), *record.get("notes", ())]),
        sections.errors_section(analysis),
        comparisons.beside_print(analysis.published),
        sections.series_section(analysis),
        wrench_section(analysis),
        sections.observers_section(analysis),
        refinement_section(analysis),
        comparisons.selection_guide(analysis),
        f"<h2>Conventions</h2>{pairs(record.get('conventions', {}))}",
        provenance(record),
    )
    return document(f"{name}: external torques", "".join(parts), payload(analysis))


def render_index(analyses: Sequence[tuple[str, Analysis]]) -> str:
    """The page over several reports, each told by its sub-folder, relative to the index."""
    words = (Column(head, words=True) for head in ("Log", "Robot", "Reference"))
    numbers = map(Column, ("Span [s]", "Samples", "Best mean RMSE [N·m]", "Floor"))
    overview = Grid(
        title="Every log has its own page",
        columns=(*words, *numbers),
        rows=tuple(index_row(folder, analysis) for folder, analysis in analyses),
    )
    tables = "".join(
        f"<h2>{link(folder, analysis.recording.name)}</h2>"
        f"{''.join(html(rmse_grid(block)) for block in blocks(analysis.errors))}"
        for folder, analysis in analyses
        if analysis.errors is not None
    )
    title = f"External joint torques from {len(analyses)} logs"
    top = f"<header><h1>{escape(title)}</h1></header>"
    found = [one for _, analysis in analyses for one in analysis.examinations]
    return document(title, f"{top}{html(overview)}{health(found)}{tables}")


def index_row(folder: str, analysis: Analysis) -> tuple[GridCell | str | float | None, ...]:
    """One log's entries in the overview: its name links to its own page."""
    recording, reference = analysis.recording, analysis.reference
    found = blocks(analysis.errors) if analysis.errors is not None else ()
    best, floor = DASH, DASH
    if found:
        means = [mean_of(row) for row in found[0].rmse]
        # A mean that is not known comes last.
        k = min(range(len(means)), key=lambda i: (means[i] != means[i], means[i]))
        best = f"{significant(means[k])} ({found[0].observers[k]})"
        floor = significant(mean_of(found[0].floor))
    return (
        GridCell(recording.name, html=link(folder, recording.name)),
        analysis.robot.name,
        reference.name if reference is not None else DASH,
        f"{recording.duration:.3f}",
        recording.samples,
        best,
        floor,
    )


def link(folder: str, name: str) -> str:
    """HTML of a link to the report in a sub-folder; both texts may hold any letter."""
    return f'<a href="{escape(quote(folder))}/index.html">{escape(name)}</a>'
