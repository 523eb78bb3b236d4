"""A batch: every log of a collection done once and gathered in one table."""

import json
import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import polars as pl

from vftcli.batch import WorkersChoice
from vftcli.batch.cluster import Effort, Failure, Outcome, Tell, run_tasks
from vftcli.batch.log_work import (
    SCHEMA,
    LogJob,
    LogTask,
    content_digest,
    key_of,
    options_digest,
    with_files,
    work_on_log,
)
from vftcli.outputs.batch_folder import MARKER, BatchFolder
from vftcli.outputs.believability import LogSummary
from vftcli.outputs.files import SEAL
from vftcli.outputs.page.pages import batch_lines, render_logs
from vftcli.outputs.run_record import envelope, versions
from vftcli.readers.opening import files_of, open_log
from vftcli.readers.reader import ALL, ReadChoice
from vftcli.readers.reading import LogFormat, absolute, labelled, read_chosen, recognise
from vftcli.readers.references import stored_observers
from vftcli.signals.errors import LogError, NoLogError, UnknownFormatError
from vftcli.signals.progress import stage

NUMBER = re.compile(rb"(?:^|[\s,;])[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?(?=$|[\s,;])")
#: A smaller file of JSON is read to see whether it is a log. [B]
DESCRIPTION = 1 << 20
FEWEST = 3  #: Numbers in a row: time, a position, an effort.
SMALL = 300_000  #: Logs of fewer bytes share a task. [B]
TOGETHER = 64  #: At most so many.
BELOW = "Every number is in batch.parquet."  #: Below the table of a batch's page.
SHARES = 8  #: Least groups of a worker, so that all end at about one time.


class LogEntry(NamedTuple):
    """One log of a collection."""

    path: Path  #: Its file or folder, from the root.
    episode: int | None = None  #: Its episode, of a file or folder that holds several.
    files: tuple[Path, ...] = ()  #: The files that it is read from.


class BatchCount(NamedTuple):
    """Progress of a batch."""

    logs: int
    before: int  #: Number done by an earlier run.
    done: int  #: Number done by this run.
    failed: int


@dataclass(kw_only=True)
class BatchRun:
    """A batch and one run of it: logs done, failures, efforts."""

    logs: Sequence[LogEntry]
    job: LogJob
    folder: BatchFolder
    workers: WorkersChoice
    command: str  #: The command line, for the records.
    tell: Tell = field(repr=False)  #: Receives a sentence on each step.

    def __post_init__(self) -> None:
        # A worker of a cluster may stand in another folder.
        self.job = replace(self.job, choice=with_files(self.job.choice, absolute))
        # Rows of other columns fit into no table of these.
        self.options = options_digest([self.job, *SCHEMA])
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
        """Groups of logs to do, equal bytes once, small ones together."""
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
        failed = {self.labels[n]: f.line for n, f in ends}
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

        page, record = lambda: render_logs(lines, failed, below=BELOW), self.record(count)
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


class LogCollection:
    """Finds the logs that a command is given.

    A file is a log, whatever it holds. Of a folder what no reader knows is left out, and what
    our commands wrote. Each episode is a log.
    """

    def __init__(self, choice: ReadChoice, leave: Path | None = None) -> None:
        # Each episode is a log of its own unless one is chosen.
        self._choice = replace(choice, episode=None) if choice.episode == ALL else choice
        self._leave = leave and absolute(leave)
        self._searched: set[Path] = set()
        self.passed: list[Path] = []  #: Files of folders that were left out.

    def find(self, places: Iterable[Path]) -> Iterator[LogEntry]:
        """The logs of files, folders and patterns, each once."""
        given: set[Path] = set()
        for place in places:
            found = [place]
            # A name may hold such a letter: a file that is there wins.
            if not place.exists() and set("*?[") & set(str(place)):
                top = Path(place.anchor)
                found = sorted(top.glob(str(place.relative_to(top))))
            for path in map(absolute, found):
                if path not in given:
                    given.add(path)
                    yield from self._inside(path) if path.is_dir() else self._parts(path)

    def _parts(self, path: Path) -> Iterator[LogEntry]:
        try:
            yield from self._episodes(path, recognise(path, self._choice))
        except (LogError, OSError):
            yield LogEntry(path, self._choice.episode, (path,))

    def _episodes(self, path: Path, reader: LogFormat) -> Iterator[LogEntry]:
        """An entry an episode; one where there is one, or one is chosen."""
        chosen, files = self._choice.episode, tuple(files_of(path))
        if reader.name == "lerobot":
            from vftcli.readers import lerobot

            meta = tuple(files_of(path / "meta"))
            for own, data in lerobot.dataset_episodes(path).items():
                if chosen in {None, own}:
                    yield LogEntry(path, own, (*meta, data))
            return
        numbers = reader.numbers(open_log(path)) if chosen is None else ()
        for number in numbers if len(numbers) > 1 else (chosen,):
            yield LogEntry(path, number, files)

    def _inside(self, folder: Path) -> Iterator[LogEntry]:
        """The folder if it is a log, else the logs below, by name."""
        place = folder.resolve()
        if folder == self._leave or place in self._searched or (folder / MARKER).is_file():
            return
        self._searched.add(place)
        try:
            reader = recognise(folder, self._choice)
            # Without metadata.yaml a bag is several recordings.
            several_bags = reader.name == "rosbag2" and not (folder / "metadata.yaml").is_file()
            if reader.name != "droid" and not several_bags:
                yield from self._episodes(folder, reader)
                return
        except LogError:
            pass
        from vftcli.readers.hdf5 import TRAJECTORY

        written = files_written(folder)
        if (folder / TRAJECTORY).is_file():
            yield from self._parts(folder / TRAJECTORY)  # what lies beside it describes it
            return
        for path in sorted(p for p in folder.iterdir() if not p.name.startswith(".")):
            if path.is_dir():
                yield from self._inside(path)
            elif path.name in written or not self._may_be_log(path):
                self.passed.append(path)
            else:
                yield from self._parts(path)

    def _may_be_log(self, path: Path) -> bool:
        """Whether a folder's file may be a log, or a damaged one."""
        if path.name.endswith((".truth.parquet", SEAL)):
            return False
        try:
            reader = recognise(path, self._choice)
        except UnknownFormatError:
            return False
        except (LogError, OSError):
            return True
        if reader.name == "json" and path.stat().st_size < DESCRIPTION:
            try:
                read_chosen(path, self._choice)
            except NoLogError:
                return False  # it describes something
            except LogError:
                return True
        lines = open_log(path).lines if reader.general else ()
        # Prose has no numbers in its second or third line.
        if lines and all(len(NUMBER.findall(line)) < FEWEST for line in lines[1:3]):
            return False
        return not stored_observers(path)


def files_written(folder: Path) -> set[str]:
    """Names of files that vftcli wrote into a folder."""
    try:
        record = json.loads((folder / SEAL).read_text("utf-8"))
        return {SEAL, *map(str, record["files"])} if "vftcli" in record["versions"] else set()
    except (OSError, ValueError, LookupError, TypeError):
        return set()
