"""Library: the logs of one command, each read once and each under a label of its own."""

import os
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

from vftcli.readers.reader import ReadChoice
from vftcli.signals.identity import refuse_repeated_logs
from vftcli.signals.letters import printable
from vftcli.signals.recording import Recording


class Library:
    """Reads the logs of one command; a log that two options name is read once."""

    def __init__(self, paths: Iterable[str | Path] = ()) -> None:
        self._labels = labelled(absolute(path) for path in paths)
        self._recordings: dict[tuple[Path, ReadChoice], Recording] = {}

    def __len__(self) -> int:
        """How many logs it knows of."""
        return len(self._labels)

    def open(self, path: str | Path, choice: ReadChoice | None = None) -> Recording:
        """Read a log once, and return the part of it that is chosen."""
        from vftcli.readers.reading import read_chosen

        choice, at, label = choice or ReadChoice(), absolute(path), self.label(path)
        read = replace(choice, interval=None)
        if (at, read) not in self._recordings:
            self._recordings[at, read] = read.taken(read_chosen(path, read, label))
        return choice.within(self._recordings[at, read])

    def open_each(
        self, paths: Iterable[str | Path], choice: ReadChoice, *, whole: bool = False
    ) -> Iterator[Recording]:
        """Read some logs, each episode as a log of its own where all are chosen."""
        from vftcli.readers.reading import episode_numbers, holds_episodes

        for path in paths:
            unasked = whole and choice.episode is None and holds_episodes(path, choice)
            if not (choice.all_episodes or unasked):
                yield self.open(path, choice)
                continue
            for number in episode_numbers(path, choice):
                yield self.open(path, replace(choice, episode=number, all_episodes=False))

    def label(self, path: str | Path) -> str:
        """What a log is called, a name that no other log of the command has."""
        at = absolute(path)
        # A log that nobody announced is told from those that were, which keep their labels.
        return self._labels.setdefault(at, labelled([at, *self._labels])[at])

    def open_logs(self, paths: Iterable[str | Path], choice: ReadChoice) -> tuple[Recording, ...]:
        """Read the logs of a command."""
        logs = tuple(self.open_each(paths, choice))
        refuse_repeated_logs(logs)
        return logs


def labelled(paths: Iterable[str | Path]) -> dict[Path, str]:
    """Give every path a label that no other of them has.

    A label is the file's name where that is unique, else as many folders before it as tell it from
    every other path: `a/log.csv` and `b/log.csv`. Spellings of one path have one label.

    Returns:
        Path as it was given → label, all of it letters that can be shown.
    """
    given = [Path(path) for path in paths]
    # Spellings of one path count once, or no tail of it would be unique.
    parts = {path: absolute(path).parts for path in given}
    tails = Counter(each[-k:] for each in set(parts.values()) for k in range(1, len(each) + 1))
    return {path: printable(_shortest_tail(parts[path], tails)) for path in given}


def absolute(path: str | Path) -> Path:
    """A path from the root, without `.` and `..`; links are not followed, they have names too."""
    return Path(os.path.abspath(path))  # noqa: PTH100 - Path.absolute leaves `..` in the path


def _shortest_tail(parts: tuple[str, ...], tails: Mapping[tuple[str, ...], int]) -> str:
    """The last parts of a path, as many as no other path ends with."""
    own = (parts[-count:] for count in range(1, len(parts) + 1))
    return str(Path(*next((tail for tail in own if tails[tail] == 1), parts)))
