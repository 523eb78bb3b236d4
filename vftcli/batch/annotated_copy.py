"""A copy of a dataset with forces: first its episodes, then its files."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vftcli.batch import WorkersChoice
from vftcli.batch.annotation import (
    SIGN,
    EpisodesTask,
    ForceChoice,
    Record,
    estimate_episodes,
    force_columns,
)
from vftcli.batch.cluster import Outcome, Tell, begin, run_tasks
from vftcli.batch.datasets import (
    RECORD,
    WORK,
    DataFile,
    ForceColumn,
    Single,
    Statistics,
    check_copy,
    copy_others,
    files_within,
    finished,
    stored_rows,
    unfinished,
)
from vftcli.batch.datasets.hdf5 import Hdf5Dataset, files_below
from vftcli.batch.datasets.lerobot import LeRobotDataset, statistics_of
from vftcli.batch.log_work import key_of, options_digest
from vftcli.outputs.files import digest, put_text
from vftcli.outputs.run_record import envelope, to_json
from vftcli.readers.opening import open_log
from vftcli.readers.reading import FORMATS
from vftcli.signals.errors import LogError
from vftcli.signals.progress import stage

TOGETHER = 16  #: Episodes of one task, and of one file of rows.
#: Up to so many files are written without new processes, which take seconds to start.
FEW = 32
HERE = WorkersChoice(jobs=0)  #: This process alone.
Dataset = LeRobotDataset | Hdf5Dataset  #: A folder of episodes to copy.


class FileTask(NamedTuple):
    """A data file to write."""

    file: DataFile
    rows: tuple[Path, ...]  #: The files of its episodes' columns.
    target: Path


def annotate(
    path: Path,
    copy: Path,
    choice: ForceChoice,
    workers: WorkersChoice,
    command: str,
    tell: Tell,
    *,
    force: bool = False,
) -> Record:
    """Write a copy of a dataset with the forces of every frame.

    `force`: an earlier copy may be replaced. Returns the content of ``meta/vftcli.json``.
    """
    dataset = open_dataset(path, choice.read.columns)
    check_copy(path, copy, force=force)
    for _ in files_within(path):
        pass  # a link that leaves it is refused before anything is computed
    key = key_of(str(path.resolve()), options_digest(choice))
    with unfinished(copy, key) as folder:
        work = folder / WORK
        rows, sources = dict[DataFile, list[Path]](), dict[str, str]()
        run = partial(run_tasks, tell=tell, seen=[str(path), str(work)])
        expected = force_columns(choice, (), derived=False, valid=choice.anyway)
        groups = planned(dataset, work, key, expected, rows, sources)
        outcomes = run(groups, partial(estimate_episodes, choice), workers)
        made = gathered(outcomes, choice)
        derived, names = any(one.get("derived") for one in made["episodes"]), joint_names(made)
        columns = force_columns(choice, names, derived=derived, valid=choice.anyway)
        write = partial(write_file, dataset, columns, choice.suffix)
        tasks = [FileTask(f, tuple(own), folder / f.place) for f, own in rows.items()]
        each = (tasks[k : k + TOGETHER] for k in range(0, len(tasks), TOGETHER))
        statistics: dict[int, Mapping[str, Statistics]] = {}
        for outcome in run(each, write, workers if len(tasks) > FEW else HERE):
            stage(f"writing {value_of(outcome)['place']}", 0.8, 1.0)
            statistics |= outcome.value["statistics"]
        stage("writing descriptions", 0.9, 1.0)
        if path.is_dir():
            copy_others(path, folder, {file.place for file in rows})
        dataset.finish(columns, dict(sorted(statistics.items())), folder)
        found = {
            "dataset": str(path),
            "sign": SIGN,
            "robot": made["robot"],
            "observer": made["observer"],
            "causal": columns[0].about["causal"],
            "columns": {c.name: {**c.about, "names": list(c.elements) or None} for c in columns},
            "status": dict(Counter(one["status"] for one in made["episodes"])),
            "transient_frames": max(one.get("transient_frames", 0) for one in made["episodes"]),
            "friction": choice.robot.friction,
            "episodes": made["episodes"],
            "sources": dict(sorted(sources.items())),
        }
        entry = {"recording": path.name, "path": str(path), "sha256": None}
        record = envelope(command, [entry], found=found)
        with finished(folder / RECORD) as temporary:
            put_text(temporary, to_json(record))
    return record


def open_dataset(path: Path, columns: str | None = None) -> Dataset:
    """The dataset in a folder or HDF5 file, by ``--columns``."""
    file = open_log(path)
    if FORMATS["lerobot"].recognises(file):
        return LeRobotDataset(path)
    if FORMATS["hdf5"].recognises(file):
        return Hdf5Dataset(path.parent, path, columns)
    if path.is_dir() and files_below(path):
        return Hdf5Dataset(path, None, columns)
    raise LogError(
        f"{path}: neither a LeRobot dataset (a folder with meta/info.json), nor HDF5 files "
        "(DROID's trajectory.h5, *.hdf5); of another log `vftcli estimate` writes the torques"
    )


def planned(
    dataset: Dataset,
    work: Path,
    key: str,
    columns: list[ForceColumn],
    rows: dict[DataFile, list[Path]],
    sources: dict[str, str],
) -> Iterator[list[EpisodesTask]]:
    """Groups of episodes, one group a task, found while workers run.

    Adds the files of a data file's columns to `rows`, its sha256 to `sources`.
    """
    group: list[EpisodesTask] = []
    for file in dataset.files():
        dataset.check_new(file, columns)
        source = sources[file.place.as_posix()] = digest(dataset.folder / file.place)
        for first in range(0, len(file.episodes), TOGETHER):
            some = file._replace(episodes=file.episodes[first : first + TOGETHER])
            task = EpisodesTask(some, work / f"{key_of(source, key, some)}.npz")
            rows.setdefault(file, []).append(task.rows)
            group.append(task)
            if sum(len(each.file.episodes) for each in group) >= TOGETHER:
                yield group
                group = []
    if group:
        yield group


def value_of(outcome: Outcome[Any]) -> Any:  # noqa: ANN401 - what the work returns
    """Result of a task."""
    if outcome.failure is None:
        return outcome.value
    place = outcome.task.file.place
    raise LogError(f"{place}: {outcome.failure.line} ({outcome.failure.stage})")


def gathered(outcomes: Iterable[Outcome[Any]], choice: ForceChoice) -> Record:
    """Results of all episodes, in the order of their files."""
    episodes: list[Record] = []
    made: Record = {"episodes": episodes, "robot": None, "observer": None}
    for outcome in outcomes:
        some = value_of(outcome)
        for record in () if choice.anyway else some["episodes"]:
            refuse_missing(record)
        episodes += some["episodes"]
        for name in ("robot", "observer"):
            made[name] = made[name] or some[name]
        stage(f"{len(episodes)} episodes estimated", 0.0, 0.8)
    episodes.sort(key=lambda record: (record["file"], record["episode"]))
    return made


REMEDY = "--anyway writes 0 there, and a column that says so"


def refuse_missing(record: Record) -> None:
    """Refuse an episode with missing frames."""
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


def joint_names(made: Record) -> list[str]:
    """Joint names, of the first episode with any; all need as many joints."""
    episodes = made["episodes"]
    known = [one for one in episodes if one["status"] != "missing"]
    if not episodes:
        raise LogError("the dataset has no episodes")
    if not known:
        reason = episodes[0]["reason"]
        raise LogError(f"none of the {len(episodes)} episodes can be done; the first: {reason}")
    if len(widths := {one["joint_count"] for one in known}) > 1:
        raise LogError(
            f"the episodes are of arms of {' and '.join(map(str, sorted(widths)))} joints"
        )
    return known[0]["joints"] or [f"joint_{k + 1}" for k in range(known[0]["joint_count"])]


def write_file(
    dataset: Dataset, columns: list[ForceColumn], suffix: str, task: FileTask
) -> Record:
    """Write a data file with its columns; its place and its episodes' statistics."""
    begin("writing")
    rows: dict[str, Any] = {}
    for path in filter(Path.is_file, task.rows):
        rows |= stored_rows(path)
    forces: dict[int, dict[str, Single]] = {}
    for number in task.file.episodes:
        frames, own = dataset.frames(task.file, number), dict[str, Single]()
        for column in columns:
            name = column.name.removesuffix(suffix)
            of = name.removesuffix("_valid")
            values = rows.get(f"{number}/{of}")
            if values is None:
                values = np.full((frames, column.width), np.nan, np.float32)
            if of != name:  # marks where there is a value
                values = np.isfinite(values).all(axis=1, keepdims=True).astype(np.float32)
            own[column.name] = np.nan_to_num(values, nan=0.0)
        forces[number] = own
    with finished(task.target) as temporary:
        dataset.write(task.file, columns, forces, temporary)
    kept = forces.items() if dataset.has_statistics else ()
    statistics = {n: {name: statistics_of(x) for name, x in own.items()} for n, own in kept}
    return {"place": task.file.place.as_posix(), "statistics": statistics}
