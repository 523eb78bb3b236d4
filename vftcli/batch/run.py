"""A batch: every log of a collection done once, on an engine, and gathered in one table."""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from vftcli.batch.choice import WorkersChoice
from vftcli.batch.engine import Effort, Failure, Outcome, run_tasks
from vftcli.batch.keys import content_digest, key_of, options_digest, with_files
from vftcli.batch.log_work import LogJob, LogTask, work_on_log
from vftcli.batch.rows import SCHEMA
from vftcli.outputs.batch_folder import BatchFolder
from vftcli.outputs.believability import LogSummary
from vftcli.outputs.log.run_record import versions
from vftcli.outputs.page.pages import batch_lines, render_batch
from vftcli.readers.collection import LogEntry
from vftcli.readers.library import absolute, labelled

if TYPE_CHECKING:
    import polars as pl

SMALL = 300_000  #: Logs of fewer bytes go to a worker together. [B]
TOGETHER = 64  #: At most so many.
SHARES = 8  #: A worker gets at least so many groups, so that all end at about the same time.

Tell = Callable[[str], None]


@dataclass(frozen=True, kw_only=True)
class BatchPlan:
    """What a batch is to do."""

    logs: Sequence[LogEntry]  #: The logs.
    job: LogJob  #: What is done with each.
    folder: Path  #: Where it is written.
    workers: WorkersChoice  #: Where it is done.
    command: str  #: The command line, for the records.
    force: bool = False  #: Whether a batch with other options may be gone on with.
    tell: Tell = field(repr=False)  #: Who is told in a sentence what is done.
    #: Who is told after each log how many are done.
    progress: "Callable[[BatchCount], None]" = field(repr=False)


class BatchCount(NamedTuple):
    """How far a batch is."""

    logs: int  #: How many logs there are.
    before: int = 0  #: How many of them an earlier run did.
    done: int = 0  #: How many this run did.
    failed: int = 0  #: How many failed.
    seconds: float = 0.0  #: Time since its start. [s]

    @property
    def left(self) -> int:
        """How many are still to be done."""
        return self.logs - self.before - self.done - self.failed


