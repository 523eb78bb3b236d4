"""Experiments of a paper, each once a seed, and their results beside its print.

A run has its own seed, so its numbers do not depend on the others.
"""

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from html import escape
from itertools import chain
from typing import Any

import numpy as np

from vftcli.batch import WorkersChoice
from vftcli.batch.cluster import perform, run_tasks
from vftcli.outputs.charts import Chart
from vftcli.outputs.files import SEAL, OutputFolder
from vftcli.outputs.grid import DASH, Column, Grid, GridCell, Rows, markdown, minus, significant
from vftcli.outputs.page.shell import page
from vftcli.outputs.paper import Drawing, figure_files, line_figure, plots_of, write_figures
from vftcli.outputs.run_record import envelope, seal
from vftcli.reproduction.huang2025 import (
    assembled_bearing,
    closed_loop,
    dragged_sensor,
    latest_turns,
    released,
    tapped_circle,
)
from vftcli.reproduction.paper import FLOOR, Experiment, Given, Paper, PaperItem, Value
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
PAGE, TABLES = "index.html", "reproduction.md"  #: The page, and its tables.
Job = tuple[Experiment, int]  #: An experiment and one of its seeds.
RunResult = dict[tuple[str, str], Value]  #: A job's results by variant and key.
Result = RunResult | str  #: A job's results, or the one line of its failure.


def experiments_of(paper: Paper, names: Sequence[str], *, fast: bool) -> list[Experiment]:
    """The experiments of these items, with one seed if `fast`."""
    wanted = {e for name in names for e in paper.items[name].experiments}
    own = (e for name, e in paper.experiments.items() if name in wanted)
    return [replace(e, seeds=e.seeds[: 1 if fast else None]) for e in own]


def run_job(job: Job) -> RunResult:
    """A job's results; traces of the first seed alone."""
    experiment, seed = job
    found = RunResult()
    for variant, key, value in RUNS[experiment.run](seed, **experiment.given):
        if not isinstance(value, Chart):
            found[variant, key] = None if value is None else float(value)
        elif seed == experiment.seeds[0]:
            found[variant, key] = value
    return found


def run_jobs(
    experiments: Sequence[Experiment], workers: int | None = None
) -> list[tuple[str, Result]]:
    """Experiment and results by seed; timed ones run last, alone."""
    jobs = [(e, seed) for e in experiments for seed in e.seeds]
    stage(f"{len(jobs)} runs")
    alone, found = (job for job in jobs if job[0].alone), dict[tuple[str, int], Result]()
    beside = ([job] for job in jobs if not job[0].alone)
    with closing(
        run_tasks(beside, run_job, WorkersChoice(jobs=workers), lambda _: None)
    ) as ended:  # type: ignore[type-var]
        for (experiment, seed), value, failure, _ in chain(
            ended, (perform(run_job, job) for job in alone)
        ):
            where = f"{experiment.title}, seed {seed}"
            result = value if failure is None else f"{where}: {failure.line}"
            found[experiment.name, seed] = result
            done = f"{len(found)} of {len(jobs)} runs done"
            stage(f"{done}: {experiment.name}, seed {seed}", len(found) / len(jobs))
    return [(e.name, found[e.name, seed]) for e, seed in jobs]


def gather(
    paper: Paper, names: Sequence[str], results: Iterable[tuple[str, Result]]
) -> dict[str, PaperItem]:
    """Name of an item → it with its results, lists over the seeds."""
    found = {}
    for name in names:
        item = paper.items[name]
        own = [result for experiment, result in results if experiment in item.experiments]
        failures = [result for result in own if isinstance(result, str)]
        worked = [result for result in own if not isinstance(result, str)]
        values: dict[str, Any] = {key: defaultdict(list) for key, *_ in item.lines}
        chart = None
        for (variant, key), value in chain.from_iterable(result.items() for result in worked):
            if isinstance(value, Chart) and key == name:
                chart = value._replace(key=name, title=item.traces)
            elif key in values:
                values[key][variant].append(value)
        found[name] = replace(item, values=values, chart=chart, failures=failures)
    return found


