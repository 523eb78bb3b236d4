"""A dataset's copy with forces: its request, its episodes' columns, then its files."""

import json
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vftcli.analysis import Analysis
from vftcli.batch import WorkersChoice
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
    put_rows,
    stored_rows,
    unfinished,
)
from vftcli.batch.datasets.hdf5 import Hdf5Dataset, files_below
from vftcli.batch.datasets.lerobot import LeRobotDataset, statistics_of
from vftcli.batch.log_work import key_of, options_digest
from vftcli.doctor.examination import Examiner
from vftcli.doctor.signals import efforts_of
from vftcli.free_motion.free_motion import within
from vftcli.observers import ObserverChoice, settling_samples
from vftcli.observers.table import OBSERVERS
from vftcli.outputs import Record
from vftcli.outputs.files import digest, put_text
from vftcli.outputs.run_record import envelope, observer_record, robot_record, to_json
from vftcli.pipeline import AnalysisChoice, analyse, prepared
from vftcli.readers.opening import open_log
from vftcli.readers.reading import FORMATS, Library
from vftcli.signals.arrays import Array, Indices
from vftcli.signals.errors import LogError, MissingSignalError, ParameterError, VftError
from vftcli.signals.packages import VERSION
from vftcli.signals.progress import stage
from vftcli.signals.recording import Recording
from vftcli.signals.wrench import AXES
from vftcli.wrench.solvers import FRAMES

USUAL = "kfo-zoh"  #: The observer if none is named: it needs no later sample.
SIGN = "what the environment exerts ON the robot"  #: Sign of all that is added.
TOGETHER = 16  #: Episodes of one task, and of one file of rows.
#: Most files that are written without new processes.
FEW = 32
HERE = WorkersChoice(jobs=0)  #: This process alone.
Dataset = LeRobotDataset | Hdf5Dataset  #: A folder of episodes to copy.


@dataclass(frozen=True, kw_only=True)
class ForceChoice(AnalysisChoice):
    """Request for every episode, of one observer."""

    observers: ObserverChoice = field(default_factory=lambda: ObserverChoice(names=(USUAL,)))
    contacts: bool = False  #: Whether frames in contact are wanted.
    sd: bool = False  #: Whether the standard deviation is wanted.
    #: Whether to go on after a finding, and without results.
    anyway: bool = False

    def __post_init__(self) -> None:
        super().__post_init__()
        if len(self.observers.names) != 1:
            raise ParameterError(
                "annotate writes the torques of one observer; give --observer once"
            )
        if self.read.interval or self.read.episode is not None:
            raise ParameterError(
                "annotate writes every frame of every episode; leave --interval and --episode out"
            )
        read = replace(self.read, skips_unknown=True, derive=self.read.derive or "none")
        object.__setattr__(self, "read", read)
        object.__setattr__(self, "observers", replace(self.observers, from_rest=True))

    @property
    def observer(self) -> str:
        """The observer's name."""
        return self.observers.names[0]

    @property
    def is_online(self) -> bool:
        """Whether nothing needs later samples, if dq is logged."""
        wrench = self.wrench
        back = wrench is not None and (
            wrench.smooths(self.observer) or bool(wrench.zero.spans) or wrench.zero.start
        )
        return OBSERVERS[self.observer].online and not self.observers.gains_of_log and not back

    @property
    def suffix(self) -> str:
        """Suffix of the columns' names: the arm, of a dataset of two."""
        return f"_{self.read.arm}" if self.read.arm else ""


class EpisodesTask(NamedTuple):
    """Some episodes of one data file."""

    file: DataFile  #: The data file, with these episodes only.
    rows: Path  #: Where their columns are put.


def estimate_episodes(choice: ForceChoice, task: EpisodesTask) -> Record:
    """Records of some episodes; writes their forces."""
    if task.rows.is_file():
        return dict(json.loads(str(stored_rows(task.rows)["record"])))
    library, examiner = Library([task.file.log]), Examiner(anyway=choice.anyway)
    asked = replace(choice, library=library, examiner=examiner)
    arrays: dict[str, Single] = {}
    records: list[Record] = []
    found: Record = {"episodes": records, "robot": None, "observer": None}
    for number in task.file.episodes:
        begin(f"episode {number}")
        record: Record = {"episode": number, "file": task.file.place.as_posix()}
        try:
            recording = library.open(task.file.log, replace(choice.read, episode=number))
            check_signals(recording, anyway=choice.anyway)
            analysis = analyse(prepared(recording, asked), asked)
            if choice.contacts and analysis.contacts is None:
                reason = next(str(r) for r in analysis.remarks if r.code == "contacts-not-listed")
                raise LogError(f"{recording.name}: {reason}")
            columns = columns_of(analysis, choice)
        except ParameterError:
            raise  # what is asked cannot be had of any episode
        except VftError as error:
            record |= {"status": "missing", "reason": " ".join(str(error).split())}
        else:
            arrays |= {f"{number}/{name}": values for name, values in columns.items()}
            record |= record_of(analysis, columns)
            if found["robot"] is None:
                observer = analysis.observers[0]
                found["robot"] = robot_record(analysis.robot)
                found["observer"] = observer_record(observer, analysis.tunings[observer.name])
        records.append(record)
    text = to_json(found)
    if arrays:
        put_rows(task.rows, record=np.array(text), **arrays)
    return dict(json.loads(text))


