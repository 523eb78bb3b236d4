"""Reading: a file, bag or dataset becomes a Recording, by content, not by name."""

import os
import re
import shlex
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from importlib import import_module
from inspect import signature
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, ParamSpec, TypeVar

import numpy as np

from vftcli.readers.cleaning import cleaned, without_unknown_rows
from vftcli.readers.opening import HEAD_BYTES, LogFile, open_log, sha256_of
from vftcli.readers.reader import ALL, RawLog, ReadChoice, episode_of
from vftcli.readers.table import listed
from vftcli.signals.errors import LogError, ParameterError, UnknownFormatError
from vftcli.signals.parsing import did_you_mean, printable, tables_beside
from vftcli.signals.recording import Recording


class LogFormat(NamedTuple):
    """One log format."""

    name: str  #: Name for ``log.format``.
    title: str  #: What it is.
    recording: str  #: How a user records one.
    takes: str  #: Which signals are read from it.
    pitfalls: str  #: What to look out for.
    #: Module of this room with its `read`, or its `episodes`: each one's number and reader.
    module: str
    begins: str = ""  #: Pattern of the content's first bytes, "" for any.
    line: str = ""  #: Pattern of a text's first line, "" for any.
    folder: bool = False  #: Whether it is a folder.
    #: Whether it takes any table, and is asked only if no other format fits.
    general: bool = False
    takes_columns: bool = True  #: Whether ``--columns`` may describe it.
    #: Whether it reads ``--columns`` itself where its files are text.
    describes: bool = False
    episodes: bool = False  #: Whether a file may hold several recordings.
    columns: str = ""  #: Its program's columns, in the grammar of ``--columns``.
    #: Its last columns hold the payload's mass, then its centre.
    payload: str = ""
    clock: str = ""  #: Its clock in words, "" for the column's name.
    remedy: str = ""  #: What to do where clock or positions are missing.

    @property
    def _module(self) -> ModuleType:
        return import_module(f"vftcli.readers.{self.module}")

    def recognises(self, file: LogFile) -> bool:
        """Whether a file's content is of this format."""
        if file.is_folder != self.folder:
            return False
        if not self.begins and not self.line:
            return bool(self._module.recognises(file, self))
        each = ((self.begins, file.head), (self.line, file.first_line))
        return all(re.match(pattern.encode("latin-1"), text) for pattern, text in each if pattern)

    def read(self, file: LogFile, request: ReadChoice) -> RawLog:
        """Read a file of this format."""
        if not self.episodes:
            found: RawLog = self._module.read(file, request, self)
            return found
        with self._module.episodes(file) as each:
            number, part, remarks = episode_of(file.path, request, tuple(each))
            raw: RawLog = each[number](request)
        part = " ".join(word for word in (part, raw.part) if word)
        return replace(raw, part=part, remarks=(*remarks, *raw.remarks))

    def numbers(self, file: LogFile) -> tuple[int, ...]:
        """The numbers of a file's episodes, none of one recording."""
        if not self.episodes:
            return ()
        with self._module.episodes(file) as each:
            return tuple(each)


#: Every format by its name.
FORMATS = {
    name: LogFormat(name=name, **entry.pop("reader"), **entry)
    for name, entry in tables_beside(__file__, "layouts.toml").items()
}


P = ParamSpec("P")
R = TypeVar("R")
#: An argument's declared kind → its words.
EXPECTED = {str | None: "a text", str | Path: "a file's name", str | Path | None: "a file's name"}


def checked_call(function: Callable[P, R]) -> Callable[P, R]:
    """A function for notebooks; wrong arguments raise a ParameterError."""
    name, shown = f"vft.{function.__qualname__}", signature(function)

    @wraps(function)
    def called(*places: P.args, **given: P.kwargs) -> R:
        for word in given.keys() - shown.parameters:
            near = did_you_mean(word, shown.parameters)
            raise ParameterError(f"{name} has no keyword {word}.{near}")
        try:
            values = shown.bind(*places, **given).arguments
        except TypeError as error:
            raise ParameterError(f"{name}: {error}") from None
        for word, value in values.items():
            kind: Any = shown.parameters[word].annotation
            if kind in EXPECTED and not isinstance(value, kind):
                raise ParameterError(f"{name}: {word} is {value!r}; expected {EXPECTED[kind]}")
        if not isinstance(values.get("settings") or {}, Mapping):
            raise ParameterError(f"{name}: settings are a dict, as {{'duration': 8}}")
        return function(*places, **given)

    return called


@checked_call
def read(
    path: str | Path,
    *,
    format: str | None = None,
    columns: str | None = None,
    signals: Collection[str] | None = None,
    label: str = "",
    episode: int | None = None,
    arm: str | None = None,
    interval: str | None = None,
) -> Recording:
    """Read a log, recognising its format by content unless one is named.

    Args:
        path: A file, a bag folder or a dataset's folder.
        format: Name of a format in FORMATS.
        columns: Which columns hold which signals, in the grammar of ``--columns``.
        signals: Fields of Recording that are wanted; others may be left unread. None for all.
        label: What to call it in tables; its file's name if "".
        episode: Which episode of a file that holds several; its first, said in a remark, if None.
        arm: Which arm of a log of two, ``left`` or ``right``.
        interval: Seconds ``A:B`` from its first sample, None for all.

    Raises:
        UnknownFormatError: If no format fits, or more than one.
        LogError: If the file cannot be read as what it is, or has no such episode or arm.
        ClockError: If its clock stops, runs backwards or holds no samples.
    """
    choice = replace(
        ReadChoice.parsed(columns=columns, arm=arm, interval=interval),
        format=format,
        signals=None if signals is None else frozenset(signals),
        episode=episode,
    )
    return choice.within(read_chosen(path, choice, label))


