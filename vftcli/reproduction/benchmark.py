"""A benchmark: all logs of a manifest scored once by all protocols, in one table.

It first makes simulated logs, free logs with planted pushes, and robot files from other
days. Each task writes its rows; a second run skips tasks with rows.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
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
from vftcli.pipeline import AnalysisChoice, prepared
from vftcli.readers.reading import Library, absolute
from vftcli.reproduction.manifest import (
    BenchmarkLog,
    Manifest,
    Pushes,
    Rival,
    TrainedRobot,
    read_parts,
)
from vftcli.reproduction.scoring import SCHEMA, ScoreTask, score_log
from vftcli.robots.chain import flange_jacobian
from vftcli.robots.run import Run
from vftcli.robots.terms import effort_name
from vftcli.signals.arrays import Array
from vftcli.signals.packages import check_installed
from vftcli.signals.parsing import counted
from vftcli.signals.progress import stage
from vftcli.signals.recording import Recording
from vftcli.signals.shown import frame_of, per_joint
from vftcli.signals.wrench import per_axis
from vftcli.simulation import load_scenario, simulate
from vftcli.simulation.writers import TRUTH_COLUMNS


@dataclass
class BenchmarkRun:
    """A benchmark and one run of it."""

    manifest: Manifest
    rivals: Sequence[Rival]
    output: Path  #: The folder that it writes.
    workers: WorkersChoice
    command: str  #: The command line, for the records.
    marked: frozenset[str]  #: Logs scored in spite of a complaint.
    tell: Tell = field(repr=False)
    #: Name of each piece of work → how it ended.
    ended: dict[str, Outcome[Any]] = field(default_factory=dict)
    #: Name → log to score, its entry's or with the made file.
    logs: dict[str, BenchmarkLog] = field(default_factory=dict)
    #: Name → file of each trained robot.
    robots: dict[str, Path] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.folder = BatchFolder(absolute(self.output), "scores.parquet")

    def run(self, *, force: bool) -> Results:
        """Scores of every method, once all is done and written."""
        logs = [log for log in self.manifest.logs.values() if not log.missing]
        marker = {"command": self.command, "do": "benchmark"}
        with self.folder.opened(options_digest("benchmark"), marker, force=force):
            for log in logs:
                self.make_log(log)
            for name in dict.fromkeys(log.identified for log in logs if log.identified):
                self.fit(self.manifest.robots[name])
            tasks, done = {task.key: task for task in self.tasks()}, self.folder.keys()
            self.score([task for key, task in tasks.items() if key not in done])
            there = self.folder.keys()
            table = self.folder.read_rows([key for key in tasks if key in there], SCHEMA)
            results, record = Results(table), self.record(logs)
            ends = [(name, *failure) for name, failure in self.failures.items()]
            columns = dict.fromkeys(("task", "stage", "error", "line"), String)
            title = f"{counted(len(logs), 'log')} against the truth"
            self.folder.put_gathered(
                [table],
                pl.DataFrame(ends, columns, orient="row"),
                lambda: render_benchmark(results, title, record),
                record,
            )
            return results

    @property
    def failures(self) -> dict[str, Failure]:
        """Name of what failed → why."""
        return {name: each.failure for name, each in self.ended.items() if each.failure}

    def made(
        self, file: str, sources: Sequence[Path], options: object, work: Callable[[Path], object]
    ) -> Path | None:
        """A file made of others and options, if new; None if that fails."""
        name = Path(file).stem
        key = key_of(content_digest(sources), options_digest(options))
        path = self.folder.made(f"{name}-{key[:8]}") / file
        if not path.exists():
            stage(f"making {name}")
            self.ended[name] = perform(work, path)
        return path if path.exists() else None

    def make_log(self, log: BenchmarkLog) -> None:
        """Have a log to score: its file, or one that is made for it."""
        base = self.logs.get(log.base) if log.pushes else log
        if base is None:
            return  # it could not be made, which is said
        if log.pushes or log.scenario or log.parts:
            work = partial(write_log, log, base, self.command)
            path = self.made(f"{log.name}.parquet", base.paths, log, work)
            if path is None:
                return
            if log.pushes or log.scenario:
                log = replace(log, truth="torque", truth_file=str(companions(path)[0]))
            words = tuple(each for each in log.options if each[0] != "columns")
            log = replace(log, file=str(path), parts=(), scenario="", options=words)
        self.logs[log.name] = log

    def fit(self, robot: TrainedRobot) -> None:
        """Make a robot file from its training logs, if all are there."""
        logs = [self.logs[name] for name in robot.train if name in self.logs]
        if len(logs) < len(robot.train):
            return
        paths = [path for log in logs for path in log.paths]
        task = Task(method=robot.method or None, name=robot.name)
        words = {"robot": robot.robot} if robot.robot else {}
        choice = replace(
            logs[0].choice(interval=robot.interval or None, **words),
            wrench=None,
            library=Library(paths),
            examiner=Examiner(fitting=task.keeps_links),
        )

        def fit(path: Path) -> None:
            identified(paths, (), choice, task).robot.save(path)

        if path := self.made(f"{robot.name}.toml", paths, [choice, task], fit):
            self.robots[robot.name] = path

    def tasks(self) -> Iterator[ScoreTask]:
        """A task a log and protocol, and for outside estimates."""
        logs = self.logs
        for log in logs.values():
            words: dict[str, dict[str, object]] = {"alone": {}}
            if all(":" in word or word in logs for word in log.free):
                places = [str(logs[word].paths[0]) if word in logs else word for word in log.free]
                words["free"] = {"free": places}
            if log.identified in self.robots:
                words["identified"] = {"robot": str(self.robots[log.identified])}
            for protocol in log.protocols:
                if protocol in words:
                    yield self.task(log, protocol, log.choice(**words[protocol]))
        for rival in self.rivals:
            arms = {log.arm for log in logs.values() if rival.file(log) is not None}
            for log in logs.values():
                if log.arm in arms and log.protocols:
                    yield self.task(log, rival.protocol, log.choice(), rival)

    def task(
        self, log: BenchmarkLog, protocol: str, choice: AnalysisChoice, rival: Rival | None = None
    ) -> ScoreTask:
        """The task of a log, with a key of all its inputs."""
        outside = rival and [rival, rival.file(log), rival.file(log, "contacts.csv")]
        label = ", ".join([log.name, protocol, *([rival.name] if rival else [])])
        about = {
            "log": log.name,
            "arm": log.arm,
            "protocol": protocol,
            "exact_model": log.exact_model,
            "marked": log.base in self.marked,
            "truth_error_Nm": log.truth_error.tau_Nm,
        }
        options = options_digest([log, choice, log.truth_path, outside, about])
        key = key_of(content_digest(log.paths), options)
        return ScoreTask(self.folder.path, key, label, log, choice, rival, about)

    def score(self, tasks: Sequence[ScoreTask]) -> None:
        """Score some tasks, in the order in which they end."""
        groups, seen = ([task] for task in tasks), [str(self.folder.path)]
        ended = run_tasks(groups, score_log, self.workers, self.tell, seen)
        with closing(ended):  # type: ignore[type-var]
            for done, outcome in enumerate(ended, 1):
                self.ended[outcome.task.label] = outcome
                stage(f"{done} of {len(tasks)} scored", done / len(tasks))

    def record(self, logs: Sequence[BenchmarkLog]) -> dict[str, Any]:
        """Content of `run.json`: manifest, logs, absent ones, efforts."""
        keys, manifest = ("arm", "truth", "source", "licence"), self.manifest
        entries = [
            {
                "recording": log.name,
                "path": str(made.paths[0]) if (made := self.logs.get(log.name)) else None,
                "sha256": content_digest(log.paths) if log.paths else None,
                **{key: getattr(log, key) for key in keys},
                "truth_error": log.truth_error.note,
            }
            for log in logs
        ]
        efforts = {name: each.effort for name, each in self.ended.items() if each.effort}
        found = {
            "manifest": manifest.path.stem,
            "manifest_sha256": digest_of(manifest.path),
            "left_out": manifest.absent(),
            "failures": {name: failure.line for name, failure in self.failures.items()},
            "outside": {rival.name: rival for rival in self.rivals},
            "tasks": [{"task": name, **each._asdict()} for name, each in efforts.items()],
        }
        return envelope(self.command, entries, found=found)


def write_log(log: BenchmarkLog, base: BenchmarkLog, command: str, path: Path) -> None:
    """Write an entry's log, with its truth."""
    if log.pushes:
        choice = replace(base.choice(), examiner=Examiner(anyway=True))
        read = choice.library.open(base.paths[0], replace(choice.read, derive="none"))
        recording, wrench, tau = planted(prepared(read, choice), log.pushes)
        table = (("t", recording.t), *per_joint("tau_ext", tau), *per_axis("wrench", wrench))
        put_table(companions(path)[0], frame_of(table), {"columns": TRUTH_COLUMNS})
        convert(recording, path, force=True)
    elif log.scenario:
        check_installed("pinocchio", "a simulated log")
        made = simulate(load_scenario(log.scenario, log.changes), log.seed)
        save({path: made}, "parquet", force=True, command=command)
    else:
        put_table(path, pl.DataFrame(read_parts(log)))


def planted(run: Run, pushes: Pushes) -> tuple[Recording, Array, Array]:
    """A run's log with pushes in its drive torque (τ − Jᵀ w), their w and Jᵀ w.

    Half sines at the flange in base axes, without moments. The motion does not yield.
    """
    t, recording, robot = run.t, run.recording, run.robot
    wrench = np.zeros((recording.samples, 6))
    for start, length, force in pushes:
        share = (t - start) / length
        course = np.where(abs(share - 0.5) < 0.5, np.sin(np.pi * share), 0.0)
        wrench[:, :3] += course[:, None] * force
    tau = np.einsum("tij,ti->tj", flange_jacobian(robot.chain, recording.q), wrench)
    name = effort_name(recording, robot)
    constant = robot.torque_constant if name == "current" else None
    effort = recording.require(name) - (tau if constant is None else tau / constant)
    return replace(recording, **{name: effort}), wrench, tau