def files_of(paper: Paper, names: Sequence[str], form: str | None) -> list[str]:
    """Files of a folder of these items, figures if `form`."""
    drawn = [name for name in names if paper.items[name].traces]
    return [PAGE, TABLES, SEAL, *figure_files(form, drawn)]


def spread(values: Sequence[float | None]) -> str:
    """Mean over the seeds, range, number of seeds if not all."""
    known = [x for x in values if x is not None and np.isfinite(x)]
    if not known:
        return DASH
    each = float(np.mean(known)), min(known), max(known)
    text, low, high = (
        minus(f"{value:.0f}" if value == round(value) else significant(value)) for value in each
    )
    if low != high:
        text += f" ({low} … {high})"
    if len(known) < len(values):
        text += f", {len(known)} of {len(values)}"
    return text


def item_grid(item: PaperItem) -> Grid:
    """The print, ours in every variant, and the floor, if any."""
    floors = any(FLOOR in values for values in item.values.values())
    kinds = [*item.variants, FLOOR] if floors else item.variants
    rows: Rows = []
    for line in item.lines:
        values = item.values[line.key]
        ours = (spread(values.get(kind, ())) for kind in kinds)
        about = line.label, line.unit or DASH, minus(line.printed) or DASH
        rows.append((*about, *ours))
    return Grid(("what", "unit", *map(Column, ("printed", *kinds))), rows)


def beside_print(item: PaperItem) -> str:
    """Ours over the print: median and range over the lines."""
    ratios = []
    for line in item.lines:
        values = item.values[line.key].get(item.nearest, ())
        known = [x for x in values if x is not None]
        if known and line.number and line.compared:
            ratios.append(float(np.mean(known)) / line.number)
    if not ratios:
        return DASH
    each = np.quantile(ratios, [0.5, 0.0, 1.0])
    text, low, high = (significant(x, 2) for x in each)
    return text if low == high else f"{text} ({low} … {high})"


def overview(found: Mapping[str, PaperItem]) -> Grid:
    """Every item in a row: title, ours over the print, verdict."""
    rows: Rows = []
    for name, item in found.items():
        link = f'<a href="#{name}">{escape(item.label)}</a>'
        ratio = beside_print(item)
        rows.append((
            GridCell(item.label, html=link),
            wrapped(item.title),
            ratio,
            DASH if ratio == DASH else item.nearest,
            wrapped("; ".join(item.failures) or item.verdict),
        ))  # fmt: skip
    columns = (
        "item",
        Column("what it shows", words=True, seldom=True),
        Column("ours / print"),
        Column("ours", words=True, seldom=True),
        "reproduced",
    )
    return Grid(columns, rows)


def wrapped(text: str) -> GridCell:
    """Words that the page may break."""
    return GridCell(text, html=f'<span class="wrapped">{escape(text)}</span>')


def write_reproduction(
    folder: OutputFolder,
    paper: Paper,
    found: Mapping[str, PaperItem],
    experiments: Sequence[Experiment],
    command: str,
    form: str | None = None,
) -> None:
    """Write page, tables, figures if a form is given, and the record."""
    seeds = [
        e.title + (f": seeds {', '.join(map(str, e.seeds))}" if any(e.seeds) else "")
        for e in experiments
    ]
    drawn = {name: item.chart for name, item in found.items() if item.chart is not None}
    text = page(
        "reproduction.html",
        f"{paper.name}, reproduced",
        [*drawn.values()],
        paper=paper,
        overview=overview(found),
        found=found,
        item_grid=item_grid,
        seeds=seeds,
    )
    folder.write(PAGE, text)
    shown = [item for item in found.values() if item.lines]
    grids = (replace(item_grid(item), title=item.heading) for item in shown)
    folder.write(TABLES, "\n".join(map(markdown, [overview(found), *grids])))
    if form is not None:
        drawings = {
            name: Drawing(found[name].heading, partial(line_figure, plots=plots_of(chart)))
            for name, chart in drawn.items()
        }
        write_figures(folder, drawings, form)
    record = {
        "paper": paper.name,
        "runs": [{"experiment": e.name, "seed": seed} for e in experiments for seed in e.seeds],
        "values": {name: item.values for name, item in found.items()},
        "failures": {name: item.failures for name, item in found.items() if item.failures},
    }
    seal(folder, SEAL, envelope(command, found=record))
