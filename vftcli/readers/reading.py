"""Reading: a file, bag or dataset becomes a Recording. The content decides, never the name."""

import sys
from collections.abc import Collection, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from vftcli.readers.cleaning import RestartError, cleaned, without_unknown_rows
from vftcli.readers.formats import FORMATS, LogFormat, description, known_kind
from vftcli.readers.opening import Digest
from vftcli.readers.reader import (
    LogFile,
    RawLog,
    ReadChoice,
    open_log,
)
from vftcli.signals.arrays import number_array
from vftcli.signals.errors import (
    LogError,
    MissingSignalError,
    ParameterError,
    ShapeError,
    UnknownFormatError,
)
from vftcli.signals.parsing import did_you_mean
from vftcli.signals.recording import JOINT_SIGNALS, Recording
from vftcli.signals.remarks import warning


def read(
    path: str | Path,
    *,
    format: str | None = None,
    columns: str | None = None,
    signals: Collection[str] | None = None,
    label: str = "",
    episode: int | None = None,
    arm: str | None = None,
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

    Raises:
        UnknownFormatError: If no format fits, or more than one.
        LogError: If the file cannot be read as what it is, or has no such episode or arm.
        ClockError: If its clock stands still, runs backwards or holds no samples.
    """
    wanted = frozenset(signals) if signals is not None else None
    choice = ReadChoice(format=format, columns=columns, signals=wanted, episode=episode, arm=arm)
    return read_chosen(path, choice, label)


def read_chosen(path: str | Path, choice: ReadChoice, label: str = "") -> Recording:
    """Read a log whole, as `read` does, in the way a choice says."""
    if not isinstance(path, str | Path):
        raise ParameterError(f"the log is {path!r}; expected the name of a file or folder")
    path = Path(path)
    if choice.all_episodes:
        raise ParameterError(
            f"{path}: --episode all is for commands that take several logs (compare, report, "
            "contacts, thresholds, identify); name one: --episode K"
        )
    file = open_log(path)
    reader = _reader(file, choice.format, choice.columns)
    if choice.episode is not None and not reader.episodes:
        raise LogError(f"{path}: one recording, without episodes; leave --episode out.")
    digest = Digest((path,))
    if "polars" not in sys.modules and not reader.episodes:
        digest.start()  # its import takes longer than the hash and leaves a core idle

    with np.errstate(all="ignore"):  # what a damaged file holds is judged when it is cleaned
        raw = reader.read(file, choice)
        raw = replace(raw, remarks=(*file.remarks, *raw.remarks))
        raw = without_unknown_rows(raw) if choice.skips_unknown else raw
    if choice.arm is not None and not raw.part.endswith("arm"):
        raise LogError(f"{path}: a log of one arm; leave --arm out.")
    digest = Digest(raw.files) if raw.files else digest
    if not raw.part:
        digest.start()  # of one of many parts it may never be asked for
    return cleaned(raw, path, reader.name, digest.hexdigest, label)


def episode_numbers(path: str | Path, choice: ReadChoice) -> Sequence[int]:
    """The numbers of the episodes that a file holds, rising."""
    file = open_log(Path(path))
    reader = _reader(file, choice.format, choice.columns)
    if not reader.episodes:
        raise LogError(f"{path}: one recording, without episodes; leave --episode out.")
    return reader.numbers(file)


def holds_episodes(path: str | Path, choice: ReadChoice) -> bool:
    """Whether a file holds several episodes."""
    file = open_log(Path(path))
    reader = _reader(file, choice.format, choice.columns)
    return len(reader.numbers(file)) > 1


def read_first_recording(path: str | Path, choice: ReadChoice | None = None) -> Recording:
    """Read a log as `read` does; of a file that holds several recordings or arms, the first.

    For examining a log, where looking at a part and saying so tells more than refusing.
    """
    choice = replace(choice or ReadChoice(), examining=True)
    try:
        return read_chosen(path, choice)
    except RestartError as error:
        segment = f"{choice.columns},segment=1" if choice.columns else "segment=1"
        first = read_chosen(path, replace(choice, columns=segment))
        told = warning("time-reset", restarts=len(error.rows), rows=list(error.rows))
        remarks = (told, *first.source.remarks)
        return replace(first, source=replace(first.source, remarks=remarks))


def recognise(path: str | Path, choice: ReadChoice | None = None) -> LogFormat:
    """The format that a path's content calls for, or that is chosen."""
    choice = choice or ReadChoice()
    return _reader(open_log(Path(path)), choice.format, choice.columns)


def _reader(file: LogFile, name: str | None, columns: str | None) -> LogFormat:
    """The format that is named, or that the content calls for."""
    if name is not None and name not in FORMATS:
        raise UnknownFormatError(
            f"no format {name!r}; known formats: {', '.join(FORMATS)}.{did_you_mean(name, FORMATS)}"
        )
    reader = FORMATS[name] if name else _recognise(file)
    if columns is None:
        return reader
    if not reader.takes_columns:
        takers = ", ".join(r.name for r in FORMATS.values() if r.takes_columns)
        raise LogError(
            f"{file.path}: --columns does not apply to {reader.name}, whose signals are known. "
            f"It applies to {takers}."
        )
    whole = reader.general or reader.describes or not file.lines
    return reader if whole else FORMATS["table"]


def _recognise(file: LogFile) -> LogFormat:
    """The one format that knows the content; a general one only where no other does."""
    # A general format would take nearly any text, also that of a vendor: it is asked last.
    found = [r for r in FORMATS.values() if not r.general and r.recognises(file)]
    if not found and known_kind(file) is None:
        found = [r for r in FORMATS.values() if r.general and r.recognises(file)]
    if len(found) == 1:
        return found[0]
    if not found:
        raise UnknownFormatError(f"{file.path}: not recognised as a log: {description(file)}.")
    raise UnknownFormatError(
        f"{file.path}: could be {' or '.join(r.name for r in found)}. Say which: "
        "--set log.format=NAME."
    )


def assemble(t: ArrayLike, *, name: str = "arrays", **signals: ArrayLike) -> Recording:
    """Make a Recording of arrays: repeated stamps are dropped and counted, gaps are reported.

    Args:
        t: Stamps, not decreasing. (T,) [s]
        name: What to call the recording in tables.
        signals: Fields of `Recording` by name, at least ``q``: (T, n) in SI units.

    Raises:
        ShapeError: If a signal is no array of numbers with a row for each stamp.
        MissingSignalError: If there is no ``q``, or a name is not a signal of a Recording.
        LogError: If a signal holds NaN or infinity.
        ClockError: If the clock runs backwards.
    """
    known = (*JOINT_SIGNALS, "wrench")
    if unknown := [key for key in signals if key not in known]:
        raise MissingSignalError(f"no signal {unknown[0]!r}; a recording has {', '.join(known)}")
    if "q" not in signals:
        raise MissingSignalError(
            "a recording needs joint positions: give q=… of shape (T, n) [rad]"
        )
    arrays = {key: np.array(number_array(value, key, name)) for key, value in signals.items()}
    for key, value in arrays.items():
        if value.ndim != 2 or len(value) != np.size(t):
            told = f"{key} of {name} has shape {value.shape}"
            raise ShapeError(f"{told}; expected ({np.size(t)}, n), a row for each stamp of t")
    raw = RawLog(
        stamps=np.array(number_array(t, "t", name)), tick=1.0, clock="as given", signals=arrays
    )
    return cleaned(raw, Path(name), "arrays")
