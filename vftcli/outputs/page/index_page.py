"""The index over the reports of several logs: one line a log, the worst first."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from types import MappingProxyType
from typing import NamedTuple
from urllib.parse import quote

from vftcli.analysis import Analysis
from vftcli.outputs.believability import MARKS, SEVERITY, Ground, Standing, grounds, health
from vftcli.outputs.contacts import by_force, hardest_words
from vftcli.outputs.grid import DASH, Column, Grid, GridCell, html, significant
from vftcli.outputs.log.rmse_tables import blocks, rmse_grid
from vftcli.outputs.page.shell import alarms, document, lead, section, soft, top

#: Heads of the overview.
HEADS = ("Log", "Robot", "Span", "Contacts", "Hardest", "Not told below", "Mean RMSE", "Health")

WORST_FIRST = "The worst first: by the health of the log, then by the hardest contact."


class IndexLine(NamedTuple):
    """One log in the overview."""

    name: str  #: What it is called.
    page: str  #: Its own page, relative to the index; "" without one.
    robot: str  #: Its arm.
    duration: float  #: How long it is. [s]
    contacts: str  #: How many, or that they are a load, or `DASH`.
    hardest: str  #: The hardest contact in words, or `DASH`.
    force: float  #: Its force, 0 without one. [N]
    least: float | None  #: The force below which nothing is told, None where that is not known. [N]
    error: str  #: The least mean RMSE and its observer, or `DASH`.
    standing: Standing  #: How healthy the log is.
    words: str  #: Why.


def render_index(
    analyses: Sequence[tuple[str, Analysis]], failed: Mapping[str, str] = MappingProxyType({})
) -> str:
    """The page over several reports."""
    lines = [(folder, analysis, health(grounds(analysis))) for folder, analysis in analyses]
    lines.sort(key=lambda line: rank(index_line(*line)))
    tables = "".join(
        f"<h3>{link(page_in(folder), analysis.recording.name)}</h3>"
        f"{''.join(html(rmse_grid(block)) for block in blocks(analysis.errors))}"
        for folder, analysis, _ in lines
        if analysis.errors is not None
    )
    found = [one for _, analysis in analyses for one in analysis.examinations]
    robots = dict.fromkeys(a.robot.title or a.robot.name for _, a in analyses)
    title, words = headline(analyses)
    parts = (
        alarms(found),
        top((f"{len(analyses) + len(failed)} logs", ", ".join(robots)), title, lead(words)),
        overview(index_line(*line) for line in lines),
        *(soft(escape(f"✗ {name} is left out: {reason}")) for name, reason in failed.items()),
        soft(WORST_FIRST),
        section("Errors against a reference", tables),
    )
    return document(title, "".join(parts), scripts=["sort.js"])


def overview(lines: Iterable[IndexLine]) -> str:
    """The table of all logs, the worst first; a click on a head sorts by it."""
    rows = tuple(map(index_row, sorted(lines, key=rank)))
    return html(Grid(columns=tuple(Column(head, words=True) for head in HEADS), rows=rows))


def headline(analyses: Sequence[tuple[str, Analysis]]) -> tuple[str, str]:
    """How many logs were touched, and where the hardest contact is."""
    lists = [analysis.contacts for _, analysis in analyses if analysis.contacts is not None]
    pushed = [found for found in lists if found.contacts and not found.contacts[0].is_load]
    loads = sum(bool(found.contacts and found.contacts[0].is_load) for found in lists)
    if not lists:
        return f"External joint torques from {len(analyses)} logs.", ""
    title = f"Something pushed the arm in {len(pushed)} of {len(analyses)} logs."
    if not pushed and not loads:
        title = "Nothing pushed the arm, as far as these logs can tell."
    hard = [found for found in pushed if found.hardest is not None]
    words = ""
    if hard:
        most = max(hard, key=lambda found: by_force(found.hardest) if found.hardest else ())
        words = f"Hardest in {most.recording}: {hardest_words(most)}."
    if loads:
        words += f" {loads} more bear{'s' * (loads == 1)} a load, or a wrong payload or model."
    return title, words.strip()


def rank(line: IndexLine) -> tuple[int, float]:
    """Where a log stands: the worst health first, then the hardest contact."""
    return SEVERITY.index(line.standing), -line.force


def index_line(folder: str, analysis: Analysis, ground: Ground) -> IndexLine:
    """One log's entries in the overview."""
    found, contacts, hardest = analysis.contacts, DASH, DASH
    if found is not None:
        is_load = bool(found.contacts) and found.contacts[0].is_load
        contacts = "load" if is_load else str(len(found.contacts))
        hardest = hardest_words(found)
    best, errors = DASH, blocks(analysis.errors) if analysis.errors is not None else ()
    if errors:
        lead = errors[0].means.least
        best = DASH if lead is None else f"{significant(lead[1])} N·m ({lead[0]})"
    most = None if found is None else found.hardest
    return IndexLine(
        name=analysis.recording.name,
        page=page_in(folder),
        robot=analysis.robot.name,
        duration=analysis.recording.duration,
        contacts=contacts,
        hardest=hardest,
        force=(most and most.peak_force) or 0.0,
        least=None if found is None else found.told_force,
        error=best,
        standing=ground.standing,
        words=f"{ground.subject}: {ground.sentence}" if ground.standing != "good" else "sound",
    )


def index_row(line: IndexLine) -> tuple[GridCell | str, ...]:
    """A line of the overview: the log's name links to its own page, where it has one."""
    mark = MARKS[line.standing]
    sign = f'<b class="{line.standing}">{mark}</b> {escape(line.words)}'
    name = link(line.page, line.name) if line.page else ""
    return (
        GridCell(line.name, html=name),
        line.robot,
        f"{line.duration:.1f} s",
        line.contacts,
        line.hardest,
        DASH if line.least is None else f"{line.least:.0f} N",
        line.error,
        GridCell(f"{mark} {line.words}", html=f'<span class="wrapped">{sign}</span>'),
    )


def page_in(folder: str) -> str:
    """The page in a report's sub-folder, relative to the index."""
    return f"{folder}/index.html"


def link(page: str, name: str) -> str:
    """HTML of a link to a log's page; both texts may hold any letter."""
    return f'<a href="{escape(quote(page))}">{escape(name)}</a>'
