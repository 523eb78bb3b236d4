"""The index over the reports of several logs: one line a log, the worst first."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from types import MappingProxyType
from urllib.parse import quote

from vftcli.analysis import Analysis
from vftcli.evaluation.errors import JointMeans
from vftcli.outputs.answer import hardest_words
from vftcli.outputs.believability import MARKS, LogSummary, grounds, log_line
from vftcli.outputs.contacts import by_force
from vftcli.outputs.grid import Column, Grid, GridCell, html
from vftcli.outputs.log.rmse_tables import blocks, rmse_grid
from vftcli.outputs.page.shell import alarms, document, lead, section, soft, top
from vftcli.outputs.quantity import DASH, significant

#: Heads of the overview.
HEADS = ("Log", "Robot", "Span", "Contacts", "Hardest", "Not told below", "Mean RMSE", "Health")

WORST_FIRST = "The worst first: by the health of the log, then by the hardest contact."


def render_index(
    analyses: Sequence[tuple[str, Analysis]], failed: Mapping[str, str] = MappingProxyType({})
) -> str:
    """The page over several reports, each with its folder."""
    lines = [(index_line(*each), each[1]) for each in analyses]
    lines.sort(key=lambda line: line[0].rank)
    tables = "".join(
        f"<h3>{link(line)}</h3>{''.join(map(html, map(rmse_grid, blocks(analysis.errors))))}"
        for line, analysis in lines
        if analysis.errors is not None
    )
    found = [one for _, analysis in analyses for one in analysis.examinations]
    robots = dict.fromkeys(a.robot.title or a.robot.name for _, a in analyses)
    title, words = headline(analyses)
    parts = (
        alarms(found),
        top((f"{len(analyses) + len(failed)} logs", ", ".join(robots)), title, lead(words)),
        overview(line for line, _ in lines),
        *(soft(escape(f"✗ {name} is left out: {reason}")) for name, reason in failed.items()),
        soft(WORST_FIRST),
        section("Errors against a reference", tables),
    )
    return document(title, "".join(parts), scripts=["sort.js"])


def index_line(folder: str, analysis: Analysis) -> LogSummary:
    """One log's line, with its page in a sub-folder and its least error."""
    line = log_line(analysis, grounds(analysis))._replace(page=f"{folder}/index.html")
    for block in blocks(analysis.errors)[:1] if analysis.errors is not None else ():
        line = line._replace(error=least_error(block.means))
    return line


def least_error(means: JointMeans) -> str:
    """The least mean RMSE and its observer."""
    return DASH if means.least is None else f"{significant(means.least[1])} N·m ({means.least[0]})"


def overview(lines: Iterable[LogSummary]) -> str:
    """The table of all logs, the worst first; a click on a head sorts by it."""
    rows = tuple(map(index_row, sorted(lines, key=lambda line: line.rank)))
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


def index_row(line: LogSummary) -> tuple[GridCell | str, ...]:
    """A line of the overview: the log's name links to its own page, where it has one."""
    mark = MARKS[line.standing]
    sign = f'<b class="{line.standing}">{mark}</b> {escape(line.words)}'
    return (
        GridCell(line.name, html=link(line) if line.page else ""),
        line.robot,
        f"{line.duration:.1f} s",
        line.contacts,
        line.hardest,
        DASH if line.least is None else f"{line.least:.0f} N",
        line.error,
        GridCell(f"{mark} {line.words}", html=f'<span class="wrapped">{sign}</span>'),
    )


def link(line: LogSummary) -> str:
    """HTML of a link to a log's page; both texts may hold any letter."""
    return f'<a href="{escape(quote(line.page))}">{escape(line.name)}</a>'
