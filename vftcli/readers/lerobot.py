"""LeRobot datasets, versions 2 and 3: a folder with Parquet and meta/info.json."""

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
from vftcli.readers.parquet import ParquetTable, episodes_of
from vftcli.readers.reader import ARMS, Episodes, RawLog, ReadChoice, arm_of
from vftcli.readers.reading import LogFormat
from vftcli.readers.table import Names, Notes, listed
from vftcli.readers.tables import from_table
from vftcli.signals.errors import LogError
from vftcli.signals.remarks import fact

Json = Any  #: A value of a description.

#: Bytes of a description beside the data that are parsed.
DESCRIPTION_BYTES = 64 * 1024 * 1024

FRAME = "frame_index"

#: How far stamps of 32 bits may lie from frame / fps. [s]
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
    yield {each[0]: partial(read, *each) for each in dataset_episodes(file.path).items()}


def read_episode(
    file: LogFile, info: Mapping[str, Any], number: int, path: Path, request: ReadChoice
) -> RawLog:
    """Read an episode of a dataset, of which meta/info.json says this."""
    table = ParquetTable(open_log(path))
    numbers = table.episodes()
    if numbers.size:
        table.rows = np.flatnonzero(numbers == number)
        if not table.rows.size:
            raise LogError(f"{path}: no row is of episode {number}, which its name promises.")
    usual, names, remarks, side = _columns_of(file.path, table, info["features"], request)
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
    path: Path, table: ParquetTable, described: Mapping[str, Json], request: ReadChoice
) -> tuple[str, Names, Notes, str]:
    """The --columns text of an observation, the joints' names, remarks and the arm."""
    if request.spec.item("q"):
        return "t=timestamp,q=observation.state", (), (), ""
    features = {n: each.get("names") for n, each in described.items() if isinstance(each, dict)}
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
    """The log on its frame numbers and rate, if its stamps are these in 32 bits."""
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
    """meta/info.json, with a table of features."""
    path = folder / "meta" / "info.json"
    try:
        info: dict[str, Any] = json.loads(text_of(path))
        info.setdefault("features", {}).keys()  # what holds no names is no description
    except (OSError, ValueError, RecursionError, AttributeError):
        raise LogError(f"{path}: not a readable description of a dataset") from None
    return info


def text_of(path: Path) -> str:
    """The text of a description beside the data; a ValueError if it is no UTF-8."""
    if path.stat().st_size > DESCRIPTION_BYTES:
        raise LogError(f"{path}: larger than {DESCRIPTION_BYTES >> 20} MiB; no description is.")
    return path.read_text("utf-8")


@lru_cache(maxsize=1024)  # who reads all episodes asks for each again
def _numbers_in(path: Path, _changed: int) -> tuple[int, ...]:
    named = re.fullmatch(r"episode_(\d{6,9})", path.stem)  # version 2: an episode a file
    return (int(named[1]),) if named else episodes_of(ParquetTable(open_log(path)).episodes())


def dataset_episodes(folder: Path) -> dict[int, Path]:
    """The episodes of a dataset, rising, and the data file that holds each."""
    paths = sorted((folder / "data").rglob("*.parquet"))
    each = {number: p for p in paths for number in _numbers_in(p, p.stat().st_mtime_ns)}
    if not each:
        raise LogError(f"{folder}: a LeRobot dataset without data/**/*.parquet.")
    return dict(sorted(each.items()))


def recognises(file: LogFile, _: LogFormat) -> bool:
    """Whether a folder is a dataset."""
    return "meta" in file.entries and (file.path / "meta" / "info.json").is_file()
