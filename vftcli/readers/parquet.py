"""Parquet tables: flat columns, or columns of lists as LeRobot writes them."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from vftcli.errors import LogError
from vftcli.readers.reader import LogFile, RawLog, Reader, Request
from vftcli.readers.table import Column
from vftcli.readers.tables import from_table

EPISODE = "episode_index"


class ParquetTable:
    """A Parquet file; only the columns asked for are decoded.

    Attributes:
        path: The file.
        names: Column names.
    """

    def __init__(self, path: Path, source: Any, rows: Any = None) -> None:  # noqa: ANN401
        self.path = path
        self._source = source
        self._rows = rows
        self.names: tuple[str, ...] | None = tuple(self._schema)

    @cached_property
    def _schema(self) -> dict[str, Any]:
        import polars as pl

        with guarded(self.path):
            return dict(pl.read_parquet_schema(self._seekable()))

    def _seekable(self) -> Any:  # noqa: ANN401 - a path or a stream
        return self._source if isinstance(self._source, Path) else BytesIO(self._source)

    @property
    def width(self) -> int:
        """Number of columns."""
        return len(self._schema)

    @property
    def repairs(self) -> tuple[str, ...]:
        """Nothing is ever mended here."""
        return ()

    def told(self) -> dict[str, Any]:
        """What vftcli convert wrote beside the columns; nothing for files of other programs."""
        import polars as pl

        with guarded(self.path):
            text = pl.read_parquet_metadata(self._seekable()).get("vftcli", "{}")
        try:
            told = json.loads(text)
        except (ValueError, RecursionError):
            return {}
        good = isinstance(told, dict) and isinstance(told.get("joint_names", []), list)
        return told if good else {}

    @cached_property
    def lists(self) -> Mapping[int, int]:
        """Columns of lists and their length in the first row."""
        import polars as pl

        kinds = list(self._schema.items())
        found = {k: name for k, (name, kind) in enumerate(kinds) if kind in (pl.List, pl.Array)}
        if not found:
            return {}
        with guarded(self.path):
            row = pl.read_parquet(self._seekable(), columns=list(found.values()), n_rows=1)
        firsts = {k: row[name].to_list() for k, name in found.items()}
        return {k: len(first[0]) for k, first in firsts.items() if first and first[0] is not None}

    def load(self, columns: Sequence[int], clock: int | None) -> dict[int, Column]:
        """Decode some columns.

        Raises:
            LogError: If a column holds no numbers or its lists differ in length.
        """
        import polars as pl

        names = list(self._schema)
        with guarded(self.path):
            frame = pl.read_parquet(
                self._seekable(), columns=[names[c] for c in columns], use_pyarrow=False
            )
        if self._rows is not None:
            frame = frame[self._rows]
        return {c: self._numbers(frame[names[c]], c, clock) for c in columns}

    def _numbers(self, series: Any, column: int, clock: int | None) -> Column:  # noqa: ANN401
        import polars as pl

        if column in self.lists:
            return self._matrix(series, self.lists[column])
        if series.dtype in (pl.Datetime, pl.Duration):
            series = series.dt.cast_time_unit("ns").to_physical()
        elif not series.dtype.is_numeric() and series.dtype != pl.Boolean:
            raise LogError(f"{self.path}: column {series.name} holds {series.dtype}, not numbers.")
        whole = column == clock and series.dtype.is_integer() and not series.null_count()
        cast = series.cast(pl.Int64 if whole else pl.Float64, strict=False)
        return np.array(cast.to_numpy())

    def _matrix(self, series: Any, length: int) -> Column:  # noqa: ANN401 - polars
        import polars as pl

        lengths = series.list.len() if series.dtype == pl.List else None
        if series.null_count() or (lengths is not None and (lengths != length).any()):
            raise LogError(f"{self.path}: the lists of {series.name} are not all {length} long.")
        inner = series.explode() if len(series) else series
        if not inner.dtype.is_numeric():
            raise LogError(f"{self.path}: the lists of {series.name} hold {inner.dtype}.")
        values = np.array(inner.cast(pl.Float64).to_numpy())
        return values.reshape(len(series), length)


class guarded:  # noqa: N801 - a context manager reads as a verb
    """Turn the errors of the Parquet decoder into a LogError that names the file."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __enter__(self) -> None:
        """Nothing to do."""

    def __exit__(self, kind: Any, error: Any, _trace: Any) -> None:  # noqa: ANN401
        """Translate what the decoder raised.

        Raises:
            LogError: If it raised.
        """
        import polars as pl

        panic = error is not None and type(error).__name__ == "PanicException"
        if panic or isinstance(error, pl.exceptions.PolarsError | OSError | ValueError):
            reason = str(error).split("\n")[0][:120]
            raise LogError(f"{self.path}: a damaged Parquet file ({reason})") from None


def read_parquet(file: LogFile, request: Request) -> RawLog:
    """Read a Parquet file: ours, a user's, or one file of a LeRobot dataset."""
    source = file.path if file.wrapping is None else file.content
    table = ParquetTable(file.path, source)
    if EPISODE in (table.names or ()):
        refuse_episodes(table)
    raw = from_table(table, request)
    told = table.told()
    names = tuple(str(name) for name in told.get("joint_names") or ())
    return replace(
        raw,
        wrench_frame=raw.wrench_frame or told.get("wrench_frame"),
        joint_names=raw.joint_names or names,
        robot_hint=raw.robot_hint or told.get("robot"),
    )


def refuse_episodes(table: ParquetTable) -> None:
    """Raise a LogError if the file holds more than one episode: each has its own clock.

    Raises:
        LogError: With the episodes' number and what to do.
    """
    episodes = table.load([(table.names or ()).index(EPISODE)], None)
    number = len(np.unique(next(iter(episodes.values()))))
    if number > 1:
        raise LogError(
            f"{table.path}: holds {number} episodes, each with its own clock. Give the dataset's "
            "folder (its first episode is read), or save one episode to its own file."
        )


PARQUET = Reader(
    name="parquet",
    title="Parquet table",
    recording="polars or pandas; vftcli convert LOG -o x.parquet; one episode of LeRobot.",
    takes="Columns by alias or by --columns; columns of lists: q=observation.state[0:7].",
    pitfalls="LeRobot stores float32 at 60 Hz or less. A file of many episodes is refused.",
    recognises=lambda file: file.head.startswith(b"PAR1"),
    read=read_parquet,
    columns=True,
)
