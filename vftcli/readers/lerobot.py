"""LeRobot datasets, versions 2 and 3: a folder of Parquet files with meta/info.json."""

import json
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from vftcli.readers.aliases import ALIASES, AXES, TABLE
from vftcli.readers.columns import SIGNALS
from vftcli.readers.opening import LogFile, open_log
from vftcli.readers.parquet import EPISODE, ParquetTable, episodes_of
from vftcli.readers.reader import ARMS, Episodes, RawLog, ReadChoice, arm_of
from vftcli.readers.reading import LogFormat
from vftcli.readers.table import Names, Notes, listed
from vftcli.readers.tables import from_table
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import fact

Json = Any  #: A value of a description.

DESCRIPTION_BYTES = 64 * 1024 * 1024  #: Bytes of a description beside the data that are parsed.

FRAME = "frame_index"

#: How far the stamps, 32-bit floats, may lie from frame / fps, which is then the clock.
#: [s]
CLOCK_SLACK = 1e-3
#: What an element's name says it measures, in words of `ALIASES`.
WORDS = "pos|positions?|vel|velocity|velocities|efforts?|torques?|currents?"
NAMED = re.compile(rf"(.+)[._/]({WORDS})")  #: joint_1.pos
COUNTED = re.compile(rf"(joint)[_.]({WORDS})[_.](\d{{1,4}})$")  #: joint_positions.1

SIDE = re.compile(rf"(?:^|[._/ ])({'|'.join(ARMS)})(?:$|[._/ ])")
NO_JOINT = re.compile(r"(?i)grip|finger")
MEASURED = ("q", "dq", "torque", "current", "tau_ext")  #: Signals that are looked for.
#: Word → the signal that it names.
SIGNAL_OF = {word: signal for signal in reversed(MEASURED) for word in ALIASES[signal]}
#: Values of robot_type that are a profile's name.
ROBOTS = ("panda", "fr3", "ur5", "ur5e", "ur10e")

EPISODES_TABLE = (
    EPISODE, "length", "dataset_from_index", "dataset_to_index", "data/chunk_index",
    "data/file_index",
)  # fmt: skip


class Episode(NamedTuple):
    """Where an episode is."""

    number: int  #: Its index.
    #: Its data file by the dataset's usual name, None where it is unknown.
    file: Path | None
    length: int | None = None  #: Its frames, None where it is unknown.
    #: Index of its first frame in the dataset, None where it is unknown.
    start: int | None = None


class Element(NamedTuple):
    """One number of an observation: which signal of which joint."""

    column: str  #: Its name for --columns.
    signal: str  #: Field of Recording.
    joint: str  #: The joint's name, "" where the dataset gives none.
    side: str  #: left, right, or "" for neither.


@contextmanager
def episodes(file: LogFile) -> Iterator[Episodes]:
    """The episodes of a dataset."""
    read = partial(read_episode, file, info_of(file.path))
    yield {each.number: partial(read, each) for each in dataset_episodes(file.path)}


def read_episode(
    file: LogFile, info: Mapping[str, Any], episode: Episode, request: ReadChoice
) -> RawLog:
    """Read an episode of a dataset, of which meta/info.json says this."""
    path = data_file(file.path, episode)
    table = _rows_of(open_log(path), episode)
    usual, names, remarks, side = _columns_of(file.path, table, info.get("features"), request)
    layout = TABLE._replace(columns=usual)
    raw = from_table(table, request, layout, names=names, remarks=remarks)
    robot = str(info.get("robot_type", "")).lower()
    return replace(
        _by_frames(raw, table, info.get("fps")),
        part=f"{side} arm" if side else "",
        files=(file.path / "meta" / "info.json", path),
        robot_hint=robot if robot in ROBOTS else None,
    )


