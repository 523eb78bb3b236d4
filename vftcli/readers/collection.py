"""Collection: every log that files, folders, patterns and data sets hold, in a fixed order."""

import json
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from vftcli.readers import lerobot
from vftcli.readers.estimates import stored_observers
from vftcli.readers.formats import LogFormat
from vftcli.readers.hdf5_layouts import TRAJECTORY
from vftcli.readers.library import absolute
from vftcli.readers.opening import files_of
from vftcli.readers.reader import LogFile, ReadChoice, open_log
from vftcli.readers.reading import read_chosen, recognise
from vftcli.signals.errors import LogError, NoLogError, UnknownFormatError

TRUTH = ".truth.parquet"  #: Ending of what a simulation writes beside its log.
BATCH = "batch.json"  #: The file by which a folder of `vftcli batch` is known.
#: The file that lists what a command of ours wrote beside it; beside other files its ending.
RECORD = "run.json"
METADATA = "metadata.yaml"  #: The file that lists the pieces of a bag of ROS 2.

NUMBER = re.compile(rb"(?:^|[\s,;])[-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?(?=$|[\s,;])")
#: A file of JSON beside logs that is smaller is read to see whether it is one. [B]
DESCRIPTION = 1 << 20
FEWEST = 3  #: Numbers in a row: time, a position, an effort.


class LogEntry(NamedTuple):
    """One log of a collection."""

    path: Path  #: Its file or folder, from the root.
    episode: int | None = None  #: Its episode, of a file or folder that holds several.
    files: tuple[Path, ...] = ()  #: The files that it is read from.


class LogCollection:
    """Finds the logs that a command is given.

    A file is a log, whatever it holds. A folder is searched: what no reader knows is left out, and
    what our own commands wrote. A file or data set of several episodes is a log an episode.

    Attributes:
        passed: Files of folders that were left out.
    """

    def __init__(self, choice: ReadChoice, leave: Path | None = None) -> None:
        self._choice = choice
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
        """The episodes of a file, or itself: what cannot be read is told when it is read."""
        try:
            reader = recognise(path, self._choice)
            yield from self._episodes(path, reader)
        except (LogError, OSError):
            yield LogEntry(path, self._choice.episode, (path,))

    def _episodes(self, path: Path, reader: LogFormat) -> Iterator[LogEntry]:
        """An entry an episode; one alone where there is one, or one is chosen."""
        chosen, files = self._choice.episode, tuple(files_of(path))
        if reader.name == "lerobot":
            meta = tuple(files_of(path / "meta"))
            for episode in lerobot.episodes_told(path):
                if chosen in {None, episode.number}:
                    own = lerobot.data_file(path, episode)
                    yield LogEntry(path, episode.number, (*meta, own))
            return
        numbers = reader.numbers(open_log(path))
        if chosen is not None or len(numbers) < 2:
            yield LogEntry(path, chosen, files)
            return
        for number in numbers:
            yield LogEntry(path, int(number), files)

    def _inside(self, folder: Path) -> Iterator[LogEntry]:
        """A folder that is a log, or the logs in it and below, in the order of their names."""
        if folder.resolve() in self._searched or folder == self._leave:
            return
        self._searched.add(folder.resolve())
        if (folder / BATCH).is_file():
            return
        try:
            reader = recognise(folder, self._choice)
            # Recorders write metadata.yaml beside the pieces of one recording: without it what
            # reads as a bag is a folder of several.
            several_bags = reader.name == "rosbag2" and not (folder / METADATA).is_file()
            if reader.name != "droid" and not several_bags:
                yield from self._episodes(folder, reader)
                return
        except LogError:
            pass
        written = files_written(folder)
        if (folder / TRAJECTORY).is_file():
            yield from self._parts(folder / TRAJECTORY)  # what lies beside it describes it
            return
        for path in sorted(folder.iterdir()):
            if path.name.startswith("."):
                continue
            if path.is_dir():
                yield from self._inside(path)
            elif path.name in written or not self._may_be_log(path):
                self.passed.append(path)
            else:
                yield from self._parts(path)

    def _may_be_log(self, path: Path) -> bool:
        """Whether a file of a folder is taken; one that is damaged is, so that this is told."""
        if path.name.endswith((TRUTH, RECORD)):
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
        if reader.general and not holds_numbers(open_log(path)):
            return False  # prose reads as a table of one column
        return not stored_observers(path)


def holds_numbers(file: LogFile) -> bool:
    """Whether a file that may be a table is binary, or has numbers in its second or third line."""
    if not file.lines:
        return True
    rows = [NUMBER.findall(line) for line in file.lines[1:3]]
    return any(len(numbers) >= FEWEST for numbers in rows)


def matching(place: Path) -> list[Path]:
    """A path, or where there is nothing and it is a pattern, the paths that it fits."""
    # A name may hold such a letter: a file that is there wins.
    if place.exists() or not set("*?[") & set(str(place)):
        return [place]
    top = Path(place.anchor)
    return sorted(top.glob(str(place.relative_to(top))))


def files_written(folder: Path) -> set[str]:
    """Names of the files in a folder that a command of ours wrote there, by its record."""
    try:
        record = json.loads((folder / RECORD).read_text(encoding="utf-8"))
        return {RECORD, *map(str, record["files"])} if "vftcli" in record["versions"] else set()
    except (OSError, ValueError, LookupError, TypeError):
        return set()
