"""The index over the reports of several logs: one line a log, the worst first."""

from collections.abc import Mapping, Sequence
from html import escape
from types import MappingProxyType
from urllib.parse import quote

from vftcli.analysis import Analysis
from vftcli.outputs.believability import Ground, grounds, health
from vftcli.outputs.contacts import by_force, hardest_words
from vftcli.outputs.grid import DASH, Column, Grid, GridCell, html, significant
from vftcli.outputs.log.rmse_tables import blocks, mean_of, rmse_grid
from vftcli.outputs.page.shell import alarms, document, lead, section, soft, top

ORDER = ("bad", "caution", "unknown", "good")
"""Standings, the worst first."""

HEADS = ("Log", "Robot", "Span", "Contacts", "Hardest", "Not told below", "Mean RMSE", "Health")
"""Heads of the overview."""


def render_index(
    analyses: Sequence[tuple[str, Analysis]], failed: Mapping[str, str] = MappingProxyType({})
) -> str:
    """The page over several reports.

    Args:
        analyses: Each told by its sub-folder, relative to the index.
        failed: Why each of the other logs could not be analysed, by its label.
    """
    lines = [(folder, analysis, health(grounds(analysis))) for folder, analysis in analyses]
    lines.sort(key=rank)
    overview = Grid(
        columns=tuple(Column(head, words=True) for head in HEADS),
        rows=tuple(index_row(*line) for line in lines),
    )
    tables = "".join(
        f"<h3>{link(folder, analysis.recording.name)}</h3>"
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
        html(overview),
        *(soft(escape(f"✗ {name} is left out: {reason}")) for name, reason in failed.items()),
        soft("The worst first: by the health of the log, then by the hardest contact."),
        section("Errors against a reference", tables),
    )
    return document(title, "".join(parts))


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


def rank(line: tuple[str, Analysis, Ground]) -> tuple[int, float]:
    """Where a log stands: the worst health first, then the hardest contact."""
    _, analysis, ground = line
    hardest = analysis.contacts.hardest if analysis.contacts is not None else None
    return ORDER.index(ground.standing), -((hardest and hardest.peak_force) or 0.0)


def index_row(folder: str, analysis: Analysis, ground: Ground) -> tuple[GridCell | str, ...]:
    """One log's entries in the overview: its name links to its own page."""
    recording, found = analysis.recording, analysis.contacts
    contacts = hardest = least = DASH
    if found is not None:
        is_load = bool(found.contacts) and found.contacts[0].is_load
        contacts = "load" if is_load else str(len(found.contacts))
        hardest = hardest_words(found)
        if found.told_force is not None:
            least = f"{found.told_force:.0f} N"
    best, errors = DASH, blocks(analysis.errors) if analysis.errors is not None else ()
    if errors:
        means = [mean_of(row) for row in errors[0].rmse]
        # A mean that is not known comes last.
        k = min(range(len(means)), key=lambda i: (means[i] != means[i], means[i]))
        best = f"{significant(means[k])} N·m ({errors[0].observers[k]})"
    words = f"{ground.subject}: {ground.sentence}" if ground.standing != "good" else "sound"
    sign = f'<b class="{ground.standing}">{ground.mark}</b> {escape(words)}'
    return (
        GridCell(recording.name, html=link(folder, recording.name)),
        analysis.robot.name,
        f"{recording.duration:.1f} s",
        contacts,
        hardest,
        least,
        best,
        GridCell(f"{ground.mark} {words}", html=f'<span class="wrapped">{sign}</span>'),
    )


def link(folder: str, name: str) -> str:
    """HTML of a link to the report in a sub-folder; both texts may hold any letter."""
    return f'<a href="{escape(quote(folder))}/index.html">{escape(name)}</a>'