def _columns_of(
    path: Path, table: ParquetTable, described: Json, request: ReadChoice
) -> tuple[str, Names, Notes, str]:
    """The columns of an observation, the joints' names, what is to be said, and the arm of two."""
    if request.spec.item("q"):
        return "t=timestamp,q=observation.state", (), (), ""
    each_of = described.items() if isinstance(described, dict) else ()
    features = {name: each.get("names") for name, each in each_of if isinstance(each, dict)}
    # What is commanded is no measurement.
    observed = [name for name in table.names if name.startswith("observation.")]
    there = [e for name in observed for e in _elements_of(name, table, features.get(name))]
    sides = [side for side in ARMS if any(e.side == side and e.signal == "q" for e in there)]
    # Nothing tells a sensor's wrench from an estimate.
    left = [name for name in observed if "wrench" in f"{name} {features.get(name)}".lower()]
    remarks: Notes = ()
    if left and not request.spec.item("wrench"):
        remarks = (fact("wrench-left-out", features=listed(left)),)
    side = ""
    if len(sides) > 1:
        side, said = arm_of(path, request, sides)
        remarks = (*remarks, *said)
        there = [e for e in there if e.side in {side, ""}]
    by_signal = {s: [e for e in there if e.signal == s] for s in MEASURED}
    if not by_signal["q"]:
        raise LogError(
            f"{path}: no joint positions among {listed(list(table.names))}. Name the columns "
            "with --columns, as in 'q[rad]=observation.state[0:7]'."
        )
    names = tuple(element.joint for element in by_signal["q"])
    names = names if all(names) and len(set(names)) == len(names) else ()
    grammar = {field: word for word, field in SIGNALS.items()}
    items = [
        f"{grammar[signal]}={'|'.join(e.column for e in _in_order(path, signal, found, names))}"
        for signal, found in by_signal.items()
        if found
    ]
    return ",".join(["t=timestamp", *items]), names, remarks, side


def _in_order(path: Path, signal: str, elements: list[Element], names: Names) -> list[Element]:
    """A signal's elements in the order of the joints, as they stand where they have no names."""
    by_joint = {element.joint: element for element in elements}
    if not names or "" in by_joint:
        return elements
    if len(by_joint) != len(elements) or set(by_joint) != set(names):
        raise LogError(
            f"{path}: {signal} is of the joints {listed(list(by_joint))}, the positions are of "
            f"{listed(names)}. Name the columns with --columns."
        )
    return [by_joint[name] for name in names]


def _elements_of(name: str, table: ParquetTable, labels: Json) -> Iterable[Element]:
    """The joints' elements of a feature; none of a gripper or a pose."""
    width = table.lists.get(table.names.index(name))
    *_, last = ["", *(part for part in name.lower().split(".")[1:] if part not in ARMS)]
    of_feature = "q" if last == "state" else SIGNAL_OF.get(last, "")
    if isinstance(labels, dict):
        labels = next(iter(labels.values()), None)
    good = isinstance(labels, list) and len(labels) == (width or 1)
    for k in range(width or 1):
        label = COUNTED.sub(r"\1_\3.\2", str(labels[k])) if good else ""
        match = NAMED.fullmatch(label)
        joint, signal = (match[1], SIGNAL_OF.get(match[2], "")) if match else (label, of_feature)
        pose = AXES.fullmatch(re.split("[_.]", joint)[-1])
        if signal and not pose and not NO_JOINT.search(joint):
            side = SIDE.search(label.replace("_", ".")) or SIDE.search(name)
            yield Element(
                f"{name}[{k}]" if width else name, signal, joint, side[1] if side else ""
            )


def _by_frames(raw: RawLog, table: ParquetTable, fps: Json) -> RawLog:
    """The log by its frames' numbers and rate, where its stamps are these rounded to 32 bits."""
    good = isinstance(fps, int | float) and 0 < fps < 1 / CLOCK_SLACK
    if not good or FRAME not in table.names or raw.clock != "column timestamp":
        return raw
    column = table.names.index(FRAME)
    frames = table.load([column], clock=column)[column]
    exact = frames.ndim == 1 and np.all(
        np.abs(raw.stamps * raw.tick - frames / fps) < CLOCK_SLACK
    )
    if frames.dtype.kind != "i" or not exact:
        return raw
    return replace(raw, stamps=frames, tick=1 / fps, clock=f"column {FRAME} at {fps:g} Hz")


def info_of(folder: Path) -> dict[str, Any]:
    """meta/info.json."""
    path = folder / "meta" / "info.json"
    try:
        info = json.loads(text_of(path))
    except (OSError, ValueError, RecursionError):
        raise LogError(f"{path}: not a readable description of a dataset") from None
    return info if isinstance(info, dict) else {}