def check_signals(recording: Recording, *, anyway: bool) -> None:
    """Raise without velocities or efforts that change."""
    if recording.dq is None:
        raise MissingSignalError(
            f"{recording.name}: no joint velocities. --set log.derive=dq makes them of positions "
            "over the complete episode, so that the forces are not causal, and that is recorded"
        )
    efforts = efforts_of(recording)
    if not efforts:
        raise MissingSignalError(
            f"{recording.name}: no joint torques or currents, so no forces can be estimated; "
            "ports of DROID and Open X-Embodiment leave them out, DROID's raw release has them"
        )
    for _, value in () if anyway else efforts:
        same = np.flatnonzero((value == value[0]).all(axis=0))
        if 2 * len(same) >= recording.joints:
            joints = ", ".join(f"J{j + 1}" for j in same)
            raise LogError(
                f"{recording.name}: the effort of {joints} is {value[0, same[0]]:g} in every "
                "frame, so it was not measured: gravity would be written as force. Name the column "
                "that was measured with --columns. --anyway continues despite this"
            )


def columns_of(analysis: Analysis, choice: ForceChoice) -> dict[str, Single]:
    """An episode's columns by name, a row a frame, else NaN."""
    estimate, t = analysis.estimates[0], analysis.t
    found: dict[str, Array] = {"external_torque": estimate.tau}
    if choice.sd:
        if estimate.sd is None:
            raise ParameterError(
                f"--add sd: {estimate.name} states no standard deviation; choose another "
                "--observer, as kfo-zoh"
            )
        found["external_torque_sd"] = estimate.sd
    if choice.wrench is not None:
        found["wrench"] = analysis.wrenches[0].known
    if choice.contacts:
        touched = within(t, [(contact.start, contact.stop) for contact in analysis.listed])
        found["contact"] = touched[:, None].astype(np.float64)
    samples = analysis.recording.source.row_samples
    return {name: by_row(values, samples) for name, values in found.items()}


def by_row(values: Array, samples: Indices | None) -> Single:
    """Sample values (T, k) by row of the file; else NaN."""
    if samples is None:
        return values.astype(np.float32)
    return np.where(samples[:, None] >= 0, values[samples], np.nan).astype(np.float32)


def record_of(analysis: Analysis, columns: Mapping[str, Single]) -> Record:
    """Record of a finished episode."""
    recording, observer = analysis.recording, analysis.observers[0]
    missing = {name: int(np.isnan(v).any(axis=1).sum()) for name, v in columns.items()}
    some = {name: count for name, count in missing.items() if count}
    warnings = {f.code: None for one in analysis.examinations for f in one.warnings}
    refusals = [f.code for one in analysis.examinations for f in one.refusals()]
    return {
        "status": "part" if some else "done",
        "frames": len(columns["external_torque"]),
        **({"missing_frames": some} if some else {}),
        "transient_frames": settling_samples(observer, recording.median_step, recording.joints),
        "clock": recording.source.clock,
        "joints": list(recording.joint_names) or None,
        "joint_count": recording.joints,
        "robot": analysis.robot.name,
        "derived": list(recording.source.derived),
        "warnings": list(warnings),
        **({"overridden": refusals} if refusals else {}),
        "notes": [str(r) for r in (*recording.source.remarks, *analysis.estimates[0].remarks)],
    }


def force_columns(
    choice: ForceChoice, names: Sequence[str], *, derived: bool, valid: bool
) -> list[ForceColumn]:
    """The written columns."""
    online, version = choice.is_online and not derived, f"vftcli {VERSION}"
    made = {"observer": choice.observer, "causal": online, "version": version}
    joint = {"units": "N·m", "frame": "joint axes", "sign": SIGN, **made}
    flag = {"units": "1", "frame": "none", "sign": "1 where known, 0 where filled with 0", **made}
    found = [("external_torque", tuple(names), joint)]
    if choice.sd:
        found.append(("external_torque_sd", tuple(names), {**joint, "sign": "not negative"}))
    if valid:
        found.append(("external_torque_valid", (), flag))
    if choice.wrench is not None:
        frame = FRAMES[choice.wrench.frame]
        found.append(("wrench", AXES, {**joint, "units": "N, N·m", "frame": frame}))
        if valid:
            found.append(("wrench_valid", (), flag))
    if choice.contacts:
        listed = {**flag, "sign": "1 in a contact of the list, else 0", "causal": False}
        found.append(("contact", (), listed))
    return [
        ForceColumn(
            name + choice.suffix,
            elements if elements == AXES else tuple(f"{each}.{name}" for each in elements),
            about,
        )
        for name, elements, about in found
    ]


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
        made = gathered(run(groups, partial(estimate_episodes, choice), workers), choice)
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
    """Joint names, of the first episode with any."""
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
    """Write a data file with its columns; its place and statistics."""
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