class _Run:
    """One run of a plan: which logs are done, which failed, what each took."""

    def __init__(self, plan: BatchPlan) -> None:
        self.plan = plan
        self.folder = BatchFolder(absolute(plan.folder))
        choice = with_files(plan.job.choice, absolute)
        self.job = replace(plan.job, choice=choice)
        self.options = options_digest(self.job)
        names = labelled(entry.path for entry in plan.logs)
        self.labels = [
            names[e.path] if e.episode is None else f"{names[e.path]} episode {e.episode}"
            for e in plan.logs
        ]
        self.keys: dict[int, str] = {}
        self.failures: dict[int, Failure] = {}
        self.efforts: dict[str, Effort] = {}
        self.before, self.began = 0, time.monotonic()
        self.done: set[str] = set()

    def waiting(self) -> Iterator[tuple[int, LogTask]]:
        """The logs that are to be done, with their numbers; those of equal bytes once."""
        there, begun = self.folder.keys(), set[str]()
        for number, entry in enumerate(self.plan.logs):
            try:
                content = content_digest(entry.files)
            except OSError as error:
                line = f"cannot be read ({error.strerror})"
                self.failures[number] = Failure("finding", type(error).__name__, line)
                continue
            key = self.keys[number] = key_of(content, self.options, entry.episode)
            if key in there:
                self.before += 1
                continue
            if key in begun:
                continue
            begun.add(key)
            yield (
                number,
                LogTask(
                    job=self.job,
                    folder=self.folder.path,
                    command=self.plan.command,
                    path=entry.path,
                    episode=entry.episode,
                    label=self.labels[number],
                    key=key,
                    sha256=content if entry.files == (entry.path,) else "",
                ),
            )

    def grouped(self, waiting: Iterable[tuple[int, LogTask]]) -> Iterator[list[LogTask]]:
        """The same in groups: small logs go together."""
        workers = max(1, self.plan.workers.workers or 4)
        most = max(1, min(TOGETHER, len(self.plan.logs) // (SHARES * workers)))
        group: list[LogTask] = []
        room = float(most)
        for number, task in waiting:
            entry = self.plan.logs[number]
            share = 1.0 if entry.episode is not None or size_of(entry) < SMALL else float(most)
            if group and share > room:
                yield group
                group, room = [], float(most)
            group.append(task)
            room -= share
        if group:
            yield group

    def work(self) -> None:
        """Do what is left of the batch."""
        groups = self.grouped(self.waiting())
        first = next(groups, None)
        if first is None:
            self.plan.progress(self.count())
            return
        # What every worker has to see: the folder, the first log, and what the options name.
        seen = [str(self.folder.path), str(first[0].path)]

        def noted(path: Path) -> Path:
            seen.append(str(path))
            return path

        with_files(self.job.choice, noted)
        every = chain([first], groups)
        ended = run_tasks(every, work_on_log, self.plan.workers, self.plan.tell, seen)
        # A batch that stops early takes its cluster down at once.
        with closing(ended):  # type: ignore[type-var]
            for outcome in ended:
                self.take(outcome)
                self.plan.progress(self.count())

    def take(self, outcome: "Outcome[LogTask]") -> None:
        """Keep what a log came to: why it failed, what it took."""
        task = outcome.task
        if outcome.effort is not None:
            self.efforts[task.key] = outcome.effort
        failure = outcome.failure
        if failure is None:
            self.done.add(task.key)
            return
        for name in (f"{task.path}: ", f"{task.label}: "):  # it is told with the log's name
            failure = failure._replace(line=failure.line.removeprefix(name))
        for number in [n for n, key in self.keys.items() if key == task.key]:
            self.failures[number] = failure

    def count(self) -> BatchCount:
        """How far it is."""
        return BatchCount(
            logs=len(self.plan.logs),
            before=self.before,
            done=len(self.done),
            failed=len(self.failures),
            seconds=time.monotonic() - self.began,
        )

    def gather(self) -> "tuple[pl.DataFrame, BatchCount]":
        """Write the tables, the page and the record of what every log took."""
        import polars as pl

        there = self.folder.keys()
        # Logs of equal bytes that were found after one of them had failed.
        ended = {self.keys[n]: f for n, f in self.failures.items() if n in self.keys}
        self.failures |= {n: ended[key] for n, key in self.keys.items() if key in ended}
        finished = [n for n, key in sorted(self.keys.items()) if key in there]
        logs = pl.DataFrame(
            {
                "log": [self.labels[n] for n in finished],
                "episode": [self.plan.logs[n].episode for n in finished],
                "key": [self.keys[n] for n in finished],
            },
            schema={"log": pl.String, "episode": pl.Int64, "key": pl.String},
        )
        failures = pl.DataFrame(
            [
                (self.labels[n], self.keys.get(n), *failure)
                for n, failure in sorted(self.failures.items())
            ],
            schema={
                "log": pl.String,
                "key": pl.String,
                "stage": pl.String,
                "error": pl.String,
                "line": pl.String,
            },
            orient="row",
        )
        count = self.count()._replace(done=len(finished) - self.before)
        pages, lines = self.pages(finished), list[LogSummary]()

        def noted() -> "Iterator[pl.DataFrame]":
            for piece in self.folder.gather(logs, SCHEMA):
                lines.extend(batch_lines(piece, pages))
                yield piece

        self.folder.put_gathered(
            noted(),
            failures,
            lambda: render_batch(lines, failures),
            self.record(count),
        )
        return failures, count

    def pages(self, finished: Sequence[int]) -> dict[str, str]:
        """Label of a log → its own page, where it has one."""
        if self.job.do != "report":
            return {}
        return {self.labels[n]: f"{self.folder.place(self.keys[n])}/index.html" for n in finished}

    def record(self, count: BatchCount) -> dict[str, Any]:
        """What `run.json` holds: all that depends on when and where a log was done."""
        label_of = {key: self.labels[n] for n, key in self.keys.items()}
        spans = [(e.started, e.started + e.seconds) for e in self.efforts.values()]
        return {
            "command": self.plan.command,
            "versions": versions(),
            "do": self.job.do,
            "options_sha256": self.options,
            "logs": count.logs,
            "done_before": count.before,
            "done_now": count.done,
            "failed": count.failed,
            "in_task_s": sum(e.seconds for e in self.efforts.values()),
            "in_task_cpu_s": sum(e.cpu_seconds for e in self.efforts.values()),
            "first_to_last_s": max(b for _, b in spans) - min(a for a, _ in spans)
            if spans
            else None,
            "tasks": [
                {"log": label_of[key], "key": key, **effort._asdict()}
                for key, effort in self.efforts.items()
            ],
        }


def run_batch(plan: BatchPlan) -> "tuple[pl.DataFrame, BatchCount]":
    """Do what is left of a batch, and gather all of it.

    Returns:
        Why logs failed (columns log, key, stage, error, line), and how many did.
    """
    run = _Run(plan)
    record = {"command": plan.command, "do": plan.job.do, "versions": versions()}
    with run.folder.opened(run.options, record, force=plan.force):
        run.work()
        return run.gather()


def size_of(entry: LogEntry) -> int:
    """Bytes of a log's files, 0 of those that are gone."""
    return sum(path.stat().st_size for path in entry.files if path.exists())