def text_of(path: Path) -> str:
    """The text of a description beside the data."""
    if path.stat().st_size > DESCRIPTION_BYTES:
        raise LogError(f"{path}: larger than {DESCRIPTION_BYTES >> 20} MiB; no description is.")
    try:
        return path.read_text("utf-8")
    except UnicodeDecodeError:
        raise LogError(f"{path}: not text in UTF-8; it is damaged") from None


def _by_table(folder: Path, path: Path) -> Iterator[Episode]:
    table = ParquetTable(open_log(path))
    if missing := [name for name in EPISODES_TABLE if name not in table.names]:
        raise LogError(f"{path}: no column {missing[0]}; a table of episodes has one.")
    places = [table.names.index(name) for name in EPISODES_TABLE]
    loaded = table.load(places)
    columns = [loaded[place] for place in places]
    if not all(column.ndim == 1 and np.isfinite(column).all() for column in columns):
        raise LogError(f"{path}: a row of the table of episodes lacks a number.")
    for number, length, start, end, chunk, file in np.stack(columns, 1).astype(int).tolist():
        if end - start != length:
            raise LogError(
                f"{path}: episode {number} has {length} frames and spans {end - start}."
            )
        place = folder / "data" / f"chunk-{chunk:03d}" / f"file-{file:03d}.parquet"
        yield Episode(number, place, length, start)


def _by_lines(folder: Path, path: Path) -> Iterator[Episode]:
    files = {file.name: file for file in (folder / "data").rglob("*.parquet")}
    for line in filter(str.strip, text_of(path).splitlines()):
        try:
            row = json.loads(line)
            number, length = int(row[EPISODE]), int(row["length"])
        except (ValueError, KeyError, TypeError, RecursionError, OverflowError):
            raise LogError(f"{path}: a line that names no episode: {line[:60]!r}.") from None
        yield Episode(number, files.get(f"episode_{number:06d}.parquet"), length)


def _by_data(_: Path, path: Path) -> Iterator[Episode]:
    for number in episodes_of(ParquetTable(open_log(path)).episodes()):
        yield Episode(number, path)


#: Files of a dataset that name its episodes, the best first → what reads one.
WAYS = {
    "meta/episodes/**/*.parquet": _by_table, "meta/episodes.jsonl": _by_lines,
    "data/**/*.parquet": _by_data,
}  # fmt: skip


@lru_cache(maxsize=64)  # who reads all episodes asks for each again
def _episodes_by(way: str, folder: Path, path: Path, _changed: int) -> tuple[Episode, ...]:
    return tuple(WAYS[way](folder, path))


def dataset_episodes(folder: Path) -> list[Episode]:
    """The episodes of a dataset, rising."""
    found: dict[int, Episode] = {}
    for way in WAYS:
        for path in sorted(folder.glob(way)):
            each = _episodes_by(way, folder, path, path.stat().st_mtime_ns)
            found |= {episode.number: episode for episode in each}
        if found:
            return [found[number] for number in sorted(found)]
    raise LogError(f"{folder}: a LeRobot dataset without data/**/*.parquet.")


def data_file(folder: Path, episode: Episode) -> Path:
    """The data file of an episode: where the table says, or the one that holds it."""
    if episode.file is not None and episode.file.is_file():
        return episode.file
    for path in sorted((folder / "data").rglob("*.parquet")):
        if episode.number in episodes_of(ParquetTable(open_log(path)).episodes()):
            return path
    raise LogError(f"{folder}: no file of data/**/*.parquet holds episode {episode.number}.")


def _rows_of(file: LogFile, episode: Episode) -> ParquetTable:
    """The rows of an episode in its data file, checked against the table of episodes."""
    table = ParquetTable(file)
    numbers = table.episodes()
    if not numbers.size:
        return table
    rows = np.flatnonzero(numbers == episode.number)
    differs = episode.length not in {None, len(rows)}
    if "index" in table.names and episode.start is not None and not differs:
        index = table.names.index("index")
        usual = episode.start + np.arange(len(rows))
        differs = not np.array_equal(table.load([index], clock=index)[index][rows], usual)
    if differs:
        raise LogError(
            f"{file.path}: the rows of episode {episode.number} are not those that the table of "
            "episodes names; the dataset is damaged or was edited."
        )
    table.rows = rows if len(rows) != len(numbers) else None
    return table


def recognises(file: LogFile, _: LogFormat) -> bool:
    """Whether a folder is a dataset."""
    return "meta" in file.entries and (file.path / "meta" / "info.json").is_file()
