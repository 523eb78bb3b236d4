"""Readers: a log in any known format becomes a Recording. The content decides, never the name."""

import sys
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

import numpy as np

from vftcli.readers import arrays_file, lerobot, libfranka, parquet, pickles, rtde, tables
from vftcli.readers.bags import formats as bags
from vftcli.readers.cleaning import RestartError, cleaned
from vftcli.readers.opening import Digest
from vftcli.readers.reader import LogFile, RawLog, ReadChoice, Reader, open_log
from vftcli.signals.errors import LogError, UnknownFormatError
from vftcli.signals.parsing import did_you_mean
from vftcli.signals.recording import Recording
from vftcli.signals.remarks import warning

READERS: dict[str, Reader] = {
    reader.name: reader
    for reader in (
        rtde.OFFICIAL,
        rtde.BINARY,
        rtde.UR_RTDE,
        libfranka.NEW,
        libfranka.OLD,
        libfranka.STATES,
        tables.HEADED,
        tables.HEADERLESS,
        tables.NPY,
        arrays_file.NPZ,
        pickles.PICKLE,
        parquet.PARQUET,
        lerobot.LEROBOT,
        bags.ROS1,
        bags.ROS2,
        bags.DB3,
        bags.MCAP,
    )
}
"""Every format by name: one reader, one line."""


def read(
    path: str | Path,
    *,
    format: str | None = None,
    columns: str | None = None,
    signals: Collection[str] | None = None,
    label: str = "",
) -> Recording:
    """Read a log, recognising its format by content unless one is named.

    Args:
        path: A file or a bag folder.
        format: Name of a format in READERS.
        columns: Which columns hold which signals, in the grammar of ``--columns``.
        signals: Fields of Recording that are wanted; others may be left unread. None for all.
        label: What to call it in tables; its file's name if "".

    Raises:
        UnknownFormatError: If no format fits, or more than one.
        LogError: If the file cannot be read as what it is.
        ClockError: If its clock stands still, runs backwards or holds no samples.
    """
    path = Path(path)
    file = open_log(path)
    reader = _reader(file, format, columns)
    request = ReadChoice(
        columns=columns, signals=frozenset(signals) if signals is not None else None
    )
    digest = Digest(path)
    if "polars" not in sys.modules:
        digest.start()  # its import takes longer than the hash and leaves a core idle
    with np.errstate(all="ignore"):  # whatever a damaged file holds is judged when it is cleaned
        raw = reader.read(file, request)
        raw = replace(raw, remarks=(*file.remarks, *raw.remarks))
    digest.start()
    return cleaned(raw, path, reader.name, digest.hexdigest, label)


def read_first_recording(
    path: str | Path,
    *,
    format: str | None = None,
    columns: str | None = None,
) -> Recording:
    """Read a log as `read` does; of a file that holds several recordings, the first.

    For examining a log, where looking at a part and saying so tells more than refusing.
    """
    try:
        return read(path, format=format, columns=columns)
    except RestartError as error:
        segment = f"{columns},segment=1" if columns else "segment=1"
        first = read(path, format=format, columns=segment)
        told = warning("time-reset", restarts=len(error.rows), rows=list(error.rows))
        remarks = (told, *first.source.remarks)
        return replace(first, source=replace(first.source, remarks=remarks))


def recognise(path: str | Path) -> Reader:
    """Return the reader that a path's content calls for.

    Raises:
        UnknownFormatError: If no format fits, or more than one.
    """
    return _recognise(open_log(Path(path)))


def _reader(file: LogFile, name: str | None, columns: str | None) -> Reader:
    """The reader that is named, or that the content calls for."""
    if name is not None and name not in READERS:
        raise UnknownFormatError(
            f"no format {name!r}; known formats: {', '.join(READERS)}.{did_you_mean(name, READERS)}"
        )
    reader = READERS[name] if name else _recognise(file)
    if columns is None:
        return reader
    if not reader.columns:
        takers = ", ".join(r.name for r in READERS.values() if r.columns)
        raise LogError(
            f"{file.path}: --columns does not apply to {reader.name}, whose signals are known. "
            f"It applies to {takers}."
        )
    return reader if reader.general or not file.lines else tables.HEADED


def _recognise(file: LogFile) -> Reader:
    """The one reader that knows the content; a general one only where no other does."""
    # A general reader would take nearly any text, also that of a vendor: it is asked last.
    found = [r for r in READERS.values() if not r.general and r.recognises(file)]
    found = found or [r for r in READERS.values() if r.general and r.recognises(file)]
    if len(found) == 1:
        return found[0]
    if not found:
        raise UnknownFormatError(
            f"{file.path}: not recognised as any of {', '.join(READERS)}. Name its format with "
            "--format, or see docs/formats.md for what each expects."
        )
    raise UnknownFormatError(
        f"{file.path}: could be {' or '.join(r.name for r in found)}. Say which with --format."
    )


__all__ = [
    "READERS",
    "LogFile",
    "RawLog",
    "ReadChoice",
    "Reader",
    "read",
    "read_first_recording",
    "recognise",
]
