"""A benchmark: all logs of a manifest scored once by all protocols, in one table.

It first makes simulated logs, free logs with planted pushes, and robot files from other
days. Each task writes its rows; a second run skips tasks with rows.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import polars as pl
from polars import String

from vftcli.answering import identified
from vftcli.batch import WorkersChoice
from vftcli.batch.cluster import Failure, Outcome, Tell, perform, run_tasks
from vftcli.batch.log_work import content_digest, digest_of, key_of, options_digest
from vftcli.doctor.examination import Examiner
from vftcli.identification import Task
from vftcli.outputs.batch_folder import BatchFolder
from vftcli.outputs.benchmark import Results, render_benchmark
from vftcli.outputs.conversion import companions, convert, save
from vftcli.outputs.files import put_table
from vftcli.outputs.run_record import envelope
from vftcli.pipeline import prepared
from vftcli.readers.reading import Library, absolute
from vftcli.reproduction.manifest import (
    PUSHED,
    BenchmarkLog,
    Manifest,
    Rival,
    TrainedRobot,
    read_parts,
)
from vftcli.reproduction.scoring import SCHEMA, ScoreTask, planted, score_log
from vftcli.signals.option import interval
from vftcli.signals.packages import check_installed
from vftcli.signals.parsing import counted
from vftcli.signals.progress import stage
from vftcli.signals.shown import frame_of, per_joint
from vftcli.signals.wrench import per_axis
from vftcli.simulation import load_scenario, simulate


@dataclass
class BenchmarkRun:
    """A benchmark and one run of it: failures and efforts of its tasks."""

    manifest: Manifest
    rivals: Sequence[Rival]
    output: Path  #: The folder that it writes.
    workers: WorkersChoice
    command: str  #: The command line, for the records.
    marked: frozenset[str]  #: Logs scored in spite of a complaint.
    tell: Tell = field(repr=False)
    failures: list[tuple[str, Failure]] = field(default_factory=list)
    efforts: list[dict[str, Any]] = field(default_factory=list)
    #: Name → file of each log that is there.
    files: dict[str, Path] = field(default_factory=dict)
    #: Name → file of each trained robot.
    robots: dict[str, Path] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.folder = BatchFolder(absolute(self.output), "scores.parquet")

    def run(self, *, force: bool) -> Results:
        """Scores of every method, once all is done and written."""
        manifest = self.manifest
        logs = [log for log in manifest.logs if not manifest.missing(log)]
        marker = {"command": self.command, "do": "benchmark"}
        with self.folder.opened(options_digest("benchmark"), marker, force=force):
            for log in logs:
                self.make_log(log)
            for robot in manifest.robots:
                if robot.name in {log.identified for log in logs}:
                    self.fit(robot)
            tasks = list(self.tasks([log for log in logs if log.name in self.files]))
            self.score(tasks)
            there = self.folder.keys()
            done = dict.fromkeys(task.key for task in tasks if task.key in there)
            keys = pl.DataFrame({"key": [*done]}, schema={"key": String})
            pieces = self.folder.gather(keys, {"key": String, **SCHEMA})
            table = pl.concat([*pieces]).drop_nulls("method").select(*SCHEMA)
            results, record = Results(table), self.record(logs)
            columns = dict.fromkeys(("task", "stage", "error", "line"), String)
            ends = [(name, *why) for name, why in self.failures]
            title = f"{counted(len(logs), 'log')} against the truth"
            self.folder.put_gathered(
                [table],
                pl.DataFrame(ends, columns, orient="row"),
                lambda: render_benchmark(results, title, record),
                record,
            )
            return results

    def note(self, name: str, outcome: Outcome[Any]) -> None:
        """Keep a task's failure and effort."""
        if outcome.failure is not None:
            self.failures.append((name, outcome.failure))
        if outcome.effort is not None:
            self.efforts.append({"task": name, **outcome.effort._asdict()})

    def make(self, name: str, path: Path, work: Callable[[Path], object]) -> bool:
        """Whether a file is there; makes it if missing."""
        if not path.exists():
            stage(f"making {name}")
            self.note(name, perform(work, path))
        return path.exists()

    def make_log(self, log: BenchmarkLog) -> None:
        """Find a log, or make it: simulated, joined, or with pushes planted."""
        manifest, base = self.manifest, self.files.get(log.name.removesuffix(PUSHED))
        if log.file and not log.pushes:
            self.files[log.name] = manifest.data / log.file
            return
        if log.pushes and base is None:
            return  # it could not be made, which is said
        sources = [base] if log.pushes and base else manifest.paths(log)
        content = content_digest(sources) if sources else ""
        place = f"{log.name}-{key_of(content, options_digest(log))[:8]}"

        def plant(path: Path) -> None:
            choice = manifest.choice(log, "alone", sources[0])
            choice = replace(choice, library=Library(), examiner=Examiner(anyway=True))
            read = choice.library.open(sources[0], replace(choice.read, derive="none"))
            recording, wrench, tau = planted(prepared(read, choice), log)
            table = (("t", recording.t), *per_joint("tau_ext", tau), *per_axis("wrench", wrench))
            put_table(companions(path)[0], frame_of(table))
            convert(recording, path, force=True)

        def assemble(path: Path) -> None:
            signals = (part.partition("=")[0] for part in log.parts)
            put_table(path, pl.DataFrame(read_parts(dict(zip(signals, sources, strict=True)))))

        def run(path: Path) -> None:
            check_installed("pinocchio", "a simulated log")
            made = simulate(load_scenario(log.scenario, log.changes), log.seed)
            save({path: made}, "parquet", force=True, command=self.command)

        work = plant if log.pushes else run if log.scenario else assemble
        path = self.folder.made(place) / f"{log.name}.parquet"
        if self.make(log.name, path, work):
            self.files[log.name] = path

    def fit(self, robot: TrainedRobot) -> None:
        """Make a robot file from its training logs, if all are there."""
        if not self.files.keys() >= set(robot.train):
            return
        logs = [self.files[name] for name in robot.train]
        choice = self.manifest.choice(self.manifest.by_name[robot.train[0]], "alone", logs[0])
        read = replace(choice.read, interval=interval(robot.interval) if robot.interval else None)
        arm = replace(choice.robot, name=robot.robot or choice.robot.name)
        task = Task(method=robot.method or None, name=robot.name)
        examiner = Examiner(fitting=task.keeps_links)
        choice = replace(choice, read=read, robot=arm, wrench=None)
        choice = replace(choice, library=Library(logs), examiner=examiner)
        key = key_of(content_digest(logs), options_digest([choice, task]))
        path = self.folder.made("robots") / f"{robot.name}-{key[:8]}.toml"

        def fit(path: Path) -> None:
            identified(logs, (), choice, task).robot.save(path)

        if self.make(robot.name, path, fit):
            self.robots[robot.name] = path

    def score(self, tasks: Sequence[ScoreTask]) -> None:
        """Score what is not scored yet."""
        there, seen = self.folder.keys(), [str(self.folder.path)]
        left = [task for task in tasks if task.key not in there]
        if not left:
            return
        ended = run_tasks(([task] for task in left), score_log, self.workers, self.tell, seen)
        with closing(ended):  # type: ignore[type-var]
            for done, outcome in enumerate(ended, 1):
                self.note(outcome.task.label, outcome)
                stage(f"{done} of {len(left)} scored", done / len(left))

    def tasks(self, logs: Sequence[BenchmarkLog]) -> Iterator[ScoreTask]:
        """A task per log and protocol, and per log of an arm with outside estimates."""
        for log in logs:
            for protocol in log.protocols:
                is_fit = protocol == "identified"
                free = {word for word in log.free if ":" not in word}
                if log.identified in self.robots if is_fit else free <= self.files.keys():
                    yield self.task(log, protocol, None)
        for rival in self.rivals:
            arms = {log.arm for log in logs if rival.file(log) is not None}
            asked = [log for log in logs if log.arm in arms and log.protocols]
            yield from (self.task(log, rival.declared.protocol, rival) for log in asked)

    def task(self, log: BenchmarkLog, protocol: str, rival: Rival | None) -> ScoreTask:
        """The task of a log, with a key of all its inputs."""
        file, truth, outside = self.files[log.name], None, list[object]()
        robot = self.robots[log.identified] if protocol == "identified" and not rival else None
        asked = protocol if rival is None else "alone"
        choice = self.manifest.choice(log, asked, file, robot, self.files)
        if log.pushes or log.scenario:
            truth = companions(file)[0]
        elif log.truth in {"sensor", "torque"}:
            truth = self.manifest.data / log.truth_file if log.truth_file else file
        if rival is not None:
            own = rival.file(log), rival.file(log, "contacts.csv")
            outside = [rival.name, rival.declared, *own]
        marked = log.name.removesuffix(PUSHED) in self.marked
        options = options_digest([log, protocol, choice, truth, outside, marked])
        key = key_of(content_digest([file]), options)
        return ScoreTask(self.folder.path, key, log, protocol, choice, file, truth, rival, marked)

    def record(self, logs: Sequence[BenchmarkLog]) -> dict[str, Any]:
        """Content of `run.json`: manifest, logs, absent ones, efforts."""
        keys, manifest = ("arm", "truth", "source", "licence"), self.manifest
        entries = [
            {
                "recording": log.name,
                "path": str(self.files.get(log.name)),
                "sha256": content_digest(paths) if (paths := manifest.paths(log)) else None,
                **{key: getattr(log, key) for key in keys},
                "truth_error": log.truth_error.note,
            }
            for log in logs
        ]
        found = {
            "manifest": manifest.path.stem,
            "manifest_sha256": digest_of(manifest.path),
            "left_out": manifest.absent(),
            "failures": {name: failure.line for name, failure in self.failures},
            "outside": {rival.name: rival.declared for rival in self.rivals},
            "tasks": self.efforts,
        }
        return envelope(self.command, entries, found=found)