def read_chosen(path: str | Path, choice: ReadChoice, label: str = "") -> Recording:
    """Read a log whole, as `read` does, in the way a choice says."""
    path = Path(path)
    if choice.episode == ALL:
        raise ParameterError(
            f"{path}: --episode all is for commands that take several logs; name one: --episode K"
        )
    file = open_log(path)
    reader = _reader(file, choice)
    if choice.episode is not None and not reader.episodes:
        raise LogError(f"{path}: one recording, without episodes; leave --episode out.")
    with np.errstate(all="ignore"):  # a damaged file is judged when it is cleaned
        raw = reader.read(file, choice)
        raw = replace(raw, remarks=(*file.remarks, *raw.remarks))
        raw = without_unknown_rows(raw) if choice.skips_unknown else raw
    if choice.arm is not None and not raw.part.endswith("arm"):
        raise LogError(f"{path}: a log of one arm; leave --arm out.")
    sha256 = sha256_of(*(raw.files or (path,)))
    return cleaned(raw, path, reader.name, choice, sha256, label)


def episode_numbers(path: str | Path, choice: ReadChoice) -> Sequence[int]:
    """The numbers of a file's episodes, rising; none of one recording."""
    file = open_log(Path(path))
    reader = _reader(file, choice)
    if choice.episode == ALL and not reader.episodes:
        raise LogError(f"{path}: one recording, without episodes; leave --episode out.")
    return reader.numbers(file)


def recognise(path: str | Path, choice: ReadChoice | None = None) -> LogFormat:
    """The format that a path's content calls for, or that is chosen."""
    return _reader(open_log(Path(path)), choice or ReadChoice())


def _reader(file: LogFile, choice: ReadChoice) -> LogFormat:
    name = choice.format
    if name is not None and name not in FORMATS:
        raise UnknownFormatError(
            f"no format {name!r}; known formats: {', '.join(FORMATS)}.{did_you_mean(name, FORMATS)}"
        )
    # A general format fits nearly any text, so it comes last.
    found = [FORMATS[name]] if name else []
    for general in (False, True):
        if not found and not (general and known_kind(file)):
            each = (r for r in FORMATS.values() if r.general is general)
            found = [r for r in each if r.recognises(file)]
    if not found:
        raise UnknownFormatError(f"{file.path}: not recognised as a log: {description(file)}.")
    if len(found) > 1:
        names = " or ".join(reader.name for reader in found)
        raise UnknownFormatError(
            f"{file.path}: could be {names}. Say which: --set log.format=NAME."
        )
    reader = found[0]
    if choice.columns is None:
        return reader
    if not reader.takes_columns:
        takers = ", ".join(r.name for r in FORMATS.values() if r.takes_columns)
        raise LogError(
            f"{file.path}: --columns does not apply to {reader.name}, only to {takers}."
        )
    whole = reader.general or reader.describes or not file.lines
    return reader if whole else FORMATS["table"]


def description(file: LogFile) -> str:
    """The kind of a path and the remedy, to follow its name."""
    if file.is_folder:
        run = f"vftcli batch {shlex.quote(printable(str(file.path)))} --do report -o OUT"
        return (
            f"a folder ({listed(file.entries, 4) or 'empty'}); batch runs all logs in it ({run})"
        )
    if kind := known_kind(file):
        return kind
    if file.lines:
        first = file.first_line.decode("utf-8", "replace")[:60].strip()
        return (
            f"a text that is no table of numbers (it begins {printable(first)!r}); save the log as "
            "CSV: a line of names, then one row a sample"
        )
    return (
        f"a binary file of no kind that is known (it begins {file.head[:8].hex(' ')}); export the "
        "log as CSV, Parquet or MCAP, or name its format: --set log.format=NAME (help formats)"
    )


def known_kind(file: LogFile) -> str | None:
    """The kind of a file that is no log and the remedy; None of any other."""
    mistakes = tables_beside(__file__, "mistakes.toml")
    # The end of a zip archive names what it holds.
    end = bytes(file.content[-HEAD_BYTES:]) if file.head.startswith(b"PK\x03\x04") else b""
    for name, words in mistakes["zip"].items():
        if name.encode() in end:
            return str(words)
    for begins, words in mistakes["begins"].items():
        if re.match(begins.encode("latin-1"), file.head, re.DOTALL):
            return str(words)
    return None


class Library:
    """Reads the logs of one command; a log that two options name is read once."""

    def __init__(self, paths: Iterable[str | Path] = ()) -> None:
        self._labels = labelled(paths)
        self._recordings: dict[tuple[Path, ReadChoice], Recording] = {}

    def __len__(self) -> int:
        return len(self._labels)

    def open(self, path: str | Path | Recording, choice: ReadChoice | None = None) -> Recording:
        """Read a log once; return the part of it that is chosen."""
        choice = choice or ReadChoice()
        if isinstance(path, Recording):
            return choice.within(choice.with_stated_effort(path))
        at, label = absolute(path), self.label(path)
        read = replace(choice, interval=None)
        if (at, read) not in self._recordings:
            self._recordings[at, read] = read.with_stated_effort(read_chosen(path, read, label))
        return choice.within(self._recordings[at, read])

    def open_each(
        self, paths: Iterable[str | Path | Recording], choice: ReadChoice, *, whole: bool = False
    ) -> Iterator[Recording]:
        """Read some logs, each episode as a log of its own where all are chosen."""
        asked = choice.episode == ALL or (whole and choice.episode is None)
        for path in paths:
            numbers: Sequence[int] = ()
            if asked and not isinstance(path, Recording):
                numbers = episode_numbers(path, choice)
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

    The file's name after as many folders as tell it apart; spellings of one path have one.
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
