"""Experiments of a paper, each once a seed, and their results beside its print.

A run has its own seed, so its numbers do not depend on the others. A page, its Markdown
and figures show them.
"""

from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from functools import partial
from html import escape
from itertools import chain, product
from typing import Any, NamedTuple

import numpy as np

from vftcli.batch import WorkersChoice
from vftcli.batch.cluster import perform, run_tasks
from vftcli.outputs.charts import Chart
from vftcli.outputs.files import SEAL, OutputFolder
from vftcli.outputs.grid import DASH, Column, Grid, GridCell, markdown, minus, significant
from vftcli.outputs.page.shell import page
from vftcli.outputs.paper import Drawing, figure_files, line_figure, plots_of, write_figures
from vftcli.outputs.run_record import envelope, seal
from vftcli.reproduction.control import closed_loop, latest_turns, released
from vftcli.reproduction.estimates import assembled_bearing, dragged_sensor, tapped_circle
from vftcli.reproduction.paper import FLOOR, Given, Paper, ShownItem, paper_of
from vftcli.reproduction.timing import computing_time
from vftcli.signals.progress import stage

#: Experiment → its results from a seed and its own arguments.
RUNS: dict[str, Callable[..., Iterator[Given]]] = {
    run.__name__: run
    for run in (
        assembled_bearing,
        closed_loop,
        computing_time,
        dragged_sensor,
        latest_turns,
        released,
        tapped_circle,
    )
}
PAGE, TEXT = "index.html", "reproduction.md"  #: The page, and its Markdown.
#: Note on the overview's ratios.
RATIOS = (
    "Ours / print: the median of the lines that print a number, in brackets the range, of the "
    "column that it follows."
)


class Job(NamedTuple):
    """One experiment with one seed."""

    paper: str
    experiment: str
    seed: int


#: A job's results by variant and key.
RunResult = dict[tuple[str, str], float | Chart | None]
Result = RunResult | str  #: A job's results, or the one line of its failure.


def jobs_of(paper: Paper, names: Sequence[str], fast: bool) -> list[Job]:
    """Experiments of these items, once a seed; only the first if `fast`."""
    wanted = {e for name in names for e in paper.items[name].experiments}
    return [
        Job(paper.name, name, seed)
        for name in paper.experiments
        if name in wanted
        for seed in paper.experiments[name].seeds[: 1 if fast else None]
    ]


def run_job(job: Job) -> RunResult:
    """A job's results; traces of the first seed alone."""
    experiment, found = paper_of(job.paper).experiments[job.experiment], RunResult()
    for variant, key, value in RUNS[experiment.run](job.seed, **experiment.given):
        if not isinstance(value, Chart):
            found[variant, key] = None if value is None else float(value)
        elif job.seed == experiment.seeds[0]:
            found[variant, key] = value
    return found


def run_jobs(jobs: Sequence[Job], workers: int | None = None) -> dict[Job, Result]:
    """Results of jobs, timed ones last, alone; a failure is one line."""
    stage(f"{len(jobs)} runs")
    experiments = {job: paper_of(job.paper).experiments[job.experiment] for job in jobs}
    alone = [job for job in jobs if experiments[job].alone]
    beside = ([job] for job in jobs if job not in alone)
    found: dict[Job, Result] = {}
    with closing(
        run_tasks(beside, run_job, WorkersChoice(jobs=workers), lambda _: None)
    ) as ended:  # type: ignore[type-var]
        for job, value, failure, _ in chain(ended, (perform(run_job, job) for job in alone)):
            where = f"{experiments[job].title}, seed {job.seed}"
            found[job] = value if failure is None else f"{where}: {failure.line}"
            done = f"{len(found)} of {len(jobs)} runs done"
            stage(f"{done}: {job.experiment}, seed {job.seed}", len(found) / len(jobs))
    return {job: found[job] for job in jobs}


def gather(
    paper: Paper, names: Sequence[str], results: dict[Job, Result]
) -> dict[str, ShownItem]:
    """Name of an item → its values, a list over the seeds for each."""
    found = {}
    for name in names:
        item, values = paper.items[name], defaultdict[str, Any](lambda: defaultdict(list))
        own = [result for job, result in results.items() if job.experiment in item.experiments]
        made = [result for result in own if not isinstance(result, str)]
        for one, line in product(made, item.lines):
            for (variant, key), value in one.items():
                if key == line.key:
                    values[key][variant].append(value)
        charts = [x for x in (one.get(("", name)) for one in made) if isinstance(x, Chart)]
        chart = charts[0]._replace(key=name, title=item.traces) if charts else None
        failures = tuple(result for result in own if isinstance(result, str))
        found[name] = ShownItem(item, values, chart, failures)
    return found


def files_of(paper: Paper, names: Sequence[str], form: str | None) -> list[str]:
    """Files of a folder of these items; `form` is the figures' format."""
    drawn = [name for name in names if paper.items[name].traces]
    return [PAGE, TEXT, SEAL, *figure_files(form, drawn)]


def spread(values: Sequence[float | None]) -> str:
    """Mean over the seeds, range, and number of seeds if some have none."""
    known = [value for value in values if value is not None and np.isfinite(value)]
    if not known:
        return DASH
    text = short_number(float(np.mean(known)))
    if len(known) > 1 and short_number(min(known)) != short_number(max(known)):
        text += f" ({short_number(min(known))} … {short_number(max(known))})"
    return text if len(known) == len(values) else f"{text}, {len(known)} of {len(values)}"


