"""A copy of a dataset with forces: its episodes on the engine, then its files, then the rest."""

import hashlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vftcli.batch.annotation import (
    SIGN,
    EpisodesTask,
    ForceChoice,
    estimate_episodes,
    force_columns,
)
from vftcli.batch.choice import WorkersChoice
from vftcli.batch.cluster import run_tasks
from vftcli.batch.datasets import Dataset, open_dataset
from vftcli.batch.datasets.copying import (
    RECORD,
    WORK,
    check_copy,
    copy_others,
    files_within,
    finished,
    stored_rows,
    unfinished,
)
from vftcli.batch.datasets.episodes import DataFile, ForceColumn, Single, Statistics
from vftcli.batch.datasets.statistics import statistics_of
from vftcli.batch.outcome import Outcome, begin
from vftcli.outputs.files import digest, put_text
from vftcli.outputs.log.run_record import to_json, versions
from vftcli.signals.errors import LogError

TOGETHER = 16  #: Episodes that go to a worker together, and into one file of rows.
#: Episodes, and files to write, for which no processes are started unasked: that takes seconds.
FEW = 32
HERE = WorkersChoice(jobs=0)  #: This process alone.


class FileTask(NamedTuple):
    """A data file that is written."""

    file: DataFile  #: The data file.
    rows: tuple[Path, ...]  #: The files in which its episodes' columns are.
    target: Path  #: Where it is written.


def annotate(
    path: Path,
    copy: Path,
    choice: ForceChoice,
    workers: WorkersChoice,
    command: str,
    tell: Callable[[str], None],
    progress: Callable[[str, float, float], None],
    *,
    force: bool = False,
) -> dict[str, Any]:
    """Write a copy of a dataset with the forces of every frame.

    Frames without an estimate stop the run, or are filled with zeros and marked where the choice
    goes on anyway; `force` is whether an earlier copy may be replaced.

    Returns:
        What ``meta/vftcli.json`` holds.
    """
    dataset = open_dataset(path, choice.read.columns)
    check_copy(path, copy, force=force)
    for _ in files_within(path):
        pass  # a link that leaves it is refused before anything is computed
    beside = [Path(n) for n in (choice.robot.name, choice.observers.gains_file) if n is not None]
    files_beside = " ".join(digest(file) for file in beside if file.is_file())
    key = hashlib.sha256(f"{path.resolve()} {choice.key(files_beside)}".encode()).hexdigest()
    with unfinished(copy, key) as folder:
        work = folder / WORK
        plan = Plan(dataset, work, key)
        run = partial(run_tasks, tell=tell, seen=[str(path), str(work)])
        expected = force_columns(choice, (), derived=False, valid=choice.anyway)
        outcomes = run(
            plan.groups(expected), partial(estimate_episodes, choice), started(workers, dataset)
        )
        made = gathered(outcomes, choice, progress)
        columns = force_columns(
            choice,
            joint_names(made),
            derived=any(one.get("derived") for one in made.episodes),
            valid=choice.anyway,
        )
        write = partial(write_file, dataset, columns, choice.suffix)
        tasks = [FileTask(f, tuple(r), folder / f.place) for f, r in plan.rows.items()]
        each = (tasks[k : k + TOGETHER] for k in range(0, len(tasks), TOGETHER))
        statistics: dict[int, Mapping[str, Statistics]] = {}
        for outcome in run(each, write, workers if len(tasks) > FEW else HERE):
            progress(f"writing {value_of(outcome)['place']}", 0.8, 1.0)
            statistics |= outcome.value["statistics"]
        progress("writing descriptions", 0.9, 1.0)
        if path.is_dir():
            copy_others(path, folder, plan.places)
        dataset.finish(columns, dict(sorted(statistics.items())), folder)
        record = record_of_copy(path, command, choice, columns, made, plan.sources)
        with finished(folder / RECORD) as temporary:
            put_text(temporary, to_json(record))
    return record


def started(workers: WorkersChoice, dataset: Dataset) -> WorkersChoice:
    """Place of the episodes' work: here by default if they are few."""
    some = islice(dataset.files(), FEW + 1)
    few = sum(len(file.episodes) for file in some) <= FEW
    return HERE if few and workers == WorkersChoice() else workers


class Plan:
    """The work on a dataset, planned while workers already do the first of it.

    Attributes:
        rows: Data file → the files in which its episodes' columns are.
        sources: Data file → its sha256.
    """

    def __init__(self, dataset: Dataset, work: Path, key: str) -> None:
        self._dataset, self._work, self._key = dataset, work, key
        self.rows: dict[DataFile, list[Path]] = {}
        self.sources: dict[str, str] = {}

    @property
    def places(self) -> set[Path]:
        """The data files, by their paths in the dataset."""
        return {file.place for file in self.rows}

    def groups(self, columns: list[ForceColumn]) -> Iterator[list[EpisodesTask]]:
        """The episodes in groups that go to a worker together."""
        group: list[EpisodesTask] = []
        for file in self._dataset.files():
            self._dataset.check_new(file, columns)
            source = digest(self._dataset.folder / file.place)
            self.sources[file.place.as_posix()] = source
            for first in range(0, len(file.episodes), TOGETHER):
                some = file._replace(episodes=file.episodes[first : first + TOGETHER])
                name = hashlib.sha256(f"{self._key} {source} {some}".encode()).hexdigest()
                rows = self._work / f"{name}.npz"
                self.rows.setdefault(file, []).append(rows)
                group.append(EpisodesTask(some, rows))
                if sum(len(task.file.episodes) for task in group) >= TOGETHER:
                    yield group
                    group = []
        if group:
            yield group


