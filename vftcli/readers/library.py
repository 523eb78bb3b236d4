"""Library: the logs of a command, each read once and under its own label."""

import os
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from vftcli.readers import reading
from vftcli.readers.reader import ALL, ReadChoice
from vftcli.signals.parsing import printable
from vftcli.signals.recording import Recording


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