def short_number(value: float) -> str:
    """Three significant digits; a whole number as it is."""
    text = f"{value:.0f}" if value == round(value) else significant(value)
    return minus(text)


def item_grid(shown: ShownItem) -> Grid:
    """The print, ours in every variant, and the floor, if any."""
    item, values = shown.item, shown.values
    floors = any(FLOOR in values.get(line.key, {}) for line in item.lines)
    kinds = (*item.variants, *([FLOOR] if floors else []))
    heads = ("what", "unit", "printed", *kinds)
    rows = [
        (
            line.label,
            line.unit or DASH,
            minus(line.printed) or DASH,
            *(spread(values.get(line.key, {}).get(kind, [])) for kind in kinds),
        )
        for line in item.lines
    ]
    words = {"what", "unit"}
    return Grid(tuple(Column(h, words=h in words) for h in heads), rows=tuple(rows))


def beside_print(shown: ShownItem) -> str:
    """Ours over the print: median and range of the lines with a number."""
    kind = shown.item.nearest
    ratios = []
    for line in shown.item.lines:
        values = shown.values.get(line.key, {}).get(kind, [])
        known = [value for value in values if value is not None]
        if known and line.number and line.compared:
            ratios.append(float(np.mean(known)) / line.number)
    if not ratios:
        return DASH
    low, high = significant(min(ratios), 2), significant(max(ratios), 2)
    text = significant(float(np.median(ratios)), 2)
    return text if low == high else f"{text} ({low} … {high})"


def overview(found: Mapping[str, ShownItem]) -> Grid:
    """Every item in a row: its title, ours over the print, and its verdict."""
    heads = "item", "what it shows", "ours / print", "ours", "reproduced"
    rows = [
        (
            GridCell(shown.item.label, html=f'<a href="#{name}">{escape(shown.item.label)}</a>'),
            wrapped(shown.item.title),
            (ratio := beside_print(shown)),
            DASH if ratio == DASH else shown.item.nearest,
            wrapped("; ".join(shown.failures) or shown.item.verdict),
        )
        for name, shown in found.items()
    ]
    seldom = {"what it shows", "ours"}
    columns = [Column(h, words=h != "ours / print", seldom=h in seldom) for h in heads]
    return Grid(columns, rows)


def wrapped(text: str) -> GridCell:
    """Words that the page may break."""
    return GridCell(text, html=f'<div class="words">{escape(text)}</div>')


def seeds_line(jobs: Sequence[Job], paper: Paper) -> tuple[str, ...]:
    """Experiments and their seeds."""
    seeds: dict[str, list[int]] = {}
    for job in jobs:
        seeds.setdefault(job.experiment, []).append(job.seed)
    return tuple(
        paper.experiments[name].title
        + (f": seed{'s' * (len(own) > 1)} {', '.join(map(str, own))}" if own != [0] else "")
        for name, own in seeds.items()
    )


def render_page(paper: Paper, found: Mapping[str, ShownItem], jobs: Sequence[Job]) -> str:
    """The page."""
    return page(
        "reproduction.html",
        f"{paper.name}, reproduced",
        [shown.chart for shown in found.values() if shown.chart is not None],
        paper=paper,
        overview=overview(found),
        ratios=RATIOS,
        found=found,
        item_grid=item_grid,
        seeds=seeds_line(jobs, paper),
    )


def render_markdown(
    paper: Paper, found: Mapping[str, ShownItem], jobs: Sequence[Job], command: str
) -> str:
    """Markdown of a reproduction, with its command."""
    parts = [
        f"# {paper.name}, reproduced\n",
        f"{paper.title}. doi {paper.doi}.\n",
        "\n".join(paper.setting) + "\n",
        f"Made by `{command}`. `--only table1,fig7` makes some items, `--fast` one seed of each.\n",
        markdown(overview(found)),
        f"{RATIOS}\n",
    ]
    for shown in found.values():
        item = shown.item
        parts.append(f"## {item.label}: {item.title}\n")
        parts += [f"**Failed:** {line}\n" for line in shown.failures]
        parts.append(f"**{item.answer}** {item.why}\n")
        if item.lines:
            parts.append(markdown(item_grid(shown)))
    parts.append("## What was run\n")
    parts.append("".join(f"- {line}\n" for line in seeds_line(jobs, paper)))
    return "\n".join(parts)


def write_reproduction(
    folder: OutputFolder,
    paper: Paper,
    found: Mapping[str, ShownItem],
    jobs: Sequence[Job],
    command: str,
    form: str | None = None,
) -> None:
    """Write page, Markdown, figures if a form is given, and the seal."""
    folder.write(PAGE, render_page(paper, found, jobs))
    folder.write(TEXT, render_markdown(paper, found, jobs, command))
    if form is not None:
        drawings = {
            name: Drawing(
                f"{shown.item.label}: {shown.item.title}",
                partial(line_figure, plots=plots_of(shown.chart)),
            )
            for name, shown in found.items()
            if shown.chart is not None
        }
        write_figures(folder, drawings, form)
    record = {
        "paper": paper.name,
        "runs": [{"experiment": job.experiment, "seed": job.seed} for job in jobs],
        "values": {name: shown.values for name, shown in found.items()},
        "failures": {name: shown.failures for name, shown in found.items() if shown.failures},
    }
    seal(folder, SEAL, envelope(command, found=record))