class Made(NamedTuple):
    """Results of the episodes."""

    episodes: list[dict[str, Any]]  #: A record each.
    robot: dict[str, Any] | None  #: The robot of the first that could be done.
    observer: dict[str, Any] | None  #: Its observer.


def value_of(outcome: Outcome[Any]) -> Any:  # noqa: ANN401 - what the work returns
    """Result of a task."""
    if outcome.failure is None:
        return outcome.value
    place = outcome.task.file.place
    raise LogError(f"{place}: {outcome.failure.line} ({outcome.failure.stage})")


def gathered(
    outcomes: Iterable[Outcome[Any]],
    choice: ForceChoice,
    progress: Callable[[str, float, float], None],
) -> Made:
    """Results of the episodes, in the order of their files."""
    episodes: list[dict[str, Any]] = []
    robot = observer = None
    for outcome in outcomes:
        told = value_of(outcome)
        for record in told["episodes"]:
            if not choice.anyway:
                refuse_missing(record)
        episodes += told["episodes"]
        robot, observer = robot or told["robot"], observer or told["observer"]
        progress(f"{len(episodes)} episodes estimated", 0.0, 0.8)
    episodes.sort(key=lambda record: (record["file"], record["episode"]))
    return Made(episodes, robot, observer)


REMEDY = "--anyway writes 0 there, and a column that says so"


def refuse_missing(record: Mapping[str, Any]) -> None:
    """Refuse an episode of which frames are missing."""
    if record["status"] == "missing":
        # All files of DROID have one name.
        reason = record["reason"].removeprefix(Path(record["file"]).name).rstrip(".")
        place = record["file"] if reason != record["reason"].rstrip(".") else ""
        raise LogError(f"{place}{reason}. {REMEDY}")
    if record["status"] == "part":
        name, count = next(iter(record["missing_frames"].items()))
        why = (
            "these poses hide it; --set virtual-sensor.solver=smoother has a wrench in every pose"
            if name == "wrench"
            else "a value of the log is no number there"
        )
        raise LogError(
            f"{record['file']}: episode {record['episode']}: {name} is missing in {count} of "
            f"{record['frames']} frames: {why}; {REMEDY}"
        )


def joint_names(made: Made) -> list[str]:
    """The names of the joints, of the first episode that tells any; all must have as many."""
    known = [one for one in made.episodes if one["status"] != "missing"]
    if not known:
        count = len(made.episodes)
        raise LogError(
            f"none of the {count} episodes can be done; the first: {made.episodes[0]['reason']}"
            if made.episodes
            else "the dataset has no episodes"
        )
    if len(widths := {one["joint_count"] for one in known}) > 1:
        raise LogError(
            f"the episodes are of arms of {' and '.join(map(str, sorted(widths)))} joints"
        )
    return known[0]["joints"] or [f"joint_{k + 1}" for k in range(known[0]["joint_count"])]


def write_file(
    dataset: Dataset, columns: list[ForceColumn], suffix: str, task: FileTask
) -> dict[str, Any]:
    """Write a data file with its columns; return its place and the statistics of its episodes."""
    begin("writing")
    rows: dict[str, Any] = {}
    for path in filter(Path.is_file, task.rows):
        rows |= stored_rows(path)
    forces = {
        number: filled(number, rows, columns, suffix, dataset.frames(task.file, number))
        for number in task.file.episodes
    }
    with finished(task.target) as temporary:
        dataset.write(task.file, columns, forces, temporary)
    statistics = {
        number: {name: statistics_of(values) for name, values in own.items()}
        for number, own in forces.items()
        if dataset.has_statistics
    }
    return {"place": task.file.place.as_posix(), "statistics": statistics}


def filled(
    number: int, rows: Mapping[str, Any], columns: list[ForceColumn], suffix: str, frames: int
) -> dict[str, Single]:
    """An episode's columns with 0 for no value, and columns that mark these."""
    found: dict[str, Single] = {}
    for column in columns:
        name = column.name.removesuffix(suffix)
        of = name.removesuffix("_valid")
        values = rows.get(f"{number}/{of}")
        if values is None:
            values = np.full((frames, column.width), np.nan, np.float32)
        if of != name:
            values = np.isfinite(values).all(axis=1, keepdims=True).astype(np.float32)
        found[column.name] = np.nan_to_num(values, nan=0.0)
    return found


def record_of_copy(
    path: Path,
    command: str,
    choice: ForceChoice,
    columns: list[ForceColumn],
    made: Made,
    sources: Mapping[str, str],
) -> dict[str, Any]:
    """Content of ``meta/vftcli.json``."""
    return {
        "command": command,
        "versions": versions(),
        "dataset": str(path),
        "sign": SIGN,
        "robot": made.robot,
        "observer": made.observer,
        "causal": columns[0].told["causal"],
        "columns": {c.name: {**c.told, "names": list(c.elements) or None} for c in columns},
        "status": dict(Counter(one["status"] for one in made.episodes)),
        "transient_frames": max(one.get("transient_frames", 0) for one in made.episodes),
        "friction": choice.robot.friction,
        "episodes": made.episodes,
        "sources": dict(sorted(sources.items())),
    }
