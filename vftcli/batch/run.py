"""A batch: every log of a collection done once and gathered in one table."""

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import polars as pl

from vftcli.batch.choice import WorkersChoice
from vftcli.batch.cluster import Effort, Failure, Outcome, Tell, run_tasks
from vftcli.batch.keys import content_digest, key_of, options_digest, with_files
from vftcli.batch.log_work import SCHEMA, LogJob, LogTask, work_on_log
from vftcli.outputs.batch_folder import BatchFolder
from vftcli.outputs.believability import LogSummary
from vftcli.outputs.page.pages import batch_lines, render_batch
from vftcli.outputs.run_record import envelope, versions
from vftcli.readers.library import LogEntry, absolute, labelled
from vftcli.signals.progress import stage

SMALL = 300_000  #: Logs of fewer bytes share a task. [B]
TOGETHER = 64  #: At most so many.
SHARES = 8  #: Least groups of a worker, so that all end at about one time.


class BatchCount(NamedTuple):
    """Progress of a batch."""

    logs: int  #: Number of logs.
    before: int  #: Number done by an earlier run.
    done: int  #: Number done by this run.
    failed: int  #: Number failed.


@dataclass(kw_only=True)
class BatchRun:
    """A batch and one run of it: logs done, failures, efforts."""

    logs: Sequence[LogEntry]  #: The logs.
    job: LogJob  #: Work on each.
    folder: BatchFolder  #: Where it is written.
    workers: WorkersChoice  #: Where it is done.
    command: str  #: The command line, for the records.
    tell: Tell = field(repr=False)  #: Receives a sentence on each step.

    def __post_init__(self) -> None:
        # A worker of a cluster may stand in another folder.
        self.job = replace(self.job, choice=with_files(self.job.choice, absolute))
        self.options = options_digest(self.job)
        names = labelled(entry.path for entry in self.logs)
        self.labels = [
            names[e.path] if e.episode is None else f"{names[e.path]} episode {e.episode}"
            for e in self.logs
        ]
        self.keys: dict[int, str] = {}
        self.failures: dict[int, Failure] = {}
        self.efforts: dict[str, Effort] = {}
        self.before = 0
        self.done: set[str] = set()

    def groups(self) -> Iterator[list[LogTask]]:
        """Groups of logs to do, those of equal bytes once, small ones together."""
        there, begun = self.folder.keys(), set[str]()
        workers = max(1, self.workers.jobs or 4)
        most = max(1, min(TOGETHER, len(self.logs) // (SHARES * workers)))
        group: list[LogTask] = []
        room = float(most)
        for number, entry in enumerate(self.logs):
            try:
                content = content_digest(entry.files)
            except OSError as error:
                line = f"cannot be read ({error.strerror})"
                self.failures[number] = Failure("finding", type(error).__name__, line)
                continue
            key = self.keys[number] = key_of(content, self.options, entry.episode)
            self.before += key in there
            if key in there or key in begun:
                continue
            begun.add(key)
            size = sum(path.stat().st_size for path in entry.files if path.exists())
            share = 1.0 if entry.episode is not None or size < SMALL else float(most)
            if group and share > room:
                yield group
                group, room = [], float(most)
            room -= share
            group.append(
                LogTask(
                    job=self.job,
                    folder=self.folder.path,
                    command=self.command,
                    path=entry.path,
                    episode=entry.episode,
                    label=self.labels[number],
                    key=key,
                    sha256=content if entry.files == (entry.path,) else "",
                )
            )
        if group:
            yield group

    def run(self, *, force: bool) -> "tuple[pl.DataFrame, BatchCount]":
        """Failures (log, key, stage, error, line) and counts, once all is done.

        `force`: a batch with other options may go on.
        """
        record = {"command": self.command, "do": self.job.do, "versions": versions()}
        with self.folder.opened(self.options, record, force=force):
            self.work()
            return self.gather()

    def work(self) -> None:
        """Do the rest of the batch."""
        groups = self.groups()
        first = next(groups, None)
        if first is None:
            return
        # Every worker must see the folder, the first log, the options' files.
        seen = [str(self.folder.path), str(first[0].path)]

        def noted(path: Path) -> Path:
            seen.append(str(path))
            return path

        with_files(self.job.choice, noted)
        ended = run_tasks(chain([first], groups), work_on_log, self.workers, self.tell, seen)
        # A batch that stops early takes its cluster down at once.
        with closing(ended):  # type: ignore[type-var]
            for outcome in ended:
                self.take(outcome)
                failed, every = len(self.failures), len(self.logs)
                over = self.before + len(self.done) + failed
                stage(f"{over}/{every} logs, {failed} failed", over / every)

    def take(self, outcome: Outcome[LogTask]) -> None:
        """Keep a log's failure and effort."""
        task = outcome.task
        if outcome.effort is not None:
            self.efforts[task.key] = outcome.effort
        failure = outcome.failure
        if failure is None:
            self.done.add(task.key)
            return
        for name in (f"{task.path}: ", f"{task.label}: "):  # the report has the log's name
            failure = failure._replace(line=failure.line.removeprefix(name))
        for number in [n for n, key in self.keys.items() if key == task.key]:
            self.failures[number] = failure

    def gather(self) -> "tuple[pl.DataFrame, BatchCount]":
        """Write the tables, the page and the record of efforts."""
        there = self.folder.keys()
        # Logs of equal bytes that were found after one of them had failed.
        ended = {self.keys[n]: f for n, f in self.failures.items() if n in self.keys}
        self.failures |= {n: ended[key] for n, key in self.keys.items() if key in ended}
        finished = [n for n, key in sorted(self.keys.items()) if key in there]
        logs = pl.DataFrame(
            [(self.labels[n], self.logs[n].episode, self.keys[n]) for n in finished],
            schema={"log": pl.String, "episode": pl.Int64, "key": pl.String},
            orient="row",
        )
        ends = sorted(self.failures.items())
        failures = pl.DataFrame(
            [(self.labels[n], self.keys.get(n), *failure) for n, failure in ends],
            schema=dict.fromkeys(("log", "key", "stage", "error", "line"), pl.String),
            orient="row",
        )
        done = len(finished) - self.before
        count = BatchCount(len(self.logs), self.before, done, len(self.failures))
        # A report is a log's own page.
        own = finished if self.job.do == "report" else ()
        pages = {self.labels[n]: f"{self.folder.place(self.keys[n])}/index.html" for n in own}
        lines = list[LogSummary]()

        def noted() -> "Iterator[pl.DataFrame]":
            for piece in self.folder.gather(logs, SCHEMA):
                lines.extend(batch_lines(piece, pages))
                yield piece

        page, record = lambda: render_batch(lines, failures), self.record(count)
        self.folder.put_gathered(noted(), failures, page, record)
        return failures, count

    def record(self, count: BatchCount) -> dict[str, Any]:
        """Content of `run.json`: time and place of each log's work."""
        label_of = {key: self.labels[n] for n, key in self.keys.items()}
        efforts = self.efforts.values()
        last = max((e.started + e.seconds for e in efforts), default=0.0)
        found = {
            "do": self.job.do,
            "options_sha256": self.options,
            "done_before": count.before,
            "done_now": count.done,
            "failed": count.failed,
            "in_task_s": sum(e.seconds for e in efforts),
            "in_task_cpu_s": sum(e.cpu_seconds for e in efforts),
            "first_to_last_s": last - min(e.started for e in efforts) if efforts else None,
            "tasks": [
                {"log": label_of[key], "key": key, **effort._asdict()}
                for key, effort in self.efforts.items()
            ],
        }
        logs = [
            {"recording": self.labels[n], "path": str(self.logs[n].path), "sha256": None}
            for n in self.keys
        ]
        return envelope(self.command, logs, found=found)
