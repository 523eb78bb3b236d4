"""Library: the logs of a command, each read once and under its own label."""

import json
import os
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from vftcli.readers import reading
from vftcli.readers.opening import files_of, open_log
from vftcli.readers.reader import ALL, ReadChoice
from vftcli.readers.reading import LogFormat
from vftcli.readers.references import stored_observers
from vftcli.signals.errors import LogError, NoLogError, UnknownFormatError
from vftcli.signals.parsing import printable
from vftcli.signals.recording import Recording

TRUTH = ".truth.parquet"  #: Ending of what a simulation writes beside its log.
BATCH = "batch.json"  #: The file by which a folder of `vftcli batch` is known.
#: Lists what a command wrote into a folder, or beside a file.
RECORD = "run.json"
METADATA = "metadata.yaml"  #: The file that lists the pieces of a bag of ROS 2.

NUMBER = re.compile(rb"(?:^|[\s,;])[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?(?=$|[\s,;])")
#: A file of JSON beside logs that is smaller is read to see whether it is one. [B]
DESCRIPTION = 1 << 20
FEWEST = 3  #: Numbers in a row: time, a position, an effort.


class Library:
    """Reads the logs of one command; a log that two options name is read once."""

    def __init__(self, paths: Iterable[str | Path] = ()) -> None:
        self._labels = labelled(paths)
        self._recordings: dict[tuple[Path, ReadChoice], Recording] = {}

    def __len__(self) -> int:
        return len(self._labels)

    def open(self, path: str | Path | Recording, choice: ReadChoice | None = None) -> Recording:
        """Read a log once unless it is read, and return the part of it that is chosen."""
        choice = choice or ReadChoice()
        if isinstance(path, Recording):
            return choice.within(choice.with_stated_effort(path))
        at, label = absolute(path), self.label(path)
        read = replace(choice, interval=None)
        if (at, read) not in self._recordings:
            self._recordings[at, read] = read.with_stated_effort(
                reading.read_chosen(path, read, label)
            )
        return choice.within(self._recordings[at, read])

    def open_each(
        self, paths: Iterable[str | Path | Recording], choice: ReadChoice, *, whole: bool = False
    ) -> Iterator[Recording]:
        """Read some logs, each episode as a log of its own where all are chosen."""
        asked = choice.episode == ALL or (whole and choice.episode is None)
        for path in paths:
            numbers: Sequence[int] = ()
            if asked and not isinstance(path, Recording):
                numbers = reading.episode_numbers(path, choice)
            if not numbers or (len(numbers) == 1 and choice.episode != ALL):
                yield self.open(path, choice)
                continue
            for number in numbers:
                yield self.open(path, replace(choice, episode=number))

    def label(self, path: str | Path) -> str:
        """The name of a log, unique within a command."""
        at = absolute(path)
        # A log without a label gets one that no other has.
        return self._labels.setdefault(at, labelled([at, *self._labels])[at])


def labelled(paths: Iterable[str | Path]) -> dict[Path, str]:
    """Give every path, from the root, a label that no other of them has.

    It is the file's name, after as many folders as tell it from every other path:
    `a/log.csv` and `b/log.csv`. Spellings of one path have one label.
    """
    # Spellings of one path count once, or no tail of it would be unique.
    parts = {path: path.parts for path in map(absolute, paths)}
    tails = Counter(each[-k:] for each in parts.values() for k in range(1, len(each) + 1))
    labels = {}
    for path, names in parts.items():
        own = (names[-count:] for count in range(1, len(names) + 1))
        labels[path] = printable(str(Path(*next((t for t in own if tails[t] == 1), names))))
    return labels


def absolute(path: str | Path) -> Path:
    """A path from the root, without `.` and `..`; links are kept."""
    return Path(os.path.abspath(path))  # noqa: PTH100 - Path.absolute leaves `..` in the path


class LogEntry(NamedTuple):
    """One log of a collection."""

    path: Path  #: Its file or folder, from the root.
    episode: int | None = None  #: Its episode, of a file or folder that holds several.
    files: tuple[Path, ...] = ()  #: The files that it is read from.


class LogCollection:
    """Finds the logs that a command is given.

    A file is a log, whatever it holds. Of a folder what no reader knows is left out, and what
    our commands wrote. Each episode is a log.

    Attributes:
        passed: Files of folders that were left out.
    """

    def __init__(self, choice: ReadChoice, leave: Path | None = None) -> None:
        # Each episode is a log of its own unless one is chosen.
        self._choice = replace(choice, episode=None) if choice.episode == ALL else choice
        self._leave = leave and absolute(leave)
        self._searched: set[Path] = set()
        self.passed: list[Path] = []

    def find(self, places: Iterable[Path]) -> Iterator[LogEntry]:
        """The logs of files, folders, and patterns as ``logs/**/*.csv``, each once."""
        given: set[Path] = set()
        for place in places:
            for path in map(absolute, matching(place)):
                if path not in given:
                    given.add(path)
                    yield from self._inside(path) if path.is_dir() else self._parts(path)

    def _parts(self, path: Path) -> Iterator[LogEntry]:
        try:
            yield from self._episodes(path, reading.recognise(path, self._choice))
        except (LogError, OSError):
            yield LogEntry(path, self._choice.episode, (path,))

    def _episodes(self, path: Path, reader: LogFormat) -> Iterator[LogEntry]:
        """An entry an episode; one alone where there is one, or one is chosen."""
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
        """The folder if it is a log, else the logs in it and below, by name."""
        place = folder.resolve()
        if folder == self._leave or place in self._searched or (folder / BATCH).is_file():
            return
        self._searched.add(place)
        try:
            reader = reading.recognise(folder, self._choice)
            # Without metadata.yaml a bag is a folder of several recordings, not pieces of one.
            several_bags = reader.name == "rosbag2" and not (folder / METADATA).is_file()
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
        """Whether a folder's file may be a log, damaged ones too: their error is shown."""
        if path.name.endswith((TRUTH, RECORD)):
            return False
        try:
            reader = reading.recognise(path, self._choice)
        except UnknownFormatError:
            return False
        except (LogError, OSError):
            return True
        if reader.name == "json" and path.stat().st_size < DESCRIPTION:
            try:
                reading.read_chosen(path, self._choice)
            except NoLogError:
                return False  # it describes something
            except LogError:
                return True
        lines = open_log(path).lines if reader.general else ()
        # Prose has no numbers in its second or third line.
        if lines and all(len(NUMBER.findall(line)) < FEWEST for line in lines[1:3]):
            return False
        return not stored_observers(path)


def matching(place: Path) -> list[Path]:
    """A path, or where there is nothing and it is a pattern, the paths that it fits."""
    # A name may hold such a letter: a file that is there wins.
    if place.exists() or not set("*?[") & set(str(place)):
        return [place]
    top = Path(place.anchor)
    return sorted(top.glob(str(place.relative_to(top))))


def files_written(folder: Path) -> set[str]:
    """Names of the files that vftcli wrote into a folder, by its record."""
    try:
        record = json.loads((folder / RECORD).read_text("utf-8"))
        return {RECORD, *map(str, record["files"])} if "vftcli" in record["versions"] else set()
    except (OSError, ValueError, LookupError, TypeError):
        return set()
