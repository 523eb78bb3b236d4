"""Library: the logs of one command, each read once and each under a label of its own."""

from collections.abc import Collection, Iterable
from pathlib import Path
from typing import NamedTuple

from vftcli.readers.labels import absolute, labelled
from vftcli.readers.reader import ReadChoice
from vftcli.signals.identity import refuse_repeated_logs
from vftcli.signals.recording import Recording


class Reading(NamedTuple):
    """What a log was read as; the same reading is made once.

    Attributes:
        path: The file or folder, from the root.
        format: The format's name, None to recognise it.
        columns: Description of its columns, or None.
        signals: The signals that were wanted, None for all.
    """

    path: Path
    format: str | None
    columns: str | None
    signals: frozenset[str] | None


class Library:
    """Reads the logs of one command; a log that two options name is read once.

    Args:
        paths: The logs the command was given. A log that is read without having been named here
            gets a label that differs from theirs.
    """

    def __init__(self, paths: Iterable[str | Path] = ()) -> None:
        self._labels = labelled(absolute(path) for path in paths)
        self._recordings: dict[Reading, Recording] = {}

    def read(
        self,
        path: str | Path,
        *,
        format: str | None = None,
        columns: str | None = None,
        signals: Collection[str] | None = None,
    ) -> Recording:
        """Read a log as `vftcli.readers.read` does, or return the reading that was made of it."""
        from vftcli.readers import read

        at = absolute(path)
        label = self._labels.setdefault(at, labelled([at, *self._labels])[at])
        reading = Reading(at, format, columns, None if signals is None else frozenset(signals))
        if reading not in self._recordings:
            recording = read(path, format=format, columns=columns, signals=signals, label=label)
            self._recordings[reading] = recording
        return self._recordings[reading]

    def open(self, path: str | Path, choice: ReadChoice) -> Recording:
        """Read a log as it is chosen, and take the part of it that is."""
        read = self.read(path, format=choice.format, columns=choice.columns, signals=choice.signals)
        return choice.within(read)

    def open_logs(self, paths: Iterable[str | Path], choice: ReadChoice) -> tuple[Recording, ...]:
        """Read the logs of a command.

        Raises:
            ParameterError: If two of them are the same run.
        """
        logs = tuple(self.open(path, choice) for path in paths)
        refuse_repeated_logs(logs)
        return logs
