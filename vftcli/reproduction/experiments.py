"""Experiments of a paper, each once a seed, and their results beside its print.

A run has its own seed, so its numbers do not depend on the others. A page, its Markdown
and figures show them.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from html import escape
from itertools import chain

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
from vftcli.reproduction.paper import FLOOR, Given, Job, Paper, PaperItem
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


#: A job's results by variant and key.
RunResult = dict[tuple[str, str], float | Chart | None]
Result = RunResult | str  #: A job's results, or the one line of its failure.


def jobs_of(paper: Paper, names: Sequence[str], fast: bool) -> list[Job]:
    """Experiments of these items, once a seed; only the first if `fast`."""
    wanted = {e for name in names for e in paper.items[name].experiments}
    return [
        Job(experiment, seed)
        for name, experiment in paper.experiments.items()
        if name in wanted
        for seed in experiment.seeds[: 1 if fast else None]
    ]


def run_job(job: Job) -> RunResult:
    """A job's results; traces of the first seed alone."""
    experiment, found = job.experiment, RunResult()
    for variant, key, value in RUNS[experiment.run](job.seed, **experiment.given):
        if not isinstance(value, Chart):
            found[variant, key] = None if value is None else float(value)
        elif job.seed == experiment.seeds[0]:
            found[variant, key] = value
    return found


def run_jobs(jobs: Sequence[Job], workers: int | None = None) -> list[tuple[Job, Result]]:
    """Jobs and their results, timed ones run last, alone; a failure is one line."""
    stage(f"{len(jobs)} runs")
    alone = [job for job in jobs if job.experiment.alone]
    beside = ([job] for job in jobs if not job.experiment.alone)
    found: dict[tuple[str, int], Result] = {}
    with closing(
        run_tasks(beside, run_job, WorkersChoice(jobs=workers), lambda _: None)
    ) as ended:  # type: ignore[type-var]
        for (experiment, seed), value, failure, _ in chain(
            ended, (perform(run_job, job) for job in alone)
        ):
            where = f"{experiment.title}, seed {seed}"
            found[experiment.name, seed] = (
                value if failure is None else f"{where}: {failure.line}"
            )
            done = f"{len(found)} of {len(jobs)} runs done"
            stage(f"{done}: {experiment.name}, seed {seed}", len(found) / len(jobs))
    return [(job, found[job.experiment.name, job.seed]) for job in jobs]


def gather(
    paper: Paper, names: Sequence[str], results: Iterable[tuple[Job, Result]]
) -> dict[str, PaperItem]:
    """Name of an item → it with its results, a list over the seeds for each value."""
    found = {}
    for name in names:
        item = paper.items[name]
        values = {line.key: defaultdict[str, list[float | None]](list) for line in item.lines}
        chart, failures = None, list[str]()
        for job, result in results:
            if job.experiment.name not in item.experiments:
                continue
            if isinstance(result, str):
                failures.append(result)
                continue
            for (variant, key), value in result.items():
                if not isinstance(value, Chart) and key in values:
                    values[key][variant].append(value)
                elif isinstance(value, Chart) and key == name:
                    chart = value._replace(key=name, title=item.traces)
        found[name] = replace(item, values=values, chart=chart, failures=failures)
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


def item_grid(item: PaperItem) -> Grid:
    """The print, ours in every variant, and the floor, if any."""
    floors = any(FLOOR in values for values in item.values.values())
    kinds = (*item.variants, *([FLOOR] if floors else []))
    heads = ("what", "unit", "printed", *kinds)
    rows = [
        (
            line.label,
            line.unit or DASH,
            minus(line.printed) or DASH,
            *(spread(item.values[line.key].get(kind, [])) for kind in kinds),
        )
        for line in item.lines
    ]
    words = {"what", "unit"}
    return Grid(tuple(Column(h, words=h in words) for h in heads), rows=tuple(rows))


def beside_print(item: PaperItem) -> str:
    """Ours over the print: median and range of the lines with a number."""
    ratios = []
    for line in item.lines:
        values = item.values[line.key].get(item.nearest, [])
        known = [value for value in values if value is not None]
        if known and line.number and line.compared:
            ratios.append(float(np.mean(known)) / line.number)
    if not ratios:
        return DASH
    low, high = significant(min(ratios), 2), significant(max(ratios), 2)
    text = significant(float(np.median(ratios)), 2)
    return text if low == high else f"{text} ({low} … {high})"


def overview(found: Mapping[str, PaperItem]) -> Grid:
    """Every item in a row: its title, ours over the print, and its verdict."""
    heads = "item", "what it shows", "ours / print", "ours", "reproduced"
    rows = [
        (
            GridCell(item.label, html=f'<a href="#{name}">{escape(item.label)}</a>'),
            wrapped(item.title),
            (ratio := beside_print(item)),
            DASH if ratio == DASH else item.nearest,
            wrapped("; ".join(item.failures) or item.verdict),
        )
        for name, item in found.items()
    ]
    seldom = {"what it shows", "ours"}
    columns = [Column(h, words=h != "ours / print", seldom=h in seldom) for h in heads]
    return Grid(columns, rows)


def wrapped(text: str) -> GridCell:
    """Words that the page may break."""
    return GridCell(text, html=f'<div class="words">{escape(text)}</div>')


def seeds_line(jobs: Sequence[Job]) -> tuple[str, ...]:
    """Experiments and their seeds."""
    seeds: dict[str, list[int]] = {}
    for job in jobs:
        seeds.setdefault(job.experiment.title, []).append(job.seed)
    return tuple(
        title + (f": seed{'s' * (len(own) > 1)} {', '.join(map(str, own))}" if own != [0] else "")
        for title, own in seeds.items()
    )


def render_page(paper: Paper, found: Mapping[str, PaperItem], jobs: Sequence[Job]) -> str:
    """The page."""
    return page(
        "reproduction.html",
        f"{paper.name}, reproduced",
        [item.chart for item in found.values() if item.chart is not None],
        paper=paper,
        overview=overview(found),
        ratios=RATIOS,
        found=found,
        item_grid=item_grid,
        seeds=seeds_line(jobs),
    )


def render_markdown(
    paper: Paper, found: Mapping[str, PaperItem], jobs: Sequence[Job], command: str
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
    for item in found.values():
        parts.append(f"## {item.label}: {item.title}\n")
        parts += [f"**Failed:** {line}\n" for line in item.failures]
        parts.append(f"**{item.answer}** {item.why}\n")
        if item.lines:
            parts.append(markdown(item_grid(item)))
    parts.append("## What was run\n")
    parts.append("".join(f"- {line}\n" for line in seeds_line(jobs)))
    return "\n".join(parts)


def write_reproduction(
    folder: OutputFolder,
    paper: Paper,
    found: Mapping[str, PaperItem],
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
                f"{item.label}: {item.title}", partial(line_figure, plots=plots_of(item.chart))
            )
            for name, item in found.items()
            if item.chart is not None
        }
        write_figures(folder, drawings, form)
    record = {
        "paper": paper.name,
        "runs": [{"experiment": job.experiment.name, "seed": job.seed} for job in jobs],
        "values": {name: item.values for name, item in found.items()},
        "failures": {name: item.failures for name, item in found.items() if item.failures},
    }
    seal(folder, SEAL, envelope(command, found=record))
