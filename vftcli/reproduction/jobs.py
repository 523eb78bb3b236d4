"""Experiments of a paper: each once a seed, two at a time, for all items.

A run has its own seed and nothing in common with another, so that the numbers do not depend on
how many run beside one another.
"""

import multiprocessing
import os
import signal
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from itertools import chain, product
from typing import Any, NamedTuple

from vftcli.reproduction.control import closed_loop, latest_turns, released
from vftcli.reproduction.estimates import assembled_bearing, dragged_sensor, tapped_circle
from vftcli.reproduction.paper import Paper, RunResult, ShownItem, paper_of
from vftcli.reproduction.timing import computing_time
from vftcli.signals.errors import VftError

MOST_WORKERS = 2  #: Processes beside one another: what a full run was measured with.
#: Name of an experiment's `run` → what it gives of a seed and the experiment's own arguments.
RUNS: dict[str, Callable[..., RunResult]] = {
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


class Job(NamedTuple):
    """One experiment with one seed."""

    paper: str  #: Name of the paper.
    experiment: str  #: Name of the experiment.
    seed: int  #: Of everything drawn.


#: Hears how many jobs are done, how many there are, and which one ended.
Hearer = Callable[[int, int, str], None]
Result = RunResult | str  #: What a job gave, or the one line on why it failed.


def jobs_of(paper: Paper, names: Sequence[str], fast: bool) -> list[Job]:
    """Experiments of these items, once a seed; only the first if `fast`."""
    wanted = {e for name in names for e in paper.items[name].experiments}
    return [
        Job(paper.name, name, seed)
        for name in paper.experiments
        if name in wanted
        for seed in paper.experiments[name].seeds[: 1 if fast else None]
    ]


def perform(job: Job) -> Result:
    """Run a job; what it cannot do is one line."""
    experiment = paper_of(job.paper).experiments[job.experiment]
    try:
        made = RUNS[experiment.run](job.seed, **experiment.given)
    except (VftError, ArithmeticError) as error:
        return f"{experiment.title}, seed {job.seed}: {error}"
    # Traces are those of the first seed: the others' would only be carried about.
    return made if job.seed == experiment.seeds[0] else replace(made, charts={})


def run_jobs(
    jobs: Sequence[Job],
    tell: Hearer,
    workers: int | None = None,
) -> dict[Job, Result]:
    """Run jobs, those that take the time last and by themselves."""
    alone = [job for job in jobs if paper_of(job.paper).experiments[job.experiment].alone]
    beside = [job for job in jobs if job not in alone]
    own = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    count = min(workers or min(own or 1, MOST_WORKERS), len(beside))
    found: dict[Job, Result] = {}
    for job, result in chain(pooled(beside, count), ((job, perform(job)) for job in alone)):
        found[job] = result
        tell(len(found), len(jobs), f"{job.experiment}, seed {job.seed}")
    return {job: found[job] for job in jobs}


def pooled(jobs: Sequence[Job], count: int) -> Iterator[tuple[Job, Result]]:
    """Jobs in order of their end, in so many processes; one: this one."""
    if count <= 1:
        yield from ((job, perform(job)) for job in jobs)
        return
    context = multiprocessing.get_context("spawn")
    # A worker ends without a word when Ctrl-C ends the command.
    silent = signal.SIGINT, signal.SIG_DFL
    pool = ProcessPoolExecutor(count, context, initializer=signal.signal, initargs=silent)
    try:
        futures: dict[Future[Result], Job] = {pool.submit(perform, job): job for job in jobs}
        for future in as_completed(futures):
            job = futures[future]
            try:
                yield job, future.result()
            except BrokenProcessPool:
                yield job, f"{job.experiment}, seed {job.seed}: its process was ended"
    except BaseException:
        for child in multiprocessing.active_children():
            child.terminate()
        raise
    finally:
        pool.shutdown(cancel_futures=True)


def gather(paper: Paper, names: Sequence[str], results: dict[Job, Result]) -> dict[str, ShownItem]:
    """Name of an item → its values, a list over the seeds for each."""
    found = {}
    for name in names:
        item, values = paper.items[name], defaultdict[str, Any](lambda: defaultdict(list))
        own = [result for job, result in results.items() if job.experiment in item.experiments]
        made = [result for result in own if isinstance(result, RunResult)]
        for one, line in product(made, item.lines):
            for variant, value in one.values.get(line.key, {}).items():
                values[line.key][variant].append(value)
        charts = [one.charts[name] for one in made if name in one.charts]
        chart = charts[0]._replace(key=name, title=item.traces) if charts else None
        failures = tuple(result for result in own if isinstance(result, str))
        found[name] = ShownItem(item, values, chart, failures)
    return found
